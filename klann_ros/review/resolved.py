"""A run's poses, solved again."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, nan

from klann_ros.kinematics import AnyLeg, linkage_poses
from klann_ros.kinematics.batch.given_angles import (
    differences,
    feet,
    loop_errors,
    transmission_angles,
)
import numpy as np

from .loading.layouts import Floats
from .pairing import pairs
from .recording import LegRecording

# So many poses at once: what is made of them stays small.
_BLOCK = 65536
_LARGEST = np.finfo(np.float64).max

# Is given how many poses are solved, and of how many.
Progress = Callable[[int, int], object]


@dataclass(frozen=True, eq=False)
class Resolved:
    """
    A leg's poses in a run, solved again.

    Attributes
    ----------
    angle_errors : numpy.ndarray, shape (n,)
        Largest difference of a pose's angles from the re-solved ones, modulo a turn [rad], or of
        a distance in the linkage's size; NaN where the crank angle cannot be reached, infinite
        where an angle is not finite.
    residuals : numpy.ndarray, shape (n,)
        Norm of f at the recorded pose [m]; infinite where an angle is not finite.
    foot_errors : numpy.ndarray, shape (m,)
        Distance of H from where the angles of its pose put it [m]; NaN where no pose is known to
        be its own or the pose is not finite, infinite where H is not finite.
    transmission_angles : numpy.ndarray, shape (n, number of dyads)
        Those of the re-solved poses, in [0, pi] [rad]; NaN where there is none.

    """

    angle_errors: Floats
    residuals: Floats
    foot_errors: Floats
    transmission_angles: Floats


def resolve(recording: LegRecording, leg: AnyLeg, progress: Progress | None = None) -> Resolved:
    """
    Solve every recorded pose again, from its crank angle alone.

    The closed form does it: it shares no equation with the solver that made the pose.
    """
    poses = recording.poses.values
    count = len(poses)
    again = Resolved(
        np.empty(count),
        np.empty(count),
        np.full(len(recording.feet), nan),
        np.empty((count, len(leg.assembly))),
    )
    of_feet, of_poses = pairs(recording.feet.stamps, recording.poses.stamps)
    for begin in range(0, count, _BLOCK):
        end = min(begin + _BLOCK, count)
        angles = poses[slice(begin, end)]
        _solve_again(leg, angles, again, slice(begin, end))
        paired = slice(*np.searchsorted(of_poses, [begin, end]))
        h = feet(leg, angles[of_poses[paired] - begin])
        found = recording.feet.values[of_feet[paired]]
        again.foot_errors[of_feet[paired]] = _distances(found, h)
        if progress is not None:
            progress(end, count)
    return again


def _solve_again(leg: AnyLeg, angles: Floats, again: Resolved, block: slice) -> None:
    expected, again.transmission_angles[block] = solved_again(leg, angles[:, 0])
    finite = np.isfinite(angles).all(axis=1)
    errors = np.abs(differences(leg, angles[:, 1:], expected)).max(axis=1)
    again.angle_errors[block] = np.where(finite, errors, inf)
    again.residuals[block] = np.where(finite, loop_errors(leg, angles), inf)


def _distances(found: Floats, own: Floats) -> Floats:
    with np.errstate(invalid='ignore', over='ignore'):
        distances = np.hypot(*(found - own).T)
    # A foot that is NaN by itself is a fault of its own, that of its pose is not.
    return np.where(np.isfinite(found).all(axis=1), np.minimum(distances, _LARGEST), inf)


def solved_again(leg: AnyLeg, alphas: Floats) -> tuple[Floats, Floats]:
    """
    Return the other angles at crank angles, and the transmission angles; NaN out of reach.

    Shapes (n, number of angles - 1) and (n, number of dyads) [rad].
    """
    poses = linkage_poses(leg, alphas, angles=True)
    angles: Floats = poses.angles  # type: ignore[assignment] # asked for
    return angles, transmission_angles(leg, np.column_stack([alphas, angles]))
