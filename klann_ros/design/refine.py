"""Refinement of a leg: its path by derivatives by every dimension, its limits by differences."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from klann_ros.kinematics import GeometryError, Linkage, linkage_poses, moved_numbers, Variants
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import AnyArray, ComplexArray, FloatArray
import numpy as np

from .evolve import Scores, variant_scores
from .figures import crank_angles
from .requirements import Requirements
from .space import Space
from .target import Target

MAX_STEPS = 100
# Steps towards limits alone.
MAX_LIMIT_STEPS = 40
# Crank angles by which the length of a path is measured, and the nearest point of it is sought.
PATH_ANGLES, NEAREST_ANGLES = 360, 4096
# Newton steps of crank angles on a path.
CORRECTIONS = 3
# A step that improves by a smaller part is the last one.
MIN_GAIN = 1e-6
# Limits: the step of their differences, and the weight of a relative shortfall [path's size].
LIMIT_STEP, LIMIT_WEIGHT = 1e-4, 10.0
# Steps of the point where a path starts, and the last one [periods].
MAX_OFFSET_STEPS, MIN_OFFSET_STEP = 20, 1e-13
# Residuals of a leg that does not turn; a start on an end of a range is just within it.
WORSE, MARGIN = 10.0, 1e-9


class _Point(NamedTuple):
    """Variables of the fit: dimensions x in [0, 1], z -> factor z + shift, start of the path."""

    x: FloatArray
    factor: complex
    shift: complex
    offset: float


class _Residuals(NamedTuple):
    """Distances of the target's samples from a path, shape (k,) [m], and their derivatives."""

    values: FloatArray
    jacobian: FloatArray


class _FootSamples(NamedTuple):
    """
    Feet z_k that correspond to the samples of a target, shape (k,) [m].

    `by_offset` are their derivatives by the offset, `by_numbers`, shape (k, d), by the dimensions.
    """

    feet: ComplexArray
    by_offset: ComplexArray
    by_numbers: ComplexArray


def refined(requirements: Requirements, space: Space, x: FloatArray) -> Linkage:
    """
    Return a candidate nearer to its path, on which it is placed, and its limits; x of shape (d,).

    Levenberg-Marquardt on the distances of corresponding points, with the derivatives of the foot
    by each dimension, and on what limits lack.

    Raises
    ------
    GeometryError
        It is no linkage.

    """
    target = requirements.target
    start = _Point(x, 1.0 + 0.0j, 0j, 0.0)
    sense = 1.0
    if target is not None:
        fit = target.fit(linkage_poses(_linkage(space, x), crank_angles(PATH_ANGLES)).h[None])
        start = _Point(x, complex(fit.factor[0]), complex(fit.shift[0]), float(fit.offset[0]))
        sense = float(fit.sense[0])
    fitted = _Fit(requirements, space, sense)
    candidates = []
    for point in (start, _least_squares(fitted, start)):
        leg = fitted.leg(point)
        error = 0.0 if target is None else path_error(target, leg)
        candidates.append((float(fitted.scores([point]).total[0]), error, leg))
    return min(candidates, key=lambda candidate: candidate[:2])[-1]


def leg_figures(requirements: Requirements, linkage: Linkage) -> dict[str, float]:
    """Return the figures of a linkage in its place, as the search has them (SI)."""
    placed = requirements.without_motion()
    columns = variant_scores(placed, Variants.of([linkage])).figures
    figures = {name: float(column[0]) for name, column in columns.items()}
    if requirements.target is not None:
        figures['path_error'] = path_error(requirements.target, linkage)
    return figures


def path_error(target: Target, linkage: Linkage) -> float:
    """
    Return the rms distance of a linkage's foot path from a target, where it is [m].

    With timing the feet are solved at the crank angles of the points.
    """
    fixed = replace(target, can_move=False, can_turn=False, can_scale=False)
    fit = fixed.fit(linkage_poses(linkage, crank_angles(PATH_ANGLES)).h[None])
    offset = float(fit.offset[0])
    least_square = np.inf
    for _ in range(MAX_OFFSET_STEPS):
        samples = _foot_samples(target, linkage, offset, float(fit.sense[0]))
        if samples is None:
            return float('inf')
        gap = samples.feet - fixed.samples
        least_square = min(least_square, float((np.abs(gap) ** 2).mean()))
        rate = samples.by_offset
        step = -float((np.conj(rate) * gap).real.sum() / (np.abs(rate) ** 2).sum())
        offset += step
        if abs(step) < MIN_OFFSET_STEP:
            break
    return float(np.sqrt(least_square))


def point_error(target: Target, linkage: Linkage) -> float:
    """Return the rms distance of the given points from the nearest of the foot path [m]."""
    if target.is_timed:
        return path_error(target, linkage)
    # It takes half a second to load.
    from scipy.spatial import KDTree  # noqa: PLC0415

    turn: Any = linkage_poses(linkage, crank_angles(NEAREST_ANGLES), velocities=True)
    if turn.reason.any():
        return float('inf')
    points = np.column_stack([target.points.real, target.points.imag])
    nearest = KDTree(turn.h).query(points)[1]
    rates = _complex(turn.h_1[nearest])
    gap = target.points - _complex(turn.h[nearest])
    # The distance from the tangent there.
    across = (np.conj(rates) * gap).imag / np.maximum(np.abs(rates), 1e-12)
    return float(np.sqrt((across**2).mean()))


@dataclass(frozen=True, eq=False)
class _Fit:
    """The fit of a candidate of a space; `sense` is the direction of travel along the target."""

    requirements: Requirements
    space: Space
    sense: float

    def leg(self, point: _Point) -> Linkage:
        """Return the linkage of a point, in its place."""
        leg = _linkage(self.space, point.x)
        return leg if self.requirements.target is None else leg.moved(point.factor, point.shift)

    def scores(self, points: Sequence[_Point]) -> Scores:
        """Return the scores of legs near the first, in their places."""
        variants = self.space.variants(np.array([point.x for point in points]))
        base = self.leg(points[0])
        factor = np.array([point.factor for point in points])
        shift = np.array([point.shift for point in points])
        numbers = moved_numbers(base.structure, [*variants.numbers], factor, shift)
        changes = dict(zip(base.dimensions, numbers, strict=True))
        moved = Variants(base, changes, assembly=variants.signs)
        return variant_scores(self.requirements.without_motion(), moved)

    def residuals(self, point: _Point) -> _Residuals | None:
        """Return the residuals; None if the candidate does not turn."""
        try:
            path = self._path_residuals(point)
            return path and self._with_limits(point, path)
        except GeometryError:
            return None

    def stepped(self, point: _Point, step: FloatArray) -> _Point:
        """Return a point after a step, in the order of the Jacobian's columns."""
        target = self.requirements.target
        count = len(point.x)
        if target is None:
            return point._replace(x=point.x + step)
        motion = iter(step[count:].tolist())
        offset = point.offset + next(motion)
        rotation = next(motion) if target.can_turn else 0.0
        growth = next(motion) if target.can_scale else 0.0
        shift = complex(next(motion), next(motion)) if target.can_move else 0j
        factor = point.factor * np.exp(growth + 1j * rotation)
        return _Point(point.x + step[:count], complex(factor), point.shift + shift, offset)

    def _path_residuals(self, point: _Point) -> _Residuals | None:
        target = self.requirements.target
        leg = _linkage(self.space, point.x)
        if target is None:
            return _Residuals(np.empty(0), np.empty((0, len(point.x))))
        samples = _foot_samples(target, leg, point.offset, self.sense, has_gradients=True)
        if samples is None:
            return None
        path = point.factor * samples.feet
        by_x = samples.by_numbers @ _number_derivatives(self.space, point.x)
        by_offset = point.factor * samples.by_offset[:, None]
        columns: list[AnyArray] = [point.factor * by_x, by_offset]
        if target.can_turn:
            columns.append(1j * path[:, None])
        if target.can_scale:
            columns.append(path[:, None])
        if target.can_move:
            columns += [np.ones((len(path), 1)), np.full((len(path), 1), 1j)]
        gap = path + point.shift - target.samples
        jacobian = np.hstack(columns)
        stacked = np.concatenate([gap.real, gap.imag])
        return _Residuals(stacked, np.vstack([jacobian.real, jacobian.imag]))

    def _with_limits(self, point: _Point, path: _Residuals) -> _Residuals | None:
        """Return the residuals with a row for each limit, its violation, by differences."""
        if not self.requirements.evolved_limits:
            return path
        size = path.jacobian.shape[1]
        steps = LIMIT_STEP * np.concatenate([np.eye(size), -np.eye(size)])
        scores = self.scores([point])
        if scores.violations[0, 0] > 0.0:
            return None
        violations = np.maximum(0.0, scores.violations[0, 1:])
        jacobian = np.zeros((len(violations), size))
        if violations.any():
            table = self.scores([self.stepped(point, step) for step in steps]).violations[:, 1:]
            difference = (table[:size] - table[size:]).T / (2.0 * LIMIT_STEP)
            jacobian[violations > 0.0] = difference[violations > 0.0]
        # A limit weighs more than the path, of which it may cost a part.
        weight = 1.0
        if self.requirements.target is not None:
            weight = LIMIT_WEIGHT * self.requirements.target.size * np.sqrt(len(path.values))
        return _Residuals(
            np.concatenate([path.values, weight * violations]),
            np.vstack([path.jacobian, weight * jacobian]),
        )


def _linkage(space: Space, x: FloatArray) -> Linkage:
    return space.variants(x[None])[0]


def _least_squares(fit: _Fit, start: _Point) -> _Point:
    """Return the point of least residuals near a start."""
    # It takes half a second to load.
    from scipy.optimize import least_squares  # noqa: PLC0415

    last: dict[bytes, _Residuals] = {}
    first = fit.residuals(start)
    if first is None or not first.values.any():
        return start

    def residuals_at(step: FloatArray) -> _Residuals:
        key = step.tobytes()
        if key not in last:
            residuals = fit.residuals(fit.stepped(start, step))
            # A leg that does not turn is no way out: worse than any.
            last.clear()
            last[key] = residuals or _Residuals(WORSE * first.values, first.jacobian)
        return last[key]

    dimension_count = len(start.x)
    step_size = first.jacobian.shape[1]
    low = np.full(step_size, -np.inf)
    high = np.full(step_size, np.inf)
    low[:dimension_count] = -start.x - MARGIN
    high[:dimension_count] = 1.0 - start.x + MARGIN
    solution = least_squares(
        lambda step: residuals_at(step).values,
        np.zeros(step_size),
        jac=lambda step: residuals_at(step).jacobian,
        bounds=(low, high),
        max_nfev=MAX_LIMIT_STEPS if fit.requirements.target is None else MAX_STEPS,
        xtol=1e-10,
        ftol=MIN_GAIN,
        gtol=1e-15,
        x_scale='jac',
    )
    point = fit.stepped(start, solution.x)
    return point._replace(x=np.clip(point.x, 0.0, 1.0))


def _foot_samples(
    target: Target, leg: Linkage, offset: float, sense: float, *, has_gradients: bool = False
) -> _FootSamples | None:
    """
    Return the feet that correspond to a target's samples; None if the leg does not turn.

    With timing they are at equal steps of the crank; without, at equal steps of the path's length.
    With the length s(alpha) from the crank angle 0, S of the whole path and the unit tangent t,
    the foot at s = f S moves by dh/dx + t (f dS/dx - ds/dx) with a dimension x.
    """
    count = len(target.samples)
    fractions = np.remainder(offset + sense * np.arange(count) / count, 1.0)
    angles = crank_angles(PATH_ANGLES)
    has_stretch = has_gradients and not target.is_timed
    turn: Any = linkage_poses(leg, angles, velocities=True, gradients=has_stretch)
    # It must turn between the samples, too.
    if turn.reason.any():
        return None
    rates = _complex(turn.h_1)
    speeds = np.abs(rates)
    lengths = _integral(speeds)
    alphas = TURN * fractions if target.is_timed else _angles_at(fractions, speeds, lengths)
    poses: Any = linkage_poses(leg, alphas, velocities=True, gradients=has_gradients)
    if poses.reason.any():
        return None
    by_offset = TURN * _complex(poses.h_1)
    by_numbers = np.empty((count, 0), dtype=np.complex128)
    if has_gradients:
        by_numbers = _complex(poses.h_gradient, axis=1)
    if target.is_timed:
        return _FootSamples(_complex(poses.h), by_offset, by_numbers)
    slowest = MIN_GAIN * lengths[-1]
    tangents = by_offset / np.maximum(np.abs(by_offset), slowest)
    if has_gradients:
        turn_tangents = rates / np.maximum(speeds, slowest)
        stretch = np.conj(turn_tangents)[:, None] * _complex(turn.h_1_gradient, axis=1)
        stretches = _integral(stretch.real)
        places = alphas / TURN * PATH_ANGLES
        index = np.clip(places.astype(np.intp), 0, PATH_ANGLES - 1)
        share = (places - index)[:, None]
        along = stretches[index] + share * (stretches[index + 1] - stretches[index])
        by_numbers += tangents[:, None] * (fractions[:, None] * stretches[-1] - along)
    return _FootSamples(_complex(poses.h), lengths[-1] * tangents, by_numbers)


def _angles_at(fractions: FloatArray, speeds: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return the crank angles at fractions of a path's length, from its speeds over a turn."""
    from scipy.interpolate import CubicHermiteSpline  # noqa: PLC0415 - see `_least_squares`

    ends = crank_angles(PATH_ANGLES + 1) * ((PATH_ANGLES + 1) / PATH_ANGLES)
    length_at = CubicHermiteSpline(ends, lengths, np.append(speeds, speeds[0]))
    wanted = fractions * lengths[-1]
    alphas = np.interp(wanted, lengths, ends)
    for _ in range(CORRECTIONS):
        slopes = np.maximum(length_at(alphas, 1), MIN_GAIN * lengths[-1])
        step = (wanted - length_at(alphas)) / slopes
        alphas = alphas + np.clip(step, -TURN / PATH_ANGLES, TURN / PATH_ANGLES)
    return np.asarray(alphas, dtype=np.float64)


def _complex(vectors: FloatArray, axis: int = -1) -> ComplexArray:
    """Return vectors of two coordinates along an axis as complex numbers."""
    x, y = np.moveaxis(vectors, axis, 0)
    return np.asarray(x + 1j * y)


def _integral(samples: FloatArray) -> FloatArray:
    """Return the integral over a turn from 0 to each sample, and to the end, to fourth order."""
    following = np.roll(samples, -1, axis=0)
    outer = np.roll(samples, 1, axis=0) + np.roll(samples, -2, axis=0)
    parts = (13.0 * (samples + following) - outer) * (TURN / len(samples) / 24.0)
    return np.concatenate([np.zeros((1, *samples.shape[1:])), np.cumsum(parts, axis=0)])


def _number_derivatives(space: Space, x: FloatArray) -> FloatArray:
    """Return the derivatives of all dimensions by the variables, shape (dimensions, d)."""
    count = len(x)
    step = 1e-3
    # Dimensions are at most of second degree in the variables: these are exact.
    stencil = np.concatenate([x + step * np.eye(count), x - step * np.eye(count)])
    numbers = space.variants(stencil).numbers
    return np.asarray((numbers[:, :count] - numbers[:, count:]) / (2.0 * step))
