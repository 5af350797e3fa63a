"""Write the findings of a review, and the right answer of every pose, beside the messages."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256

from klann_ros.cli import output_errors
from klann_ros.kinematics.arrays import FloatArray, IntArray
from klann_ros.log import ANNOTATION, extend, Topic, TopicMessages
from klann_ros.log.errors import LogError
from klann_ros.messages import (
    DIAGNOSTICS,
    HEADER_SIZE,
    JOINT_STATE,
    JointStateTemplate,
    MAX_STAMP,
    POINT,
    point_template,
)
from klann_ros.review.model.poses import solve_blocks, SolvedBlock
from klann_ros.review.model.recording import LegRecording
from klann_ros.review.model.review import Finding, Review
import numpy as np
from numpy.typing import NDArray


def annotate(review: Review, output: str) -> None:
    """
    Write a copy of a reviewed run with annotations, as a new folder.

    Every message of the run is in it byte for byte. Beside them are `/review/findings`, a message
    at the time of each finding; and for each leg with a known geometry the solved angles and foot
    at the crank angle of every recorded pose since the last change of its geometry, with its log
    time and stamp: `/review/NAMESPACE/joint_states` and `/review/NAMESPACE/LEG/point_h`. Raises
    an OutputError if the output exists, the run is annotated already, or the disk refused.
    """
    messages = list(_findings(review, _topic('/findings', DIAGNOSTICS.name)))
    # Legs of one JointState have poses of the same times: one message has their answers, too.
    of_message = defaultdict[tuple[str, bytes], list[_Answers]](list)
    for leg in review.legs:
        evaluated, known = leg.evaluated, leg.evaluated.solver.leg
        if known is not None and leg.errors is not None:
            for block in leg.errors.solved or solve_blocks(evaluated, known):
                answers = _answers(evaluated, block)
                messages.append(_feet(answers))
                of_message[evaluated.namespace, answers.digest()].append(answers)
    messages += map(_states, of_message.values())
    with output_errors('--annotate', output, LogError):
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
    sec, nanosec = divmod(min(time, MAX_STAMP), 10**9)
    status = {
        'level': finding.severity,
        'name': f'review: {finding.check}',
        'message': finding.text,
        'hardware_id': finding.leg or 'run',
        'values': [
            {'key': 'meaning', 'value': finding.meaning},
            {'key': 'leg', 'value': finding.leg},
        ],
    }
    return DIAGNOSTICS.write(
        {'header.stamp.sec': sec, 'header.stamp.nanosec': nanosec, 'status': [status]}
    )


@dataclass(frozen=True, eq=False)
class _Answers:
    """The solved poses of a block with a reachable crank angle."""

    leg: LegRecording
    times: IntArray  # log times, shape (n,) [ns]
    stamps: NDArray[np.uint32]  # shape (n, 2): seconds and nanoseconds
    angles: FloatArray  # shape (n, number of angles) [rad]
    feet: FloatArray  # shape (n, 2) [m]

    def digest(self) -> bytes:
        """Return a digest of its log times and stamps."""
        return sha256(self.times.tobytes() + self.stamps.tobytes()).digest()


def _answers(leg: LegRecording, block: SolvedBlock) -> _Answers:
    finite = np.isfinite(block.solved)
    # Mostly all of them, which spares the copies.
    reached = slice(None) if finite.all() else np.flatnonzero(finite.all(axis=1))
    stamps = leg.poses.stamps[block.rows][reached]
    seconds = stamps // 10**9
    return _Answers(
        leg,
        leg.poses.times[block.rows][reached],
        np.column_stack([seconds, stamps - 10**9 * seconds]).astype('<u4'),
        block.solved[reached],
        block.solved_feet[reached],
    )


def _states(answers: Sequence[_Answers]) -> TopicMessages:
    """Return the angles of all legs of a message."""
    first = answers[0]
    names: list[str] = []
    for answer in answers:
        names += answer.leg.solver.published_joints(answer.leg.name)
    state = JointStateTemplate(names)
    changes: dict[int, NDArray[np.generic]] = {HEADER_SIZE: first.stamps}
    offset = state.first_number
    for answer in answers:
        changes[offset] = answer.angles
        offset += answer.angles.itemsize * answer.angles.shape[1]
    topic = _topic(f'{first.leg.namespace}/joint_states', JOINT_STATE.name)
    return TopicMessages(topic, first.times, state.fill(0, 0, [0.0] * len(names)), changes)


def _feet(answers: _Answers) -> TopicMessages:
    leg = answers.leg
    foot = point_template(f'{leg.name}/leg_plane'.lstrip('/'))
    place = f'{leg.namespace}/{leg.name}'.rstrip('/')
    return TopicMessages(
        _topic(f'{place}/point_h', POINT.name),
        answers.times,
        foot.fill(0, 0, 0.0, 0.0),
        {HEADER_SIZE: answers.stamps, foot.first_number: answers.feet},
    )
