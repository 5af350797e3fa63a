"""Refinement of a leg on its path, by the derivatives of the foot by every dimension."""

from cmath import phase
from typing import Any, NamedTuple

from klann_ros.kinematics import GeometryError, GROUND, Linkage, linkage_poses
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import ComplexArray, FloatArray
import numpy as np

from .figures import crank_angles
from .space import Space
from .target import PATH_POINTS, resampled, Target

MAX_STEPS = 100
# Crank angles between which the nearest point of a path is sought, and projections onto it.
NEAREST_ANGLES, PROJECTIONS = 360, 2
# A step that improves by a smaller part is the last one.
MIN_GAIN = 1e-6
# Residuals of a leg that does not turn; a start on an end of a range is just within it.
WORSE, MARGIN = 10.0, 1e-9


class _Point(NamedTuple):
    """Variables of the fit: dimensions x in [0, 1], z -> factor z + shift, the crank's zero."""

    x: FloatArray
    factor: complex
    shift: complex
    zero: float


class _Residuals(NamedTuple):
    """Distances of the target's points from a path, shape (k,) [m], and their derivatives."""

    values: FloatArray
    jacobian: FloatArray

    @property
    def cost(self) -> float:
        return float(self.values @ self.values)


def refined(target: Target, space: Space, x: FloatArray) -> tuple[Linkage, float]:
    """
    Return a candidate nearer to a path, placed on it, and its error; x of shape (d,).

    Levenberg-Marquardt on the distances of the target's points from the path, with the derivatives
    of the foot by each dimension.

    Raises
    ------
    GeometryError
        It is no linkage.

    """
    drawn = _linkage(space, x)
    fit = target.fit(linkage_poses(drawn, crank_angles(NEAREST_ANGLES)).h[None])
    start = _Point(x, complex(fit.factor[0]), complex(fit.shift[0]), 0.0)
    if target.is_timed:
        start = start._replace(zero=_best_zero(target, drawn, start))
    minimum = _least_squares(target, space, start)
    # The figure is the distance of corresponding points: the fit need not improve it.
    candidates = []
    for point in (start, minimum):
        leg = _placed(_linkage(space, point.x), point.factor, point.shift)
        path = linkage_poses(leg, crank_angles(NEAREST_ANGLES)).h
        candidates.append((leg, target.distance(path)))
    return min(candidates, key=lambda candidate: candidate[1])


def _linkage(space: Space, x: FloatArray) -> Linkage:
    return space.variants(x[None])[0]


def _least_squares(target: Target, space: Space, start: _Point) -> _Point:
    """Return the point of least residuals near a start."""
    # It takes half a second to load.
    from scipy.optimize import least_squares  # noqa: PLC0415

    last: dict[bytes, _Residuals] = {}
    first = _residuals(target, space, start)
    if first is None:
        return start

    def residuals_at(step: FloatArray) -> _Residuals:
        key = step.tobytes()
        if key not in last:
            residuals = _residuals(target, space, _stepped(target, start, step))
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
    rotation = next(motion) if target.can_turn else 0.0
    growth = next(motion) if target.can_scale else 0.0
    shift = complex(next(motion), next(motion)) if target.can_move else 0j
    zero = next(motion) if target.is_timed else 0.0
    x = np.clip(point.x + step[:count], 0.0, 1.0)
    factor = point.factor * np.exp(growth + 1j * rotation)
    return _Point(x, complex(factor), point.shift + shift, point.zero + zero)


def _residuals(target: Target, space: Space, point: _Point) -> _Residuals | None:
    """Return the residuals; None if the candidate does not turn."""
    try:
        leg = _linkage(space, point.x)
    except GeometryError:
        return None
    z = resampled(target.points[None], by_length=not target.is_timed)[0]
    if target.is_timed:
        alphas = point.zero + TURN * np.arange(PATH_POINTS) / PATH_POINTS
    else:
        alphas = _nearest(leg, point, z)
    poses: Any = linkage_poses(leg, alphas, velocities=True, gradients=True)
    if poses.reason.any():
        return None
    h = poses.h @ (1.0, 1j)
    gradient = np.einsum('i,kid->kd', np.array([1.0, 1j]), poses.h_gradient)
    path = point.factor * h
    columns = [point.factor * (gradient @ _number_derivatives(space, point.x))]
    if target.can_turn:
        columns.append(1j * path[:, None])
    if target.can_scale:
        columns.append(path[:, None])
    if target.can_move:
        columns += [np.ones((len(h), 1)), np.full((len(h), 1), 1j)]
    velocity = point.factor * (poses.h_1 @ (1.0, 1j))
    gap = path + point.shift - z
    if target.is_timed:
        jacobian = np.hstack([*columns, velocity[:, None]])
        stacked = np.concatenate([gap.real, gap.imag])
        return _Residuals(stacked, np.vstack([jacobian.real, jacobian.imag]))
    # Across the path: along it the nearest point moves.
    across = np.conj(1j * velocity / np.abs(velocity))
    return _Residuals((across * gap).real, (across[:, None] * np.hstack(columns)).real)


def _nearest(leg: Linkage, point: _Point, z: ComplexArray) -> FloatArray:
    """Return the crank angles where the path is nearest to points."""
    alphas = crank_angles(NEAREST_ANGLES)
    path = point.factor * (linkage_poses(leg, alphas).h @ (1.0, 1j)) + point.shift
    # One that never closes is found out by its poses.
    nearest = alphas[np.nan_to_num(np.abs(path[:, None] - z), nan=np.inf).argmin(axis=0)]
    for _ in range(PROJECTIONS):
        poses: Any = linkage_poses(leg, nearest, velocities=True)
        foot = point.factor * (poses.h @ (1.0, 1j)) + point.shift
        rate = point.factor * (poses.h_1 @ (1.0, 1j))
        with np.errstate(all='ignore'):
            step = (np.conj(rate) * (z - foot)).real / np.abs(rate) ** 2
        reach = TURN / NEAREST_ANGLES
        nearest = nearest + np.clip(np.nan_to_num(step), -reach, reach)
    return np.asarray(nearest, dtype=np.float64)


def _number_derivatives(space: Space, x: FloatArray) -> FloatArray:
    """Return the derivatives of all dimensions by the variables, shape (dimensions, d)."""
    count = len(x)
    step = 1e-3
    # Dimensions are at most of second degree in the variables: these are exact.
    stencil = np.concatenate([x + step * np.eye(count), x - step * np.eye(count)])
    numbers = space.variants(stencil).numbers
    return np.asarray((numbers[:, :count] - numbers[:, count:]) / (2.0 * step))


def _best_zero(target: Target, leg: Linkage, point: _Point) -> float:
    """Return the crank angle at the first point of a path with timing [rad]."""
    z = resampled(target.points[None], by_length=False)[0]
    h = linkage_poses(leg, TURN * np.arange(PATH_POINTS) / PATH_POINTS).h @ (1.0, 1j)
    h = point.factor * h + point.shift
    errors = np.empty(PATH_POINTS)
    for n in range(PATH_POINTS):
        errors[n] = np.abs(np.roll(h, -n) - z).sum()
    return TURN * int(np.nanargmin(errors)) / PATH_POINTS


def _placed(linkage: Linkage, factor: complex, shift: complex) -> Linkage:
    """Return a linkage turned, scaled and moved: z -> factor z + shift."""
    structure = linkage.structure
    size = abs(factor)
    pivots = [factor * pivot + shift for pivot in linkage.pivots]
    changes = {}
    for dimension, number in zip(structure.dimensions, linkage.numbers, strict=True):
        if dimension.is_length:
            changes[dimension.name] = size * number
        elif dimension.kind in {'x', 'y'}:
            z = pivots[dimension.place]
            changes[dimension.name] = z.real if dimension.kind == 'x' else z.imag
        elif structure.bodies[structure.bars[dimension.place][0]].along == GROUND:
            angle = number + dimension.sense * phase(factor)
            changes[dimension.name] = float(np.remainder(angle + np.pi, TURN) - np.pi)
    return linkage.varied(changes)
