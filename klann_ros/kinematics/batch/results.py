"""Results of a batch: the poses, and the reason of each missing pose."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from klann_ros.kinematics.arrays import ByteArray, FloatArray, with_short_repr
from klann_ros.kinematics.validation import real_array
import numpy as np
from numpy.typing import ArrayLike


class Reason(IntEnum):
    """
    Why a pose of a batch was not solved; 0 if it was.

    Dyads are counted as in `UnreachableError`, loops as in `LoopsOpenError`. Coincident ends
    of a dyad count as too close. Codes of further blocks follow from `unreachable` and
    `open_loops`.
    """

    SOLVED = 0
    CRANK_ANGLE = 1  # not finite, or beyond +-1e6 rad
    DYAD_1_TOO_FAR = 2
    DYAD_1_TOO_CLOSE = 3
    DYAD_2_TOO_FAR = 4
    DYAD_2_TOO_CLOSE = 5
    DYAD_3_TOO_FAR = 6
    DYAD_3_TOO_CLOSE = 7
    LOOPS_1_OPEN = 101
    LOOPS_2_OPEN = 102
    REFUSED = 255  # an invalid linkage


def unreachable(block: int, *, far: bool) -> int:
    """Return the reason for a dyad that does not close; `block` counts from 1."""
    return 2 * block + (not far)


def open_loops(block: int) -> int:
    """Return the reason for coupled loops that do not close."""
    return 100 + block


@with_short_repr
@dataclass(frozen=True, eq=False)
class LinkagePoses:
    """
    Many poses; all numbers of an unsolved one are NaN.

    The arrays are read-only, except an `h` that the caller has provided. Derivatives are by the
    crank angle, and NaN at singular poses.

    Attributes
    ----------
    h : numpy.ndarray, shape (..., 2)
        The foot [m].
    reason : numpy.ndarray of uint8, shape (...)
        0 if the pose was solved, else a `Reason`.
    angles : numpy.ndarray, shape (..., n - 1), or None
        The other angles, in the order of `joint_names`, in (-pi, pi] [rad] if requested.
    points : numpy.ndarray, shape (..., p, 2), or None
        The points, in the structure's order [m] if requested.
    transmission_angles : numpy.ndarray, shape (..., number of blocks), or None
        The transmission angles of `LinkagePose`, in [0, pi] [rad] if requested.
    h_1 : numpy.ndarray, shape (..., 2), or None
        dH/dalpha, the foot's velocity at a crank rate of 1 rad/s [m/rad] if requested.
    angles_1 : numpy.ndarray, shape (..., n - 1), or None
        Derivatives of the angles if both are requested.
    points_1 : numpy.ndarray, shape (..., p, 2), or None
        Derivatives of the points [m/rad] if both are requested.
    h_gradient : numpy.ndarray, shape (..., 2, d), or None
        Derivatives of the foot by each dimension [m/m, m/rad] if gradients are requested. That by
        an encoder's zero is h_1.
    angles_gradient : numpy.ndarray, shape (..., n - 1, d), or None
        The same of the angles if both are requested [rad/m, rad/rad].
    points_gradient : numpy.ndarray, shape (..., p, 2, d), or None
        The same of the points if both are requested.
    h_1_gradient : numpy.ndarray, shape (..., 2, d), or None
        The same of h_1 if both are requested.
    dimension_names : tuple of str
        The names of the d dimensions, as in `Linkage.dimensions`, if gradients are requested.

    """

    h: FloatArray
    reason: ByteArray
    angles: FloatArray | None = None
    points: FloatArray | None = None
    transmission_angles: FloatArray | None = None
    h_1: FloatArray | None = None
    angles_1: FloatArray | None = None
    points_1: FloatArray | None = None
    h_gradient: FloatArray | None = None
    angles_gradient: FloatArray | None = None
    points_gradient: FloatArray | None = None
    h_1_gradient: FloatArray | None = None
    dimension_names: tuple[str, ...] = ()

    def crank_torque(self, force: ArrayLike) -> FloatArray:
        """
        Return the torque at the crank that balances a force on the foot, shape (...) [N m].

        T = -F . dH/dalpha, counter-clockwise positive; see `Leg.crank_torque`.

        Parameters
        ----------
        force : array-like of float, shape (2,) or (..., 2)
            Force on the foot (x, y) [N]: one for all poses, or one for each.

        Raises
        ------
        ValueError
            dH/dalpha was not requested, or the force does not fit.

        """
        if self.h_1 is None:
            msg = 'the velocities were not requested: linkage_poses(..., velocities=True)'
            raise ValueError(msg)
        f = np.asarray(real_array('force', force), dtype=np.float64)
        if f.shape[-1:] != (2,):
            msg = f'force is refused: its shape must be (2,) or (..., 2), not {f.shape}'
            raise ValueError(msg)
        work = f[..., 0] * self.h_1[..., 0] + f[..., 1] * self.h_1[..., 1]
        # Subtracted, not negated: the torque of no force is 0.0 and not -0.0.
        torque: FloatArray = 0.0 - work
        return torque

    def arrays(self) -> dict[str, FloatArray]:
        """Return the existing arrays by name, without the reasons."""
        arrays = vars(self).copy()
        del arrays['reason']
        return {name: array for name, array in arrays.items() if isinstance(array, np.ndarray)}


def part_of(results: LinkagePoses, rows: slice, columns: slice) -> LinkagePoses:
    """Return the part of the results in a block."""
    views: dict[str, Any] = results.arrays()
    for name, array in views.items():
        views[name] = array[rows, columns]
    return LinkagePoses(reason=results.reason[rows, columns], **views)
