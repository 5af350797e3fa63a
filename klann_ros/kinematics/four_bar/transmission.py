"""How well a four-bar transmits: the transmission angle and the mechanical advantage."""

from math import atan2, dist, inf, isnan, nan, pi, radians, sin, sqrt
from typing import NamedTuple, TYPE_CHECKING

from klann_ros.kinematics.angles import crank_angle

from . import closed_form, equations
from .pose import closed_form_pose
from .reach import limits

if TYPE_CHECKING:
    from .geometry import FourBarGeometry

# Good practice for large forces.
LEAST, GREATEST = radians(40.0), radians(140.0)


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
        return self.least >= LEAST and self.greatest <= GREATEST


def transmission_angle(geometry: 'FourBarGeometry', theta2: float) -> float:
    """
    Return the angle mu between coupler and rocker, in [0, pi] [rad].

        cos mu = (L3^2 + L4^2 - L1^2 - L2^2 + 2 L1 L2 cos theta2) / (2 L3 L4)

    computed as tan(mu / 2)^2 = (Z^2 - (L3 - L4)^2) / ((L3 + L4)^2 - Z^2) in factors, with Z =
    |A O4|: that keeps its digits near 0 and pi. Both assemblies have the same.

    Parameters
    ----------
    geometry : FourBarGeometry
        The linkage.
    theta2 : float
        Crank angle [rad].

    Raises
    ------
    CrankAngleError
        `theta2` is not finite, or beyond +-1e6 rad.
    UnreachableError
        Coupler and rocker do not meet at this crank angle.

    References
    ----------
    "Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples, "Angulo de transmissao".

    """
    theta2 = crank_angle(theta2)
    if not closed_form.missed_by_rounding(geometry, theta2):
        raise closed_form.unreachable(geometry, theta2)
    l_3, l_4 = geometry.coupler, geometry.rocker
    z = dist(closed_form.crank_pin(geometry, theta2), (geometry.ground, 0.0))
    near = (z - (l_3 - l_4)) * (z + (l_3 - l_4))
    far = (l_3 + l_4 - z) * (l_3 + l_4 + z)
    return 2.0 * atan2(sqrt(max(0.0, near)), sqrt(max(0.0, far)))


def transmission_extremes(geometry: 'FourBarGeometry') -> TransmissionExtremes:
    """Return the least and the greatest transmission angle, and where; mu grows with |theta2|."""
    near, far = limits(geometry.lengths)
    # At the ends of what can be reached coupler and rocker are in line.
    least = transmission_angle(geometry, 0.0) if near == 0.0 else 0.0
    greatest = transmission_angle(geometry, pi) if far == pi else pi
    return TransmissionExtremes(
        least,
        (0.0,) if near == 0.0 else (-near, near),
        greatest,
        (pi,) if far == pi else (-far, far),
    )


def mechanical_advantage(geometry: 'FourBarGeometry', theta2: float) -> float:
    """
    Return the mechanical advantage T4 / T2 = w2 / w4 at a crank angle.

        T4 / T2 = L4 sin(theta4 - theta3) / (L2 sin(theta2 - theta3))

    It is negative where rocker and crank turn in opposite directions; inf, without a sign since
    it changes there, where crank and coupler are in line (a limit position of the rocker); 0
    where coupler and rocker are in line; NaN where all links are, at a change point.

    Parameters
    ----------
    geometry : FourBarGeometry
        The linkage.
    theta2 : float
        Crank angle [rad].

    Raises
    ------
    CrankAngleError
        `theta2` is not finite, or beyond +-1e6 rad.
    UnreachableError
        Coupler and rocker do not meet at this crank angle.

    """
    pose = closed_form_pose(geometry, theta2)
    sine = sin(pose.theta2 - pose.theta3)
    # What rounding makes of theta3 grows as coupler and rocker come in line.
    rounding = equations.rounding(geometry) / min(geometry.crank, geometry.coupler)
    if isnan(pose.coefficients[0]):
        return nan if abs(sine) <= sqrt(rounding) else 0.0
    across = abs(sin(pose.theta4 - pose.theta3))
    if abs(sine) * across <= rounding:
        return inf
    return 1.0 / pose.coefficients[1]
