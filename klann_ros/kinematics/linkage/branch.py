"""
The assembly branch of coupled loops: the poses that the crank reaches from the start.

There is no closed form for coupled loops. Their branch is followed once, in small steps, through
singular poses only where it goes on smoothly, and kept as a table. A guess at any crank angle is
the nearest pose in it, led on along its tangent.
"""

from bisect import bisect_left
from collections.abc import Sequence
from contextlib import suppress
from math import isnan, pi
from operator import itemgetter
from typing import Any, NamedTuple, TypeAlias

from klann_ros.kinematics.angles import Arc, TURN
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.errors import GeometryError, LoopsOpenError, NotConvergedError
from klann_ros.kinematics.newton import newton_raphson
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
# Steps of the poses before a change point, which lead across it [rad], their number, and the
# largest error of the pose beyond it and of its derivative [rad, size].
CROSSING_STEP = 0.002
CROSSING_NODES = 8
MAX_CROSSING_ERROR = 1e-4
MAX_RATE_ERROR = 1e-2
_BEFORE = -np.arange(1.0, CROSSING_NODES + 1)
_POWERS = np.arange(CROSSING_NODES)
# The weights of the poses before it at one step beyond it.
_EXTRAPOLATION = np.linalg.inv(_BEFORE[:, None] ** _POWERS).sum(axis=0)
SignPair: TypeAlias = tuple[tuple[int, ...], tuple[int, ...]]
# Fields of a corrected pose: see LinkagePose.
_X_AND_COEFFICIENTS = itemgetter(1, 5)


class BranchSample(NamedTuple):
    """A pose: crank angle, the other angles and their derivatives [rad]."""

    alpha: float
    x: tuple[float, ...]
    x_1: tuple[float, ...]
    # The signs of the blocks.
    signs: tuple[int, ...]

    def predict(self, step: float) -> tuple[float, ...]:
        """Return the angles a step of the crank further on, to first order."""
        return tuple(x + step * x_1 for x, x_1 in zip(self.x, self.x_1, strict=True))


class Crossing(NamedTuple):
    """A change point: its path angle [rad], and the signs of the blocks before and after it."""

    alpha: float
    signs: SignPair


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
        self._correct: dict[tuple[int, ...], Any] = {}
        # The path angles where signs change, and the signs before and after [rad].
        self._crossings: list[Crossing] = []
        alpha, *x = start
        self._start = alpha
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

    @property
    def arc(self) -> Arc:
        """Return the crank angles of its ends [rad]; (0, 2 pi) for a whole turn."""
        return (0.0, TURN) if self._is_turn else (self._first, self._last)

    @property
    def gap(self) -> float | None:
        """Return a crank angle before the branch, beyond its ends [rad]; None for a whole turn."""
        return None if self._is_turn else (self._first + self._last) / 2.0 - pi

    @property
    def change_points(self) -> list[ChangePoint]:
        """Return its change points."""
        points = []
        for crossing in self._crossings:
            for b, (before, after) in enumerate(zip(*crossing.signs, strict=True)):
                if before != after:
                    points.append(ChangePoint(crossing.alpha, b + 1, 1))
        return points

    @property
    def sign_changes(self) -> list[SignChanges]:
        """Return the signs of its blocks along the path."""
        signs = []
        for b, sign in enumerate(self._linkage.assembly):
            offsets = []
            for point in self.change_points:
                if point.block == b + 1:
                    offsets.append((point.beta - self._start) % self._span)
            signs.append(SignChanges(sign, self._start, tuple(sorted(offsets)), self._span))
        return signs

    def x(self, alpha: float) -> tuple[float, ...]:
        """Return the angles at a path angle [rad]; a LoopsOpenError beyond the branch."""
        branch_alpha = self._within(alpha)
        nearest = self._nearest_sample(branch_alpha)
        if self._first <= branch_alpha <= self._last:
            guess = nearest.predict(branch_alpha - nearest.alpha)
            sample = self._corrected(alpha, guess, self._signs(branch_alpha))
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
        samples, x, x_1, _ = zip(*self._samples, strict=True)
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

    def _signs(self, alpha: float) -> tuple[int, ...]:
        """Return the signs at a path angle on the branch."""
        signs = self._samples[0].signs
        for crossing in sorted(self._crossings):
            if crossing.alpha > alpha:
                break
            signs = crossing.signs[1]
        return signs

    def _sample(
        self, alpha: float, guess: tuple[float, ...], signs: tuple[int, ...]
    ) -> BranchSample | None:
        """Return the pose at a crank angle; None if the guess fails or it is singular."""
        sample = self._corrected(alpha, guess, signs)
        return None if sample is None or isnan(sample.x_1[0]) else sample

    def _corrected(
        self, alpha: float, guess: tuple[float, ...], signs: tuple[int, ...]
    ) -> BranchSample | None:
        if signs not in self._correct:
            self._correct[signs] = step_functions(self._linkage, tuple, signs).correct
        pose = self._correct[signs](alpha, guess, TOLERANCE, ITERATIONS)
        if pose is None:
            return None
        x, x_1 = _X_AND_COEFFICIENTS(pose)
        return BranchSample(alpha, x, x_1, signs)

    def _follow(self, first: BranchSample, direction: float) -> list[BranchSample]:
        """Return the poses from the first on, until it is back or the branch ends."""
        samples = [first]
        length = BRANCH_STEP
        while length > MIN_BRANCH_STEP:
            way = abs(samples[-1].alpha - first.alpha)
            if way >= self._span:
                # A branch that comes back as another one has several turns, if it has crossings.
                if self._is_back(samples) or not self._crossings or self.period >= MAX_PERIOD:
                    break
                self.period *= 2
            last = samples[-1]
            guess = last.predict(direction * length)
            sample = self._sample(last.alpha + direction * length, guess, last.signs)
            if sample is not None:
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

        The poses at equal steps before it are led on to the other side by their polynomial. There
        the signs are free; a pose that is not where the polynomial leads, with its derivatives,
        is on another branch.
        """
        end = samples[-1].alpha
        nodes = end - direction * CROSSING_STEP * np.arange(1.0, CROSSING_NODES + 1)
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
        bodies = self._linkage.structure.bodies[1:]
        sizes = np.array([self._linkage.size if body.slides else 1.0 for body in bodies])
        guess += sizes * (_EXTRAPOLATION @ [differences(pose.x, x) for pose in poses])
        try:
            limits: Any = {'tolerance': TOLERANCE, 'max_iterations': ITERATIONS}
            solution = newton_raphson(self._linkage, beyond, guess, **limits)[-1].tolist()
        except NotConvergedError:
            return False
        after = self._signs_of(beyond, solution)
        sample = self._sample(beyond, tuple(solution), after)
        if sample is None:
            return False
        error_1 = (np.array(sample.x_1) - _EXTRAPOLATION @ [pose.x_1 for pose in poses]) / sizes
        error = max(map(abs, differences(sample.x, guess.tolist())))
        if error > MAX_CROSSING_ERROR or np.abs(error_1).max() > MAX_RATE_ERROR:
            return False
        while abs(samples[-1].alpha - end) < 0.999 * CROSSING_STEP:
            samples.pop()
        samples.append(sample)
        if after != signs:
            pair = (signs, after) if direction > 0.0 else (after, signs)
            self._crossings.append(Crossing(self._zero(poses, pair, direction), pair))
        return True

    def _zero(self, poses: Sequence[BranchSample], signs: SignPair, direction: float) -> float:
        """Return the crank angle at which a sine that changes its sign is 0 [rad]."""
        block = self._linkage.blocks[[a != b for a, b in zip(*signs, strict=True)].index(True)]
        sines = [block.sine(self._linkage.vectors(pose.alpha, pose.x)) for pose in poses]
        polynomial = np.polynomial.Polynomial.fit(_BEFORE, sines, CROSSING_NODES - 1)
        roots = polynomial.roots()
        root = float(roots[np.abs(roots).argmin()].real)
        first = poses[0].alpha + direction * CROSSING_STEP
        return first + direction * CROSSING_STEP * root

    def _signs_of(self, alpha: float, x: Sequence[float]) -> tuple[int, ...]:
        u = self._linkage.vectors(alpha, x)
        return tuple(1 if block.sine(u) > 0.0 else -1 for block in self._linkage.blocks)

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

    def _nearest_sample(self, alpha: float) -> BranchSample:
        i = bisect_left(self._samples, alpha, key=lambda sample: sample.alpha)
        neighbours = self._samples[slice(max(0, i - 1), i + 1)]
        return min(neighbours, key=lambda sample: abs(sample.alpha - alpha))
