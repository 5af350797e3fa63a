"""What moves a playback along a log: its timeline, and everything that can be done to it."""

from collections.abc import Callable
from threading import Condition
from time import monotonic

from klann_ros.log.errors import LogError

from .timeline import Lateness, Timeline

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


class Transport:
    """
    Wait for one position after the other in one thread, while others steer.

    Parameters
    ----------
    begin, length
        Where to start, and how much of the log there is, counted from its start [s].
    rate
        How fast: 2 is twice as fast as it was recorded.
    paused
        Whether to wait for :meth:`resume`.

    Attributes
    ----------
    lateness
        What was late since the latest start or jump.

    """

    def __init__(
        self, begin: float, length: float, *, rate: float = 1.0, paused: bool = False
    ) -> None:
        self.length = length
        self.lateness = Lateness()
        self._changed = Condition()
        self._timeline = Timeline(begin, rate)
        self._interrupt: Callable[[], None] = lambda: None
        # Where to begin the next pass; None while there is nothing but to go on.
        self._target: float | None = begin
        # The position that is waited for, and whether nothing comes after it.
        self._awaited = begin
        self._at_end = False
        self._loaded = False
        self._paused = paused
        self._stepping = False
        self._stopped = False

    # What the one thread does.

    def take_target(self) -> float | None:
        """Return where to begin now; None if there is nothing more to do."""
        with self._changed:
            target, self._target = self._target, None
            if self._stopped or target is None:
                return None
            self.lateness = Lateness()
            self._move(target)
            return target

    def on_interrupt(self, interrupt: Callable[[], None]) -> None:
        """Let a jump or the end call this, from another thread; at once if there was one."""
        with self._changed:
            self._interrupt = interrupt
            if self._interrupted:
                self._interrupt()

    def reach(self, position: float) -> bool:
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

    def reach_end(self, begin: float, end: float, loop_to: float | None, *, empty: bool) -> None:
        """
        Wait at the end of a pass, and go back from there in a loop.

        Parameters
        ----------
        begin, end
            From where to where it went [s].
        loop_to
            Where a loop begins [s]; None if it is none.
        empty
            Whether there was no message, so that a step would look for one for ever.

        """
        with self._changed:
            if self._interrupted:
                return
            if loop_to is not None:
                end = max(end, begin + SHORTEST_LOOP * self._timeline.rate)
            self._load(end)
            self._at_end = empty or loop_to is None
            self._changed.notify_all()
            while not self._interrupted:
                left = self._timeline.due(end) - self._settled()
                if left <= 0.0 or (self._stepping and not self._at_end):
                    self._target = loop_to
                    return
                self._changed.wait(min(left, LONGEST_WAIT))

    def _load(self, position: float) -> None:
        """Let the time run, now that the first message is in memory."""
        self._awaited = position
        if not self._loaded:
            self._loaded = True
            if not self._paused:
                self._timeline = self._timeline.started(monotonic())

    @property
    def position(self) -> float:
        """Return where it is, counted from the start of the log [s]."""
        with self._changed:
            return max(0.0, min(self._timeline.at(self._settled()), self.length))

    @property
    def paused(self) -> bool:
        """Return whether it stands still until it is told otherwise."""
        return self._paused

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
        """Play exactly the next message; a PlaybackError if it is not paused, or there is none."""
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
        """Go on from another position [s], paused or not; a PlaybackError if it has none."""
        if not 0.0 <= position <= self.length:
            raise PlaybackError(f'position = {position} is not within 0 .. {self.length:g} s')
        with self._changed:
            self._target = position
            self._move(position)
            self._interrupt()
            self._changed.notify_all()

    def set_rate(self, rate: float) -> None:
        """Go on at another rate; a ValueError if it makes no sense."""
        with self._changed:
            self._timeline = self._timeline.at_rate(rate, self._settled())
            self._changed.notify_all()

    def stop(self) -> None:
        """End it."""
        with self._changed:
            self._stopped = True
            self._interrupt()
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
