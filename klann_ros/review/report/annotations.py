"""Write the findings of a review, and the right answer of every pose, beside the messages."""

from collections.abc import Iterable, Iterator
import struct

from klann_ros.kinematics.arrays import AnyArray, ByteArray
from klann_ros.log.definitions import definition
from klann_ros.log.errors import LogError
from klann_ros.log.extension import extend, TopicMessages
from klann_ros.log.reader import open_log
from klann_ros.log.records import ANNOTATION, Topic
from klann_ros.review.model.poses import solve_blocks, SolvedBlock
from klann_ros.review.model.recording import LegRecording
from klann_ros.review.model.review import Finding, Review
from klann_ros.sanitize.cdr import (
    aligned,
    append_string,
    CDR_HEADER,
    HEADER_SIZE,
    JointStateTemplate,
    PointTemplate,
)
from klann_ros.sanitize.outputs import OutputError
from klann_ros.sanitize.text import printable, printable_line
import numpy as np

_NAMESPACE = '/review'
_DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
_JOINT_STATE, _POINT = 'sensor_msgs/msg/JointState', 'geometry_msgs/msg/PointStamped'
_FRAME = 'leg_plane'


def annotate(review: Review, output: str) -> None:
    """
    Write a copy of a reviewed run with annotations, as a new folder.

    Every message of the run is in it byte for byte. Beside them are `/review/findings`, a message
    at the time of each finding; and for each leg with a known geometry the solved angles and foot
    at the crank angle of every recorded pose since the last change of its geometry, with its log
    time and stamp: `/review/NAMESPACE/joint_states` and `/review/NAMESPACE/LEG/point_h`.

    Raises
    ------
    OutputError
        It cannot be written: the output exists, the run is annotated already, or the disk refused.

    """
    try:
        _annotate(review, output)
    except (LogError, OSError) as error:
        reason = getattr(error, 'strerror', None) or error
        what = f'--annotate {printable(output)} cannot be written'
        raise OutputError(f'{what}: {printable_line(reason)}') from error


def _annotate(review: Review, output: str) -> None:
    path = review.recording.path
    with open_log(path) as log:
        known = {topic.type: topic for topic in log.topics if topic.message_encoding == 'cdr'}

    def topic(name: str, kind: str) -> Topic:
        text = known[kind].definition if kind in known else definition(kind)
        return Topic(f'{_NAMESPACE}{name}', kind, text, extra=(ANNOTATION,))

    messages = list(_findings(review, topic('/findings', _DIAGNOSTICS)))
    for leg in review.legs:
        solver, evaluated = leg.evaluated.solver, leg.evaluated
        if solver.leg is not None and len(evaluated.poses):
            place = f'{evaluated.namespace}/{evaluated.name}'.rstrip('/')
            states = topic(f'{evaluated.namespace}/joint_states', _JOINT_STATE)
            feet = topic(f'{place}/point_h', _POINT)
            blocks = leg.errors.solved if leg.errors is not None else ()
            messages += _answers(
                evaluated, blocks or solve_blocks(evaluated, solver.leg), states, feet
            )
    extend(path, output, [part for part in messages if len(part.times)])


def _findings(review: Review, topic: Topic) -> Iterator[TopicMessages]:
    """Yield a message for each finding; the ones of the whole run stand at its start."""
    findings = sorted(review.findings, key=lambda finding: finding.time or 0.0)
    for finding in findings:
        time = review.recording.start + round(1e9 * (finding.time or 0.0))
        yield TopicMessages(topic, np.array([time]), _diagnostics(finding, time))


def _diagnostics(finding: Finding, time: int) -> bytes:
    """Return a finding as a DiagnosticArray of one status."""
    head = aligned(append_string(b'', ''), 4) + struct.pack('<IB', 1, finding.severity)
    name = f'review: {finding.check}'
    for text in (name, finding.text, finding.leg or 'run'):
        head = append_string(head, text)
    values = {'meaning': finding.meaning, 'leg': finding.leg}
    head = aligned(head, 4) + struct.pack('<I', len(values))
    for key, value in values.items():
        head = append_string(append_string(head, key), value)
    return CDR_HEADER + struct.pack('<iI', *divmod(time, 10**9)) + head


def _answers(
    recording: LegRecording, blocks: Iterable[SolvedBlock], states: Topic, feet: Topic
) -> Iterator[TopicMessages]:
    """Yield the solved angles and feet of all poses with a reachable crank angle."""
    poses = recording.poses
    joints = recording.solver.published_joints(recording.name)
    state = JointStateTemplate(joints)
    prefix = f'{recording.name}/' if recording.name else ''
    foot = PointTemplate(f'{prefix}{_FRAME}')
    zeros = state.fill(0, 0, [0.0] * len(joints)), foot.fill(0, 0, 0.0, 0.0)
    for block in blocks:
        found = np.flatnonzero(np.isfinite(block.solved).all(axis=1))
        times, stamps = poses.times[block.rows][found], poses.stamps[block.rows][found]
        stamp = HEADER_SIZE, _bytes(np.column_stack(np.divmod(stamps, 10**9)), '<u4')
        angles = state.values_at, _bytes(block.solved[found], '<f8')
        position = foot.values_at, _bytes(block.solved_feet[found], '<f8')
        yield TopicMessages(states, times, zeros[0], (stamp, angles))
        yield TopicMessages(feet, times, zeros[1], (stamp, position))


def _bytes(numbers: AnyArray, kind: str) -> ByteArray:
    """Return rows of numbers as they are serialized."""
    return np.ascontiguousarray(numbers, kind).view(np.uint8)
