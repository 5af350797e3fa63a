"""
The playback of a log: each message when it is due, and everything that can be done meanwhile.

One thread iterates over :meth:`Playback.passes`; others steer.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from threading import Condition
from time import monotonic
from typing import TYPE_CHECKING

from .errors import LogError
from .lateness import Lateness
from .read_ahead import ReadAhead
from .timeline import Timeline

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from .reader import Log
    from .records import Message

NS = 1e9
# A log of one moment is not looped faster than this [s].
SHORTEST_LOOP = 0.1
# What is later than this puts off all that comes after it: a process that was stopped, or cannot
# keep up, goes on from where it was, without a burst [s].
LONGEST_CATCH_UP = 0.5
# What is due so soon is played now: messages come in clusters, and each wait costs more than to
# publish one [s].
SOON = 1e-4
# A step waits at most so long for its message to be read [s].
LONGEST_STEP = 5.0
# One wait; a rate can be as small that the next message is due in thousands of years [s].
LONGEST_WAIT = 3600.0


class PlaybackError(LogError):
    """What cannot be done now; the text says why."""


@dataclass(frozen=True)
class Selection:
    """
    What of a log is played.

    Parameters
    ----------
    topics
        Names of the topics.
    latched
        How many of the last messages before a start each latched topic still offers there.
    begin, end
        From where to where, counted from the start of the log [s].
    loop
        Whether it is played again and again.

    """

    topics: frozenset[str]
    latched: Mapping[str, int] = field(default_factory=dict)
    begin: float = 0.0
    end: float = inf
    loop: bool = False


class Playback:
    """
    Play a log, once or in a loop.

    Parameters
    ----------
    log
        An open log.
    selection
        What of it.
    rate
        How fast: 2 is twice as fast as it was recorded.
    paused
        Whether to wait for :meth:`resume`.

    Attributes
    ----------
    length
        How much of the log there is to play, from its start [s].
    lateness
        What was late since the latest start or jump.

    """

    def __init__(
        self, log: Log, selection: Selection, *, rate: float = 1.0, paused: bool = False
    ) -> None:
        self._log = log
        self._selection = selection
        self.length = min(selection.end, length(log))
        self.lateness = Lateness()
        self._changed = Condition()
        self._timeline = Timeline(selection.begin, rate)
        self._ahead: ReadAhead | None = None
        # Where to begin the next pass; None while there is nothing but to go on.
        self._target: float | None = selection.begin
        # The position that is waited for, and whether nothing comes after it.
        self._awaited = selection.begin
        self._at_end = False
        self._loaded = False
        self._paused = paused
        self._stepping = False
        self._stopped = False

    # What the one thread does.

    def passes(self) -> Iterator[Iterator[Message]]:
        """
        Yield a pass from each start: the first one, each turn of a loop, each jump.

        A pass yields first what latched topics offer at that position, then each message when it
        is due. It ends with the log, or where something else is to be done.
        """
        while (begin := self._take_target()) is not None:
            yield self._pass(begin)

    def _take_target(self) -> float | None:
        with self._changed:
            target, self._target = self._target, None
            if self._stopped or target is None:
                return None
            self.lateness = Lateness()
            self._move(target)
            return target

    def _pass(self, begin: float) -> Iterator[Message]:
        start = self._log.start_time + round(begin * NS)
        end = self._log.start_time + round(self.length * NS)
        yield from self._log.latest(self._selection.latched, start)
        found = self._log.messages(self._selection.topics, start=start, end=end)
        furthest, count = begin, 0
        with ReadAhead(found) as ahead:
            self._set_ahead(ahead)
            for message in ahead:
                # A log without an index is read as it stands, and may be out of order.
                furthest = max(furthest, (message.log_time - self._log.start_time) / NS)
                if not self._await(furthest):
                    return
                yield message
                count += 1
            self._set_ahead(None)
        self._finish(begin, furthest, empty=count == 0)

    def _set_ahead(self, ahead: ReadAhead | None) -> None:
        with self._changed:
            self._ahead = ahead
            if ahead is not None and self._interrupted:
                ahead.close()

    def _await(self, position: float) -> bool:
        """Wait for a message's time; return whether it is to be played."""
        with self._changed:
            self._load(position)
            while not self._interrupted:
                if self._stepping:
                    self._stepping = False
                    self._timeline = self._timeline.moved(position, monotonic())
                    self._changed.notify_all()
                    return True
                late = self._settled() - self._timeline.due(position)
                if late >= -SOON:
                    self.lateness.note(late)
                    return True
                self._changed.wait(min(-late, LONGEST_WAIT))
            return False

    def _finish(self, begin: float, last: float, *, empty: bool) -> None:
        """Wait at the end, until the time of a loop is over or a pause is."""
        loop = self._selection.loop
        end = last
        with self._changed:
            if self._interrupted:
                return
            if loop:
                end = max(self.length, begin + SHORTEST_LOOP * self._timeline.rate)
            self._load(end)
            self._at_end = empty or not loop
            self._changed.notify_all()
            while not self._interrupted:
                left = self._timeline.due(end) - self._settled()
                if left <= 0.0 or (self._stepping and not self._at_end):
                    self._target = self._selection.begin if loop else None
                    return
                self._changed.wait(min(left, LONGEST_WAIT))

    def _load(self, position: float) -> None:
        """Let the time run, now that the first message is in memory."""
        self._awaited = position
        if not self._loaded:
            self._loaded = True
            if not self._paused:
                self._timeline = self._timeline.started(monotonic())

    # What others do meanwhile.

    @property
    def position(self) -> float:
        """Return where it is, counted from the start of the log [s]."""
        with self._changed:
            return max(0.0, min(self._timeline.at(self._settled()), self.length))

    @property
    def time(self) -> int:
        """Return where it is, in log time [ns]."""
        return self._log.start_time + round(self.position * NS)

    def pause(self) -> None:
        """Stand still until told otherwise."""
        with self._changed:
            self._paused = True
            self._timeline = self._timeline.stopped(self._settled())
            self._changed.notify_all()

    def resume(self) -> None:
        """Go on from here."""
        with self._changed:
            self._paused = False
            if self._loaded:
                self._timeline = self._timeline.started(self._settled())
            self._changed.notify_all()

    def step(self) -> None:
        """
        Play exactly the next message.

        Raises
        ------
        PlaybackError
            It is not paused, or there is no next message.

        """
        with self._changed:
            if not self._paused:
                raise PlaybackError('it is playing; pause it first')
            self._stepping = True
            self._changed.notify_all()
            self._changed.wait_for(
                lambda: not self._stepping or self._at_end or self._stopped, LONGEST_STEP
            )
            if self._stepping:
                self._stepping = False
                reason = 'there is no message left' if self._at_end else 'it is still being read'
                raise PlaybackError(reason)

    def seek(self, position: float) -> None:
        """
        Go on from another position [s], paused or not.

        Raises
        ------
        PlaybackError
            There is no such position.

        """
        if not 0.0 <= position <= self.length:
            raise PlaybackError(f'position = {position} is not within 0 .. {self.length:g} s')
        with self._changed:
            self._target = position
            self._move(position)
            if self._ahead is not None:
                self._ahead.close()
            self._changed.notify_all()

    def set_rate(self, rate: float) -> None:
        """
        Go on at another rate.

        Raises
        ------
        ValueError
            The rate makes no sense.

        """
        with self._changed:
            self._timeline = self._timeline.at_rate(rate, self._settled())
            self._changed.notify_all()

    def stop(self) -> None:
        """End it."""
        with self._changed:
            self._stopped = True
            if self._ahead is not None:
                self._ahead.close()
            self._changed.notify_all()

    @property
    def _interrupted(self) -> bool:
        return self._stopped or self._target is not None

    def _move(self, position: float) -> None:
        """Stand at a position until its first message is in memory."""
        now = monotonic()
        self._timeline = self._timeline.moved(position, now).stopped(now)
        self._awaited = position
        self._loaded = self._at_end = False

    def _settled(self) -> float:
        """Return the time, after all is put off that is too late to be caught up with."""
        now = monotonic()
        late = now - self._timeline.due(self._awaited)
        if late > LONGEST_CATCH_UP:
            self.lateness.held_up += late
            self._timeline = self._timeline.held_up(self._awaited, now)
        return now


def length(log: Log) -> float:
    """Return the time from the first message of a log to the last [s]."""
    return (log.end_time - log.start_time) / NS
