"""A topic of a run: how its messages came, and its figures: how many, how often, how late."""

from dataclasses import dataclass, field
from functools import cached_property
from math import nan

import numpy as np
from numpy.typing import NDArray

from .times import intervals, median, Times

# Sent on events, not at a rate: markers, logs, parameter events, states of nodes; joysticks and
# commands while somebody drives.
_EVENT_PACKAGES = ('visualization_msgs/', 'rcl_interfaces/', 'lifecycle_msgs/')
_EVENT_TYPES = ('sensor_msgs/msg/Joy', 'geometry_msgs/msg/Twist')
_COMMAND = 'cmd_vel'
# Sent at a rate, however long they stall.
_STREAMS = (
    'sensor_msgs/',
    'geometry_msgs/',
    'nav_msgs/msg/Odometry',
    'rosgraph_msgs/',
    'std_msgs/msg/Float64',
)

MORE = '+'
"""Stands behind a number of lost messages that is the least."""
WHY_MORE = 'publishers left, and of what they sent last nothing is known'


@dataclass(frozen=True, eq=False)
class TopicRecording:
    """How the messages of a topic came."""

    # The topic and its message type; the type is '' if nothing of it is in the run.
    name: str
    type: str  # noqa: A003, RUF100 - as all tools call it; ruff lets it be
    # Shape (n,): log times, sorted [ns].
    times: Times
    # Shape (n,): times from publishing to receiving [s]; NaN of what a latched publisher sent
    # before it was heard, which waited for whoever would come.
    latencies: NDArray[np.float32]
    # Messages lost on the way into the run; None where nobody can tell.
    lost: int | None
    # What publishers that came later had sent before the recorder heard them.
    early: int = 0
    # How many publishers left: of what each sent last nothing is known.
    left: int = 0
    # Whether several publishers were there at once, as their numbers or the recorder tell.
    shared: bool = False
    # Shape (k, 3): where sequence numbers are missing: the log times before and after [ns], and
    # how many.
    missing: Times = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))
    # Shape (k, 2): where the recorder's clock was set back: the log times after that, and by how
    # much at least [ns].
    set_back: Times = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    # Shape (k, 2): where one publisher ended and another began: the log times before and after
    # [ns]; known only where no two publish at once.
    restarts: Times = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    # How many other messages are logged earlier than the one before them in the file: those of
    # several publishers come in turns, and some are sent again.
    overtaken: int = 0
    # How many of those that are lost the recorder had received.
    dropped: int = 0
    # Log time of the topic's first message where these are not all [ns]; 0 for the first of these.
    first: int = 0

    @property
    def lost_at(self) -> int | None:
        """Return the log time of the first message behind a gap in the numbers [ns]."""
        return int(self.missing[0, 1]) if len(self.missing) else None

    @property
    def is_periodic(self) -> bool:
        """Return whether messages of this type are sent at a rate; others are sent on events."""
        is_command = self.name.rpartition('/')[2] == _COMMAND
        is_event = self.type in _EVENT_TYPES or self.type.startswith(_EVENT_PACKAGES)
        return not (is_command or is_event)

    @property
    def is_stream(self) -> bool:
        """Return whether messages of this type have a rate even where long silences hide it."""
        return self.is_periodic and self.type.startswith(_STREAMS)

    @cached_property
    def figures(self) -> 'TopicFigures':
        """Return its figures."""
        return _figures(self)


@dataclass(frozen=True)
class TopicFigures:
    """
    A topic in a run, by its messages' times; NaN where there are too few messages.

    Attributes
    ----------
    name, type : str
        The topic and its message type.
    count : int
        Messages in the run.
    rate : float
        Mean rate of the log times [Hz].
    period : float
        Median time between two messages [s].
    longest_gap : float
        Longest time between two messages [s].
    latency_p50, latency_p99 : float
        Time from publishing to receiving that half of the messages, and all but one in a hundred,
        do not exceed [s]; NaN where no latency is known.
    lost : int or None
        Messages lost on the way into the run; None where nobody can tell.
    early : int
        What publishers that came later had sent before the recorder heard them.
    publishers_left : int
        How many publishers left: of what each sent last nothing is known, and `lost` is the least.

    """

    name: str
    type: str  # noqa: A003, RUF100 - as all tools call it; ruff lets it be
    count: int
    rate: float
    period: float
    longest_gap: float
    latency_p50: float
    latency_p99: float
    lost: int | None
    early: int
    publishers_left: int

    @property
    def lost_in_words(self) -> str:
        """Return how many were lost, with a + where more may have been; ? for unknown."""
        if self.lost is None:
            return '?'
        return f'{self.lost}{MORE}' if self.publishers_left else str(self.lost)


def _figures(topic: TopicRecording) -> TopicFigures:
    steps = intervals(topic.times)
    latencies = topic.latencies[~np.isnan(topic.latencies)]
    p50, p99 = np.percentile(latencies, [50.0, 99.0]) if len(latencies) else (nan, nan)
    return TopicFigures(
        name=topic.name,
        type=topic.type,
        count=len(topic.times),
        rate=1.0 / mean if steps.size and (mean := float(steps.mean())) > 0.0 else nan,
        period=median(steps) if steps.size else nan,
        longest_gap=float(steps.max()) if steps.size else nan,
        latency_p50=float(p50),
        latency_p99=float(p99),
        lost=topic.lost,
        early=topic.early,
        publishers_left=topic.left,
    )
