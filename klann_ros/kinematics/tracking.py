"""
Newton-Raphson with warm starts: from one pose to the next, along its assembly branch.

`track` is pure and knows no linkage: how to refine a guess, how to make one from nothing, and the
last pose are its arguments. The legs are what remembers the last pose.
"""

from collections.abc import Callable
from math import ceil, remainder
from typing import Protocol, TypeVar

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


class TrackedPose(Protocol):
    """What tracking needs of a pose."""

    @property
    def alpha(self) -> float:
        """Return the driving angle [rad]."""

    @property
    def iterations(self) -> int:
        """Return the iterations spent on it."""

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Return the other angles' derivatives by the driving angle; NaN at a singular pose."""

    def ahead(self, step: float) -> tuple[float, ...]:
        """Return the other angles a step of the driver [rad] further on, to first order."""

    def _replace(self: 'Pose', *, iterations: int) -> 'Pose':  # noqa: PYI019 - no Self in 3.10
        """Return the same pose, as one that took so many iterations."""


Pose = TypeVar('Pose', bound=TrackedPose)
# Of a driving angle, a guess of the others, the tolerance and the most iterations, the pose; None
# where it does not converge, or not on the assembly branch.
Refine = Callable[[float, tuple[float, ...], float, int], Pose | None]
# Of a driving angle, a guess of the others made from nothing.
Seed = Callable[[float], tuple[float, ...]]


def track(
    refine: 'Refine[Pose]',
    seed: Seed,
    alpha: float,
    last: Pose | None,
    *,
    tolerance: float,
    max_crank_step: float,
    max_parts: int = MAX_PARTS,
) -> Pose:
    """
    Return the pose at a driving angle, led there from the last pose along the assembly branch.

    The step from the last pose, less whole turns, is made in parts of at most `max_crank_step`,
    each guessed along the tangent of the one before. Where there is no last pose, or a part
    fails, `seed` gives the guess, and Newton-Raphson confirms it.

    Parameters
    ----------
    refine : callable
        Newton-Raphson from a guess.
    seed : callable
        A guess from nothing, on the assembly branch; it raises where there is no pose.
    alpha : float
        Driving angle, any number of turns, finite and within +-1e6 [rad].
    last : pose or None
        The warm start: a pose of the same linkage.
    tolerance : float
        Largest correction of a converged pose [rad].
    max_crank_step : float
        The largest step of the driver that is made at once [rad].
    max_parts : int
        A step of more parts is seeded.

    Raises
    ------
    UnreachableError
        What `seed` raises: the linkage cannot be assembled at this angle.
    NotConvergedError
        Newton-Raphson does not confirm the seed.

    """
    if last is not None:
        step = alpha - last.alpha
        if not -max_crank_step <= step <= max_crank_step:
            step = remainder(step, TURN)
        if -max_crank_step <= step <= max_crank_step:
            # Of a singular pose the tangent is NaN, and so is all that comes of it.
            pose = refine(alpha, last.ahead(step), tolerance, MAX_ITERATIONS)
        elif abs(step) <= max_parts * max_crank_step:
            parts = ceil(abs(step) / max_crank_step)
            pose = _follow(refine, alpha, last, tolerance, (step, parts))
        else:
            pose = None
        if pose is not None:
            return pose
    return _seeded(refine, seed, alpha, tolerance)


def _follow(
    refine: 'Refine[Pose]', alpha: float, last: Pose, tolerance: float, steps: tuple[float, int]
) -> Pose | None:
    """Return the pose at a driving angle, a step in so many parts from the last; None if lost."""
    step, parts = steps
    step /= parts
    spent = 0
    for remaining in range(parts - 1, 0, -1):
        between = alpha - remaining * step
        pose = refine(between, last.ahead(step), COARSE_TOLERANCE, COARSE_ITERATIONS)
        if pose is None:
            return None
        spent += pose.iterations
        last = pose
    pose = refine(alpha, last.ahead(step), tolerance, MAX_ITERATIONS)
    return pose and pose._replace(iterations=spent + pose.iterations)


def _seeded(refine: 'Refine[Pose]', seed: Seed, alpha: float, tolerance: float) -> Pose:
    guess = seed(alpha)
    pose = refine(alpha, guess, tolerance, MAX_ITERATIONS)
    if pose is None:
        reason = 'it does not confirm the closed form'
        raise NotConvergedError(alpha, np.array([guess]), reason)
    return pose
