"""
Newton-Raphson for the four-bar, written out for speed.

`refine` makes the iterates of the Newton of `equations.f` and its Jacobian. It is pure: the guess
is an argument.
"""

from math import cos, hypot, pi, sin
from typing import NamedTuple

from klann_ros.kinematics.angles import FAR, wrap

from . import equations
from .geometry import FourBarGeometry
from .pose import FourBarPose, NO_COEFFICIENTS


class Constants(NamedTuple):
    """What `refine` needs of a geometry, in the order it unpacks it."""

    l_1: float
    l_2: float
    l_3: float
    l_4: float
    sign: int
    rounding: float
    singular: float
    geometry: FourBarGeometry


def constants(geometry: FourBarGeometry) -> Constants:
    """Return the constants of a geometry; do it once, not for every pose."""
    singular = equations.singular_sine(geometry) * geometry.coupler * geometry.rocker
    rounding = equations.rounding(geometry)
    return Constants(*geometry.lengths, geometry.assembly, rounding, singular, geometry)


def refine(
    constants: Constants,
    theta2: float,
    guess: tuple[float, ...],
    tolerance: float,
    max_iterations: int,
) -> FourBarPose | None:
    """
    Return the pose that Newton-Raphson reaches from a guess, or None.

    With AB = L3 (cos theta3, sin theta3) and OB = L4 (cos theta4, sin theta4), the corrections
    dx = -Phi^-1 f are

        dtheta3 = (OB.x f1 + OB.y f2) / det        det = L3 L4 sin(theta4 - theta3)
        dtheta4 = (AB.x f1 + AB.y f2) / det

    The pose is the first iterate after a correction of at most `tolerance` in both angles, or one
    whose residual is rounding already (near a singular pose corrections stay above 1e-12 rad).

    Parameters
    ----------
    constants : Constants
        The linkage.
    theta2 : float
        Crank angle [rad].
    guess : tuple of float
        theta3, theta4 [rad].
    tolerance : float
        Largest correction of a converged pose [rad].
    max_iterations : int
        How many iterations it may take.

    Returns
    -------
    FourBarPose or None
        None: it did not converge, or not on the geometry's assembly branch.

    """
    l_1, l_2, l_3, l_4, sign, rounding, singular, geometry = constants
    theta3, theta4 = guess
    oa_x, oa_y = l_2 * cos(theta2), l_2 * sin(theta2)
    x = l_1 - oa_x
    iterations, settled = 0, False
    while iterations < max_iterations:
        iterations += 1
        ab_x, ab_y = l_3 * cos(theta3), l_3 * sin(theta3)
        ob_x, ob_y = l_4 * cos(theta4), l_4 * sin(theta4)
        f1 = x + ob_x - ab_x
        f2 = ob_y - ab_y - oa_y
        det = ab_x * ob_y - ab_y * ob_x
        if settled or (-rounding <= f1 <= rounding and -rounding <= f2 <= rounding):
            break
        if det == 0.0:
            return None
        d_theta3 = (ob_x * f1 + ob_y * f2) / det
        d_theta4 = (ab_x * f1 + ab_y * f2) / det
        theta3 += d_theta3
        theta4 += d_theta4
        settled = -tolerance <= d_theta3 <= tolerance and -tolerance <= d_theta4 <= tolerance
    else:
        return None
    # The tangent of a nearly singular pose leads many turns away, and those cost digits.
    if not (-FAR < theta3 < FAR and -FAR < theta4 < FAR):
        return None
    # Rounding may give a pose that is singular the wrong sign.
    if det * sign < -rounding * (l_3 + l_4):
        return None
    if -singular <= det <= singular:
        coefficients = NO_COEFFICIENTS
    else:
        coefficients = (
            (ob_x * oa_y - ob_y * oa_x) / det,
            (ab_x * oa_y - ab_y * oa_x) / det,
        )
    return FourBarPose(
        theta2,
        theta3 if -pi < theta3 <= pi else wrap(theta3),
        theta4 if -pi < theta4 <= pi else wrap(theta4),
        iterations,
        hypot(f1, f2),
        coefficients,
        geometry,
    )
