"""
The assembly branch of coupled loops: the poses that the crank reaches from the start.

There is no closed form for coupled loops. Their branch is followed once, in small steps, without
passing a singular pose, and kept as a table. A guess at any crank angle is the nearest pose in it,
led on along its tangent.
"""

from bisect import bisect_left
from collections.abc import Sequence
from math import isnan, pi
from operator import itemgetter
from typing import NamedTuple

from klann_ros.kinematics.angles import Arc, TURN
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.errors import GeometryError, LoopsOpenError
import numpy as np

from .equations import LoopEquations
from .step import MAX_BRANCH_JUMP, step_functions

# Crank step between the table's poses [rad]: 1/8 of the safe tangent step of the Klann leg.
BRANCH_STEP = 0.05
# The branch ends where smaller steps fail [rad].
MIN_BRANCH_STEP = 1e-9
TOLERANCE = 1e-9
ITERATIONS = 6
# Fields of a corrected pose: see LinkagePose.
_X_AND_COEFFICIENTS = itemgetter(1, 5)


class BranchSample(NamedTuple):
    """A pose: crank angle, the other angles and their derivatives [rad]."""

    alpha: float
    x: tuple[float, ...]
    x_1: tuple[float, ...]

    def predict(self, step: float) -> tuple[float, ...]:
        """Return the angles a step of the crank further on, to first order."""
        return tuple(x + step * x_1 for x, x_1 in zip(self.x, self.x_1, strict=True))


class Branch:
    """
    The poses of a linkage along its branch, over a whole turn or an arc.

    Made of a linkage that ends with the coupled loops of block number `block`, and a start: every
    coordinate, the crank's angle first [rad, m]. A GeometryError says that it is nearly singular
    at its start, or not back there after a turn.
    """

    def __init__(self, linkage: LoopEquations, start: Sequence[float], block: int) -> None:
        self._block = block
        self._correct = step_functions(linkage, tuple).correct
        alpha, *x = start
        first = self._sample(alpha, tuple(x))
        if first is None:
            text = (
                'its coupled loops cannot be followed from the start: it is nearly singular there'
            )
            raise GeometryError(text)
        samples = self._follow(first, 1.0)
        if not _is_closed_turn(linkage, samples):
            samples = _one_turn([*reversed(self._follow(first, -1.0)[1:]), *samples], alpha)
        self._samples = samples
        self._first = samples[0].alpha
        self._last = samples[-1].alpha
        self._is_turn = _is_closed_turn(linkage, samples)
        self._refuse_overlap()

    @property
    def arc(self) -> Arc:
        """Return the crank angles of its ends [rad]; (0, 2 pi) for a whole turn."""
        return (0.0, TURN) if self._is_turn else (self._first, self._last)

    def x(self, alpha: float) -> tuple[float, ...]:
        """Return the angles at a crank angle [rad]; a LoopsOpenError beyond the branch."""
        branch_alpha = self._within(alpha)
        nearest = self._nearest_sample(branch_alpha)
        if self._first <= branch_alpha <= self._last:
            sample = self._corrected(alpha, nearest.predict(branch_alpha - nearest.alpha))
            if sample is not None:
                return sample.x
        raise LoopsOpenError(alpha, self._block, alpha + nearest.alpha - branch_alpha)

    def guesses(self, alphas: FloatArray) -> FloatArray:
        """Return guesses of the angles at many crank angles, shape (n - 1, k); NaN beyond it."""
        samples, x, x_1 = map(np.array, zip(*self._samples, strict=True))
        angles = self._first + np.remainder(alphas - self._first, TURN)
        right = np.searchsorted(samples, angles).clip(1, len(samples) - 1)
        nearest = right - (angles - samples[right - 1] < samples[right] - angles)
        guesses = x[nearest] + (angles - samples[nearest])[:, None] * x_1[nearest]
        guesses[angles > self._last] = np.nan
        return np.asarray(guesses.T)

    def _sample(self, alpha: float, guess: tuple[float, ...]) -> BranchSample | None:
        """Return the pose at a crank angle; None if the guess fails or it is singular."""
        sample = self._corrected(alpha, guess)
        return None if sample is None or isnan(sample.x_1[0]) else sample

    def _corrected(self, alpha: float, guess: tuple[float, ...]) -> BranchSample | None:
        pose = self._correct(alpha, guess, TOLERANCE, ITERATIONS)
        return None if pose is None else BranchSample(alpha, *_X_AND_COEFFICIENTS(pose))

    def _follow(self, first: BranchSample, direction: float) -> list[BranchSample]:
        """Return the poses from the first on, for a whole turn or until the branch ends."""
        samples = [first]
        length = BRANCH_STEP
        while abs(samples[-1].alpha - first.alpha) < TURN and length > MIN_BRANCH_STEP:
            guess = samples[-1].predict(direction * length)
            sample = self._sample(samples[-1].alpha + direction * length, guess)
            if sample is None:
                length /= 2.0
            else:
                samples.append(sample)
                length = min(BRANCH_STEP, 2.0 * length)
        return samples

    def _refuse_overlap(self) -> None:
        """Refuse a branch that overlaps itself after a turn in another assembly mode."""
        if self._is_turn or self._last - self._first < TURN - 2.0 * BRANCH_STEP:
            return
        try:
            self.x(self._first + 2.0 * BRANCH_STEP)
            self.x(self._last - 2.0 * BRANCH_STEP)
        except LoopsOpenError:
            return
        raise GeometryError(
            'its coupled loops are not back where they were after a turn of the crank: one crank '
            'angle has two poses, and such a linkage is not solved'
        )

    def _within(self, alpha: float) -> float:
        """Return the crank angle, less whole turns, on the branch or nearest to it."""
        middle = (self._first + self._last) / 2.0
        return alpha - TURN * round((alpha - middle) / TURN)

    def _nearest_sample(self, alpha: float) -> BranchSample:
        i = bisect_left(self._samples, alpha, key=lambda sample: sample.alpha)
        neighbours = self._samples[slice(max(0, i - 1), i + 1)]
        return min(neighbours, key=lambda sample: abs(sample.alpha - alpha))


def _is_closed_turn(linkage: LoopEquations, samples: Sequence[BranchSample]) -> bool:
    """Return whether samples are a whole turn, after which the loops are back where they were."""
    start = samples[0]
    end = samples[-1]
    if end.alpha - start.alpha < TURN:
        return False
    back = end.predict(start.alpha + TURN - end.alpha)
    return max(map(abs, linkage.coordinate_differences(back, start.x))) <= MAX_BRANCH_JUMP


def _one_turn(samples: list[BranchSample], start: float) -> list[BranchSample]:
    """Return one turn of samples around the start; a longer branch has two poses at an angle."""
    if samples[-1].alpha - samples[0].alpha < TURN:
        return samples
    first = min(max(samples[0].alpha, start - pi), samples[-1].alpha - TURN)
    return [sample for sample in samples if first <= sample.alpha <= first + TURN]
