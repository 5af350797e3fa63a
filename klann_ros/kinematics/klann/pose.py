"""A solved pose of the Klann leg."""

from math import nan, sin
from typing import NamedTuple

from klann_ros.kinematics.angles import crank_angle, wrap
from klann_ros.kinematics.dyad import clearance
import numpy as np
from numpy.typing import NDArray

from . import closed_form, equations
from .geometry import KlannGeometry

# The names under which the angles are published and drawn, in the order of a pose's fields.
JOINTS = ('alpha', 'gamma', 'beta', 'delta', 'theta')
# The kinematic coefficients of a singular pose.
NO_COEFFICIENTS = (nan, nan, nan, nan)


class KlannPose(NamedTuple):
    """
    A solved pose: immutable, and cheap enough to be made a thousand times a second.

    Attributes
    ----------
    alpha : float
        Crank angle as given, not wrapped [rad].
    gamma, beta, delta, theta : float
        The textbook's angles in (-pi, pi] [rad]; gamma and theta are clockwise.
    h : tuple of float
        The foot H (x, y) [m].
    iterations : int
        Newton iterations spent, the last of which only confirms; 0 for the closed form.
    residual : float
        Euclidean norm of f at this pose [m]: by how much the loops do not close.
    coefficients : tuple of float
        Kinematic coefficients d(gamma, beta, delta, theta)/d(alpha); NaN at a singular pose.
    geometry : KlannGeometry
        The leg.

    """

    alpha: float
    gamma: float
    beta: float
    delta: float
    theta: float
    h: tuple[float, float]
    iterations: int
    residual: float
    coefficients: tuple[float, float, float, float]
    geometry: KlannGeometry

    @property
    def x(self) -> tuple[float, float, float, float]:
        """Return the state vector (gamma, beta, delta, theta) [rad]."""
        return self[1:5]

    @property
    def joints(self) -> tuple[float, float, float, float, float]:
        """Return every angle, alpha first [rad]: those of JOINTS."""
        return self[:5]

    def ahead(self, step: float) -> tuple[float, float, float, float]:
        """Return the angles x a step of the crank [rad] further on, to first order."""
        _, gamma, beta, delta, theta, _, _, _, coefficients, _ = self
        gamma_1, beta_1, delta_1, theta_1 = coefficients
        return (
            gamma + step * gamma_1,
            beta + step * beta_1,
            delta + step * delta_1,
            theta + step * theta_1,
        )

    @property
    def points(self) -> NDArray[np.float64]:
        """Return the points A to H, shape (8, 2) [m]; computed at each use."""
        return equations.points(self.geometry, self.alpha, self.x)

    @property
    def transmission_angles(self) -> tuple[float, float]:
        """
        Return the angle between the links of each dyad, in [0, pi] [rad].

        pi/2 transmits best; at 0 and pi the dyad is folded or stretched out, and singular.
        """
        return _between(self.gamma + self.beta), _between(self.delta + self.theta)

    @property
    def sines(self) -> tuple[float, float]:
        """Return |sin| of both transmission angles: 1 transmits best, 0 is singular."""
        return abs(sin(self.gamma + self.beta)), abs(sin(self.delta + self.theta))

    @property
    def clearances(self) -> tuple[float, float]:
        """
        Return how far the ends of each dyad, B and D, E and G, are inside its reach [m].

        At 0 the dyad is stretched out or folded, and the pose is singular.
        """
        _, b, _, d, e, _, g, _ = ((x, y) for x, y in self.points.tolist())
        geometry = self.geometry
        return (
            clearance(b, d, geometry.l_bc, geometry.l_dc),
            clearance(e, g, geometry.l_ef, geometry.l_fg),
        )

    @property
    def distance_to_singularity(self) -> float:
        """Return the least of both clearances: how much a pivot may be off before it jams [m]."""
        return min(self.clearances)

    @property
    def condition(self) -> float:
        """Condition number of Phi in the 2-norm: how much Newton amplifies a residual."""
        return float(np.linalg.cond(equations.phi(self.geometry, self.x)))


def closed_form_pose(geometry: KlannGeometry, alpha: float) -> KlannPose:
    """
    Return the pose at a crank angle by the geometric method.

    Parameters
    ----------
    geometry : KlannGeometry
        The leg.
    alpha : float
        Crank angle, any number of turns [rad].

    Raises
    ------
    CrankAngleError
        `alpha` is not finite, or beyond +-1e6 rad.
    UnreachableError
        A dyad does not close at this crank angle.

    """
    alpha = crank_angle(alpha)
    joints = closed_form.joints(geometry, alpha)
    x = closed_form.angles(geometry, joints)
    gamma, beta, delta, theta = x
    return KlannPose(
        alpha,
        wrap(gamma),
        wrap(beta),
        wrap(delta),
        wrap(theta),
        joints.h,
        0,
        float(np.linalg.norm(equations.f(geometry, alpha, x))),
        _coefficients(geometry, alpha, x),
        geometry,
    )


def _coefficients(
    geometry: KlannGeometry, alpha: float, x: tuple[float, float, float, float]
) -> tuple[float, float, float, float]:
    """Solve Phi dx/dalpha = -df/dalpha; NaN where Phi is singular but for rounding."""
    gamma, beta, delta, theta = x
    sine_1, sine_2 = equations.singular_sines(geometry)
    if abs(sin(gamma + beta)) <= sine_1 or abs(sin(delta + theta)) <= sine_2:
        return NO_COEFFICIENTS
    solution = np.linalg.solve(equations.phi(geometry, x), -equations.f_alpha(geometry, alpha))
    gamma, beta, delta, theta = solution.tolist()
    return gamma, beta, delta, theta


def _between(angle: float) -> float:
    return abs(wrap(angle))
