"""
Drives of pages: crank angles and velocities, published under a lease while a page is connected.

A page takes a drive in two steps: the other publishers are requested to yield (lease.py); only
when all have yielded, or are idle, does anything move.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Event, Lock, Thread
from time import monotonic
from typing import Any

from geometry_msgs.msg import TwistStamped
from klann_ros.live import Answer, Command, DriveError, LiveCrankDrive, TopicRate, WalkDrive
from klann_ros.nodes.endpoints import OUTPUT, publish_last
from klann_ros.nodes.lease import DELIVERY_TIME, Lease
from klann_ros.nodes.process import LOG_PERIOD
from klann_ros.sanitize.text import error_with_place
from rclpy.node import Node
from std_msgs.msg import Float64

# Timeout for the other publishers to yield or fall silent; then nothing is driven [s].
TAKE_TIMEOUT = 2.5
# Silence after which a publisher that cannot yield counts as idle [s].
_IDLE_TIME = 1.0
# More messages than were sent from here prove another active publisher.
_MAX_FOREIGN = 5
# Periods of a turning crank's messages, and of all other commands [s].
_TURNING_PERIOD = 0.01
_COMMAND_PERIOD = 0.05
# Redundant stop messages to a walker.
_STOP_MESSAGES = 5
CRANK, WALK = 'crank', 'walk'
# Returns the rate of a subscribed topic, else None.
RateOf = Callable[[str], TopicRate | None]


@dataclass
class Offer:
    """A topic that pages may drive, and its other publishers."""

    kind: str
    topic: str
    # All topics that drive the same thing, and the nodes that publish them.
    topics: tuple[str, ...]
    publishers: tuple[str, ...]
    # The publishers that can yield to a driver.
    yielding: tuple[str, ...]

    @property
    def name(self) -> str:
        """Return the name of the drive on the page."""
        return f'{self.kind}:{self.topic}'


@dataclass
class _LeasedDrive:
    """A drive, its lease, and the page that has it."""

    offer: Offer
    drive: LiveCrankDrive | WalkDrive
    lease: Lease
    publisher: Any = None
    # The time since which the owner waits for the others to yield [s]; None while it drives.
    waiting_since: float | None = None
    # The time since which no other publisher has sent anything [s].
    alone_since: float | None = None
    # The page that lost it last, and the reason; shown until a page drives.
    previous_owner: int | None = None
    reason: str = ''
    # Stop messages that are still to be sent to a walker.
    stops_left: int = 0
    # The number of messages sent from here, and of those received from others on each topic when
    # the drive began.
    sent: int = 0
    begin: dict[str, tuple[TopicRate, int]] = field(default_factory=dict)

    def is_alone(self, now: float, rate_of: RateOf) -> tuple[bool, str]:
        """Return whether all others have yielded or are idle; and the reason for giving up."""
        if self.lease.other:
            return False, f'{self.lease.other} drives {self.offer.topic}'
        active = self._not_yielded()
        if not active or all(_is_silent(rate_of(topic)) for topic in self.offer.topics):
            self.alone_since = self.alone_since or now
            return now - self.alone_since >= DELIVERY_TIME, ''
        self.alone_since = None
        if self.waiting_since is None or now - self.waiting_since < TAKE_TIMEOUT:
            return False, ''
        verb = 'does' if len(active) == 1 else 'do'
        return False, f'{", ".join(active)} still publishes and {verb} not yield'

    def start(self, owner: int, angle: float) -> None:
        """Begin to drive, a crank from its present angle [rad]."""
        self.drive.take(owner, self.drive.alive_at, angle)
        self.waiting_since = None
        self.begin = {}
        self.sent = 0

    def intruder(self, rate_of: RateOf) -> str:
        """Return the other active publisher while a page drives, in words; '' for none."""
        for topic in self.offer.topics:
            rate = rate_of(topic)
            if rate is None:
                continue
            foreign = rate.count - (self.sent if topic == self.offer.topic else 0)
            first_rate, first_foreign = self.begin.get(topic, (None, 0))
            # A new subscription counts from 0.
            if first_rate is not rate:
                self.begin[topic] = (rate, foreign)
            elif foreign - first_foreign > _MAX_FOREIGN:
                publishers = ', '.join(self._not_yielded()) or 'another node'
                return f'{publishers} publishes {topic} as well and does not yield'
        return ''

    def _not_yielded(self) -> list[str]:
        yielded = self.lease.yielded
        return [name for name in self.offer.publishers if name not in yielded]

    def as_data(self, rate_of: RateOf) -> dict[str, Any]:
        """Return its state for the page, ready for JSON."""
        offer = self.offer
        owner = self.drive.owner
        yielded = self.lease.yielded if owner else []
        is_free = owner is None and not self.stops_left
        is_sent = not all(_is_silent(rate_of(topic)) for topic in offer.topics)
        return {
            'target': offer.name,
            'kind': offer.kind,
            'topic': offer.topic,
            'owner': owner,
            'taking': owner is not None and self.waiting_since is not None,
            'previous_owner': self.previous_owner,
            'reason': self.reason,
            'publishers': list(offer.publishers),
            'foreign': [name for name in offer.publishers if name not in offer.yielding],
            # Publishers that certainly keep pages from driving: nobody else sends.
            'blocking': [*offer.publishers] if is_free and is_sent and not offer.yielding else [],
            'yielded': [name for name in offer.publishers if name in yielded],
            'elsewhere': self.lease.other,
        }


class Drives:
    """
    Publish for pages, in a thread that neither a page nor a callback can delay.

    `put` runs a function in ROS's thread, such as `on_change`, which is called there after each
    change of a drive. `crank_angle` returns the present angle of a named drive's crank [rad].
    """

    def __init__(
        self,
        node: Node,
        put: Callable[[Callable[[], object]], object],
        on_change: Callable[[], object],
        crank_angle: Callable[[str], float],
        rate_of: RateOf,
    ) -> None:
        self._node = node
        self._put = put
        self._on_change = on_change
        self._crank_angle = crank_angle
        self._rate_of = rate_of
        self._drives: dict[str, _LeasedDrive] = {}
        self._lock = Lock()
        self._wake = Event()
        self._stopped = False
        self._thread = Thread(target=self._run, name='drives', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop all drives."""
        with self._lock:
            for leased in self._drives.values():
                self._release(leased, 'view_node has ended')
        self._stopped = True
        self._wake.set()
        self._thread.join(1.0)
        with self._lock:
            for leased in self._drives.values():
                if leased.stops_left and leased.publisher is not None:
                    publish_last(leased.publisher, self._twist())
                leased.lease.release()

    def offer(self, offers: list[Offer]) -> None:
        """Set the possible drives; in ROS's thread."""
        names = {offer.name for offer in offers}
        with self._lock:
            for offer in offers:
                leased = self._drives.get(offer.name)
                if leased is None:
                    drive: LiveCrankDrive | WalkDrive
                    drive = LiveCrankDrive() if offer.kind == CRANK else WalkDrive()
                    # Made before it is needed: discovery takes longer than a handshake.
                    leased = _LeasedDrive(offer, drive, Lease(self._node, offer.topic))
                    self._drives[offer.name] = leased
                leased.offer = offer
            for name, leased in list(self._drives.items()):
                is_free = leased.drive.owner is None and leased.publisher is None
                if name not in names and is_free:
                    del self._drives[name]
                    leased.lease.close()

    def state(self) -> list[dict[str, Any]]:
        """Return the drives and their owners, ready for JSON."""
        with self._lock:
            return [leased.as_data(self._rate_of) for leased in self._drives.values()]

    def keep_alive(self, page: int) -> None:
        """Note that a page is connected."""
        now = monotonic()
        # Without the lock: each is one assignment, at every message of a page.
        for leased in list(self._drives.values()):
            if leased.drive.owner == page:
                leased.drive.alive_at = now

    def disconnected(self, page: int) -> None:
        """Stop the drives of a closed page."""
        with self._lock:
            stopped = [d for d in self._drives.values() if d.drive.owner == page]
            for leased in stopped:
                self._release(leased, 'the page was closed')
        if stopped:
            self._wake.set()
            self._put(self._on_change)

    def command(self, page: int, command: Command, answer: Answer) -> None:
        """Take, drive or release, and answer."""
        with self._lock:
            leased = self._drives.get(command.target)
            try:
                if leased is None:
                    raise DriveError('that can no longer be driven')  # noqa: TRY301
                self._run_command(leased, page, command)
            except DriveError as error:
                answer(False, str(error))
                return
        self._wake.set()
        if command.command in {'take', 'release'}:
            self._put(self._on_change)
        answer(True, '')

    def _run_command(self, leased: _LeasedDrive, page: int, command: Command) -> None:
        """Run a command of a page; a DriveError says why it is not possible."""
        drive = leased.drive
        now = monotonic()
        if command.command == 'take':
            self._take(leased, page, now)
            return
        if drive.owner != page:
            raise DriveError('this page does not drive it: take it over first')
        if command.command == 'release':
            self._release(leased, '')
        elif leased.waiting_since is not None:
            raise DriveError('not yet: the other publishers have not yielded')
        elif isinstance(drive, LiveCrankDrive) and command.command == 'turn':
            drive.turn_to(command.value, now)
        elif isinstance(drive, LiveCrankDrive) and command.command == 'spin':
            drive.spin(command.value, now)
        elif isinstance(drive, WalkDrive) and command.command == 'walk':
            drive.walk(command.value, command.turn)
        else:
            raise DriveError(f'a {leased.offer.kind} does not {command.command}')

    def _take(self, leased: _LeasedDrive, page: int, now: float) -> None:
        """Give a drive to a page; its commands begin when other publishers have yielded."""
        drive = leased.drive
        previous_owner = drive.owner
        if previous_owner == page:
            return
        # The others have yielded to this node already, for any of its pages.
        is_held = previous_owner is not None and leased.waiting_since is None
        angle = drive.advance(now) if isinstance(drive, LiveCrankDrive) else 0.0
        drive.take(page, now, angle)
        leased.previous_owner = previous_owner
        leased.reason = 'another page has taken it over' if previous_owner is not None else ''
        leased.stops_left = 0
        if not is_held:
            leased.waiting_since = now
            leased.alone_since = None
        if leased.publisher is None:
            self._put(lambda: self._create_publisher(leased))

    def _release(self, leased: _LeasedDrive, reason: str) -> None:
        drive = leased.drive
        if drive.owner is None:
            return
        leased.previous_owner = drive.owner if reason else None
        leased.reason = reason
        drive.owner = None
        if leased.offer.kind == WALK and leased.waiting_since is None:
            leased.stops_left = _STOP_MESSAGES
        else:
            self._put(lambda: self._destroy_publisher(leased))
        leased.waiting_since = None

    def _create_publisher(self, leased: _LeasedDrive) -> None:
        kind = Float64 if leased.offer.kind == CRANK else TwistStamped
        with self._lock:
            if leased.publisher is None and leased.drive.owner is not None:
                topic = leased.offer.topic
                leased.publisher = self._node.create_publisher(kind, topic, OUTPUT)
        self._wake.set()

    def _destroy_publisher(self, leased: _LeasedDrive) -> None:
        with self._lock:
            if leased.drive.owner is None:
                if leased.publisher is not None:
                    self._node.destroy_publisher(leased.publisher)
                    leased.publisher = None
                leased.lease.release()

    def _run(self) -> None:
        while not self._stopped:
            with self._lock:
                periods = [self._serve_or_stop(leased) for leased in self._drives.values()]
            # Without a driving page, wait until one commands.
            self._wake.wait(min(filter(None, periods), default=None))
            self._wake.clear()

    def _serve_or_stop(self, leased: _LeasedDrive) -> float | None:
        """Serve a drive; one that fails is released, and the others go on."""
        try:
            return self._serve(leased)
        except Exception as error:
            text = f'the drive of {leased.offer.topic} failed: {error_with_place(error)}'
            self._node.get_logger().error(text, throttle_duration_sec=LOG_PERIOD)
            self._release(leased, 'view_node failed to drive it')
            return _COMMAND_PERIOD

    def _serve(self, leased: _LeasedDrive) -> float | None:
        """Publish due messages; return the time to the next [s], None while nothing drives."""
        drive = leased.drive
        now = monotonic()
        if drive.owner is None and not leased.stops_left:
            return None
        reason = self._update_lease(leased, now)
        if reason and drive.owner is not None:
            self._release(leased, reason)
            self._put(self._on_change)
        if drive.owner is None:
            if leased.stops_left:
                leased.stops_left -= 1
                self._publish(leased, self._twist())
                if not leased.stops_left:
                    self._put(lambda: self._destroy_publisher(leased))
        elif leased.waiting_since is None and isinstance(drive, WalkDrive):
            self._publish(leased, self._twist(drive.forward, drive.turn))
        elif leased.waiting_since is None and isinstance(drive, LiveCrankDrive):
            self._publish(leased, Float64(data=drive.advance(now)))
            return _TURNING_PERIOD if drive.speed else _COMMAND_PERIOD
        return _COMMAND_PERIOD

    def _update_lease(self, leased: _LeasedDrive, now: float) -> str:
        """Announce the lease; drive once all have yielded; return why a page must stop, or ''."""
        is_uninterrupted = leased.lease.announce()
        owner = leased.drive.owner
        if leased.drive.is_lost(now):
            return 'the page fell silent: its machine or the network was busy'
        if not is_uninterrupted:
            return 'view_node was stopped for a while'
        if owner is None or leased.waiting_since is None:
            return leased.intruder(self._rate_of) if owner is not None else ''
        is_alone, reason = leased.is_alone(now, self._rate_of)
        if is_alone and leased.publisher is not None:
            angle = self._crank_angle(leased.offer.name) if leased.offer.kind == CRANK else 0.0
            leased.start(owner, angle)
            self._put(self._on_change)
        return reason

    def _twist(self, forward: float = 0.0, turn: float = 0.0) -> TwistStamped:
        message = TwistStamped()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.header.frame_id = 'base_link'
        message.twist.linear.x = forward
        message.twist.angular.z = turn
        return message

    def _publish(self, leased: _LeasedDrive, message: Any) -> None:
        if leased.publisher is not None:
            leased.sent += 1
            leased.publisher.publish(message)


def _is_silent(rate: TopicRate | None) -> bool:
    silence = None if rate is None else rate.silence()
    return silence is None or silence >= _IDLE_TIME
