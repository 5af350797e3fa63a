"""
The geometric method for the four-bar: two circles, no iteration.

It shares no equation with the Newton solver, so each is the other's oracle.
"""

from math import atan2, cos, dist, sin
from typing import TYPE_CHECKING

from klann_ros.kinematics import dyad
from klann_ros.kinematics.dyad import joint, Point
from klann_ros.kinematics.errors import UnreachableError

from .equations import rounding

if TYPE_CHECKING:
    from .geometry import FourBarGeometry

NAMES = ('A', 'O4', 'L3', 'L4')
# Where A is nearer to O4 than this part of the ground it is at O4, and the direction of A O4 means
# nothing; the products in `joint` are numbers still.
COINCIDENT = 1e-30


def crank_pin(geometry: 'FourBarGeometry', theta2: float) -> Point:
    """Return A (x, y) [m]."""
    return geometry.crank * cos(theta2), geometry.crank * sin(theta2)


def angles(geometry: 'FourBarGeometry', theta2: float) -> tuple[float, float]:
    """
    Return theta3 and theta4 at a crank angle, in the geometry's assembly, in [-pi, pi] [rad].

    B is where the circles about A and O4 meet. Where they miss each other by no more than
    rounding, coupler and rocker are in line: a change-point linkage, such as a parallelogram,
    passes such poses.

    Parameters
    ----------
    geometry : FourBarGeometry
        The linkage.
    theta2 : float
        Crank angle [rad].

    Raises
    ------
    UnreachableError
        The circles do not meet, or everywhere (A is at O4).

    """
    a, o_4 = crank_pin(geometry, theta2), (geometry.ground, 0.0)
    if dist(a, o_4) <= COINCIDENT * geometry.ground:
        raise unreachable(geometry, theta2)
    b = joint(a, o_4, geometry.coupler, geometry.rocker, geometry.assembly)
    if b is None:
        return _in_line_by_rounding(geometry, theta2, a)
    return atan2(b[1] - a[1], b[0] - a[0]), atan2(b[1], b[0] - geometry.ground)


def clearance(geometry: 'FourBarGeometry', theta2: float) -> float:
    """Return how far |A O4| is inside | L3 - L4 | .. L3 + L4 [m]; negative when outside."""
    a, o_4 = crank_pin(geometry, theta2), (geometry.ground, 0.0)
    return dyad.clearance(a, o_4, geometry.coupler, geometry.rocker)


def missed_by_rounding(geometry: 'FourBarGeometry', theta2: float) -> bool:
    """
    Return whether the circles miss each other by no more than rounding, or not at all.

    Less than what `refinement` takes for a closed loop, so that it can confirm such a pose.
    """
    return clearance(geometry, theta2) >= -0.75 * rounding(geometry)


def in_line(geometry: 'FourBarGeometry', a: Point, stretched: bool) -> tuple[float, float]:
    """Return theta3 and theta4 where coupler and rocker are stretched out or folded [rad]."""
    toward, away = (
        atan2(-a[1], geometry.ground - a[0]),
        atan2(a[1], a[0] - geometry.ground),
    )
    if stretched:
        return toward, away
    return (toward, toward) if geometry.coupler > geometry.rocker else (away, away)


def unreachable(geometry: 'FourBarGeometry', theta2: float) -> UnreachableError:
    """Return the error that says by how much coupler and rocker do not meet."""
    shortfall = max(0.0, -clearance(geometry, theta2))
    return UnreachableError(theta2, 1, shortfall, _too_far(geometry, theta2), NAMES)


def _in_line_by_rounding(
    geometry: 'FourBarGeometry', theta2: float, a: Point
) -> tuple[float, float]:
    if not missed_by_rounding(geometry, theta2):
        raise unreachable(geometry, theta2)
    return in_line(geometry, a, _too_far(geometry, theta2))


def _too_far(geometry: 'FourBarGeometry', theta2: float) -> bool:
    a, o_4 = crank_pin(geometry, theta2), (geometry.ground, 0.0)
    return dist(a, o_4) > geometry.coupler + geometry.rocker
