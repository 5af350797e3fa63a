"""A topic of a run: reception, rate, latency, losses and gaps."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import nan
import re
from typing import NamedTuple

from klann_ros.kinematics.arrays import FloatArray, IntArray
import numpy as np
from numpy.typing import NDArray

from .limits import Limits
from .times import covered_time, Interval, median, time_steps

# Sent on events, not at a rate: markers, logs, parameter events, node states, joysticks, leases,
# and commands that hold until the next one or a timeout. Only velocities of cranks have a rate.
_EVENT_PACKAGES = ('visualization_msgs/', 'rcl_interfaces/', 'lifecycle_msgs/', 'trajectory_msgs/')
_EVENT_TYPES = ('sensor_msgs/msg/Joy', 'geometry_msgs/msg/Twist', 'diagnostic_msgs/msg/KeyValue')
_COMMANDS = re.compile('cmd_vel[^/]*$|(?<!velocity_controller)/commands$')
# Sent at a rate, with long stalls at most.
_STREAMS = (
    'sensor_msgs/',
    'geometry_msgs/',
    'nav_msgs/msg/Odometry',
    'rosgraph_msgs/',
    'std_msgs/msg/Float64',
)

DELAY_MEANING = 'delay: from publishing to recording, the median'
LOWER_BOUND_MEANING = 'at least: what a publisher lost just before it ended is not known'


@dataclass(frozen=True, eq=False)
class TopicRecording:
    """Reception of the messages of a topic."""

    name: str
    # '' without messages.
    type: str  # noqa: A003, RUF100 - as all tools call it; ruff lets it be
    times: IntArray  # shape (n,): log times, sorted [ns]
    # Shape (n,): times from publishing to receiving [s]; NaN of latched messages from before the
    # discovery of their publisher.
    latencies: NDArray[np.float32]
    lost: int | None  # messages lost on the way into the run; None for unknown
    early: int = 0  # messages of later publishers from before their discovery
    publishers_left: int = 0  # losses at the end of their life cannot be detected
    shared: bool = False  # whether several publishers were active at once
    # Shape (k, 3): missing sequence numbers: log times before and after [ns], and their count.
    missing: IntArray = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))
    # Shape (k, 2): steps back of the recorder's clock: log times after, and least size [ns].
    set_back: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    # Shape (k, 2): restarts of the publisher: log times before and after [ns]; only where no two
    # publish at once.
    restarts: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    # Number of other messages logged earlier than their predecessor in the file: several
    # publishers interleave, and retransmissions come late.
    reordered: int = 0
    dropped: int = 0  # lost messages that the recorder had received
    first: int = 0  # in a window of a run, log time of the topic's first message [ns]

    @property
    def is_periodic(self) -> bool:
        """Return whether messages of this type are sent at a rate; others are sent on events."""
        is_command = _COMMANDS.search(self.name) is not None
        is_event = self.type in _EVENT_TYPES or self.type.startswith(_EVENT_PACKAGES)
        return not (is_command or is_event)

    @cached_property
    def figures(self) -> 'TopicFigures':
        """Return the figures of the topic."""
        steps = time_steps(self.times)
        latencies = self.latencies[~np.isnan(self.latencies)]
        p50, p99 = np.percentile(latencies, [50.0, 99.0]) if len(latencies) else (nan, nan)
        return TopicFigures(
            name=self.name,
            type=self.type,
            count=len(self.times),
            rate=1.0 / mean if steps.size and (mean := float(steps.mean())) > 0.0 else nan,
            period=median(steps) if steps.size else nan,
            longest_gap=float(steps.max()) if steps.size else nan,
            latency_p50=float(p50),
            latency_p99=float(p99),
            lost=self.lost,
            early=self.early,
            publishers_left=self.publishers_left,
        )


@dataclass(frozen=True)
class TopicFigures:
    """A topic in a run, by its messages' times; NaN where there are too few messages."""

    name: str
    type: str  # noqa: A003, RUF100 - as all tools call it; ruff lets it be
    count: int  #: messages in the run
    rate: float  #: mean rate of the log times [Hz]
    period: float  #: median time between two messages [s]
    longest_gap: float  #: longest time between two messages [s]
    latency_p50: float  #: median time from publishing to receiving [s]; NaN for unknown
    latency_p99: float  #: its 99th percentile [s]
    lost: int | None  #: messages lost on the way into the run; None for unknown
    early: int  #: messages of later publishers from before their discovery
    publishers_left: int  #: publishers that left; with any, `lost` is a lower bound

    @property
    def has_unknown_losses(self) -> bool:
        """Return whether more messages may be lost than `lost`."""
        return self.lost is not None and self.publishers_left > 0

    @property
    def lost_in_words(self) -> str:
        """Return the number of lost messages, which may be a lower bound or unknown."""
        if self.lost is None:
            return 'unknown'
        return f'at least {self.lost}' if self.has_unknown_losses else str(self.lost)


# Messages that a period needs.
_MIN_PERIODIC_MESSAGES = 10
# Percentile of the intervals of a periodic topic that is within the default limits.
_REGULAR_PERCENTILE = 90.0
_DEFAULT_LIMITS = Limits()
# A bursty topic has no rate: its regular intervals cover less than this share of the time, and on
# average less than this between two gaps [s].
_MIN_REGULAR_SHARE = 0.25
_MIN_REGULAR_TIME = 0.5
# A gap is a loss if this share of its possible messages is known to be missing.
_LOSS_SHARE = 0.5


class Gap(NamedTuple):
    """
    A gap: begin and end [ns], topics, and the longest interval that is no gap [s].

    `is_restart`: a gap between two publishers, the first of which was shut down.
    """

    begin: int
    end: int
    topics: tuple[str, ...]
    max_interval: float = 0.0
    is_restart: bool = False

    @property
    def length(self) -> float:
        """Return its length [s]."""
        return (self.end - self.begin) / 1e9


def find_gaps(topic: TopicRecording, limits: Limits, resolution: float = 0.0) -> Iterator[Gap]:
    """
    Yield the gaps of a periodic topic, without those explained by lost messages.

    `resolution` is the step of the log times [s].
    """
    if len(topic.times) < _MIN_PERIODIC_MESSAGES or not topic.is_periodic:
        return
    steps = time_steps(topic.times)
    period = max(median(steps), resolution)
    max_interval = limits.max_interval(period)
    rows = np.flatnonzero(steps > max_interval)
    if not rows.size or not _has_rate(topic, steps, period):
        return
    # Starting nodes delay each other.
    starts = np.array([topic.first or topic.times[0], *topic.restarts[:, 1]])
    last_start = starts[np.searchsorted(starts, topic.times[rows], side='right') - 1]
    rows = rows[topic.times[rows] - last_start >= limits.start_time * 1e9]
    restarts = set(topic.restarts[:, 0].tolist())
    lost_counts = {begin: count for begin, _, count in topic.missing.tolist()}
    for begin, end in zip(topic.times[rows].tolist(), topic.times[rows + 1].tolist(), strict=True):
        gap = Gap(begin, end, (topic.name,), max_interval, begin in restarts)
        if lost_counts.get(begin, 0) * period < _LOSS_SHARE * gap.length:
            yield gap


def _has_rate(topic: TopicRecording, steps: FloatArray, period: float) -> bool:
    """Return whether intervals [s] are regular, gaps aside."""
    usual = _DEFAULT_LIMITS.max_interval(period)
    if float(np.percentile(steps, _REGULAR_PERCENTILE)) > usual:
        return False
    if topic.type.startswith(_STREAMS):
        return True
    regular, silent = float(steps[steps <= usual].sum()), steps[steps > usual]
    is_present = regular >= _MIN_REGULAR_SHARE * float(steps.sum())
    return is_present or regular >= _MIN_REGULAR_TIME * (len(silent) + 1)


def exclude_intervals(gaps: Sequence[Gap], intervals: Sequence[Interval]) -> list[Gap]:
    """Return the gaps that are too long even without the time of merged intervals in them."""
    begins = np.array([gap.begin for gap in gaps], dtype=np.int64)
    ends = np.array([gap.end for gap in gaps], dtype=np.int64)
    times = (ends - begins) / 1e9 - covered_time(begins, ends, intervals) / 1e9
    return [gap for gap, time in zip(gaps, times.tolist(), strict=True) if time > gap.max_interval]
