"""How a four-bar transmits: transmission angle, mechanical advantage, and a table of them."""

from dataclasses import dataclass
from math import inf, nan, pi, radians, sqrt
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import crank_angle
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.batch.poses import linkage_poses
from klann_ros.kinematics.linkage.dyads import TANGENCY_TOLERANCE
from klann_ros.kinematics.linkage.pose import closed_form_vectors, initial_guess
from klann_ros.kinematics.linkage.reach import crank_limits, triangle_angle
import numpy as np
from numpy.typing import ArrayLike

from .geometry import FourBarGeometry

# Transmission angle limits of good practice for large forces.
MIN_TRANSMISSION_ANGLE, MAX_TRANSMISSION_ANGLE = radians(40.0), radians(140.0)


class TransmissionExtremes(NamedTuple):
    """
    The least and the greatest transmission angle over the crank angles that can be reached.

    Attributes
    ----------
    least, greatest : float
        Transmission angles in [0, pi] [rad].
    least_at, greatest_at : tuple of float
        The crank angles where they occur, in (-pi, pi] [rad]: 0 or pi, or the two ends of what
        can be reached.

    """

    least: float
    least_at: tuple[float, ...]
    greatest: float
    greatest_at: tuple[float, ...]

    @property
    def good(self) -> bool:
        """Return whether it stays within 40 .. 140 deg, as good practice has it."""
        return self.least >= MIN_TRANSMISSION_ANGLE and self.greatest <= MAX_TRANSMISSION_ANGLE


def transmission_angle(geometry: FourBarGeometry, theta2: float) -> float:
    """
    Return the angle mu between coupler and rocker, in [0, pi] [rad]; raises as FourBar's.

        cos mu = (L3^2 + L4^2 - L1^2 - L2^2 + 2 L1 L2 cos theta2) / (2 L3 L4)

    computed as the angle opposite Z = `|A O4|`. Both assemblies have the same.

    References
    ----------
    "Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples, "Angulo de transmissao".

    """
    theta2 = crank_angle(theta2)
    (dyad,) = geometry.linkage.blocks
    a = complex(*geometry.crank_pin(theta2))
    if -dyad.dyad_solver.clearance(geometry.ground - a) > TANGENCY_TOLERANCE * dyad.rounding:
        closed_form_vectors(geometry.linkage, theta2)  # which says by how much they do not meet
    l_3, l_4 = geometry.coupler, geometry.rocker
    return triangle_angle(l_3, l_4, abs(geometry.ground - a))


def transmission_extremes(geometry: FourBarGeometry) -> TransmissionExtremes:
    """Return the least and the greatest transmission angle, and where; mu grows with |theta2|."""
    near, far = crank_limits(geometry.lengths)
    # At the ends of what can be reached coupler and rocker are in line.
    least = transmission_angle(geometry, 0.0) if near == 0.0 else 0.0
    greatest = transmission_angle(geometry, pi) if far == pi else pi
    return TransmissionExtremes(
        least,
        (0.0,) if near == 0.0 else (-near, near),
        greatest,
        (pi,) if far == pi else (-far, far),
    )


def mechanical_advantage(geometry: FourBarGeometry, theta2: float) -> float:
    """
    Return the mechanical advantage T4 / T2 = w2 / w4 at a crank angle; raises as FourBar's.

        T4 / T2 = L4 sin(theta4 - theta3) / (L2 sin(theta2 - theta3))

    It is negative where rocker and crank turn in opposite directions; inf, without a sign since
    it changes there, where crank and coupler are in line (a limit position of the rocker); 0
    where coupler and rocker are in line; NaN where all links are, at a change point.
    """
    theta2 = crank_angle(theta2)
    return float(advantages(geometry, theta2, *initial_guess(geometry.linkage, theta2)))


def advantages(geometry: FourBarGeometry, theta2: Any, theta3: Any, theta4: Any) -> Any:
    """Return the mechanical advantage of one pose, or of arrays of poses; NaN where one is."""
    sine, across = np.sin(theta2 - theta3), np.sin(theta4 - theta3)
    (dyad,) = geometry.linkage.blocks
    # What rounding makes of theta3 grows as coupler and rocker come in line.
    rounding = dyad.rounding / min(geometry.crank, geometry.coupler)
    with np.errstate(divide='ignore', invalid='ignore'):
        ratio = geometry.rocker * across / (geometry.crank * sine)
    ratio = np.where(np.abs(sine * across) <= rounding, inf, ratio)
    in_line = np.where(np.abs(sine) <= sqrt(rounding), nan, 0.0)
    return np.where(np.abs(across) <= dyad.singular_sine, in_line, ratio)


COLUMNS = ('theta2', 'theta3', 'theta4', 'alpha', 'beta', 'Z', 'mu', 'T4/T2')
# A four-bar's lengths may be in any unit, so Z has none.
UNITS = ('[deg]',) * 5 + ('', '[deg]', '[1]')
# Rows of the printed table; the arrays have all.
MAX_ROWS = 100


@dataclass(frozen=True, eq=False)
class FourBarTable:
    """
    The course's quantities at many crank angles; NaN at unreachable ones.

    All arrays have the shape of the given crank angles, and are read-only.

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
        for row in rows[:MAX_ROWS].tolist():
            cells = (f'{v:12.{n}f}' for v, n in zip(row, places, strict=True))
            lines.append(''.join(cells))
        if len(rows) > MAX_ROWS:
            lines.append(f'... and {len(rows) - MAX_ROWS} more')
        return '\n'.join(lines)


def four_bar_table(geometry: FourBarGeometry, theta2: ArrayLike) -> FourBarTable:
    """Return the table of a four-bar; see `FourBar.table`."""
    poses = linkage_poses(geometry, theta2, angles=True, points=True)
    if poses.angles is None or poses.points is None:
        raise AssertionError('both are requested')
    given = np.array(theta2, dtype=np.float64)
    theta3, theta4 = np.moveaxis(poses.angles, -1, 0)
    to_a = poses.points[..., 1, :] - poses.points[..., 3, :]
    z = np.hypot(to_a[..., 0], to_a[..., 1])
    beta = np.arctan2(to_a[..., 1], -to_a[..., 0]) % (2.0 * np.pi)
    columns = {
        'theta2': given,
        'theta3': theta3.copy(),
        'theta4': theta4.copy(),
        'alpha': triangle_angles(z, geometry.rocker, geometry.coupler),
        'beta': beta,
        'z': z,
        'transmission_angle': triangle_angles(geometry.coupler, geometry.rocker, z),
        'mechanical_advantage': advantages(geometry, given, theta3, theta4),
    }
    for column in columns.values():
        column.setflags(write=False)
    return FourBarTable(**columns)


def triangle_angles(p: float | FloatArray, q: float, opposite: float | FloatArray) -> FloatArray:
    """Return the angles between two sides of triangles; see `reach.triangle_angle`."""
    near = (opposite - (p - q)) * (opposite + (p - q))
    far = (p + q - opposite) * (p + q + opposite)
    angles: FloatArray = 2.0 * np.arctan2(
        np.sqrt(np.maximum(0.0, near)), np.sqrt(np.maximum(0.0, far))
    )
    return angles
