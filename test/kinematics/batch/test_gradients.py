"""Derivatives by every dimension are those of the loop equations by the complex step."""

import copy
from typing import Any

from klann_ros.kinematics import (
    FourBar,
    klann_poses,
    KlannGeometry,
    KlannLeg,
    Linkage,
    linkage_poses,
    shipped_linkage,
    shipped_linkages,
    SingularPoseError,
    Variants,
)
from klann_ros.kinematics.linkage.structure import FIXED, Structure
from mechanisms import fresh, NAMES
import numpy as np
import pytest

ALPHAS = np.linspace(0.1, 6.3, 57)
STEP = 1e-200
EVERYTHING = dict.fromkeys(['angles', 'points', 'transmission_angles', 'gradients'], True)


def _turned(v: Any, angle: Any) -> tuple[Any, Any]:
    c, s = np.cos(angle), np.sin(angle)
    return c * v[0] - s * v[1], s * v[0] + c * v[1]


def _bars(structure: Structure, given: dict[tuple[str, int], Any]) -> list[tuple[Any, Any]]:
    """Return the bars in their bodies' frames, x and y apart, so that complex steps pass."""
    bars, places = [], {}
    for n, (body, bar) in enumerate(structure.bars):
        bend = given.get(('bend', n), 0.0)
        if n in structure.lines:
            bars.append(_turned((1.0, 0.0), bend))
            places[body, bar.end] = (0.0, 0.0)
            continue
        start, length = places.setdefault((body, bar.start), (0.0, 0.0)), given['length', n]
        if bar.brace is None:
            vector = _turned((length, 0.0), bend)
        else:
            q = places[body, bar.brace.start]
            x, y, r_q = q[0] - start[0], q[1] - start[1], given['brace', n]
            d = x * x + y * y
            a = (d + length**2 - r_q**2) / (2.0 * d)
            h = np.sqrt(length**2 / d - a * a) * (1.0 if bar.brace.side == 'left' else -1.0)
            vector = (a * x - h * y, a * y + h * x)
        bars.append(vector)
        places[body, bar.end] = (start[0] + vector[0], start[1] + vector[1])
    return bars


def _ends(structure: Structure, numbers: Any, x: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the loops' openings and the points: x, then y of each, along the first axis."""
    given = {
        (d.kind, d.place): d.sense * v for d, v in zip(structure.dimensions, numbers, strict=True)
    }
    bars = _bars(structure, given)

    def end(path: Any) -> tuple[Any, Any]:
        total = [0.0, 0.0]
        for place, times in path.pivots:
            total[0] = total[0] + times * given.get(('x', place), 0.0)
            total[1] = total[1] + times * given.get(('y', place), 0.0)
        for n, times in path.bars:
            body = structure.bars[n][0]
            vector, frame = bars[n], structure.frames[body]
            if n in structure.lines:
                vector = (x[body] * vector[0], x[body] * vector[1])
            if frame != FIXED:
                vector = _turned(vector, structure.senses[frame] * x[frame])
            total[0], total[1] = total[0] + times * vector[0], total[1] + times * vector[1]
        return total[0], total[1]

    size = np.shape(x[0])
    loops, points = (
        np.array([part + np.zeros(size) for path in paths for part in end(path)])
        for paths in (structure.paths.loops, structure.paths.points)
    )
    return loops, points


def _expected(structure: Structure, numbers: Any, x: list[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return dx, shape (n - 1, d, k), and the points' derivatives, shape (2 p, d, k)."""

    def column(which: int, own: list[Any], *, of_x: bool) -> tuple[np.ndarray, np.ndarray]:
        stepped = [v + (1j * STEP if n == which else 0.0) for n, v in enumerate(own)]
        loops, points = _ends(structure, *((numbers, stepped) if of_x else (stepped, x)))
        return loops.imag / STEP, points.imag / STEP

    phi, q = zip(*(column(j, x, of_x=True) for j in range(1, len(x))), strict=True)
    f, p = zip(*(column(i, list(numbers), of_x=False) for i in range(len(numbers))), strict=True)
    jacobian, right = np.stack(phi, axis=-1), np.stack(f, axis=-1)
    x_p = -np.linalg.solve(jacobian.transpose(1, 0, 2), right.transpose(1, 0, 2))
    points = np.stack(p, axis=-1).transpose(1, 0, 2) + np.stack(q, -1).transpose(1, 0, 2) @ x_p
    return x_p.transpose(1, 2, 0), points.transpose(1, 2, 0)


def _largest_error(linkage: Linkage, numbers: Any, poses: Any, alphas: Any) -> float:
    """Return the largest error relative to the derivatives' size, away from singular poses."""
    structure, shape = linkage.structure, poses.reason.shape
    n, d = len(structure.bodies) - 1, len(structure.dimensions)
    regular = poses.transmission_angles
    regular = ((np.sin(regular) > 0.02).all(axis=-1) & (poses.reason == 0)).ravel()
    assert regular.mean() > 0.3
    x = [np.broadcast_to(alphas, shape).ravel(), *poses.angles.reshape(-1, n).T]
    own = [np.broadcast_to(v, shape).ravel()[regular] for v in numbers]
    x_p, points = _expected(structure, own, [v[regular] for v in x])
    found_x = poses.angles_gradient.reshape(-1, n, d)[regular].transpose(1, 2, 0)
    found = poses.points_gradient.reshape(-1, points.shape[0], d)[regular].transpose(1, 2, 0)
    foot = structure.points.index(structure.foot)
    h = poses.points_gradient[..., foot, :, :]
    np.testing.assert_allclose(poses.h_gradient, h, rtol=0, atol=1e-9 * (1.0 + np.nanmax(abs(h))))
    size = 1.0 + np.abs(x_p).max(axis=(0, 1))
    return float(max(np.abs(e / size).max() for e in (found_x - x_p, found - points)))


@pytest.mark.parametrize('name', shipped_linkages())
def test_they_are_those_of_the_equations(name: str) -> None:
    linkage = shipped_linkage(name)
    poses = linkage_poses(linkage, ALPHAS, **EVERYTHING)
    assert poses.dimension_names == tuple(linkage.dimensions)
    assert _largest_error(linkage, linkage.numbers, poses, ALPHAS) < 1e-11


@pytest.mark.parametrize('name', NAMES)
def test_one_pose_has_the_same(name: str) -> None:
    leg = fresh(name)
    poses = linkage_poses(leg, ALPHAS, angles=True, gradients=True)
    for k in np.flatnonzero(np.isfinite(poses.h_gradient[:, 0, 0]))[::9]:
        pose = leg.closed_form(ALPHAS[k])
        one = leg.gradient(pose)
        assert one.dimension_names == poses.dimension_names
        allowed = 1e-10 / min(pose.sines) ** 3
        np.testing.assert_allclose(one.angles_gradient, poses.angles_gradient[k], atol=allowed)
        np.testing.assert_allclose(one.h_gradient, poses.h_gradient[k], atol=allowed)
    again = copy.deepcopy(leg)
    np.testing.assert_array_equal(again.gradient(pose).h_gradient, one.h_gradient)


def test_a_singular_pose_has_no_gradient() -> None:
    bar = FourBar(0.1, 0.05, 0.1, 0.05)
    with pytest.raises(SingularPoseError):
        bar.gradient(bar.closed_form(0.0))
    with pytest.raises(ValueError, match='another linkage'):
        bar.gradient(KlannLeg().solve(1.0))


@pytest.mark.parametrize('name', ['klann', 'jansen'])
def test_both_kernels_agree(name: str) -> None:
    pytest.importorskip('numba')
    numpy, numba = (
        linkage_poses(shipped_linkage(name), ALPHAS, kernel=kernel, gradients=True)
        for kernel in ('numpy', 'numba')
    )
    np.testing.assert_allclose(numba.h_gradient, numpy.h_gradient, rtol=1e-12, atol=1e-12)


def test_gradients_hold_for_5_000_random_legs() -> None:
    base, rng = KlannGeometry.sem104().linkage, np.random.default_rng(7)
    factors = rng.uniform(0.8, 1.2, (len(base.numbers), 5_000))
    variants = Variants(
        base, dict(zip(base.dimensions, np.array(base.numbers)[:, None] * factors, strict=True))
    )
    alpha = np.array([2.5])
    poses = linkage_poses(variants, alpha, **EVERYTHING)
    assert _largest_error(base, variants.numbers[..., None], poses, alpha) < 1e-9


@pytest.mark.parametrize('name', ['klann', 'jansen', 'quick_return', 'stephenson', 'trotbot'])
def test_those_of_the_velocity_are_their_slopes(name: str) -> None:
    linkage, step = shipped_linkage(name), 1e-5
    poses = linkage_poses(linkage, ALPHAS, velocities=True, gradients=True)
    up, down = (linkage_poses(linkage, ALPHAS + s, gradients=True) for s in (step, -step))
    slopes = (up.h_gradient - down.h_gradient) / (2.0 * step)
    size = 1.0 + np.nanmax(np.abs(slopes))
    np.testing.assert_allclose(poses.h_1_gradient, slopes, rtol=0, atol=1e-7 * size)


def test_a_singular_pose_and_an_unreachable_one_have_none() -> None:
    poses = linkage_poses(shipped_linkage('chebyshev'), ALPHAS, gradients=True)
    gone = poses.reason != 0
    assert gone.any()
    assert np.isnan(poses.h_gradient[gone]).all()
    assert np.isfinite(poses.h_gradient[~gone]).all()
    folded = linkage_poses(FourBar(0.1, 0.05, 0.1, 0.05), [0.0, 1.0], gradients=True)
    assert np.isnan(folded.h_gradient).all(axis=(1, 2)).tolist() == [True, False]


def test_unrequested_gradients_are_absent() -> None:
    poses = klann_poses(KlannGeometry(), ALPHAS, gradients=True)
    assert poses.angles_gradient is poses.points_gradient is poses.h_1_gradient is None
    assert poses.h_gradient is not None
    assert not poses.h_gradient.flags.writeable
    assert klann_poses(KlannGeometry(), ALPHAS).dimension_names == ()
