"""All that the course asks of a four-bar, at many crank angles at once."""

from dataclasses import dataclass

from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.batch.poses import linkage_poses
import numpy as np
from numpy.typing import ArrayLike

from .geometry import FourBarGeometry
from .transmission import advantages

COLUMNS = ('theta2', 'theta3', 'theta4', 'alpha', 'beta', 'Z', 'mu', 'T4/T2')
# A four-bar's lengths may be in any unit, so Z has none.
UNITS = ('[deg]',) * 5 + ('', '[deg]', '[1]')
# What `str` shows: a table for the eye; the arrays have all.
MOST_ROWS = 100


@dataclass(frozen=True, eq=False)
class FourBarTable:
    """
    The course's quantities at many crank angles; NaN where the crank cannot be.

    All arrays have the shape of the crank angles that were asked for, and are read-only.

    Attributes
    ----------
    theta2 : numpy.ndarray
        Crank angles as given [rad].
    theta3, theta4 : numpy.ndarray
        Angles of coupler and rocker, in (-pi, pi] [rad].
    alpha, beta : numpy.ndarray
        The course's angles at O4, as in `FourBarPose` [rad].
    z : numpy.ndarray
        The diagonal Z = `|A O4|`, in the unit of the lengths.
    transmission_angle : numpy.ndarray
        Between coupler and rocker, in [0, pi] [rad].
    mechanical_advantage : numpy.ndarray
        T4 / T2; see `FourBar.mechanical_advantage`.

    """

    theta2: FloatArray
    theta3: FloatArray
    theta4: FloatArray
    alpha: FloatArray
    beta: FloatArray
    z: FloatArray
    transmission_angle: FloatArray
    mechanical_advantage: FloatArray

    def __str__(self) -> str:
        """Return a table, angles in deg, Z in the unit of the lengths."""
        angles = (self.theta2, self.theta3, self.theta4, self.alpha, self.beta)
        columns = [np.degrees(column) for column in angles]
        columns += [self.z, np.degrees(self.transmission_angle), self.mechanical_advantage]
        rows = np.stack([column.ravel() for column in columns], axis=1)
        places = (2, 2, 2, 2, 2, 6, 2, 4)
        lines = [''.join(f'{name:>12}' for name in COLUMNS)]
        lines += [''.join(f'{unit:>12}' for unit in UNITS)]
        for row in rows[:MOST_ROWS].tolist():
            cells = (f'{v:12.{n}f}' for v, n in zip(row, places, strict=True))
            lines.append(''.join(cells))
        if len(rows) > MOST_ROWS:
            lines.append(f'... and {len(rows) - MOST_ROWS} more')
        return '\n'.join(lines)


def four_bar_table(geometry: FourBarGeometry, theta2: ArrayLike) -> FourBarTable:
    """Return the table of a four-bar; see `FourBar.table`."""
    poses = linkage_poses(geometry, theta2, angles=True, points=True)
    if poses.angles is None or poses.points is None:
        raise AssertionError('both were asked for')
    given = np.array(theta2, dtype=np.float64)
    theta3, theta4 = np.moveaxis(poses.angles, -1, 0)
    to_a = poses.points[..., 1, :] - poses.points[..., 3, :]
    z = np.hypot(to_a[..., 0], to_a[..., 1])
    beta = np.arctan2(to_a[..., 1], -to_a[..., 0]) % (2.0 * np.pi)
    columns = {
        'theta2': given,
        'theta3': theta3.copy(),
        'theta4': theta4.copy(),
        'alpha': openings(z, geometry.rocker, geometry.coupler),
        'beta': beta,
        'z': z,
        'transmission_angle': openings(geometry.coupler, geometry.rocker, z),
        'mechanical_advantage': advantages(geometry, given, theta3, theta4),
    }
    for column in columns.values():
        column.setflags(write=False)
    return FourBarTable(**columns)


def openings(p: float | FloatArray, q: float, opposite: float | FloatArray) -> FloatArray:
    """Return the angles between two sides of triangles; see `reach.opening`."""
    near = (opposite - (p - q)) * (opposite + (p - q))
    far = (p + q - opposite) * (p + q + opposite)
    angles: FloatArray = 2.0 * np.arctan2(
        np.sqrt(np.maximum(0.0, near)), np.sqrt(np.maximum(0.0, far))
    )
    return angles
