"""What pages drive: crank angles and velocities, published under a lease while a page is there."""

from collections.abc import Callable
from threading import Event, Lock, Thread
from time import monotonic
from typing import Any

from geometry_msgs.msg import TwistStamped
from klann_ros.live.clients import Answer
from klann_ros.live.drive import CrankDrive, DriveError, WalkDrive
from klann_ros.live.protocol import Command
from klann_ros.live.rates import TopicRate
from klann_ros.nodes.endpoints import OUTPUT
from klann_ros.nodes.lease import Lease
from rclpy.node import Node
from std_msgs.msg import Float64

from .driven import CRANK, Driven, Offer, WALK
from .service_calls import ServiceCalls

# Between messages of a crank that turns, and of what stands still or walks [s].
_TURNING, _STANDING = 0.01, 0.05
# Stop messages to a walker, in case that one is lost.
_STOPS = 5


class Drives:
    """
    Publish for pages, from a thread of its own: neither a page nor a callback can hold it up.

    A page takes a drive in two steps: the other publishers are asked to yield (lease.py); only
    when all have yielded, or are idle, does anything move.

    Parameters
    ----------
    node : rclpy.node.Node
        The node.
    errands : ServiceCalls
        Makes and destroys publishers in ROS's thread.
    changed : callable
        Is called, in ROS's thread, when the state of a drive has changed.
    crank_angle : callable
        Returns the angle of the crank that a named drive turns [rad].
    figures : callable
        Returns the figures of a topic that is listened to, else None.

    """

    def __init__(
        self,
        node: Node,
        calls: ServiceCalls,
        changed: Callable[[], object],
        crank_angle: Callable[[str], float],
        figures: Callable[[str], TopicRate | None],
    ) -> None:
        self._node, self._calls_to_ros, self._changed = node, calls, changed
        self._crank_angle, self._figures = crank_angle, figures
        self._drives: dict[str, Driven] = {}
        self._lock = Lock()
        self._wake = Event()
        self._stopped = False
        self._thread = Thread(target=self._run, name='drives', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop all that is driven."""
        with self._lock:
            for driven in self._drives.values():
                self._release(driven, 'view_node has ended')
        self._stopped = True
        self._wake.set()
        self._thread.join(1.0)
        with self._lock:
            for driven in self._drives.values():
                if driven.stops:
                    self._publish_walk(driven, 0.0, 0.0)
                if driven.lease is not None:
                    driven.lease.release()

    def offer(self, offers: list[Offer]) -> None:
        """Let pages drive these, and nothing else; to be called in ROS's thread."""
        names = {offer.name for offer in offers}
        with self._lock:
            for offer in offers:
                driven = self._drives.get(offer.name)
                if driven is None:
                    drive: CrankDrive | WalkDrive
                    drive = CrankDrive() if offer.kind == CRANK else WalkDrive()
                    # Made before it is needed: discovery takes longer than a handshake.
                    driven = Driven(offer, drive, Lease(self._node, offer.topic))
                    self._drives[offer.name] = driven
                driven.offer = offer
            for name in [name for name in self._drives if name not in names]:
                driven = self._drives[name]
                if driven.drive.owner is None and driven.publisher is None:
                    del self._drives[name]
                    if driven.lease is not None:
                        driven.lease.close()

    def state(self) -> list[dict[str, Any]]:
        """Return what can be driven, and by whom it is, ready for JSON."""
        with self._lock:
            return [driven.as_data() for driven in self._drives.values()]

    def keep_alive(self, page: int) -> None:
        """Note that a page is there."""
        now = monotonic()
        # No lock: each is one assignment, and a page is heard often.
        for driven in list(self._drives.values()):
            if driven.drive.owner == page:
                driven.drive.alive_at = now

    def disconnected(self, page: int) -> None:
        """Stop what a page drives that is gone."""
        with self._lock:
            mine = [d for d in self._drives.values() if d.drive.owner == page]
            for driven in mine:
                self._release(driven, 'the page was closed')
        if mine:
            self._wake.set()
            self._calls_to_ros.put(self._changed)

    def command(self, page: int, command: Command, answer: Answer) -> None:
        """
        Take, drive or give back.

        Parameters
        ----------
        page : int
            The page.
        command : Command
            Its command.
        answer : callable
            Receives whether it was done, or why not.

        """
        with self._lock:
            driven = self._drives.get(command.what)
            try:
                if driven is None:
                    raise DriveError('that cannot be driven any more')  # noqa: TRY301
                self._do(driven, page, command)
            except DriveError as error:
                answer(False, str(error))
                return
        self._wake.set()
        if command.do in {'take', 'release'}:
            self._calls_to_ros.put(self._changed)
        answer(True, '')

    def _do(self, driven: Driven, page: int, command: Command) -> None:
        drive, now = driven.drive, monotonic()
        if command.do == 'take':
            self._take(driven, page, now)
            return
        if drive.owner != page:
            raise DriveError('this page does not drive it: take it over first')
        if command.do == 'release':
            self._release(driven, '')
        elif driven.taking is not None:
            raise DriveError('not yet: the other publishers have not yielded')
        elif isinstance(drive, CrankDrive) and command.do == 'turn':
            drive.turn_to(command.value, now)
        elif isinstance(drive, CrankDrive) and command.do == 'spin':
            drive.spin(command.value, now)
        elif isinstance(drive, WalkDrive) and command.do == 'walk':
            drive.walk(command.value, command.turn)
        else:
            raise DriveError(f'a {driven.offer.kind} does not {command.do}')

    def _take(self, driven: Driven, page: int, now: float) -> None:
        drive, before = driven.drive, driven.drive.owner
        if before == page:
            return
        # The others have yielded to this node already, whichever of its pages drives.
        is_held = before is not None and driven.taking is None
        angle = drive.advance(now) if isinstance(drive, CrankDrive) else 0.0
        drive.take(page, now, angle)
        driven.loser = before
        driven.why = 'another page has taken it over' if before is not None else ''
        driven.stops = 0
        if not is_held:
            driven.taking, driven.alone = now, None
        if driven.publisher is None:
            self._calls_to_ros.put(lambda: self._open(driven))

    def _release(self, driven: Driven, why: str) -> None:
        drive = driven.drive
        if drive.owner is None:
            return
        driven.loser, driven.why = drive.owner if why else None, why
        drive.owner = None
        if driven.offer.kind == WALK and driven.taking is None:
            driven.stops = _STOPS
        else:
            self._calls_to_ros.put(lambda: self._shut(driven))
        driven.taking = None

    def _open(self, driven: Driven) -> None:
        kind = Float64 if driven.offer.kind == CRANK else TwistStamped
        with self._lock:
            if driven.publisher is None and driven.drive.owner is not None:
                topic = driven.offer.topic
                driven.publisher = self._node.create_publisher(kind, topic, OUTPUT)
        self._wake.set()

    def _shut(self, driven: Driven) -> None:
        with self._lock:
            if driven.drive.owner is None and driven.publisher is not None:
                self._node.destroy_publisher(driven.publisher)
                driven.publisher = None
            if driven.drive.owner is None and driven.lease is not None:
                driven.lease.release()

    def _run(self) -> None:
        while not self._stopped:
            with self._lock:
                pause = min(map(self._serve, self._drives.values()), default=None)
            # No page drives: wait until one does.
            self._wake.wait(pause if pause is None or pause < 1.0 else None)
            self._wake.clear()

    def _serve(self, driven: Driven) -> float:
        """Publish due messages; return the time to the next [s]."""
        drive, now = driven.drive, monotonic()
        if drive.owner is None and not driven.stops:
            return 3600.0
        why = self._why_not(driven, now)
        if why and drive.owner is not None:
            self._release(driven, why)
            self._calls_to_ros.put(self._changed)
        if drive.owner is None:
            if driven.stops:
                driven.stops -= 1
                self._publish_walk(driven, 0.0, 0.0)
                if not driven.stops:
                    self._calls_to_ros.put(lambda: self._shut(driven))
            return _STANDING
        if driven.taking is not None:
            return _STANDING
        if isinstance(drive, WalkDrive):
            self._publish_walk(driven, drive.forward, drive.turn)
            return _STANDING
        self._publish(driven, Float64(data=drive.advance(now)))
        return _TURNING if drive.speed else _STANDING

    def _why_not(self, driven: Driven, now: float) -> str:
        """Announce the lease; return why a page cannot drive on, '' while it can."""
        assert driven.lease is not None  # noqa: S101 - made with the drive
        is_whole = driven.lease.announce()
        if driven.drive.is_lost(now):
            return 'the page was not heard of any more'
        if not is_whole:
            return 'view_node was stopped for a while'
        if driven.taking is not None:
            return self._handshake(driven, now)
        return driven.intruder(self._figures) if driven.drive.owner is not None else ''

    def _handshake(self, driven: Driven, now: float) -> str:
        """Begin to drive when all others have yielded or are idle; return why that fails."""
        is_alone, why = driven.is_alone(now, self._figures)
        if is_alone and driven.publisher is not None:
            angle = self._crank_angle(driven.offer.name) if driven.offer.kind == CRANK else 0.0
            driven.start(angle)
            self._calls_to_ros.put(self._changed)
        return why

    def _publish_walk(self, driven: Driven, forward: float, turn: float) -> None:
        message = TwistStamped()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.header.frame_id = 'base_link'
        message.twist.linear.x, message.twist.angular.z = forward, turn
        self._publish(driven, message)

    def _publish(self, driven: Driven, message: Any) -> None:
        if driven.publisher is not None:
            driven.sent += 1
            driven.publisher.publish(message)
