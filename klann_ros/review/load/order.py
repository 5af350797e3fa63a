"""Log times that go back: a clock that was set back, or messages that overtook each other."""

from typing import Any

from klann_ros.review.model.times import Flags, Times
import numpy as np
from numpy.typing import NDArray

# Whoever records takes a queue in the order of its source times, and one queue after the other;
# what was sent again comes late. So messages overtake each other, and no clock is to blame: never
# where it is so little [ns] ...
_NO_MATTER = 5_000_000
# ... and not where there are several publishers and it is no more than this [ns].
_OVERTAKING = 100_000_000
# The least latency of so many messages is the same before and after, if no clock was set.
_MANY = 1000
# So does what so many in a hundred do not exceed.
_MOST = 90.0
# Fewer tell nothing.
_FEW = 20


def clock_steps(latencies: NDArray[np.float32], steps: Times, *, alone: bool) -> Flags:
    """
    Return which steps back are those of the recorder's clock.

    It was set back if the publisher's clock was, too, as on the same machine, or if from then on
    all messages come earlier after they were published than any did before.

    Parameters
    ----------
    latencies : numpy.ndarray of float32, shape (n,)
        Times from publishing to receiving in the order of the log [s]; NaN where unknown.
    steps : numpy.ndarray, shape (k, 3)
        Which message is logged earlier than the one before it, by how much, and by how much it
        was published earlier, which is negative as a rule [ns].
    alone : bool
        Whether all messages are one publisher's.

    """
    rows, back, published_back = steps.T
    likely: Flags = back >= _NO_MATTER
    if not likely.any():
        return likely
    both = (published_back >= back / 2) & (alone | (back > _OVERTAKING))
    clocks: Flags = likely & (both | _falls(latencies, rows, back))
    return clocks


def _falls(latencies: NDArray[np.float32], rows: Times, back: Times) -> Flags:
    """Return at which rows the latencies fall for good, by about so much [ns]."""
    least = _least_of(latencies, _MANY)
    before = least[np.maximum(rows - _MANY, 0)]
    # At the start there are fewer before.
    early = rows < _MANY
    if early.any():
        before[early] = np.fmin.accumulate(latencies[:_MANY])[rows[early] - 1]
    enough = (rows >= _FEW) & (len(latencies) - rows >= _FEW)
    # A clock that is far off leaves few digits for what is compared here.
    coarse = np.spacing(np.abs(before)).astype(np.float64) * 1e9 > back / 8
    with np.errstate(invalid='ignore'):
        found: Flags = enough & ~coarse & _is_about(before, least[rows], back)
    # Of two publishers with clocks of their own one may be heard later: the other goes on.
    for i in np.flatnonzero(found)[:_MANY].tolist():
        row = int(rows[i])
        before_it, since = latencies[:row][-_MANY:], latencies[row:][:_MANY]
        most = np.nanpercentile(before_it, _MOST), np.nanpercentile(since, _MOST)
        found[i] = _is_about(*most, back[i])
    return found


def _is_about(before: Any, after: Any, by: Any) -> Any:
    return np.abs((before - np.float64(after)) * 1e9 - by) <= by / 2


def _least_of(values: NDArray[np.float32], count: int) -> NDArray[np.float32]:
    """Return for each value the least of it and those that follow, so many in all, no NaN."""
    size = -(-len(values) // count) * count
    padded = np.full(size + count, np.inf, dtype=values.dtype)
    padded[: len(values)] = np.where(np.isnan(values), np.inf, values)
    blocks = padded.reshape(-1, count)
    # The least of a stretch is that of the end of a block, and of the begin of the next one.
    ends = np.minimum.accumulate(blocks[:, ::-1], axis=1)[:, ::-1].ravel()
    begins = np.minimum.accumulate(blocks, axis=1).ravel()
    last = slice(count - 1, count - 1 + len(values))
    return np.minimum(ends[: len(values)], begins[last])
