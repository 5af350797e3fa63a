"""Findings in the passing messages: repeated reviews of the last seconds."""

from collections import Counter, defaultdict, deque
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from klann_ros.log import Message, Pause, SolverParameters
from klann_ros.review.checks import CHECKS
from klann_ros.review.checks.clocks import check_clocks
from klann_ros.review.checks.completeness import answer_topics, check_losses
from klann_ros.review.load.geometry import leg_solvers, parent
from klann_ros.review.load.load import load
from klann_ros.review.load.window import LENGTH, Window
from klann_ros.review.model.answers import MAX_RESPONSE_TIME
from klann_ros.review.model.compare import leg_dimensions
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.recording import RunRecording
from klann_ros.review.model.review import Severity
from klann_ros.review.model.times import median, merge_intervals, time_steps
from klann_ros.review.model.topics import TopicRecording
from klann_ros.review.reviewing import review_recording
from klann_ros.sanitize.text import counted, printable, verb

# Period of reviews [s]: a fault is found within a second.
STEP = 0.7
# Checks that need a whole run, or are replaced here.
_EXCLUDED_CHECKS = frozenset({'container', 'geometry', 'drift', 'stale', 'frozen'})
_CHECKS = tuple(check for check in CHECKS if check not in (check_clocks, check_losses))
# Messages that a period needs, and longest period of a supervised topic [s].
_MIN_MESSAGES = 10
_MAX_PERIOD = 0.2
# Ordered messages before and after missing numbers that make a loss.
_MIN_ORDERED = 5
# Longest transport time of a message [s].
_MAX_TRANSPORT_TIME = 0.2


@dataclass(frozen=True)
class LiveFinding:
    """A finding in the passing messages; check, severity and text are those of a review."""

    check: str
    severity: Severity
    text: str
    time: int  # first occurrence, log time [ns since the epoch]
    leg: str = ''  # its leg or topic; '' for the only one
    is_new: bool = True  # whether the previous window did not have it


class _Topic(NamedTuple):
    """A periodic topic: last message [ns], and period [s]."""

    last: int
    period: float


class _LossCounter:
    """Counts lost messages of a topic, as long as its numbers are those of one publisher."""

    def __init__(self) -> None:
        self.lost = 0
        self._last = self._reached = self._ordered = 0
        self._is_shared = False
        # Up to which message each gap is uncertain, and how many messages are missing in it.
        self._gaps: deque[tuple[int, int]] = deque()

    def add(self, number: int) -> None:
        last = self._last
        self._last = number
        resumes = number == self._reached + 1 and number > last + 1
        # A new publisher starts at 1, about; the numbers of two at once go back and forth.
        self._is_shared |= not number or resumes or last // 2 < number <= last
        if self._is_shared:
            return
        self._ordered += 1
        if number <= last:
            self._reached = last
            self._ordered = 0
            self._gaps.clear()
        elif last and number > last + 1 and self._ordered > _MIN_ORDERED:
            self._gaps.append((self._ordered + _MIN_ORDERED, number - last - 1))
        while self._gaps and self._gaps[0][0] <= self._ordered:
            self.lost += self._gaps.popleft()[1]


class LiveJudge:
    """Judges passing messages by the limits of a review; used by one thread."""

    def __init__(self, limits: Limits | None = None) -> None:
        self._limits = limits or Limits()
        self._window = Window()
        # By topic: first message [ns], losses, skipped messages, and of answers their inputs.
        self._topics: dict[str, _Topic] = {}
        self._starts: dict[str, int] = {}
        self._numbers: defaultdict[str, _LossCounter] = defaultdict(_LossCounter)
        self._lost: dict[str, int] = {}
        self._skipped: Counter[str] = Counter()
        self._inputs: dict[str, frozenset[str]] = {}
        # Topics whose last command was to stand, and those with a lease: no command is due.
        self._standing: set[str] = set()
        self._leased: frozenset[str] = frozenset()
        self._last_keys: set[tuple[str, str]] = set()
        self._changes: list[LiveFinding] = []

    def add_all(self, messages: Iterable[Message]) -> None:
        """Add messages in the order of reception."""
        self._window.new.extend(messages)

    def set_solver(self, solver: SolverParameters) -> None:
        """Set the parameters of a solver; a changed leg is a finding."""
        old_solver = self._window.solver(solver.node)
        self._window.set_solver(solver)
        if old_solver is not None:
            self._changes += _changes(old_solver, solver)

    def reset(self) -> None:
        """Reset, as after a pause; solver parameters stay."""
        self._window.clear()
        self._topics.clear()

    def excuse(self, pause: Pause) -> None:
        """Excuse gaps and skipped messages while the recorder paused or stalled."""
        interval = pause.begin, pause.end + MAX_RESPONSE_TIME
        self._window.gaps = merge_intervals([*self._window.gaps, interval])
        self._skipped.update(pause.skipped)

    def findings(
        self,
        now: int,
        published: Collection[str] | None = None,
        lost: Mapping[str, int] | None = None,
    ) -> list[LiveFinding]:
        """
        Return the present findings by falling severity; call it every `STEP` seconds at least.

        Parameters
        ----------
        now : int
            Time of the log [ns since the epoch].
        published : collection of str, optional
            The topics with a publisher: one that left in order is not waited for.
        lost : mapping of str to int, optional
            Lost messages of each topic so far; by default counted here.

        """
        unmarked = [*self._changes, *self._losses(now, lost)]
        self._window.move(now)
        self._changes.clear()
        if len(self._window):
            unmarked += self._reviewed()
        unmarked += self._silent(now, published)
        findings = []
        for finding in unmarked:
            is_new = (finding.check, finding.leg) not in self._last_keys
            findings.append(replace(finding, is_new=is_new))
        self._last_keys = {(finding.check, finding.leg) for finding in findings}
        return sorted(findings, key=lambda finding: -finding.severity)

    def _reviewed(self) -> Iterator[LiveFinding]:
        """Yield the findings of a review of the window."""
        recording = load(self._window)
        topics = tuple(self._whole(topic) for topic in recording.topics)
        recording = replace(recording, topics=topics)
        self._note(recording)
        if not any(len(leg.poses) for leg in recording.legs):
            # A crank may turn before a solver starts.
            return
        for finding in review_recording(recording, self._limits, checks=_CHECKS).findings:
            if finding.is_fault and finding.check not in _EXCLUDED_CHECKS:
                time = recording.start + round((finding.time or 0.0) * 1e9)
                yield LiveFinding(finding.check, finding.severity, finding.text, time, finding.leg)

    def _whole(self, topic: TopicRecording) -> TopicRecording:
        """Return a topic of the window with its type and its first message."""
        first = self._starts.setdefault(topic.name, int(topic.times[0]))
        return replace(topic, type=self._window.types[topic.name], first=first)

    def _note(self, recording: RunRecording) -> None:
        """Note the inputs of answers, and the last messages of periodic topics."""
        for leg in recording.legs:
            for name in answer_topics(leg) if leg.crank_topics else ():
                self._inputs[name] = self._inputs.get(name, frozenset()) | leg.crank_topics
        self._leased = frozenset(recording.leases)
        for walk in recording.walks:
            for name, speeds in walk.speeds.items():
                is_standing = not speeds.values[-1:].any()
                (self._standing.add if is_standing else self._standing.discard)(name)
        for topic in recording.topics:
            if not topic.is_periodic:
                continue
            if len(topic.times) >= _MIN_MESSAGES:
                period = median(time_steps(topic.times))
                if period <= _MAX_PERIOD:
                    self._topics[topic.name] = _Topic(int(topic.times[-1]), period)
            elif len(topic.times) and topic.name in self._topics:
                period = self._topics[topic.name].period
                self._topics[topic.name] = _Topic(int(topic.times[-1]), period)

    def _silent(self, now: int, published: Collection[str] | None) -> Iterator[LiveFinding]:
        """Yield the topics with a present gap."""
        for name, topic in list(self._topics.items()):
            if published is not None and name not in published:
                del self._topics[name]
                self._starts.pop(name, None)
                continue
            gap_end = max((end for _, end in self._window.gaps), default=0)
            silence = (now - max(topic.last, gap_end)) / 1e9
            max_interval = self._limits.max_interval(topic.period)
            if (topic.last - self._starts.get(name, 0)) / 1e9 < self._limits.start_time:
                max_interval = max(max_interval, LENGTH)
            is_silent = silence > max_interval + _MAX_TRANSPORT_TIME
            if is_silent and self._is_expected(name, max_interval):
                text = f'nothing on {printable(name)} for {silence:.1f} s'
                yield LiveFinding('gap', Severity.WARNING, text, topic.last, name)

    def _is_expected(self, name: str, max_interval: float) -> bool:
        """Return whether messages are due: answers only after inputs, commands of a driver."""
        if name in self._standing | self._leased:
            return False
        if name not in self._inputs:
            return True
        inputs = self._inputs[name] & self._topics.keys()
        last_input = max((self._topics[topic].last for topic in inputs), default=0)
        return last_input > self._topics[name].last + max_interval * 1e9

    def _losses(self, now: int, lost: Mapping[str, int] | None) -> Iterator[LiveFinding]:
        """Yield the topics with losses since the last call."""
        if lost is None:
            for message in self._window.new:
                self._numbers[message.topic.name].add(message.sequence)
            lost = {}
            for name, numbers in self._numbers.items():
                lost[name] = max(numbers.lost - self._skipped[name], self._lost.get(name, 0))
        for name, count in lost.items():
            new_count = count - self._lost.get(name, 0)
            if new_count > 0:
                messages = f'{counted(new_count, "message")} of {printable(name)}'
                text = f'{messages} {verb(new_count, "was", "were")} lost'
                yield LiveFinding('lost', Severity.WARNING, text, now, name)
        self._lost = dict(lost)


def _changes(old_solver: SolverParameters, solver: SolverParameters) -> Iterator[LiveFinding]:
    """Yield the changed dimensions of the legs of a solver."""
    namespace = parent(solver.node)
    old_solvers = leg_solvers([old_solver], namespace)
    new_solvers = leg_solvers([solver], namespace)
    for name in old_solvers.keys() & new_solvers.keys():
        old_dimensions = leg_dimensions(old_solvers[name])
        changes = []
        for dimension, quantity in leg_dimensions(new_solvers[name]).items():
            old_quantity = old_dimensions.get(dimension, 'unknown')
            if quantity != old_quantity:
                changes.append(f'{dimension} is {quantity}, was {old_quantity}')
        if changes:
            text = f'{printable(solver.node)} changed its leg: {", ".join(changes)}'
            yield LiveFinding('geometry', Severity.WARNING, text, solver.time, name)
