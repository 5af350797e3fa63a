"""How regularly the messages of a topic came, and how late: histograms over powers of ten."""

from typing import Any

from klann_ros.log.wording import verb
from klann_ros.review.recording import TopicRecording
from klann_ros.review.topic_figures import intervals
from klann_ros.untrusted.text import printable
import numpy as np
from numpy.typing import NDArray

# Bins from 1 us to 1000 s, so many to a decade.
FIRST, LAST, A_DECADE = -6, 3, 20


def timing(topic: TopicRecording) -> dict[str, Any]:
    """Return the histograms of a topic."""
    return {
        'name': printable(topic.name),
        'intervals': histogram(intervals(topic.times)),
        'latencies': histogram(topic.latencies[~np.isnan(topic.latencies)]),
    }


def histogram(seconds: NDArray[Any]) -> dict[str, Any]:
    """
    Return how many times fall into each bin, and a sentence about them.

    A bin k holds 10^(FIRST + k / A_DECADE) and what is longer, up to the next; the first and the
    last that are not empty are the ends of `counts`. Above LAST all are in the last bin.
    """
    positive = seconds[seconds >= 10.0**FIRST]
    bins = np.floor((np.log10(positive) - FIRST) * A_DECADE).astype(np.intp)
    last = (LAST - FIRST) * A_DECADE - 1
    counts = np.bincount(np.clip(bins, 0, last), minlength=1)
    filled = np.flatnonzero(counts)
    begin, end = (int(filled[0]), int(filled[-1]) + 1) if filled.size else (0, 0)
    return {
        'first': begin,
        'counts': counts[slice(begin, end)].tolist(),
        'text': _sentence(seconds, len(seconds) - len(positive)),
    }


def _sentence(seconds: NDArray[Any], below: int) -> str:
    if not len(seconds):
        return 'There is none.'
    half, most, longest = (1e3 * float(s) for s in np.percentile(seconds, [50.0, 99.0, 100.0]))
    are = verb(below, 'is', 'are')
    rest = f'; {below} {are} below 1 µs or negative, and not drawn' if below else ''
    if len(seconds) == 1:
        return f'The only one is {longest:.4g} ms{rest}.'
    return (
        f'Half of {len(seconds)} are up to {half:.4g} ms, 99 % up to {most:.4g} ms, '
        f'the longest is {longest:.4g} ms{rest}.'
    )
