"""
Newton-Raphson with warm starts: from one pose to the next, along its assembly branch.

`track` is pure: the last pose is an argument. `KlannLeg` is what remembers it.
"""

from math import ceil, remainder

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.errors import NotConvergedError
import numpy as np

from . import closed_form
from .pose import KlannPose, NO_COEFFICIENTS
from .refinement import Angles, Constants, refine

# A warm start that needs more is better seeded anew.
MAX_ITERATIONS = 10
# While a large step is split, the poses between only have to stay on the branch.
COARSE_TOLERANCE = 1e-3
COARSE_ITERATIONS = 6
# Half a turn is 9 parts of 0.35 rad; what takes more is cheaper seeded from the closed form.
MAX_PARTS = 9


def track(
    constants: Constants,
    alpha: float,
    last: KlannPose | None,
    tolerance: float,
    max_crank_step: float,
) -> KlannPose:
    """
    Return the pose at a crank angle, led there from the last pose along the assembly branch.

    The step from the last pose, less whole turns, is made in parts of at most `max_crank_step`,
    each guessed along the tangent of the one before. Where there is no last pose, or a part
    fails, the closed form is the seed, and Newton-Raphson confirms it.

    Parameters
    ----------
    constants : Constants
        The leg.
    alpha : float
        Crank angle, any number of turns, finite and within +-1e6 [rad].
    last : KlannPose or None
        The warm start: a pose of the same leg.
    tolerance : float
        Largest correction of a converged pose [rad].
    max_crank_step : float
        The largest step of the crank that is made at once [rad].

    Raises
    ------
    UnreachableError
        A dyad does not close at this crank angle.
    NotConvergedError
        Newton-Raphson does not confirm the closed form.

    """
    pose = None if last is None else _follow(constants, alpha, last, tolerance, max_crank_step)
    return _seeded(constants, alpha, tolerance) if pose is None else pose


def _follow(
    constants: Constants, alpha: float, last: KlannPose, tolerance: float, max_crank_step: float
) -> KlannPose | None:
    if last.coefficients is NO_COEFFICIENTS:
        return None
    step = alpha - last.alpha
    if not -max_crank_step <= step <= max_crank_step:
        step = remainder(step, TURN)
    if -max_crank_step <= step <= max_crank_step:
        return refine(constants, alpha, _tangent(last, step), tolerance, MAX_ITERATIONS)
    if abs(step) > MAX_PARTS * max_crank_step:
        return None
    parts = ceil(abs(step) / max_crank_step)
    step /= parts
    spent = 0
    for remaining in range(parts - 1, 0, -1):
        guess = _tangent(last, step)
        between = alpha - remaining * step
        pose = refine(constants, between, guess, COARSE_TOLERANCE, COARSE_ITERATIONS)
        if pose is None:
            return None
        spent += pose.iterations
        last = pose
    pose = refine(constants, alpha, _tangent(last, step), tolerance, MAX_ITERATIONS)
    return pose and pose._replace(iterations=spent + pose.iterations)


def _tangent(pose: KlannPose, step: float) -> Angles:
    """Return the guess for a crank angle `step` [rad] further on: first order in the step."""
    _, gamma, beta, delta, theta, _, _, _, coefficients, _ = pose
    gamma_1, beta_1, delta_1, theta_1 = coefficients
    return (
        gamma + step * gamma_1,
        beta + step * beta_1,
        delta + step * delta_1,
        theta + step * theta_1,
    )


def _seeded(constants: Constants, alpha: float, tolerance: float) -> KlannPose:
    geometry = constants.geometry
    seed = closed_form.angles(geometry, closed_form.joints(geometry, alpha))
    pose = refine(constants, alpha, seed, tolerance, MAX_ITERATIONS)
    if pose is None:
        reason = 'it does not confirm the closed form'
        raise NotConvergedError(alpha, np.array([seed]), reason)
    return pose
