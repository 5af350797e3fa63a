"""What a page turns by itself: crank angles and velocities, published while it is there."""

from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Event, Lock, Thread
from time import monotonic
from typing import Any

from geometry_msgs.msg import TwistStamped
from klann_ros.live.clients import Answer
from klann_ros.live.drive import CrankDrive, DriveError, WalkDrive
from klann_ros.live.protocol import Wish
from klann_ros.nodes.endpoints import OUTPUT
from rclpy.node import Node
from std_msgs.msg import Float64

from .errands import Errands

# Between messages of a crank that turns, and of what stands still or walks [s].
_TURNING, _STANDING = 0.01, 0.05
# A walker is told so often to stand, in case that a message is lost.
_STOPS = 5
CRANK, WALK = 'crank', 'walk'


@dataclass
class Driven:
    """Something that a page can drive."""

    # 'crank' or 'walk', and the topic.
    kind: str
    topic: str
    drive: CrankDrive | WalkDrive
    publisher: Any = None
    # Why the last page has it no more; '' where it gave it back.
    why: str = ''
    # How often a walker is still told to stand.
    stops: int = 0
    # Who turns it beside the page.
    others: list[str] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Return what the page calls it."""
        return f'{self.kind}:{self.topic}'


class Drives:
    """
    Publish for pages, from a thread of its own: neither a page nor a callback can hold it up.

    Parameters
    ----------
    node : rclpy.node.Node
        Who publishes.
    errands : Errands
        Makes and destroys publishers in ROS's thread.
    changed : callable
        Is called when a drive has another owner.

    """

    def __init__(self, node: Node, errands: Errands, changed: Callable[[], object]) -> None:
        self._node, self._errands, self._changed = node, errands, changed
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
                    self._publish(driven, 0.0, 0.0)

    def offer(self, kind: str, topic: str, others: list[str]) -> None:
        """Let pages drive a topic; `others` publish on it as well."""
        with self._lock:
            driven = self._drives.get(f'{kind}:{topic}')
            if driven is None:
                drive: CrankDrive | WalkDrive = CrankDrive() if kind == CRANK else WalkDrive()
                driven = Driven(kind, topic, drive)
                self._drives[driven.name] = driven
            driven.others = others

    def forget_but(self, names: set[str]) -> None:
        """Let pages drive no more what is not among these."""
        with self._lock:
            for name in [name for name in self._drives if name not in names]:
                driven = self._drives[name]
                if driven.drive.owner is None and driven.publisher is None:
                    del self._drives[name]

    def state(self) -> list[dict[str, Any]]:
        """Return what can be driven, and by whom it is, ready for JSON."""
        with self._lock:
            return [
                {
                    'what': driven.name,
                    'kind': driven.kind,
                    'topic': driven.topic,
                    'owner': driven.drive.owner,
                    'why': driven.why,
                    'others': driven.others,
                }
                for driven in self._drives.values()
            ]

    def heard(self, page: int) -> None:
        """Note that a page is there."""
        now = monotonic()
        # No lock: each is one assignment, and a page is heard often.
        for driven in list(self._drives.values()):
            if driven.drive.owner == page:
                driven.drive.heard = now

    def left(self, page: int) -> None:
        """Stop what a page drives that is gone."""
        with self._lock:
            mine = [d for d in self._drives.values() if d.drive.owner == page]
            for driven in mine:
                self._release(driven, 'its page was closed')
        if mine:
            self._wake.set()
            self._changed()

    def wish(self, page: int, wish: Wish, angle: float, answer: Answer) -> None:
        """
        Take, drive or give back.

        Parameters
        ----------
        page : int
            Who wants it.
        wish : Wish
            What is wanted.
        angle : float
            Where the crank is [rad], where one is taken.
        answer : callable
            Is told whether it is done.

        """
        with self._lock:
            driven = self._drives.get(wish.what)
            try:
                if driven is None:
                    raise DriveError('that cannot be driven any more')  # noqa: TRY301
                self._do(driven, page, wish, angle)
            except DriveError as error:
                answer(False, str(error))
                return
        self._wake.set()
        if wish.do in {'take', 'release'}:
            self._changed()
        answer(True, '')

    def _do(self, driven: Driven, page: int, wish: Wish, angle: float) -> None:
        drive, now = driven.drive, monotonic()
        if wish.do == 'take':
            driven.why = ''
            if isinstance(drive, CrankDrive):
                drive.take(page, angle, now)
            else:
                drive.take(page, now)
            if driven.publisher is None:
                self._errands.put(lambda: self._open(driven))
            return
        if drive.owner != page:
            raise DriveError('another page has it, or nobody: take it first')
        if wish.do == 'release':
            self._release(driven, '')
        elif isinstance(drive, CrankDrive) and wish.do == 'turn':
            drive.turn_to(wish.value, now)
        elif isinstance(drive, CrankDrive) and wish.do == 'spin':
            drive.spin(wish.value, now)
        elif isinstance(drive, WalkDrive) and wish.do == 'walk':
            drive.walk(wish.value, wish.turn)
        else:
            raise DriveError(f'a {driven.kind} does not {wish.do}')

    def _release(self, driven: Driven, why: str) -> None:
        if driven.drive.owner is None:
            return
        driven.drive.owner, driven.why = None, why
        if driven.kind == WALK:
            driven.stops = _STOPS
        else:
            self._errands.put(lambda: self._shut(driven))

    def _open(self, driven: Driven) -> None:
        kind = Float64 if driven.kind == CRANK else TwistStamped
        with self._lock:
            if driven.publisher is None and driven.drive.owner is not None:
                driven.publisher = self._node.create_publisher(kind, driven.topic, OUTPUT)
        self._wake.set()

    def _shut(self, driven: Driven) -> None:
        with self._lock:
            if driven.drive.owner is None and driven.publisher is not None:
                self._node.destroy_publisher(driven.publisher)
                driven.publisher = None

    def _run(self) -> None:
        while not self._stopped:
            with self._lock:
                pause = min(map(self._serve, self._drives.values()), default=None)
            # Nobody drives: nothing is done until somebody does.
            self._wake.wait(pause if pause is None or pause < 1.0 else None)
            self._wake.clear()

    def _serve(self, driven: Driven) -> float:
        """Publish what is due; return when it is again [s]."""
        drive, now = driven.drive, monotonic()
        if drive.is_lost(now):
            self._release(driven, 'its page was not heard of any more')
            self._errands.put(self._changed)
        if drive.owner is None:
            if not driven.stops:
                return 3600.0
            driven.stops -= 1
            self._publish(driven, 0.0, 0.0)
            if not driven.stops:
                self._errands.put(lambda: self._shut(driven))
            return _STANDING
        if isinstance(drive, WalkDrive):
            self._publish(driven, drive.forward, drive.turn)
            return _STANDING
        if driven.publisher is not None:
            driven.publisher.publish(Float64(data=drive.advance(now)))
        return _TURNING if drive.speed else _STANDING

    def _publish(self, driven: Driven, forward: float, turn: float) -> None:
        if driven.publisher is None:
            return
        message = TwistStamped()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.header.frame_id = 'base_link'
        message.twist.linear.x, message.twist.angular.z = forward, turn
        driven.publisher.publish(message)
