"""Live review of the recorded messages, in a thread."""

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from threading import Event, Thread
from time import thread_time, time_ns

from diagnostic_msgs.msg import DiagnosticStatus
from klann_ros.log import Message, Pause, RecordedFinding, SolverParameters
from klann_ros.log.errors import LogError
from klann_ros.nodes.endpoints import create_steady_timer, diagnostic_status
from klann_ros.nodes.parameters import StartError
from klann_ros.review import (
    Limits,
    limits_from_file,
    LiveFinding,
    LiveJudge,
    MAX_MESSAGES,
    Severity,
    STEP,
)
from klann_ros.sanitize.text import error_with_place, printable
from rclpy.node import Node

_LEVELS = {
    Severity.NOTE: DiagnosticStatus.OK,
    Severity.WARNING: DiagnosticStatus.WARN,
    Severity.ERROR: DiagnosticStatus.ERROR,
}
# Findings with all their values on /diagnostics.
_MAX_SHOWN_FINDINGS = 20
# Ratio of the thread's idle time to its CPU time, which untrusted messages may prolong.
_IDLE_RATIO = 4.0


@dataclass(frozen=True)
class RecorderQueries:
    """What a judge asks its recorder before each evaluation."""

    # The topics with publishers.
    published: Callable[[], Collection[str]]
    # Whether this process has just stalled.
    has_stalled: Callable[[], bool]
    # The messages of each topic lost before reception.
    missed: Callable[[], Mapping[str, int]]


# Of an evaluation: time [ns since the epoch], topics with publishers, lost messages by topic.
_Request = tuple[int, frozenset[str], Mapping[str, int]]


class Judging:
    """
    Judge messages in a thread, and report findings in the node's.

    The node's loop only appends messages: a window of untrusted ones may take seconds. The loop
    also starts each evaluation, so that messages it has not read yet are no gap.

    `limits_file` is '' for the limits of a review. `on_findings` receives new findings, by
    severity.
    """

    def __init__(
        self,
        node: Node,
        limits_file: str,
        queries: RecorderQueries,
        on_findings: Callable[[Sequence[RecordedFinding]], None],
    ) -> None:
        """Start the thread; a StartError for an invalid file of limits."""
        try:
            judge = LiveJudge(limits_from_file(limits_file) if limits_file else Limits())
        except (LogError, OSError) as error:
            raise StartError(f'judge_limits: {error}') from error
        self._node = node
        self._queries = queries
        self._on_findings = on_findings
        # The present findings, and the number of all so far.
        self._present: Sequence[LiveFinding] = ()
        self._count = 0
        self._paused = False
        # Findings of evaluations that are still to be reported.
        self._unreported: deque[list[LiveFinding]] = deque()
        self._on_evaluated = node.create_guard_condition(self._report)
        self._timer = create_steady_timer(node, STEP, self._request)
        self._thread = _JudgeThread(judge, queries.has_stalled, self._put)
        # Takes each message.
        self.add = self._thread.inbox.append
        # Takes new parameters of a solver, or a time in which a gap is no fault.
        self.add_context = self._thread.context.append

    def status(self) -> DiagnosticStatus:
        """Return the most severe finding and all others, or the error of judging."""
        level = DiagnosticStatus.OK
        message = 'nothing found'
        if self._present:
            level = _LEVELS[self._present[0].severity]
            message = self._present[0].text
        elif self._thread.failure:
            level = DiagnosticStatus.WARN
            message = f'judging failed: {self._thread.failure}'
        return diagnostic_status(self._node, 'judge', level, message, self._values())

    def _values(self) -> Iterator[tuple[str, object]]:
        yield 'findings', len(self._present)
        yield 'findings so far', self._count
        for number, finding in enumerate(self._present[:_MAX_SHOWN_FINDINGS], 1):
            time = datetime.fromtimestamp(finding.time / 1e9, timezone.utc)
            yield f'{number} check', finding.check
            yield f'{number} of', printable(finding.leg)
            yield f'{number} text', finding.text
            yield f'{number} time', time.isoformat(timespec='milliseconds')

    def pause(self) -> None:
        """Stop judging."""
        self._paused = True

    def resume(self) -> None:
        """Judge messages from now on."""
        self._thread.inbox.clear()
        self._thread.must_reset = True
        self._paused = False

    def stop(self) -> None:
        """Stop the thread, and report its last findings."""
        self._timer.cancel()
        self._thread.stop()
        self._report()

    def _request(self) -> None:
        # After a stall of this process its messages are still to be read.
        if not (self._paused or self._thread.requested.is_set() or self._queries.has_stalled()):
            time = time_ns()
            published = frozenset(self._queries.published())
            self._thread.evaluate((time, published, self._queries.missed()))

    def _put(self, findings: list[LiveFinding]) -> None:
        self._unreported.append(findings)
        self._on_evaluated.trigger()

    def _report(self) -> None:
        while self._unreported:
            self._present = self._unreported.popleft()
            new_findings = [finding for finding in self._present if finding.is_new]
            self._count += len(new_findings)
            for finding in new_findings:
                text = f'{finding.check}: {finding.text}'
                self._node.get_logger().warning(text, throttle_duration_sec=1.0)
            if new_findings:
                self._on_findings([_recorded_finding(finding) for finding in new_findings])


class _JudgeThread:
    """The thread of a judge; `on_findings` receives the findings of each evaluation in it."""

    def __init__(
        self,
        judge: LiveJudge,
        has_stalled: Callable[[], bool],
        on_findings: Callable[[list[LiveFinding]], None],
    ) -> None:
        # Messages, and solvers and pauses, that the judge has not seen yet.
        self.inbox = deque[Message](maxlen=MAX_MESSAGES)
        self.context: deque[SolverParameters | Pause] = deque()
        # Whether to forget the window before the next evaluation.
        self.must_reset = False
        # The error of the last evaluation; '' without one.
        self.failure = ''
        self._judge = judge
        self._has_stalled = has_stalled
        self._on_findings = on_findings
        self._request: _Request = (0, frozenset(), {})
        # Set until an evaluation and its idle time are over.
        self.requested = Event()
        self._stopped = Event()
        self._thread = Thread(target=self._run, name='judge', daemon=True)
        self._thread.start()

    def evaluate(self, request: _Request) -> None:
        """Start an evaluation."""
        self._request = request
        self.requested.set()

    def stop(self) -> None:
        """Evaluate once more, and end the thread."""
        self._stopped.set()
        self.requested.set()
        self._thread.join()

    def _run(self) -> None:
        """Evaluate each request, in the thread of the review, for a fixed share of a CPU."""
        had_findings = False
        while not self._stopped.is_set():
            self.requested.wait()
            begin = thread_time()
            findings: list[LiveFinding] = []
            try:
                findings = self._evaluate()
                self.failure = ''
            # The recording continues, whatever untrusted messages cause.
            except Exception as error:
                self.failure = error_with_place(error)
            # Waking the loop costs a fifth of an evaluation.
            if findings or had_findings:
                self._on_findings(findings)
            had_findings = bool(findings)
            idle_time = _IDLE_RATIO * (thread_time() - begin) - STEP
            if idle_time > 0.0:
                self._stopped.wait(idle_time)
            self.requested.clear()

    def _evaluate(self) -> list[LiveFinding]:
        """Return the findings of the messages and the context that came since the last request."""
        if self.must_reset:
            self.must_reset = False
            self._judge.reset()
        messages = [self.inbox.popleft() for _ in range(len(self.inbox))]
        # A stall since the request explains the gap before these messages.
        while self._has_stalled() and not self._stopped.wait(STEP):
            pass
        while self.context:
            change = self.context.popleft()
            if isinstance(change, Pause):
                self._judge.excuse(change)
            else:
                self._judge.set_solver(change)
        self._judge.add_all(messages)
        return self._judge.findings(*self._request)


def _recorded_finding(finding: LiveFinding) -> RecordedFinding:
    severity = finding.severity.name.lower()
    return RecordedFinding(finding.check, severity, finding.text, finding.time, finding.leg)
