"""When each message of a log is due: the log's own times, from a start and at a rate."""

from collections.abc import Collection, Iterator
from math import inf, isfinite

from .reader import Log
from .records import Message

NS = 1e9


def span(log: Log, start_offset: float, duration: float) -> float:
    """Return how much of a log there is to play from an offset for a duration [s]; <= 0: none."""
    return min(duration, (log.end_time - log.start_time) / NS - start_offset)


def schedule(
    log: Log,
    *,
    rate: float = 1.0,
    start_offset: float = 0.0,
    duration: float = inf,
    topics: Collection[str] | None = None,
) -> Iterator[tuple[float, Message]]:
    """
    Yield each message with the time at which it is due, counted from the beginning of playback.

    Parameters
    ----------
    log : Log
        An open log.
    rate : float
        How fast to play: 2 is twice as fast as it was recorded, > 0.
    start_offset : float
        Time of the log to leave out at its start [s], >= 0.
    duration : float
        Time of the log to play [s].
    topics : collection of str, optional
        Full names of the topics to play; all by default.

    Raises
    ------
    ValueError
        The rate or the start offset makes no sense.

    """
    if not (isfinite(rate) and rate > 0.0):
        msg = f'rate = {rate} is refused: it must be finite and > 0'
        raise ValueError(msg)
    if not (isfinite(start_offset) and start_offset >= 0.0):
        msg = f'start offset = {start_offset} s is refused: it must be finite and >= 0'
        raise ValueError(msg)
    return _due(log, rate, start_offset, duration, topics)


def _due(
    log: Log, rate: float, start_offset: float, duration: float, topics: Collection[str] | None
) -> Iterator[tuple[float, Message]]:
    begin = log.start_time + round(start_offset * NS)
    for message in log.messages(topics):
        position = (message.log_time - begin) / NS
        if position < 0.0:
            continue
        # A log without an index is read as it stands, and may be out of order.
        if position <= duration:
            yield position / rate, message
