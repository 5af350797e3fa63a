"""A topic's figures: how many messages, how often, how late."""

from dataclasses import dataclass
from math import nan

import numpy as np

from .loading.layouts import Times
from .recording import TopicRecording

MORE = '+'
"""Stands behind a number of lost messages that is the least."""
WHY_MORE = 'publishers left, and of what they sent last nothing is known'


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


def topic_figures(topic: TopicRecording) -> TopicFigures:
    """Return a topic's figures."""
    steps = intervals(topic.times)
    latencies = topic.latencies[~np.isnan(topic.latencies)]
    p50, p99 = np.percentile(latencies, [50.0, 99.0]) if len(latencies) else (nan, nan)
    return TopicFigures(
        name=topic.name,
        type=topic.type,
        count=len(topic.times),
        rate=1.0 / mean if steps.size and (mean := float(steps.mean())) > 0.0 else nan,
        period=float(np.median(steps)) if steps.size else nan,
        longest_gap=float(steps.max()) if steps.size else nan,
        latency_p50=float(p50),
        latency_p99=float(p99),
        lost=topic.lost,
        early=topic.early,
        publishers_left=topic.left,
    )


def intervals(times: Times) -> 'np.ndarray[tuple[int], np.dtype[np.float64]]':
    """Return the times between messages, shape (n - 1,) [s]."""
    return np.diff(times) / 1e9
