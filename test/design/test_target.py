"""The distance of a leg from its path: what corresponds, and the refinement that minimizes it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from klann_ros.design import refine, requirements_from
from klann_ros.design.refine import path_error, point_error, refined
from klann_ros.design.target import Target, target_from
from klann_ros.kinematics import linkage_poses, shipped_linkage, Variants
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import ComplexArray, FloatArray
import numpy as np
import pytest

FREE = {'can_move': True, 'can_turn': True, 'can_scale': True}
FIXED = dict.fromkeys(FREE, False)


def foot(linkage: Any, alphas: FloatArray) -> ComplexArray:
    return np.asarray(linkage_poses(linkage, alphas).h @ (1.0, 1j))


def even_angles(count: int, start: float = 0.0, sense: float = 1.0) -> FloatArray:
    return np.asarray(start + sense * np.arange(count) * (TURN / count))


def feet(linkage: Any, count: int) -> FloatArray:
    return linkage_poses(linkage, even_angles(count)).h[None]


@pytest.mark.parametrize('name', ['klann', 'trotbot', 'slider_crank', 'stephenson'])
@pytest.mark.parametrize('sense', [1.0, -1.0])
@pytest.mark.parametrize('count', [5, 6, 8, 47, 360])
def test_an_exact_leg_has_no_error_on_its_own_points_with_timing(
    name: str, sense: float, count: int
) -> None:
    linkage = shipped_linkage(name)
    points = foot(linkage, even_angles(count, 1.234, sense))
    target = Target(points, is_timed=True)
    assert path_error(target, linkage) <= 1e-9 * target.size
    # In bulk, from another place and in another size, by 96 poses.
    moved = replace(target, points=2.0 * np.exp(1j) * points + 1.0)
    fit = moved.fit(feet(linkage, 96))
    assert fit.error[0] < 1e-5 * moved.size


def procrustes_error(
    w: ComplexArray, z: ComplexArray, *, can_move: bool, can_turn: bool, can_scale: bool
) -> float:
    """Return the rms distance of points after the best motion, which turns if it scales."""
    if can_move:
        w = w - w.mean()
        z = z - z.mean()
    overlap = (np.conj(w) * z).sum()
    factor = overlap / abs(overlap) if can_turn else 1.0
    if can_scale:
        factor = overlap / (np.abs(w) ** 2).sum()
    return float(np.sqrt((np.abs(factor * w - z) ** 2).mean()))


@pytest.mark.parametrize('freedom', [FREE, FIXED, {**FREE, 'can_scale': False}])
@pytest.mark.parametrize('count', [5, 97])
def test_the_fit_with_timing_is_the_best_of_all_starts(
    freedom: dict[str, bool], count: int
) -> None:
    random = np.random.default_rng(count)
    points = np.cumsum(random.normal(size=(count, 2)) @ (1.0, 1j))
    target = Target(points, is_timed=True, **freedom)
    linkage = shipped_linkage('jansen')
    fit = target.fit(feet(linkage, 96))
    least_error = np.inf
    for sense in (1.0, -1.0):
        starts = np.arange(0.0, TURN, TURN / 500)[:, None]
        for w in foot(linkage, starts + even_angles(count, 0.0, sense)):
            least_error = min(least_error, procrustes_error(w, points, **freedom))
    assert least_error * (1.0 - 1e-3) < fit.error[0] < least_error * (1.0 + 1e-9)
    # The corresponding points, with the transformation, are at that distance.
    alphas = TURN * (fit.offset[0] + fit.sense[0] * np.arange(count) / count)
    gap = fit.factor[0] * foot(linkage, alphas) + fit.shift[0] - points
    assert np.sqrt((np.abs(gap) ** 2).mean()) == pytest.approx(fit.error[0], rel=1e-5)


def test_points_that_a_leg_passes_at_other_crank_angles_are_missed_with_timing() -> None:
    linkage = shipped_linkage('klann')
    alphas = even_angles(8)
    alphas[3] += 0.2
    target = Target(foot(linkage, alphas), is_timed=True)
    assert path_error(target, linkage) > 1e-2 * target.size
    assert path_error(replace(target, is_timed=False), linkage) < 2e-2 * target.size


def test_a_leg_that_jams_between_the_points_is_infinitely_far() -> None:
    # Its gap is narrower than a step.
    linkage = shipped_linkage('four_bar')
    variants = Variants(linkage, {linkage.structure.dimensions[2].name: np.linspace(0.01, 1, 100)})
    share = (linkage_poses(variants, even_angles(90)).reason != 0).mean(axis=1)
    i = int(np.flatnonzero((share > 0.0) & (share < 0.15))[0])
    leg = variants[i]
    open_angles = even_angles(360)[linkage_poses(leg, even_angles(360)).reason != 0]
    middle = np.angle(np.exp(1j * open_angles).mean())
    points = foot(leg, even_angles(5, middle + TURN / 10))
    assert np.isfinite(points).all()
    assert path_error(Target(points, is_timed=True), leg) == np.inf


@pytest.mark.parametrize('name', ['klann', 'strider', 'watt_six_bar'])
def test_the_error_of_a_smooth_curve_falls_by_its_order(name: str) -> None:
    linkage = shipped_linkage(name)
    errors = []
    for count in (8, 32, 64):
        target = Target(foot(linkage, even_angles(count, 0.2)))
        errors.append(path_error(target, linkage) / target.size)
        assert point_error(target, linkage) < 1e-6 * target.size
    assert errors[0] < 0.03
    # To the fourth order: 16 with twice the points; chords give 4.
    assert errors[1] > 10.0 * errors[2]


def test_uneven_points_of_a_smooth_path_need_no_corners() -> None:
    linkage = shipped_linkage('klann')
    alphas = np.cumsum(np.random.default_rng(0).uniform(1.0, 4.0, 40))
    target = Target(foot(linkage, alphas * (TURN / alphas[-1])))
    polygon = replace(target, has_corners=True)
    assert path_error(target, linkage) < 0.3 * path_error(polygon, linkage)


def test_corners_are_kept_on_demand_and_in_drawings(tmp_path: Path) -> None:
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    (tmp_path / 'a.svg').write_text('<svg><path d="M0 0h1v1h-1z"/></svg>')
    contents = [{'points': square, 'corners': True}, {'file': 'a.svg'}]
    for content in contents:
        samples = target_from(content, 1.0, tmp_path).samples
        extent = np.ptp(samples.real)
        assert np.ptp(samples.imag) == pytest.approx(extent)
        on_side = np.abs((samples - samples[0]) / extent)
        assert np.isclose(on_side[:33], np.arange(33) / 32).all()
    smooth = target_from({'points': square}, 1.0, tmp_path).samples
    assert np.ptp(smooth.real) > 1.1
    assert smooth[32] == pytest.approx(1.0, abs=1e-3)


def test_repeated_points_do_not_bend_a_curve() -> None:
    points = foot(shipped_linkage('klann'), even_angles(12))
    repeated = np.repeat(points, 2)
    assert Target(repeated).samples == pytest.approx(Target(points).samples, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize('timing', ['free', 'prescribed'])
@pytest.mark.parametrize('name', ['klann', 'stephenson'])
def test_derivatives_of_corresponding_feet_are_differences(name: str, timing: str) -> None:
    linkage = shipped_linkage(name)
    target = Target(foot(linkage, even_angles(31)), is_timed=timing == 'prescribed')

    def samples(leg: Any, offset: float = 0.1) -> Any:
        return refine._foot_samples(target, leg, offset, -1.0, has_gradients=True)

    exact = samples(linkage)
    step = 1e-6
    forward = samples(linkage, 0.1 + step).feet
    difference = (forward - samples(linkage, 0.1 - step).feet) / (2.0 * step)
    scale = target.size
    assert np.abs(difference - exact.by_offset).max() < 2e-3 * scale
    for n, (dimension, number) in enumerate(linkage.dimensions.items()):
        more = samples(linkage.varied({dimension: number + step})).feet
        less = samples(linkage.varied({dimension: number - step})).feet
        difference = (more - less) / (2.0 * step)
        unit = max(1.0, np.abs(difference).max())
        assert np.abs(difference - exact.by_numbers[:, n]).max() < 2e-3 * unit, dimension


@pytest.mark.slow
@pytest.mark.parametrize(
    ('name', 'content'),
    [
        ('stephenson', {}),
        ('slider_crank', {}),
        ('klann', {'timing': 'prescribed'}),
    ],
)
def test_a_hidden_leg_is_refined_from_a_distant_one(
    name: str, content: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(refine, 'MAX_STEPS', 30)
    drawn = shipped_linkage(name)
    random = np.random.default_rng(4)
    hidden = None
    while hidden is None or linkage_poses(hidden, even_angles(96)).reason.any():
        changes = {n: v * random.uniform(0.9, 1.1) for n, v in drawn.dimensions.items()}
        hidden = drawn.varied(changes)
    points = foot(hidden, even_angles(60))
    if not content:
        points = 0.5 * np.exp(1j) * points - 0.3
    path = {'points': np.column_stack([points.real, points.imag]).tolist(), **content}
    requirements = requirements_from({'linkage': name, 'vary': 10, 'path': path})
    target = requirements.target
    assert target is not None
    (space,) = requirements.spaces
    leg = refined(requirements, space, np.full(len(space.names), 0.5))
    assert path_error(target, leg) < 1e-3 * target.size
