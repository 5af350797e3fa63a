"""Refinement of a leg: its path by exact derivatives, its poses and limits by differences."""

from dataclasses import dataclass
from typing import Any, NamedTuple

from klann_ros.kinematics import GeometryError, Linkage, linkage_poses, moved_numbers, Variants
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import AnyArray, ComplexArray, FloatArray, plane_vectors
import numpy as np

from .evolve import Scores, variant_scores
from .figures import crank_angles
from .poses import PoseTarget
from .requirements import Requirements
from .space import Space
from .target import PathFit, Target

MAX_STEPS = 100
# Steps towards limits alone, and towards poses for each weight.
MAX_LIMIT_STEPS = 40
# Crank angles by which the length of a path is measured, the nearest point of it is sought, and
# poses are.
PATH_ANGLES, NEAREST_ANGLES, POSE_ANGLES = 360, 4096, 720
# The step of differences of poses; the weights of exact ones, from run to run.
POSE_STEP = 1e-5
EXACT_WEIGHTS = (1.0, 1e2, 1e4)
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
    Return a candidate nearer to its path, on which it is placed, its poses, and its limits.

    Levenberg-Marquardt on the distances of corresponding points and from the poses, of which exact
    ones count more from one run to the next, and on what limits lack; x of shape (d,). Raises a
    GeometryError if it is no linkage.
    """
    target = requirements.target
    poses = requirements.poses
    motion = None
    alphas = np.empty(0)
    variable_count = len(x)
    weights: tuple[float, ...] = (1.0,)
    if target is not None:
        motion = target.fit(linkage_poses(_linkage(space, x), crank_angles(PATH_ANGLES)).h[None])
        variable_count += 1 + target.can_turn + target.can_scale + 2 * target.can_move
    if poses is not None:
        turn: Any = linkage_poses(_linkage(space, x), crank_angles(POSE_ANGLES), points=True)
        alphas = poses.locate(space.linkage.structure, turn.points[None])[0][0]
        variable_count += 1 if poses.is_timed else len(alphas)
        weights = EXACT_WEIGHTS if poses.is_exact.any() else weights
    start = np.zeros(variable_count)
    start[: len(x)] = x
    variables = start
    for weight in weights:
        fit = _Fit(requirements, space, motion, alphas, weight)
        variables = _least_squares(fit, variables)
    candidates = []
    for candidate in (start, variables):
        violation = float(fit.scores(candidate[None]).total[0])
        candidates.append((violation, fit.error(candidate), candidate))
    best = min(candidates, key=lambda candidate: candidate[:2])[-1]
    return fit.legs(best[None])[0]


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
    fixed = target.fixed
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
    nearest = KDTree(turn.h).query(plane_vectors(target.points))[1]
    rates = turn.h_1[nearest] @ (1.0, 1j)
    gap = target.points - turn.h[nearest] @ (1.0, 1j)
    # The distance from the tangent there.
    across = (np.conj(rates) * gap).imag / np.maximum(np.abs(rates), 1e-12)
    return float(np.sqrt((across**2).mean()))


@dataclass(frozen=True, eq=False)
class _Fit:
    """
    The fit of candidates of a space, from the motion that places the first one on its path.

    Its variables are the dimensions x in [0, 1]; with a path also the offset of its start
    [periods] and, as far as they are free, the rotation [rad], the logarithm of the scale, and the
    shift [m]; with poses the changes of their crank angles `alphas` [rad], or one for all if they
    are timed.
    """

    requirements: Requirements
    space: Space
    motion: PathFit | None
    alphas: FloatArray
    exact_weight: float

    def legs(self, variables: FloatArray) -> Variants:
        """Return legs near the first, in their places, variables of shape (n, d)."""
        variants = self.space.variants(variables[:, : len(self.space.names)])
        factor, shift = self._place(variables)
        numbers = moved_numbers(variants.base.structure, [*variants.numbers], factor, shift)
        changes = dict(zip(variants.base.dimensions, numbers, strict=True))
        first = variants[0].moved(complex(factor[0]), complex(shift[0]))
        return Variants(first, changes, assembly=variants.signs)

    def scores(self, variables: FloatArray) -> Scores:
        """Return the scores of legs near the first, in their places."""
        return variant_scores(self.requirements.without_motion(), self.legs(variables))

    def error(self, variables: FloatArray) -> float:
        """Return the distances from path and poses; infinite if it does not reach them."""
        target = self.requirements.target
        error = float(np.linalg.norm(self._pose_residuals(variables).values))
        if target is not None:
            error += path_error(target, self.legs(variables[None])[0])
        return float('inf') if np.isnan(error) else error

    def residuals(self, variables: FloatArray) -> _Residuals | None:
        """Return the residuals; None if the candidate does not turn."""
        try:
            path = self._path_residuals(variables)
            poses = self._pose_residuals(variables)
        except GeometryError:
            return None
        if path is None or not np.isfinite(poses.values).all():
            return None
        values = np.concatenate([path.values, poses.values])
        jacobian = np.vstack([path.jacobian, np.nan_to_num(poses.jacobian)])
        return self._with_limits(variables, _Residuals(values, jacobian))

    def _place(self, variables: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the factors and shifts of z -> factor z + shift, shapes (n,) or (1,)."""
        target = self.requirements.target
        if target is None or self.motion is None:
            return np.ones(1, dtype=np.complex128), np.zeros(1, dtype=np.complex128)
        first_motion = len(self.space.names) + 1
        columns = iter(variables.T[first_motion:])
        rotation = next(columns) if target.can_turn else 0.0
        growth = next(columns) if target.can_scale else 0.0
        shift = next(columns) + 1j * next(columns) if target.can_move else 0.0
        factor = self.motion.factor * np.exp(growth + 1j * rotation)
        return factor, self.motion.shift + shift

    def _path_residuals(self, variables: FloatArray) -> _Residuals | None:
        target = self.requirements.target
        x = variables[: len(self.space.names)]
        leg = _linkage(self.space, x)
        if target is None or self.motion is None:
            return _Residuals(np.empty(0), np.empty((0, len(variables))))
        offset = float(self.motion.offset[0]) + float(variables[len(x)])
        sense = float(self.motion.sense[0])
        samples = _foot_samples(target, leg, offset, sense, has_gradients=True)
        if samples is None:
            return None
        factor, shift = self._place(variables[None])
        path = factor * samples.feet
        by_x = samples.by_numbers @ _number_derivatives(self.space, x)
        columns: list[AnyArray] = [factor * by_x, factor * samples.by_offset[:, None]]
        if target.can_turn:
            columns.append(1j * path[:, None])
        if target.can_scale:
            columns.append(path[:, None])
        if target.can_move:
            columns += [np.ones((len(path), 1)), np.full((len(path), 1), 1j)]
        gap = path + shift - target.samples
        by_motion = np.hstack(columns)
        jacobian = np.zeros((len(path), len(variables)), dtype=np.complex128)
        jacobian[:, : by_motion.shape[1]] = by_motion
        stacked = np.concatenate([gap.real, gap.imag])
        return _Residuals(stacked, np.vstack([jacobian.real, jacobian.imag]))

    def _pose_residuals(self, variables: FloatArray) -> _Residuals:
        """Return the distances from poses, and their derivatives by central differences."""
        poses = self.requirements.poses
        jacobian = np.zeros((4 * len(self.alphas), len(variables)))
        if poses is None:
            return _Residuals(np.empty(0), jacobian)
        count = len(self.space.names)
        x = variables[None, :count]
        first_angle = len(variables) - (1 if poses.is_timed else len(self.alphas))
        alphas = self.alphas + variables[first_angle:]
        steps = POSE_STEP * np.concatenate([np.eye(count), -np.eye(count)])
        beside = self._pose_distances(poses, x + steps, alphas)
        jacobian[:, :count] = (beside[:count] - beside[count:]).T / (2.0 * POSE_STEP)
        turned = self._pose_distances(poses, x, alphas + POSE_STEP * np.array([[1.0], [-1.0]]))[0]
        by_angle = (turned[0] - turned[1]) / (2.0 * POSE_STEP)
        # Four parts of each distance.
        columns = 0 if poses.is_timed else np.arange(len(by_angle)) // 4
        jacobian[np.arange(len(by_angle)), first_angle + columns] = by_angle
        return _Residuals(self._pose_distances(poses, x, alphas)[0], jacobian)

    def _pose_distances(self, poses: PoseTarget, x: FloatArray, alphas: FloatArray) -> FloatArray:
        """Return the weighted parts of n candidates' distances, shape (n, ..., 4 k) [m]."""
        turn: Any = linkage_poses(self.space.variants(x), alphas, points=True)
        weights = np.where(poses.is_exact, self.exact_weight, 1.0)
        if self.requirements.target is not None:
            weights *= np.sqrt(len(self.requirements.target.samples) / len(weights))
        parts = weights[:, None] * poses.misses(self.space.linkage.structure, turn.points)
        table = np.concatenate([parts.real, parts.imag], axis=-1)
        return np.reshape(table, (*table.shape[:-2], -1))

    def _with_limits(self, variables: FloatArray, distances: _Residuals) -> _Residuals | None:
        """Return the residuals with a row for each limit, its violation, by differences."""
        if not self.requirements.evolved_limits:
            return distances
        size = len(variables)
        steps = LIMIT_STEP * np.concatenate([np.eye(size), -np.eye(size)])
        scores = self.scores(variables[None])
        if scores.violations[0, 0] > 0.0:
            return None
        violations = np.maximum(0.0, scores.violations[0, 1:])
        jacobian = np.zeros((len(violations), size))
        if violations.any():
            table = self.scores(variables + steps).violations[:, 1:]
            difference = (table[:size] - table[size:]).T / (2.0 * LIMIT_STEP)
            jacobian[violations > 0.0] = difference[violations > 0.0]
        # A limit weighs more than the distances, of which it may cost a part.
        weight = 1.0
        if len(distances.values):
            target = self.requirements.target
            length = self.space.linkage.size if target is None else target.size
            weight = LIMIT_WEIGHT * length * np.sqrt(len(distances.values))
        return _Residuals(
            np.concatenate([distances.values, weight * violations]),
            np.vstack([distances.jacobian, weight * jacobian]),
        )


def _linkage(space: Space, x: FloatArray) -> Linkage:
    return space.variants(x[None])[0]


def _least_squares(fit: _Fit, start: FloatArray) -> FloatArray:
    """Return the variables of least residuals near a start."""
    # It takes half a second to load.
    from scipy.optimize import least_squares  # noqa: PLC0415

    last: dict[bytes, _Residuals] = {}
    first = fit.residuals(start)
    if first is None or not first.values.any():
        return start

    def residuals_at(step: FloatArray) -> _Residuals:
        key = step.tobytes()
        if key not in last:
            residuals = fit.residuals(start + step)
            # A leg that does not turn is no way out: worse than any.
            last.clear()
            last[key] = residuals or _Residuals(WORSE * first.values, first.jacobian)
        return last[key]

    dimension_count = len(fit.space.names)
    low = np.full(len(start), -np.inf)
    high = np.full(len(start), np.inf)
    low[:dimension_count] = -start[:dimension_count] - MARGIN
    high[:dimension_count] = 1.0 - start[:dimension_count] + MARGIN
    solution = least_squares(
        lambda step: residuals_at(step).values,
        np.zeros(len(start)),
        jac=lambda step: residuals_at(step).jacobian,
        bounds=(low, high),
        max_nfev=MAX_LIMIT_STEPS if fit.requirements.target is None else MAX_STEPS,
        xtol=1e-10,
        ftol=MIN_GAIN,
        gtol=1e-15,
        # Beside dimensions in [0, 1] crank angles are as large.
        x_scale='jac' if fit.requirements.poses is None else 1.0,
    )
    variables: FloatArray = start + solution.x
    variables[:dimension_count] = np.clip(variables[:dimension_count], 0.0, 1.0)
    return variables


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
    rates = turn.h_1 @ (1.0, 1j)
    speeds = np.abs(rates)
    length_at = _integral(speeds)
    length = float(length_at(TURN))
    alphas = TURN * fractions if target.is_timed else _angles_at(fractions * length, length_at)
    poses: Any = linkage_poses(leg, alphas, velocities=True, gradients=has_gradients)
    if poses.reason.any():
        return None
    by_offset = TURN * (poses.h_1 @ (1.0, 1j))
    by_numbers = np.empty((count, 0), dtype=np.complex128)
    if has_gradients:
        by_numbers = (1.0, 1j) @ poses.h_gradient
    if target.is_timed:
        return _FootSamples(poses.h @ (1.0, 1j), by_offset, by_numbers)
    slowest = MIN_GAIN * length
    tangents = by_offset / np.maximum(np.abs(by_offset), slowest)
    if has_gradients:
        turn_tangents = rates / np.maximum(speeds, slowest)
        stretch = np.conj(turn_tangents)[:, None] * ((1.0, 1j) @ turn.h_1_gradient)
        stretch_at = _integral(stretch.real)
        along = fractions[:, None] * stretch_at(TURN) - stretch_at(alphas)
        by_numbers += tangents[:, None] * along
    return _FootSamples(poses.h @ (1.0, 1j), length * tangents, by_numbers)


def _angles_at(lengths: FloatArray, length_at: Any) -> FloatArray:
    """Return the crank angles at lengths of a path from the crank angle 0."""
    ends = np.linspace(0.0, TURN, PATH_ANGLES + 1)
    alphas = np.interp(lengths, length_at(ends), ends)
    for _ in range(CORRECTIONS):
        slopes = np.maximum(length_at(alphas, 1), MIN_GAIN * length_at(TURN))
        step = (lengths - length_at(alphas)) / slopes
        alphas += np.clip(step, -TURN / PATH_ANGLES, TURN / PATH_ANGLES)
        alphas = np.clip(alphas, 0.0, TURN)
    return np.asarray(alphas, dtype=np.float64)


def _integral(samples: FloatArray) -> Any:
    """Return the spline of the integral of samples over a turn from 0, shape (k, ...)."""
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - see `_least_squares`

    angles = np.linspace(0.0, TURN, len(samples) + 1)
    closed = np.concatenate([samples, samples[:1]])
    return CubicSpline(angles, closed, bc_type='periodic').antiderivative()


def _number_derivatives(space: Space, x: FloatArray) -> FloatArray:
    """Return the derivatives of all dimensions by the variables, shape (dimensions, d)."""
    count = len(x)
    step = 1e-3
    # Dimensions are at most of second degree in the variables: these are exact.
    stencil = np.concatenate([x + step * np.eye(count), x - step * np.eye(count)])
    numbers = space.variants(stencil).numbers
    return np.asarray((numbers[:, :count] - numbers[:, count:]) / (2.0 * step))
