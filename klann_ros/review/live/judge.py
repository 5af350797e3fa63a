"""Findings about what passes: a review of the last seconds, again and again."""

from collections import defaultdict, deque
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from time import time_ns
from typing import NamedTuple

from klann_ros.log.records import Message
from klann_ros.log.run_parameters import Pause, SolverParameters
from klann_ros.review.checks import CHECKS
from klann_ros.review.checks.clocks import check_clocks
from klann_ros.review.checks.completeness import answer_topics, check_losses
from klann_ros.review.load.load import load
from klann_ros.review.load.solvers import leg_solvers, parent
from klann_ros.review.model.answers import MAX_RESPONSE_TIME
from klann_ros.review.model.compare import leg_dimensions
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.recording import RunRecording
from klann_ros.review.model.review import Severity
from klann_ros.review.model.times import median, time_steps
from klann_ros.review.model.topics import TopicRecording
from klann_ros.review.reviewing import review_recording
from klann_ros.sanitize.text import counted, printable, verb

from .window import Window

# How far back a window reaches, and how often there is to be a new one [s]: a silence too short to
# be waiting for falls into one, and what is wrong is found within a second.
LENGTH, STEP = 1.0, 0.7
# A window of more messages is shorter [messages], and one of larger ones [bytes].
MOST, MOST_BYTES = 40_000, 64_000_000
# What a window is too short to tell, or what is told otherwise here.
_LEFT_OUT = frozenset({'container', 'geometry', 'drift', 'stale', 'frozen'})
_CHECKS = tuple(check for check in CHECKS if check not in (check_clocks, check_losses))
# Fewer messages tell no period; a topic whose period is longer is not waited for [s].
_LEAST, _LONGEST_PERIOD = 10, 0.2
# Gaps in the numbers count if so many messages before and after are in order.
_ORDERED = 5
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


class _SequenceNumbers:
    """Counts lost messages of a topic, as long as its numbers are those of one publisher."""

    def __init__(self) -> None:
        self.lost = 0
        self._last = self._reached = self._ordered = 0
        self._is_shared = False
        # Up to which message each gap is uncertain, and how many messages are missing in it.
        self._gaps: deque[tuple[int, int]] = deque()

    def add(self, number: int) -> None:
        before, self._last = self._last, number
        resumes = number == self._reached + 1 and number > before + 1
        # A new publisher starts at 1, about; the numbers of two at once go back and forth.
        self._is_shared |= not number or resumes or before // 2 < number <= before
        if self._is_shared:
            return
        self._ordered += 1
        if number <= before:
            self._reached, self._ordered = before, 0
            self._gaps.clear()
        elif before and number > before + 1 and self._ordered > _ORDERED:
            self._gaps.append((self._ordered + _ORDERED, number - before - 1))
        while self._gaps and self._gaps[0][0] <= self._ordered:
            self.lost += self._gaps.popleft()[1]


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
        # By topic: when it was first heard [ns], and its losses so far.
        self._starts: dict[str, int] = {}
        self._numbers: defaultdict[str, _SequenceNumbers] = defaultdict(_SequenceNumbers)
        self._lost: dict[str, int] = {}
        # By topic of answers, the topics of their questions.
        self._questions: dict[str, frozenset[str]] = {}
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

    def excuse(self, pause: Pause) -> None:
        """Take a time in which the recorder paused or stalled: silence is no fault then."""
        self._window.excuse(pause.begin, pause.end + MAX_RESPONSE_TIME)

    def findings(
        self,
        now: int | None = None,
        published: Collection[str] | None = None,
        lost: Mapping[str, int] | None = None,
    ) -> list[LiveFinding]:
        """
        Return what is wrong now, the gravest first; to be asked every `STEP` seconds at least.

        Parameters
        ----------
        now : int, optional
            The time by the clock of the log [ns since the epoch]; that of this machine otherwise.
        published : collection of str, optional
            The topics that have a publisher: one that left in order is not waited for.
        lost : mapping of str to int, optional
            How many messages of each topic were lost so far; counted here otherwise.

        """
        now = time_ns() if now is None else now
        found = [*self._changes, *self._losses(now, lost)]
        self._window.move(now)
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
        topics = tuple(self._whole(topic) for topic in recording.topics)
        recording = replace(recording, topics=topics)
        self._note(recording)
        if not any(len(leg.poses) for leg in recording.legs):
            # Whoever turns a crank may do so before there is a solver.
            return
        for finding in review_recording(recording, self._limits, checks=_CHECKS).findings:
            if finding.is_fault and finding.check not in _LEFT_OUT:
                time = recording.start + round((finding.time or 0.0) * 1e9)
                yield LiveFinding(finding.check, finding.severity, finding.text, time, finding.leg)

    def _whole(self, topic: TopicRecording) -> TopicRecording:
        """Return a topic in the window with what is known of it from before."""
        first = self._starts.setdefault(topic.name, int(topic.times[0]))
        return replace(topic, type=self._window.types[topic.name], first=first)

    def _note(self, recording: RunRecording) -> None:
        """Note who asks whom, and when the topics that have a period were heard last."""
        for leg in recording.legs:
            for name in answer_topics(leg) if leg.crank_topics else ():
                self._questions[name] = self._questions.get(name, leg.crank_topics)
                self._questions[name] |= leg.crank_topics
        for topic in recording.topics:
            if not topic.is_periodic:
                continue
            if len(topic.times) >= _LEAST:
                period = median(time_steps(topic.times))
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
                self._starts.pop(name, None)
                continue
            explained = max((end for _, end in self._window.holes), default=0)
            silent = (now - max(topic.last, explained)) / 1e9
            longest = max(self._limits.gap_periods * topic.period, self._limits.gap_time)
            if (topic.last - self._starts.get(name, 0)) / 1e9 < self._limits.start_time:
                longest = max(longest, LENGTH)
            if silent > longest + _ON_ITS_WAY and self._is_expected(name, longest):
                text = f'nothing on {printable(name)} for {silent:.1f} s'
                yield LiveFinding('gap', Severity.WARNING, text, topic.last, name)

    def _is_expected(self, name: str, longest: float) -> bool:
        """Return whether a topic should go on: answers only if there are questions since."""
        if name not in self._questions:
            return True
        asked = [self._topics[each].last for each in self._questions[name] if each in self._topics]
        return max(asked, default=0) > self._topics[name].last + longest * 1e9

    def _losses(self, now: int, lost: Mapping[str, int] | None) -> Iterator[LiveFinding]:
        """Yield the topics of which messages were lost since they were last asked for."""
        if lost is None:
            for message in self._window.new:
                self._numbers[message.topic.name].add(message.sequence)
            lost = {name: numbers.lost for name, numbers in self._numbers.items()}
        for name, count in lost.items():
            more = count - self._lost.get(name, 0)
            if more > 0:
                messages = f'{counted(more, "message")} of {printable(name)}'
                text = f'{messages} {verb(more, "was", "were")} lost'
                yield LiveFinding('lost', Severity.WARNING, text, now, name)
        self._lost = dict(lost)


def _changes(before: SolverParameters, after: SolverParameters) -> Iterator[LiveFinding]:
    """Yield what of its legs a solver has changed."""
    space = parent(after.node)
    old, new = (leg_solvers([told], space) for told in (before, after))
    for name in old.keys() & new.keys():
        one, other = leg_dimensions(old[name]), leg_dimensions(new[name])
        words = [
            f'{key} is {value}, was {one.get(key, "unknown")}'
            for key, value in other.items()
            if value != one.get(key)
        ]
        if words:
            text = f'{printable(after.node)} changed its leg: {", ".join(words)}'
            yield LiveFinding('geometry', Severity.WARNING, text, after.time, name)
