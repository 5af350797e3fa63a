"""Findings about what passes: a review of the last seconds, again and again."""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from time import time_ns
from typing import NamedTuple

from klann_ros.log.records import Message
from klann_ros.log.run_parameters import SolverParameters
from klann_ros.review.checks import CHECKS
from klann_ros.review.checks.clocks import check_clocks
from klann_ros.review.loading.load import load
from klann_ros.review.loading.solvers import leg_solvers, parent
from klann_ros.review.model.comparing import dimensions
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.recording import RunRecording
from klann_ros.review.model.review import Severity
from klann_ros.review.model.times import intervals, median
from klann_ros.review.reviewing import reviewed
from klann_ros.untrusted.text import printable

from .window import Window

# How far back a window reaches, and how often there is to be a new one [s]: a silence too short to
# be waiting for falls into one, and what is wrong is found within a second.
LENGTH, STEP = 1.0, 0.7
# A window of more messages is shorter [messages], and one of larger ones [bytes].
MOST, MOST_BYTES = 40_000, 64_000_000
# What a window is too short to tell, or what is told otherwise here.
_LEFT_OUT = frozenset({'container', 'geometry', 'drift', 'stale', 'frozen'})
_CHECKS = tuple(check for check in CHECKS if check is not check_clocks)
# Fewer messages tell no period; a topic whose period is longer is not waited for [s].
_LEAST, _LONGEST_PERIOD = 10, 0.2
# A message is on its way so long, at most [s].
_ON_ITS_WAY = 0.2


@dataclass(frozen=True)
class LiveFinding:
    """
    Something that is wrong with what passes.

    Attributes
    ----------
    check : str
        Which check found it, as in a review.
    severity : Severity
        How grave it is.
    text : str
        What it is.
    time : int
        When it was first seen, by the clock of the log [ns since the epoch].
    leg : str
        Of which leg or topic it is; '' for the only one.
    is_new : bool
        Whether it was not there in the window before.

    """

    check: str
    severity: Severity
    text: str
    time: int
    leg: str = ''
    is_new: bool = True


class _Topic(NamedTuple):
    """What is known of a topic that has a period: the last message [ns], and the period [s]."""

    last: int
    period: float


class LiveJudge:
    """
    Judges what passes; one thread gives it messages and asks it.

    Parameters
    ----------
    limits : Limits
        What is still all right.

    """

    def __init__(self, limits: Limits | None = None) -> None:
        """Begin with nothing heard."""
        self._limits = limits or Limits()
        self._window = Window(LENGTH, MOST, MOST_BYTES)
        self._topics: dict[str, _Topic] = {}
        self._before: set[tuple[str, str]] = set()
        self._changes: list[LiveFinding] = []

    def add(self, message: Message) -> None:
        """Take a message; that is all that is done for each."""
        self._window.add((message,))

    def add_all(self, messages: Iterable[Message]) -> None:
        """Take messages, in the order in which they were received."""
        self._window.add(messages)

    def tell(self, solver: SolverParameters) -> None:
        """Take what a solver has from now on; another leg than before is a finding."""
        before = self._window.solver(solver.node)
        self._window.tell(solver)
        if before is not None:
            self._changes += _changes(before, solver)

    def forget(self) -> None:
        """Begin anew, as after a pause, with what solvers told."""
        self._window.clear()
        self._topics.clear()

    def findings(
        self, now: int | None = None, published: Collection[str] | None = None
    ) -> list[LiveFinding]:
        """
        Return what is wrong now, the gravest first; to be asked every `STEP` seconds at least.

        Parameters
        ----------
        now : int, optional
            The time by the clock of the log [ns since the epoch]; that of this machine otherwise.
        published : collection of str, optional
            The topics that have a publisher: one that left in order is not waited for.

        """
        now = time_ns() if now is None else now
        self._window.move(now)
        found = [*self._changes]
        self._changes.clear()
        if len(self._window):
            found += self._reviewed()
        found += self._silent(now, published)
        keys = {(each.check, each.leg) for each in found}
        told = [replace(each, is_new=(each.check, each.leg) not in self._before) for each in found]
        self._before = keys
        return sorted(told, key=lambda each: -each.severity)

    def _reviewed(self) -> Iterator[LiveFinding]:
        """Yield what a review finds in the window."""
        recording = load(self._window)
        self._note(recording)
        if not any(len(leg.poses) for leg in recording.legs):
            # Whoever turns a crank may do so before there is a solver.
            return
        for finding in reviewed(recording, self._limits, checks=_CHECKS).findings:
            if finding.is_fault and finding.check not in _LEFT_OUT:
                time = recording.start + round((finding.time or 0.0) * 1e9)
                yield LiveFinding(finding.check, finding.severity, finding.text, time, finding.leg)

    def _note(self, recording: RunRecording) -> None:
        """Note when the topics that have a period were heard last."""
        for topic in recording.topics:
            if len(topic.times) >= _LEAST:
                period = median(intervals(topic.times))
                if period <= _LONGEST_PERIOD:
                    self._topics[topic.name] = _Topic(int(topic.times[-1]), period)
            elif len(topic.times) and topic.name in self._topics:
                known = self._topics[topic.name]
                self._topics[topic.name] = _Topic(int(topic.times[-1]), known.period)

    def _silent(self, now: int, published: Collection[str] | None) -> Iterator[LiveFinding]:
        """Yield the topics on which nothing comes any more."""
        for name, topic in list(self._topics.items()):
            if published is not None and name not in published:
                del self._topics[name]
                continue
            silent = (now - topic.last) / 1e9
            longest = max(self._limits.gap_periods * topic.period, self._limits.gap_time)
            if silent > longest + _ON_ITS_WAY:
                text = f'nothing on {printable(name)} for {silent:.1f} s'
                yield LiveFinding('gap', Severity.WARNING, text, topic.last, name)


def _changes(before: SolverParameters, after: SolverParameters) -> Iterator[LiveFinding]:
    """Yield what of its legs a solver has changed."""
    space = parent(after.node)
    old, new = (leg_solvers([told], space) for told in (before, after))
    for name in old.keys() & new.keys():
        one, other = dimensions(old[name]), dimensions(new[name])
        words = [
            f'{key} is {value}, was {one.get(key, "unknown")}'
            for key, value in other.items()
            if value != one.get(key)
        ]
        if words:
            text = f'{printable(after.node)} changed its leg: {", ".join(words)}'
            yield LiveFinding('geometry', Severity.WARNING, text, after.time, name)
