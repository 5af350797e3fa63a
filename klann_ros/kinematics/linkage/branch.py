"""
The assembly branch of coupled loops: the poses that the crank reaches from the start.

There is no closed form for coupled loops. Their branch is followed once, in small steps, through
singular poses only where it goes on smoothly, and kept as a table. A guess at any crank angle is
the nearest pose in it, led on along its tangent.
"""

from bisect import bisect_left
from collections.abc import Sequence
from contextlib import suppress
from functools import cache, partial
from math import isnan
from operator import itemgetter
from typing import NamedTuple

from klann_ros.kinematics.angles import Arc, TURN
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.errors import GeometryError, LoopsOpenError
import numpy as np

from .change_points import ChangePoint, MAX_PERIOD, SignChanges
from .equations import LoopEquations
from .step import MAX_BRANCH_JUMP, step_functions

# Crank step between the table's poses [rad]: 1/8 of the safe tangent step of the Klann leg.
BRANCH_STEP = 0.05
# The branch ends where smaller steps fail [rad].
MIN_BRANCH_STEP = 1e-9
TOLERANCE = 1e-9
ITERATIONS = 6
# Steps of the poses before a change point, which lead across it [rad], and the largest error of
# the pose beyond it and of its derivative [rad, size].
CROSSING_STEP = 0.002
MAX_CROSSING_ERROR = 1e-4
MAX_RATE_ERROR = 1e-2
# A block whose sine falls below this, and rises again, passed a change point.
CONTACT_SINE = 1e-6
# The poses before it, and their weights at one step beyond it.
_BEFORE = -np.arange(1.0, 9.0)
_EXTRAPOLATION = np.linalg.inv(np.vander(_BEFORE, increasing=True)).sum(axis=0)
# Fields of a corrected pose: x, coefficients and sines, see LinkagePose.
_POSE_FIELDS = itemgetter(1, 5, 6)


class BranchSample(NamedTuple):
    """A pose: crank angle, the other angles and their derivatives [rad]."""

    alpha: float
    x: tuple[float, ...]
    x_1: tuple[float, ...]
    # The signs of the blocks, and the smallest of their sines.
    signs: tuple[int, ...]
    sine: float

    def predict(self, step: float) -> tuple[float, ...]:
        """Return the angles a step of the crank further on, to first order."""
        return tuple(x + step * x_1 for x, x_1 in zip(self.x, self.x_1, strict=True))


class Branch:
    """
    The poses of a linkage along its branch, over a whole turn, several, or an arc.

    Made of a linkage that ends with the coupled loops of block number `block`, and a start: every
    coordinate, the crank's angle first [rad, m]. If it `crosses` change points it goes on where
    the determinant of a block passes 0 linearly and the poses go on smoothly; at the end of an arc
    they go like a square root. A GeometryError says that it is nearly singular at its start, or
    not back there after a turn.
    """

    def __init__(
        self, linkage: LoopEquations, start: Sequence[float], block: int, *, crosses: bool
    ) -> None:
        self.block = block
        self._crosses = crosses
        # The turns after which all loops are back.
        self.period = 1
        self._linkage = linkage
        bodies = linkage.structure.bodies[1:]
        self._sizes = np.array([linkage.size if body.slides else 1.0 for body in bodies])
        self._functions_of = cache(partial(step_functions, linkage, tuple))
        self.change_points: list[ChangePoint] = []
        alpha, *x = start
        first = self._sample(alpha, tuple(x), linkage.assembly)
        if first is None:
            text = (
                'its coupled loops cannot be followed from the start: it is nearly singular there'
            )
            raise GeometryError(text)
        samples = self._follow(first, 1.0)
        self._is_turn = self._is_back(samples)
        if not self._is_turn:
            samples = [*reversed(self._follow(first, -1.0)[1:]), *samples]
        self._samples = samples
        self._first = samples[0].alpha
        self._last = samples[-1].alpha
        if not self._is_turn and self._last - self._first >= TURN:
            raise GeometryError(
                'its coupled loops are not back where they were after a turn of the crank: one '
                'crank angle has two poses, and such a linkage is not solved'
            )

        # The signs of its blocks along the path.
        self.sign_changes: list[SignChanges] = []
        for number, sign in enumerate(linkage.assembly, 1):
            points = [point for point in self.change_points if point.block == number]
            offsets = sorted((point.beta - alpha) % self._span for point in points)
            self.sign_changes.append(SignChanges(sign, alpha, tuple(offsets), self._span))

    @property
    def arc(self) -> Arc:
        """Return the crank angles of its ends [rad]; (0, 2 pi) for a whole turn."""
        return (0.0, TURN) if self._is_turn else (self._first, self._last)

    def x(self, alpha: float) -> tuple[float, ...]:
        """Return the angles at a path angle [rad]; a LoopsOpenError beyond the branch."""
        branch_alpha = self._within(alpha)
        i = bisect_left(self._samples, branch_alpha, key=lambda sample: sample.alpha)
        neighbours = self._samples[slice(max(0, i - 1), i + 1)]
        nearest = min(neighbours, key=lambda sample: abs(sample.alpha - branch_alpha))
        if self._first <= branch_alpha <= self._last:
            guess = nearest.predict(branch_alpha - nearest.alpha)
            signs = tuple(int(changes.signs_at(branch_alpha)) for changes in self.sign_changes)
            sample = self._corrected(alpha, guess, signs)
            if sample is not None:
                return sample.x
        raise LoopsOpenError(alpha, self.block, alpha + nearest.alpha - branch_alpha)

    def angles(self, alphas: FloatArray) -> FloatArray:
        """Return the angles at many path angles, shape (n - 1, k); NaN beyond the branch."""
        angles = np.full((len(alphas), len(self._samples[0].x)), np.nan)
        for n, alpha in enumerate(alphas.tolist()):
            with suppress(LoopsOpenError):
                angles[n] = self.x(alpha)
        return angles.T

    def guesses(self, alphas: FloatArray) -> FloatArray:
        """Return guesses of the angles at many path angles, shape (n - 1, k); NaN beyond it."""
        samples, x, x_1, _, _ = zip(*self._samples, strict=True)
        sample_alphas = np.array(samples)
        angles = self._first + np.remainder(alphas - self._first, self._span)
        right = np.searchsorted(sample_alphas, angles).clip(1, len(samples) - 1)
        is_left = angles - sample_alphas[right - 1] < sample_alphas[right] - angles
        nearest = right - is_left
        steps = (angles - sample_alphas[nearest])[:, None]
        guesses = np.array(x)[nearest] + steps * np.array(x_1)[nearest]
        guesses[angles > self._last] = np.nan
        return np.asarray(guesses.T)

    @property
    def _span(self) -> float:
        return self.period * TURN

    def _sample(
        self, alpha: float, guess: tuple[float, ...], signs: tuple[int, ...]
    ) -> BranchSample | None:
        """Return the pose at a crank angle; None if the guess fails or it is singular."""
        sample = self._corrected(alpha, guess, signs)
        return None if sample is None or isnan(sample.x_1[0]) else sample

    def _corrected(
        self, alpha: float, guess: tuple[float, ...], signs: tuple[int, ...]
    ) -> BranchSample | None:
        pose = self._functions_of(signs).correct(alpha, guess, TOLERANCE, ITERATIONS)
        if pose is None:
            return None
        x, x_1, sines = _POSE_FIELDS(pose)
        return BranchSample(alpha, x, x_1, signs, min(sines))

    def _follow(self, first: BranchSample, direction: float) -> list[BranchSample]:
        """Return the poses from the first on, until it is back or the branch ends."""
        samples = [first]
        length = BRANCH_STEP
        while length > MIN_BRANCH_STEP:
            way = abs(samples[-1].alpha - first.alpha)
            if way >= self._span:
                # Through change points it may come back as another one: several turns.
                if self._is_back(samples) or not self.change_points or self.period >= MAX_PERIOD:
                    break
                self.period *= 2
            last = samples[-1]
            guess = last.predict(direction * length)
            sample = self._sample(last.alpha + direction * length, guess, last.signs)
            if sample is not None:
                # Its signs are those of the other motion, beyond a contact within rounding.
                is_beyond = self._crosses and last.sine < min(CONTACT_SINE, sample.sine)
                if is_beyond and self._cross(samples, direction):
                    length = BRANCH_STEP
                    continue
                samples.append(sample)
                length = min(BRANCH_STEP, 2.0 * length)
                continue
            length /= 2.0
            is_end = length <= MIN_BRANCH_STEP
            if is_end and self._crosses and self._cross(samples, direction):
                length = BRANCH_STEP
        return samples

    def _cross(self, samples: list[BranchSample], direction: float) -> bool:
        """
        Step across a change point after the last sample; return whether it is one.

        The poses at equal steps before it are led on to the other side by their polynomial, which
        tells the signs there; a pose that is not where it leads, with its derivatives, is on
        another branch.
        """
        end = samples[-1].alpha
        nodes = end + direction * CROSSING_STEP * _BEFORE
        signs = samples[-1].signs
        poses = []
        for node in nodes.tolist():
            near = min(samples, key=lambda sample: abs(sample.alpha - node))
            pose = self._sample(node, near.predict(node - near.alpha), signs)
            if pose is None or near.signs != signs:
                return False
            poses.append(pose)
        beyond = end + direction * CROSSING_STEP
        differences = self._linkage.coordinate_differences
        x = poses[0].x
        guess = np.array(x)
        guess += self._sizes * (_EXTRAPOLATION @ [differences(pose.x, x) for pose in poses])
        u = self._linkage.vectors(beyond, guess)
        after = tuple(1 if block.sine(u) > 0.0 else -1 for block in self._linkage.blocks)
        sample = self._sample(beyond, tuple(guess.tolist()), after)
        if sample is None:
            return False
        error_1 = np.array(sample.x_1) - _EXTRAPOLATION @ [pose.x_1 for pose in poses]
        error = max(map(abs, differences(sample.x, guess.tolist())))
        if error > MAX_CROSSING_ERROR or np.abs(error_1 / self._sizes).max() > MAX_RATE_ERROR:
            return False
        while abs(samples[-1].alpha - end) < 0.999 * CROSSING_STEP:
            samples.pop()
        samples.append(sample)
        for number, (sign, sign_after) in enumerate(zip(signs, after, strict=True), 1):
            if sign_after != sign:
                self.change_points.append(ChangePoint(end, number, 1))
        return True

    def _is_back(self, samples: Sequence[BranchSample]) -> bool:
        """Return whether samples are a whole period, after which the loops are back."""
        start = samples[0]
        end = samples[-1]
        if end.alpha - start.alpha < self._span or end.signs != start.signs:
            return False
        back = end.predict(start.alpha + self._span - end.alpha)
        differences = self._linkage.coordinate_differences(back, start.x)
        return max(map(abs, differences)) <= MAX_BRANCH_JUMP

    def _within(self, alpha: float) -> float:
        """Return the path angle, less whole periods, on the branch or nearest to it."""
        middle = (self._first + self._last) / 2.0
        return alpha - self._span * round((alpha - middle) / self._span)
