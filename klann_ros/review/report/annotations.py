"""Write the findings of a review, and the right answer of every pose, beside the messages."""

from collections.abc import Iterator
import struct

from klann_ros.log.errors import LogError
from klann_ros.log.extension import extend, TopicMessages
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
from klann_ros.sanitize.outputs import reported
import numpy as np


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
    messages = list(_findings(review, _topic('/findings', 'diagnostic_msgs/msg/DiagnosticArray')))
    for leg in review.legs:
        evaluated, known = leg.evaluated, leg.evaluated.solver.leg
        if known is not None and leg.errors is not None:
            for block in leg.errors.solved or solve_blocks(evaluated, known):
                messages += _answers(evaluated, block)
    with reported('--annotate', output, LogError):
        extend(review.recording.path, output, messages)


def _topic(name: str, kind: str) -> Topic:
    return Topic(f'/review{name}', kind, extra=(ANNOTATION,))


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


def _answers(recording: LegRecording, block: SolvedBlock) -> Iterator[TopicMessages]:
    """Yield the solved angles and feet of the poses with a reachable crank angle."""
    place = f'{recording.namespace}/{recording.name}'.rstrip('/')
    joints = recording.solver.published_joints(recording.name)
    state = JointStateTemplate(joints)
    foot = PointTemplate(f'{recording.name}/leg_plane'.lstrip('/'))
    finite = np.isfinite(block.solved)
    # Mostly all of them, which spares the copies.
    reached = slice(None) if finite.all() else np.flatnonzero(finite.all(axis=1))
    times = recording.poses.times[block.rows][reached]
    stamps = recording.poses.stamps[block.rows][reached]
    seconds = stamps // 10**9
    stamp = np.column_stack([seconds, stamps - 10**9 * seconds]).astype('<u4')
    yield TopicMessages(
        _topic(f'{recording.namespace}/joint_states', 'sensor_msgs/msg/JointState'),
        times,
        state.fill(0, 0, [0.0] * len(joints)),
        {HEADER_SIZE: stamp, state.values_at: block.solved[reached]},
    )
    yield TopicMessages(
        _topic(f'{place}/point_h', 'geometry_msgs/msg/PointStamped'),
        times,
        foot.fill(0, 0, 0.0, 0.0),
        {HEADER_SIZE: stamp, foot.values_at: block.solved_feet[reached]},
    )
