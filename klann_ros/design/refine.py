"""Refinement of a leg on its path, by the derivatives of the foot by every dimension."""

from dataclasses import replace
from typing import Any, NamedTuple

from klann_ros.kinematics import GeometryError, Linkage, linkage_poses
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import AnyArray, ComplexArray, FloatArray
import numpy as np

from .figures import CANDIDATE_ANGLES, crank_angles
from .space import Space
from .target import Target

MAX_STEPS = 100
# Crank angles by which the length of a path is measured, and a point nearest to another is sought.
PATH_ANGLES, NEAREST_ANGLES = 360, 1024
# Newton steps of crank angles on a path.
CORRECTIONS = 3
# A step that improves by a smaller part is the last one.
MIN_GAIN = 1e-6
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

    @property
    def cost(self) -> float:
        return float(self.values @ self.values)


class _FootSamples(NamedTuple):
    """
    Feet z_k that correspond to the samples of a target, shape (k,) [m].

    `by_offset` are their derivatives by the offset, `by_numbers`, shape (k, d), by the dimensions.
    """

    feet: ComplexArray
    by_offset: ComplexArray
    by_numbers: ComplexArray


def refined(target: Target, space: Space, x: FloatArray) -> tuple[Linkage, float]:
    """
    Return a candidate nearer to a path, placed on it, and its error; x of shape (d,).

    Levenberg-Marquardt on the distances of corresponding points, with the derivatives of the foot
    by each dimension.

    Raises
    ------
    GeometryError
        It is no linkage.

    """
    drawn = _linkage(space, x)
    fit = target.fit(linkage_poses(drawn, crank_angles(PATH_ANGLES)).h[None])
    start = _Point(x, complex(fit.factor[0]), complex(fit.shift[0]), float(fit.offset[0]))
    minimum = _least_squares(target, space, start, float(fit.sense[0]))
    candidates = []
    for point in (start, minimum):
        leg = _linkage(space, point.x).moved(point.factor, point.shift)
        candidates.append((leg, path_error(target, leg)))
    return min(candidates, key=lambda candidate: candidate[1])


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

    grid = crank_angles(NEAREST_ANGLES)
    grid_poses = linkage_poses(linkage, grid)
    if grid_poses.reason.any():
        return float('inf')
    points = np.column_stack([target.points.real, target.points.imag])
    alphas = grid[KDTree(grid_poses.h).query(points)[1]]
    distances = np.empty(len(points))
    for _ in range(CORRECTIONS):
        poses: Any = linkage_poses(linkage, alphas, velocities=True)
        gap = target.points - _complex(poses.h)
        distances = np.abs(gap)
        rate = _complex(poses.h_1)
        step = (np.conj(rate) * gap).real / np.maximum(np.abs(rate) ** 2, 1e-30)
        alphas = alphas + np.clip(step, -TURN / NEAREST_ANGLES, TURN / NEAREST_ANGLES)
    return float(np.sqrt((distances**2).mean()))


def _linkage(space: Space, x: FloatArray) -> Linkage:
    return space.variants(x[None])[0]


def _least_squares(target: Target, space: Space, start: _Point, sense: float) -> _Point:
    """Return the point of least residuals near a start; `sense` is the direction of travel."""
    # It takes half a second to load.
    from scipy.optimize import least_squares  # noqa: PLC0415

    last: dict[bytes, _Residuals] = {}
    first = _residuals(target, space, start, sense)
    if first is None:
        return start

    def residuals_at(step: FloatArray) -> _Residuals:
        key = step.tobytes()
        if key not in last:
            residuals = _residuals(target, space, _stepped(target, start, step), sense)
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
        max_nfev=MAX_STEPS,
        xtol=1e-10,
        ftol=MIN_GAIN,
        gtol=None,
    )
    return _stepped(target, start, solution.x)


def _stepped(target: Target, point: _Point, step: FloatArray) -> _Point:
    """Return a point after a step, in the order of the Jacobian's columns."""
    count = len(point.x)
    motion = iter(step[count:].tolist())
    offset = point.offset + next(motion)
    rotation = next(motion) if target.can_turn else 0.0
    growth = next(motion) if target.can_scale else 0.0
    shift = complex(next(motion), next(motion)) if target.can_move else 0j
    x = np.clip(point.x + step[:count], 0.0, 1.0)
    factor = point.factor * np.exp(growth + 1j * rotation)
    return _Point(x, complex(factor), point.shift + shift, offset)


def _residuals(target: Target, space: Space, point: _Point, sense: float) -> _Residuals | None:
    """Return the residuals; None if the candidate does not turn."""
    try:
        leg = _linkage(space, point.x)
    except GeometryError:
        return None
    samples = _foot_samples(target, leg, point.offset, sense, has_gradients=True)
    if samples is None:
        return None
    path = point.factor * samples.feet
    by_x = samples.by_numbers @ _number_derivatives(space, point.x)
    columns: list[AnyArray] = [point.factor * by_x, point.factor * samples.by_offset[:, None]]
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


def _foot_samples(
    target: Target, leg: Linkage, offset: float, sense: float, *, has_gradients: bool = False
) -> _FootSamples | None:
    """Return the feet that correspond to a target's samples; None if the leg does not turn."""
    count = len(target.samples)
    fractions = offset + sense * np.arange(count) / count
    if target.is_timed:
        alphas = TURN * fractions
        # The leg must turn between the points, too.
        if linkage_poses(leg, crank_angles(CANDIDATE_ANGLES)).reason.any():
            return None
        poses: Any = linkage_poses(leg, alphas, velocities=True, gradients=has_gradients)
        if poses.reason.any():
            return None
        by_numbers = np.empty((count, 0), dtype=np.complex128)
        if has_gradients:
            by_numbers = _complex(poses.h_gradient, axis=1)
        return _FootSamples(_complex(poses.h), TURN * _complex(poses.h_1), by_numbers)
    return _samples_by_length(leg, np.remainder(fractions, 1.0), has_gradients=has_gradients)


def _samples_by_length(
    leg: Linkage, fractions: FloatArray, *, has_gradients: bool
) -> _FootSamples | None:
    """
    Return the feet at fractions of the path's length; None if the leg does not turn.

    With the length s(alpha) from the crank angle 0, S of the whole path and the unit tangent t,
    the foot at s = f S moves by dh/dx + t (f dS/dx - ds/dx) with a dimension x.
    """
    from scipy.interpolate import CubicHermiteSpline  # noqa: PLC0415 - see `_least_squares`

    grid = crank_angles(PATH_ANGLES)
    poses: Any = linkage_poses(leg, grid, velocities=True, gradients=has_gradients)
    if poses.reason.any():
        return None
    rate = _complex(poses.h_1)
    speed = np.abs(rate)
    lengths = _integral(speed)
    ends = np.append(grid, TURN)
    length_at = CubicHermiteSpline(ends, lengths, np.append(speed, speed[0]))
    wanted = fractions * lengths[-1]
    alphas = np.interp(wanted, lengths, ends)
    slowest = MIN_GAIN * lengths[-1]
    for _ in range(CORRECTIONS):
        step = (wanted - length_at(alphas)) / np.maximum(length_at(alphas, 1), slowest)
        alphas = alphas + np.clip(step, -TURN / PATH_ANGLES, TURN / PATH_ANGLES)
    at_samples: Any = linkage_poses(leg, alphas, velocities=True, gradients=has_gradients)
    if at_samples.reason.any():
        return None
    sample_rate = _complex(at_samples.h_1)
    tangent = sample_rate / np.maximum(np.abs(sample_rate), slowest)
    by_numbers = np.empty((len(fractions), 0), dtype=np.complex128)
    if has_gradients:
        tangents = rate / np.maximum(speed, slowest)
        stretch = (np.conj(tangents)[:, None] * _complex(poses.h_1_gradient, axis=1)).real
        stretches = _integral(stretch)
        index = np.clip((alphas / TURN * PATH_ANGLES).astype(np.intp), 0, PATH_ANGLES - 1)
        share = (alphas / TURN * PATH_ANGLES - index)[:, None]
        along = stretches[index] + share * (stretches[index + 1] - stretches[index])
        shift = fractions[:, None] * stretches[-1] - along
        by_numbers = _complex(at_samples.h_gradient, axis=1) + tangent[:, None] * shift
    return _FootSamples(_complex(at_samples.h), lengths[-1] * tangent, by_numbers)


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
