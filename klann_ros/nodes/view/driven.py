"""One thing that pages drive: its topic, its lease, and the other publishers there."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from klann_ros.live.drive import CrankDrive, WalkDrive
from klann_ros.live.rates import TopicRate
from klann_ros.nodes.lease import Lease

# Time for the other publishers to yield or fall silent; else nothing is driven [s].
TAKE_TIME = 2.5
# Silence after which a publisher that cannot yield counts as idle [s].
_SILENCE = 1.0
# Messages sent before the others yielded have arrived after this time [s].
_DELIVERY_TIME = 0.1
# More messages than were sent from here prove another active publisher.
_MAX_FOREIGN = 5
CRANK, WALK = 'crank', 'walk'
# Returns the figures of a topic that is listened to, else None.
FiguresOf = Callable[[str], TopicRate | None]


@dataclass
class Offer:
    """What pages may drive: a topic, and the other publishers there."""

    kind: str
    topic: str
    # All topics that drive the same thing, and the nodes that publish them.
    topics: tuple[str, ...]
    publishers: tuple[str, ...]
    # Those of them that yield to a driver.
    yielding: tuple[str, ...]

    @property
    def name(self) -> str:
        """Return what the page calls it."""
        return f'{self.kind}:{self.topic}'


@dataclass
class Driven:
    """Something that a page can drive, and the page that drives it."""

    offer: Offer
    drive: CrankDrive | WalkDrive
    lease: Lease | None = None
    publisher: Any = None
    # Since when the owner waits for the others to yield [s]; None while it drives.
    taking: float | None = None
    # Since when no other publisher has sent anything [s].
    alone: float | None = None
    # The page that lost it last, and the reason; shown until somebody drives.
    loser: int | None = None
    why: str = ''
    # Stop messages that are still to be sent to a walker.
    stops: int = 0
    # Messages sent from here, and what had been sent and received when the drive began.
    sent: int = 0
    begin: dict[str, tuple[TopicRate, int]] = field(default_factory=dict)

    def is_alone(self, now: float, figures: FiguresOf) -> tuple[bool, str]:
        """Return whether all others have yielded or are idle; and why that will not be."""
        assert self.lease is not None  # noqa: S101 - made with the drive
        assert self.taking is not None  # noqa: S101 - else it drives already
        if self.lease.other:
            return False, f'{self.lease.other} drives {self.offer.topic}'
        yielded = self.lease.yielded
        rest = [name for name in self.offer.publishers if name not in yielded]
        if not rest or all(_is_silent(figures(topic)) for topic in self.offer.topics):
            self.alone = self.alone or now
            return now - self.alone >= _DELIVERY_TIME, ''
        self.alone = None
        if now - self.taking < TAKE_TIME:
            return False, ''
        verb = 'does' if len(rest) == 1 else 'do'
        return False, f'{", ".join(rest)} still publishes and {verb} not yield'

    def start(self, angle: float) -> None:
        """Begin to drive, a crank from where it is [rad]."""
        owner = self.drive.owner
        assert owner is not None  # noqa: S101 - a page takes it
        self.drive.take(owner, self.drive.alive_at, angle)
        self.taking, self.begin, self.sent = None, {}, 0

    def intruder(self, figures: FiguresOf) -> str:
        """Return which other publisher is active while a page drives; '' for none."""
        for topic in self.offer.topics:
            found = figures(topic)
            if found is None:
                continue
            sent = self.sent if topic == self.offer.topic else 0
            known, begin = self.begin.get(topic, (None, 0))
            # A new subscription counts from 0.
            if known is not found:
                self.begin[topic] = found, found.count - sent
            elif found.count - sent - begin > _MAX_FOREIGN:
                yielded = self.lease.yielded if self.lease else []
                names = [name for name in self.offer.publishers if name not in yielded]
                who = ', '.join(names) or 'another node'
                return f'{who} publishes {topic} as well and does not yield'
        return ''

    def as_data(self) -> dict[str, Any]:
        """Return it as the page shows it, ready for JSON."""
        offer, owner = self.offer, self.drive.owner
        lease = self.lease
        yielded = [n for n in offer.publishers if lease and n in lease.yielded] if owner else []
        return {
            'what': offer.name,
            'kind': offer.kind,
            'topic': offer.topic,
            'owner': owner,
            'taking': owner is not None and self.taking is not None,
            'loser': self.loser,
            'why': self.why,
            'publishers': list(offer.publishers),
            'foreign': [name for name in offer.publishers if name not in offer.yielding],
            'yielded': yielded,
            'elsewhere': lease.other if lease else '',
        }


def _is_silent(figures: TopicRate | None) -> bool:
    silence = None if figures is None else figures.silence()
    return silence is None or silence >= _SILENCE
