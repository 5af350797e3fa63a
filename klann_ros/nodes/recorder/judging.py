"""Live review of the recorded messages, in a thread."""

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from datetime import datetime, timezone
from threading import Event, Thread
from time import thread_time, time_ns

from diagnostic_msgs.msg import DiagnosticStatus
from klann_ros.log import Message, Pause, RecordedFinding, SolverParameters
from klann_ros.log.errors import LogError
from klann_ros.nodes.endpoints import create_steady_timer, diagnostic_status
from klann_ros.nodes.parameters import StartError
from klann_ros.nodes.process import error_and_place
from klann_ros.review import (
    Limits,
    limits_from_file,
    LiveFinding,
    LiveJudge,
    MAX_MESSAGES,
    Severity,
    STEP,
)
from klann_ros.sanitize.text import printable
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


class Judging:
    """
    Judge messages in a thread, and report findings in the node's.

    The node's loop only appends messages: a window of untrusted ones may take seconds. The loop
    also starts each evaluation, so that messages it has not read yet are no gap.

    `limits` is a file, '' for those of a review. `published` returns the topics with publishers,
    `has_stalled` whether this process has just stalled, `missed` the messages of each topic lost
    before reception. `on_findings` receives new findings, by severity.
    """

    def __init__(
        self,
        node: Node,
        limits: str,
        *,
        published: Callable[[], Collection[str]],
        has_stalled: Callable[[], bool],
        missed: Callable[[], Mapping[str, int]],
        on_findings: Callable[[Sequence[RecordedFinding]], None],
    ) -> None:
        """Start the thread; a StartError for an invalid file of limits."""
        try:
            self._judge = LiveJudge(limits_from_file(limits) if limits else Limits())
        except (LogError, OSError) as error:
            raise StartError(f'judge_limits: {error}') from error
        self._inbox = deque[Message](maxlen=MAX_MESSAGES)
        # Takes each message.
        self.add = self._inbox.append
        # The error of the last evaluation.
        self._problem = ''
        self._node, self._logger = node, node.get_logger()
        # The present findings, and the number of all so far.
        self._present: Sequence[LiveFinding] = ()
        self._count = 0
        self._context: deque[SolverParameters | Pause] = deque()
        self._published, self._missed, self._on_findings = published, missed, on_findings
        self._has_stalled = has_stalled
        self._paused = self._resumed = False
        self._requested, self._stopped = Event(), Event()
        self._now, self._names = 0, frozenset[str]()
        self._counts: Mapping[str, int] = {}
        self._results: deque[list[LiveFinding]] = deque()
        self._on_result = node.create_guard_condition(self._report)
        self._timer = create_steady_timer(node, STEP, self._request)
        self._thread = Thread(target=self._run, name='judge', daemon=True)
        self._thread.start()

    def add_solver(self, solver: SolverParameters) -> None:
        """Take new parameters of a solver."""
        self._context.append(solver)

    def excuse(self, pause: Pause) -> None:
        """Take a time in which a gap is no fault."""
        self._context.append(pause)

    def status(self) -> DiagnosticStatus:
        """Return the most severe finding and all others, or the error of judging."""
        level, message = DiagnosticStatus.OK, 'nothing found'
        if self._problem:
            level, message = DiagnosticStatus.WARN, f'judging failed: {self._problem}'
        if self._present:
            level, message = _LEVELS[self._present[0].severity], self._present[0].text
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
        self._inbox.clear()
        self._resumed, self._paused = True, False

    def stop(self) -> None:
        """Stop the thread, and report its last findings."""
        self._timer.cancel()
        self._stopped.set()
        self._requested.set()
        self._thread.join()
        self._report()

    def _request(self) -> None:
        # After a stall of this process its messages are still to be read.
        if not (self._paused or self._requested.is_set() or self._has_stalled()):
            self._now, self._names = time_ns(), frozenset(self._published())
            self._counts = self._missed()
            self._requested.set()

    def _report(self) -> None:
        while self._results:
            self._present = self._results.popleft()
            new = [finding for finding in self._present if finding.is_new]
            self._count += len(new)
            for finding in new:
                self._logger.warning(f'{finding.check}: {finding.text}', throttle_duration_sec=1.0)
            if new:
                self._on_findings([_recorded(finding) for finding in new])

    def _run(self) -> None:
        before: list[LiveFinding] = []
        while not self._stopped.is_set():
            self._requested.wait()
            begin = thread_time()
            try:
                findings = self._findings()
                self._problem = ''
            # The recording continues, whatever untrusted messages cause.
            except Exception as error:
                findings, self._problem = [], error_and_place(error)
            # Waking the loop costs a fifth of an evaluation.
            if findings or before:
                self._results.append(findings)
                self._on_result.trigger()
            before = findings
            idle = _IDLE_RATIO * (thread_time() - begin) - STEP
            if idle > 0.0:
                self._stopped.wait(idle)
            self._requested.clear()

    def _findings(self) -> list[LiveFinding]:
        if self._resumed:
            self._resumed = False
            self._judge.reset()
        inbox = self._inbox
        messages = [inbox.popleft() for _ in range(len(inbox))]
        # A stall since the request explains the gap before these messages.
        while self._has_stalled() and not self._stopped.wait(STEP):
            pass
        while self._context:
            item = self._context.popleft()
            if isinstance(item, Pause):
                self._judge.excuse(item)
            else:
                self._judge.set_solver(item)
        self._judge.add_all(messages)
        return self._judge.findings(self._now, self._names, self._counts)


def _recorded(finding: LiveFinding) -> RecordedFinding:
    severity = finding.severity.name.lower()
    return RecordedFinding(finding.check, severity, finding.text, finding.time, finding.leg)
