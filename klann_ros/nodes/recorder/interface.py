"""Parameters, services and diagnostics of recorder_node."""

from collections import deque

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from klann_ros.log import COMPRESSIONS, RecordingState
from klann_ros.nodes import endpoints
from klann_ros.nodes.parameters import Declaration, number
from klann_ros.sanitize.text import counted, verb
from rclpy.node import Node
from rclpy.serialization import serialize_message

TOPICS = (
    *('crank_angle', 'crank_state', 'crank_state/*', 'joint_states', 'point_h', 'velocity_h'),
    *('*/point_h', '*/velocity_h', 'markers', 'robot_description', 'leg_description'),
    *('cmd_vel', 'crank_command', 'odom', 'imu', 'ground_truth', '/clock', '/diagnostics'),
    *('cmd_vel/lease', 'crank_angle/lease'),
    # Those of ros2_control.
    *('*_broadcaster/joint_states', '*_broadcaster/imu'),
    *('*_controller/commands', '*_controller/joint_trajectory'),
)
_DAY = 86400.0
RECORDER_PARAMETERS = (
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
    Declaration('flush_period', 0.5, 'a crash loses at most this much [s]', limits=(0.01, 60.0)),
    Declaration(
        'max_file_size',
        0,
        'a larger file is finished, and the next one begun [bytes]; 0: no limit',
        limits=(0, 2**62),
    ),
    number(
        'max_file_duration',
        0.0,
        'a longer file is finished, and the next one begun [s]; 0: no limit',
        0.0,
        1e9,
    ),
    Declaration(
        'min_free_space',
        500_000_000,
        'the recording ends when less is free on the disk [bytes]; 0: when it is full',
        limits=(0, 2**62),
    ),
    Declaration(
        'judge', False, 'check messages against the limits of a review, and report findings'
    ),
    Declaration('judge_limits', '', 'file of other limits, as for review --limits'),
    number(
        'pre_trigger',
        0.0,
        'write nothing until a finding, or a call of ~/trigger; then also the messages of this '
        'time before it, as a run in the folder output [s]; 0: write all. Above 0 judge is true '
        'unless it is set',
        0.0,
        _DAY,
    ),
    number(
        'post_trigger', 10.0, 'and the messages of this time after the last cause [s]', 0.0, _DAY
    ),
    Declaration(
        'pre_trigger_bytes',
        256_000_000,
        'memory limit of the messages before a cause [bytes]',
        limits=(1_000_000, 2**40),
    ),
    number('diagnostics_period', 1.0, 'time between diagnostics [s]', 0.01, 3600.0),
)
SERVICES = """Services (std_srvs/srv/Trigger):
  ~/split: finish the file and begin a new one, whose name is the response
  ~/pause: skip messages from now on; the run contains the time and their number
  ~/resume: record again
  ~/trigger: with pre_trigger, record an event now; the response is its run"""
# Shutdown timeout for the last report [s].
_FLUSH_TIMEOUT = 1.0
# Own reports that may still arrive at the recorder's own subscription.
_MAX_OWN_REPORTS = 50


class RecordingDiagnostics:
    """Publisher of a recording's diagnostics, which are not recorded themselves."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._lost = 0
        self._published: deque[bytes] = deque(maxlen=_MAX_OWN_REPORTS)
        self._publisher = endpoints.create_publisher(node, DiagnosticArray, '/diagnostics')
        self.topic = self._publisher.topic_name

    def report(self, state: RecordingState, *further: DiagnosticStatus) -> None:
        """Publish the state of a recording, and further statuses, such as a judge's."""
        level, message = _level_and_message(state, state.lost - self._lost)
        values = _diagnostic_values(state).items()
        status = endpoints.diagnostic_status(self._node, 'recording', level, message, values)
        report = serialize_message(endpoints.diagnostic_array(self._node, [status, *further]))
        self._published.append(report)
        self._publisher.publish(report)
        self._lost = state.lost

    def flush(self) -> None:
        """Wait until the last report has arrived, up to a timeout."""
        endpoints.flush([self._publisher], _FLUSH_TIMEOUT)

    def has_published(self, data: bytes) -> bool:
        """Return whether a message is one of these reports."""
        return data in self._published


def _level_and_message(state: RecordingState, new_losses: int) -> tuple[bytes, str]:
    if state.failure:
        return DiagnosticStatus.ERROR, f'the recording has ended: {state.failure}'
    if state.faults:
        return DiagnosticStatus.ERROR, '; '.join(state.faults)
    if new_losses > 0:
        text = f'{counted(new_losses, "message")} {verb(new_losses, "was", "were")} lost'
        return DiagnosticStatus.WARN, text
    return DiagnosticStatus.OK, 'paused' if state.paused else state.stage or 'recording'


def _diagnostic_values(state: RecordingState) -> dict[str, object]:
    values: dict[str, object] = {
        'file': state.file,
        'size': state.size,
        'free': 'unknown' if state.free is None else state.free,
        'queued': state.queued,
        'paused': str(state.paused).lower(),
        **state.buffer,
    }
    for name, count in state.counts.items():
        values[f'{name} received'] = count.received
        values[f'{name} written'] = count.written
        values[f'{name} lost'] = 'unknown' if count.lost is None else count.lost
        values[f'{name} sent before discovery'] = count.before_discovery
        values[f'{name} publishers left'] = count.departed
    return values
