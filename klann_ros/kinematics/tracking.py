"""
Newton-Raphson with warm starts: from one pose to the next, along its assembly branch.

`track` is pure and knows no linkage: how to refine a guess, how to make one from nothing, and the
last pose are its arguments. The legs are what remembers the last pose.
"""

from collections.abc import Callable
from math import ceil, isnan, remainder
from typing import Any, NamedTuple

import numpy as np

from .angles import TURN
from .errors import NotConvergedError

# A warm start that needs more is better seeded anew.
MAX_ITERATIONS = 10
# While a large step is split, the poses between only have to stay on the branch.
COARSE_TOLERANCE = 1e-3
COARSE_ITERATIONS = 6
# Half a turn is 9 parts of 0.35 rad; what takes more is cheaper seeded anew.
MAX_PARTS = 9


class Settings(NamedTuple):
    """
    How a leg is led from pose to pose.

    The largest correction of a converged pose, the largest step of the crank that is made at once
    [rad], and in how many of them a step is made at most; one of more is seeded.
    """

    tolerance: float
    max_crank_step: float
    max_parts: int = MAX_PARTS


def track(  # noqa: PLR0917 - as they are called
    refine: Callable[..., Any],
    ahead: Callable[..., Any],
    seed: Callable[[float], tuple[float, ...]],
    alpha: float,
    last: Any,
    settings: Settings,
) -> Any:
    """
    Return the pose at a driving angle, led there from the last pose along the assembly branch.

    The step from the last pose, less whole turns, is made in parts of at most `max_crank_step`,
    each guessed along the tangent of the one before. Where there is no last pose, a part fails, or
    the pose is singular, so that its sign does not tell the branch, `seed` gives the guess, and
    Newton-Raphson confirms it; else a NotConvergedError. `seed` raises where there is no pose;
    `refine` and `ahead` are those of a `Step`.
    """
    tolerance, max_crank_step, max_parts = settings
    if last is not None:
        step = alpha - last[0]
        if not -max_crank_step <= step <= max_crank_step:
            step = remainder(step, TURN)
        if abs(step) <= max_parts * max_crank_step:
            parts = max(1, ceil(abs(step) / max_crank_step))
            pose = _follow(ahead, alpha, last, tolerance, (step, parts))
            if pose is not None and not isnan(pose.coefficients[0]):
                return pose
    guess = seed(alpha)
    pose = refine(alpha, guess, tolerance, MAX_ITERATIONS)
    if pose is None:
        reason = 'it does not confirm the closed form'
        raise NotConvergedError(alpha, np.array([guess]), reason)
    return pose


def _follow(
    ahead: Callable[..., Any], alpha: float, last: Any, tolerance: float, steps: tuple[float, int]
) -> Any:
    """Return the pose at a driving angle, a step in so many parts from the last; None if lost."""
    step, parts = steps
    step /= parts
    spent = 0
    for remaining in range(parts - 1, -1, -1):
        between = alpha - remaining * step
        limits = (
            (COARSE_TOLERANCE, COARSE_ITERATIONS) if remaining else (tolerance, MAX_ITERATIONS)
        )
        pose = ahead(between, step, last.x, last.coefficients, *limits)
        if pose is None:
            return None
        spent += pose.iterations
        last = pose
    return last if parts == 1 else last._replace(iterations=spent)
