"""How far a run's poses are from those solved again."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf, nan
from typing import NamedTuple

from klann_ros.kinematics import AnyLeg, linkage_poses
from klann_ros.kinematics.batch.given_angles import (
    differences,
    feet,
    loop_errors,
    transmission_angles,
    vectors,
)
import numpy as np

from .pairing import pairs
from .recording import LegRecording
from .times import Floats, RowIndices

# So many poses at once: what is made of them stays small.
_BLOCK = 65536
_LARGEST = np.finfo(np.float64).max


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """A leg's poses in a run, solved again."""

    # Shape (n,): largest difference of a pose's angles from the re-solved ones, modulo a turn
    # [rad], or of a distance in the linkage's size; NaN where the crank angle cannot be reached,
    # infinite where an angle is not finite.
    angle_errors: Floats
    # Shape (n,): norm of f at the recorded pose [m]; infinite where an angle is not finite.
    residuals: Floats
    # Shape (m,): distance of H from where the angles of its pose put it [m]; NaN where no pose is
    # known to be its own or the pose is not finite, infinite where H is not finite.
    foot_errors: Floats
    # Shape (n, number of dyads): those of the re-solved poses, in [0, pi] [rad]; NaN where there
    # is none.
    transmission_angles: Floats


class SolvedBlock(NamedTuple):
    """Some poses, and the leg's own at their crank angles."""

    # Which poses they are.
    rows: slice
    # Shape (k, number of angles): the angles as they are recorded, and by the closed form, which
    # shares no equation with the solver that made them; NaN where the crank angle cannot be
    # reached [rad].
    recorded: Floats
    solved: Floats
    # Which recorded feet belong to them, and to which of the block.
    of_feet: RowIndices
    of_poses: RowIndices

    def angle_errors(self, leg: AnyLeg) -> Floats:
        """Return how far each angle but the crank's is from its own, modulo a turn [rad]."""
        apart: Floats = np.abs(differences(leg, self.recorded[:, 1:], self.solved[:, 1:]))
        return apart


def solved_blocks(recording: LegRecording, leg: AnyLeg) -> Iterator[SolvedBlock]:
    """Solve every recorded pose again, from its crank angle alone, block by block."""
    poses = recording.poses.values
    of_feet, of_poses = pairs(recording.feet.stamps, recording.poses.stamps)
    for begin in range(0, len(poses), _BLOCK):
        end = min(begin + _BLOCK, len(poses))
        recorded = poses[slice(begin, end)]
        solved = linkage_poses(leg, recorded[:, 0], angles=True)
        angles: Floats = solved.angles  # type: ignore[assignment]  # asked for
        paired = slice(*np.searchsorted(of_poses, [begin, end]))
        yield SolvedBlock(
            slice(begin, end),
            recorded,
            np.column_stack([recorded[:, 0], angles]),
            of_feet[paired],
            of_poses[paired] - begin,
        )


def pose_errors(
    recording: LegRecording, leg: AnyLeg, progress: Callable[[float], object] = lambda _: None
) -> PoseErrors:
    """Return how far a leg's poses are from those solved again; `progress` gets what is done."""
    count = len(recording.poses)
    errors = PoseErrors(
        np.empty(count),
        np.empty(count),
        np.full(len(recording.feet), nan),
        np.empty((count, len(leg.assembly))),
    )
    for block in solved_blocks(recording, leg):
        rows, angles = block.rows, block.recorded
        finite = np.isfinite(angles).all(axis=1)
        errors.transmission_angles[rows] = transmission_angles(leg, block.solved)
        errors.angle_errors[rows] = np.where(finite, block.angle_errors(leg).max(axis=1), inf)
        u = vectors(leg, angles)
        errors.residuals[rows] = np.where(finite, loop_errors(leg, angles, u), inf)
        recorded = recording.feet.values[block.of_feet]
        own = feet(leg, angles, u)[block.of_poses]
        errors.foot_errors[block.of_feet] = _foot_errors(recorded, own)
        progress(rows.stop / count)
    return errors


def _foot_errors(recorded: Floats, own: Floats) -> Floats:
    with np.errstate(invalid='ignore', over='ignore'):
        distances = np.hypot(*(recorded - own).T)
    # A foot that is NaN by itself is a fault of its own, that of its pose is not.
    return np.where(np.isfinite(recorded).all(axis=1), np.minimum(distances, _LARGEST), inf)
