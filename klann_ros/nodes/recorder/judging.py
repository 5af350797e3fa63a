"""What is recorded is held against the limits of a review meanwhile, in a thread of its own."""

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from datetime import datetime, timezone
from threading import Event, Thread
from time import thread_time, time_ns

from diagnostic_msgs.msg import DiagnosticStatus
from klann_ros.log.errors import LogError
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import Pause, SolverParameters, ToldFinding
from klann_ros.nodes.parameters import StartError
from klann_ros.nodes.process import error_and_place
from klann_ros.review.live.judge import LiveFinding, LiveJudge, MAX_MESSAGES, STEP
from klann_ros.review.model.limits import Limits, limits_from_file
from klann_ros.review.model.review import Severity
from klann_ros.sanitize.text import printable
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from .interface import status_of

_LEVELS = {
    Severity.NOTE: DiagnosticStatus.OK,
    Severity.WARNING: DiagnosticStatus.WARN,
    Severity.ERROR: DiagnosticStatus.ERROR,
}
# So many findings are told in full.
_MOST_SHOWN = 20
# The thread rests so many times as long as it has worked: strangers may send what takes long.
_REST = 4.0


class Judging:
    """
    Judge messages in a thread of its own, and tell what is found in the node's.

    The node's loop only appends what it takes: a window of what strangers send may take seconds,
    and the loop has queues to empty. It also says when to judge: what it has not taken yet is no
    silence.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose loop it is.
    limits : str
        A file of what is still all right; '' for the limits of a review.
    published : callable
        Returns the topics that have publishers.
    has_stalled : callable
        Returns whether this process has just not run.
    lost : callable
        Returns how many messages of each topic were lost so far, as the recorder counts them.
    on_new : callable
        Is given what was found and was not there a moment ago, the gravest first.

    Attributes
    ----------
    add : callable
        Takes a message; to be called for each.
    problem : str
        Why nothing could be judged last; '' if it could.

    Raises
    ------
    StartError
        The file holds no limits.

    """

    def __init__(
        self,
        node: Node,
        limits: str,
        *,
        published: Callable[[], Collection[str]],
        has_stalled: Callable[[], bool],
        lost: Callable[[], Mapping[str, int]],
        on_new: Callable[[Sequence[ToldFinding]], None],
    ) -> None:
        """Begin at once."""
        inbox = deque[Message](maxlen=MAX_MESSAGES)
        self.add = inbox.append
        self._inbox, self._judge = inbox, LiveJudge(_limits_of(limits))
        self._status, self.problem = JudgeStatus(node), ''
        self._teller = node.get_logger()
        self._told: deque[SolverParameters | Pause] = deque()
        self._published, self._lost, self._on_new = published, lost, on_new
        self._has_stalled = has_stalled
        self._paused = self._forgets = False
        self._asked, self._stopped = Event(), Event()
        self._now, self._names = 0, frozenset[str]()
        self._counts: Mapping[str, int] = {}
        self._found: deque[list[LiveFinding]] = deque()
        self._news = node.create_guard_condition(self._hand_over)
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(STEP, self._ask, clock=clock)
        self._thread = Thread(target=self._run, name='judge', daemon=True)
        self._thread.start()

    def tell(self, solver: SolverParameters) -> None:
        """Take what a solver has from now on."""
        self._told.append(solver)

    def excuse(self, pause: Pause) -> None:
        """Take a time in which silence is no fault."""
        self._told.append(pause)

    def status(self) -> DiagnosticStatus:
        """Return what is wrong now, for /diagnostics."""
        return self._status.status(self.problem)

    def pause(self) -> None:
        """Judge nothing until further notice."""
        self._paused = True

    def resume(self) -> None:
        """Judge what comes from now on."""
        self._inbox.clear()
        self._forgets, self._paused = True, False

    def stop(self) -> None:
        """Judge nothing any more; what was found is told before."""
        self._timer.cancel()
        self._stopped.set()
        self._asked.set()
        self._thread.join()
        self._hand_over()

    def _ask(self) -> None:
        """Have what has come judged, unless the thread still works."""
        # After a stall of this process, what was published meanwhile is still to be taken.
        if not (self._paused or self._asked.is_set() or self._has_stalled()):
            self._now, self._names = time_ns(), frozenset(self._published())
            self._counts = self._lost()
            self._asked.set()

    def _hand_over(self) -> None:
        while self._found:
            new = self._status.take(self._found.popleft())
            for finding in new:
                self._teller.warning(f'{finding.check}: {finding.text}', throttle_duration_sec=1.0)
            if new:
                self._on_new([_told(finding) for finding in new])

    def _run(self) -> None:
        before: list[LiveFinding] = []
        while not self._stopped.is_set():
            self._asked.wait()
            begin = thread_time()
            try:
                found = self._findings()
                self.problem = ''
            # Whatever strangers send, the recording goes on.
            except Exception as error:
                found, self.problem = [], error_and_place(error)
            # To wake the loop costs as much as a fifth of a window.
            if found or before:
                self._found.append(found)
                self._news.trigger()
            before = found
            rest = _REST * (thread_time() - begin) - STEP
            if rest > 0.0:
                self._stopped.wait(rest)
            self._asked.clear()

    def _findings(self) -> list[LiveFinding]:
        if self._forgets:
            self._forgets = False
            self._judge.reset()
        while self._told:
            news = self._told.popleft()
            if isinstance(news, Pause):
                self._judge.excuse(news)
            else:
                self._judge.set_solver(news)
        inbox = self._inbox
        self._judge.add_all([inbox.popleft() for _ in range(len(inbox))])
        return self._judge.findings(self._now, self._names, self._counts)


class JudgeStatus:
    """
    What the judge says on /diagnostics.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose status it is.

    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._findings: Sequence[LiveFinding] = ()
        self._count = 0

    def take(self, findings: Sequence[LiveFinding]) -> list[LiveFinding]:
        """Take what is wrong now; return what was not a moment ago."""
        self._findings = findings
        new = [finding for finding in findings if finding.is_new]
        self._count += len(new)
        return new

    def status(self, problem: str) -> DiagnosticStatus:
        """Return the gravest finding, and all there are, or why nothing can be judged."""
        level, message = DiagnosticStatus.OK, 'nothing found'
        if problem:
            level, message = DiagnosticStatus.WARN, f'nothing can be judged: {problem}'
        if self._findings:
            level, message = _LEVELS[self._findings[0].severity], self._findings[0].text
        return status_of(self._node, 'judge', level, message, self._values())

    def _values(self) -> Iterator[tuple[str, object]]:
        yield 'findings', len(self._findings)
        yield 'findings so far', self._count
        for number, finding in enumerate(self._findings[:_MOST_SHOWN], 1):
            time = datetime.fromtimestamp(finding.time / 1e9, timezone.utc)
            yield f'{number} check', finding.check
            yield f'{number} of', printable(finding.leg)
            yield f'{number} text', finding.text
            yield f'{number} time', time.isoformat(timespec='milliseconds')


def _limits_of(path: str) -> Limits:
    """Return the limits of a file, or those of a review; a StartError says what is wrong."""
    try:
        return limits_from_file(path) if path else Limits()
    except (LogError, OSError) as error:
        raise StartError(f'judge_limits: {error}') from error


def _told(finding: LiveFinding) -> ToldFinding:
    """Return a finding as a run holds it."""
    severity = finding.severity.name.lower()
    return ToldFinding(finding.check, severity, finding.text, finding.time, finding.leg)
