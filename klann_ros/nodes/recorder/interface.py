"""What a recorder offers: its parameters, its services, and its diagnostics."""

from collections import deque
from collections.abc import Callable, Iterable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from klann_ros.log.write.mcap_file import COMPRESSIONS
from klann_ros.log.write.recording import RecordingState
from klann_ros.nodes.endpoints import create_publisher, flush
from klann_ros.nodes.parameters import Declaration
from klann_ros.sanitize.text import counted, verb
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.serialization import serialize_message

TOPICS = (
    'crank_angle',
    'crank_state',
    'joint_states',
    'point_h',
    'velocity_h',
    '*/point_h',
    '*/velocity_h',
    'markers',
    'robot_description',
    'cmd_vel',
    'crank_command',
    'odom',
    'imu',
    'ground_truth',
    '/clock',
    '/diagnostics',
)
PARAMETERS = (
    Declaration(
        'output',
        '',
        'folder of the run; empty: runs/<UTC time>. With pre_trigger the folder of all runs; '
        'empty: runs',
        constraint='not there yet, unless there is pre_trigger',
    ),
    Declaration('topics', list(TOPICS), 'names of the topics; * stands for anything'),
    Declaration('all_topics', False, 'record every topic that is not hidden'),
    Declaration('compression', 'zstd', 'of the chunks', choices=tuple(COMPRESSIONS)),
    Declaration('flush_period', 0.5, 'a crash costs at most this much [s]', limits=(0.01, 60.0)),
    Declaration(
        'max_file_size',
        0,
        'a larger file is finished, and the next one begun [bytes]; 0: no limit',
        limits=(0, 2**62),
    ),
    Declaration(
        'max_file_duration',
        0.0,
        'a longer file is finished, and the next one begun [s]; 0: no limit',
        limits=(0.0, 1e9),
        any_number=True,
    ),
    Declaration(
        'min_free_space',
        500_000_000,
        'the recording ends when less is free on the disk [bytes]; 0: when it is full',
        limits=(0, 2**62),
    ),
    Declaration(
        'judge', False, 'hold what passes against the limits of a review, and tell what is wrong'
    ),
    Declaration('judge_limits', '', 'a file of other limits, as for review --limits'),
    Declaration(
        'pre_trigger',
        0.0,
        'write nothing until a finding, or a call of ~/trigger; then so much of what came before '
        'as well, as a run in the folder output [s]; 0: write all. Above 0 judge is true unless '
        'it is given',
        limits=(0.0, 86400.0),
        any_number=True,
    ),
    Declaration(
        'post_trigger',
        10.0,
        'and so much of what comes after the last cause [s]',
        limits=(0.0, 86400.0),
        any_number=True,
    ),
    Declaration(
        'pre_trigger_bytes',
        256_000_000,
        'what came before may take so much memory [bytes]',
        limits=(1_000_000, 2**40),
    ),
)
SERVICES = """Services (std_srvs/srv/Trigger):
  ~/split: finish the file and go on in a new one, whose name is the answer
  ~/pause: leave out what comes from now on; the run says when, and how much it was
  ~/resume: record again
  ~/trigger: with pre_trigger, record an event now; the answer is its run"""
PERIOD = 1.0
# What is under way at the end is waited for at most so long [s].
LAST_WORDS = 1.0


class RecordingDiagnostics:
    """
    Publisher of a recording's diagnostics, which are not a part of what it records.

    Parameters
    ----------
    node : rclpy.node.Node
        Who publishes.

    Attributes
    ----------
    topic : str
        Where they are published.

    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._lost = 0
        # Others receive a report at most so many later.
        self._published: deque[bytes] = deque(maxlen=50)
        self._also: list[Callable[[], DiagnosticStatus]] = []
        self._publisher = create_publisher(node, DiagnosticArray, '/diagnostics')
        self.topic = self._publisher.topic_name

    def also(self, status: Callable[[], DiagnosticStatus]) -> None:
        """Tell what is returned here as well, in each report."""
        self._also.append(status)

    def start(self, state: Callable[[], RecordingState]) -> None:
        """Tell once a second what is returned here."""
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._node.create_timer(PERIOD, lambda: self.report(state()), clock=clock)

    def report(self, state: RecordingState) -> None:
        """Tell how a recording stands."""
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        level, message = _verdict(state, state.lost - self._lost)
        array.status = [
            status_of(self._node, 'recording', level, message, _values(state).items()),
            *(status() for status in self._also),
        ]
        data = serialize_message(array)
        self._published.append(data)
        self._publisher.publish(data)
        self._lost = state.lost

    def flush(self) -> None:
        """Wait until the last report has arrived, but not for ever."""
        flush([self._publisher], LAST_WORDS)

    def has_published(self, data: bytes) -> bool:
        """Return whether a message is one of these."""
        return data in self._published


def status_of(
    node: Node, what: str, level: bytes, message: str, values: Iterable[tuple[str, object]]
) -> DiagnosticStatus:
    """Return the status of a part of a node."""
    name = f'{node.get_name()}: {what}'
    return DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        hardware_id=name,
        values=[KeyValue(key=key, value=str(value)) for key, value in values],
    )


def _verdict(state: RecordingState, lost_now: int) -> tuple[bytes, str]:
    """Return the level and the most important thing to say."""
    if state.failure:
        return DiagnosticStatus.ERROR, f'the recording has ended: {state.failure}'
    if state.faults:
        return DiagnosticStatus.ERROR, '; '.join(state.faults)
    if lost_now > 0:
        return (
            DiagnosticStatus.WARN,
            f'{counted(lost_now, "message")} {verb(lost_now, "was", "were")} lost',
        )
    return DiagnosticStatus.OK, 'paused' if state.paused else state.stage or 'recording'


def _values(state: RecordingState) -> dict[str, object]:
    values: dict[str, object] = {
        'file': state.file,
        'size': state.size,
        'free': 'unknown' if state.free is None else state.free,
        'queued': state.queued,
        'paused': str(state.paused).lower(),
        **state.held,
    }
    for name, count in state.counts.items():
        values[f'{name} received'] = count.received
        values[f'{name} written'] = count.written
        values[f'{name} lost'] = 'unknown' if count.lost is None else count.lost
        # What is not lost and not in the run, and where nothing can be known.
        values[f'{name} sent before heard'] = count.early
        values[f'{name} publishers left'] = count.left
    return values
