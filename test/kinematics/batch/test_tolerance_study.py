"""`tolerance_study`: its random legs, statistics and sensitivities."""

from dataclasses import fields, replace
import math
from typing import Any

from klann_ros.kinematics import klann_poses, KlannGeometry, tolerance_study
from klann_ros.kinematics.batch import tolerance_study as module
from klann_ros.kinematics.klann import NUMBERS
import numpy as np
import pytest

SEM104 = KlannGeometry.sem104()
LENGTHS_OF_DYAD_1 = ('l_ab', 'l_bc', 'l_dc')


def non_turning_share(width: float) -> float:
    """
    Return how many legs cannot turn fully if every length errs by up to `width`, by integration.

    AB + AD > BC + DC is what happens first; the margin is a sum of three uniform errors.
    """
    margin = SEM104.l_bc + SEM104.l_dc - SEM104.l_ab - math.hypot(SEM104.x_d, SEM104.y_a)
    a, b, c = (width * getattr(SEM104, name) for name in LENGTHS_OF_DYAD_1)
    # The volume of a box's corners beyond a plane, by inclusion and exclusion.
    corners = [(s, t, u) for s in (1, -1) for t in (1, -1) for u in (1, -1)]
    beyond = sum(s * t * u * max(0.0, s * a + t * b + u * c - margin) ** 3 for s, t, u in corners)
    return beyond / (48 * a * b * c)


@pytest.mark.slow
def test_two_percent_on_every_length_stop_two_legs_in_a_hundred() -> None:
    exact = non_turning_share(0.02)
    assert exact == pytest.approx(0.02043, abs=5e-6)
    samples = 50_000
    study = tolerance_study(SEM104, 0.02, samples=samples, crank_angles=12, seed=104)
    scatter = math.sqrt(exact * (1 - exact) / samples)
    assert study.non_turning_fraction == pytest.approx(exact, abs=3 * scatter)
    # The published 1.87 % is one draw of some 10 000 legs.
    assert exact - 0.0187 < 1.5 * math.sqrt(exact * (1 - exact) / 10_000)


def test_a_leg_that_stops_between_the_crank_angles_is_counted() -> None:
    # Only near 165.6 deg can it not be reached.
    tight = replace(SEM104, l_bc=0.12 + math.hypot(0.35, 0.09) - 0.14 + 1e-9)
    study = tolerance_study(tight, {'l_bc': 1e-8}, samples=2000, crank_angles=3)
    assert study.non_turning_fraction == pytest.approx(0.45, abs=0.05)
    assert np.isnan(study.stride).mean() == study.non_turning_fraction


def test_without_tolerances_every_leg_is_the_drawn_one() -> None:
    study = tolerance_study(SEM104, {}, samples=5, crank_angles=3600)
    assert study.non_turning_fraction == 0.0
    np.testing.assert_array_equal(study.nominal, klann_poses(SEM104, study.alphas).h)
    for deviation in (study.mean, study.rms, study.p95, study.p99, study.largest):
        assert not deviation.any()
    np.testing.assert_array_equal(study.box, np.stack([study.nominal] * 2, axis=1))
    extent = np.ptp(study.nominal, axis=0)
    np.testing.assert_array_equal([study.stride, study.lift], np.repeat(extent[:, None], 5, 1))


@pytest.mark.slow
@pytest.mark.parametrize(
    ('distribution', 'sigma', 'p95'),
    [('uniform', 1 / math.sqrt(3), 0.95), ('normal', 0.329, 0.64)],
)
def test_the_foot_errs_by_just_its_own_length(distribution: str, sigma: float, p95: float) -> None:
    width = 0.001
    options: Any = {'samples': 20_000, 'crank_angles': 5, 'distribution': distribution}
    study = tolerance_study(SEM104, {'l_gh': width}, **options)
    np.testing.assert_allclose(study.rms, width * sigma, rtol=0.02)
    np.testing.assert_allclose(study.p95, width * p95, rtol=0.03)
    assert (study.largest <= width * (1 + 1e-9)).all()
    assert (study.largest > 0.98 * width).all()
    assert (np.abs(study.mean) < 0.02 * width).all()


def test_the_statistics_are_those_of_the_legs() -> None:
    tolerances = {'l_ab': 0.002, 'x_e': 0.001, 'angle_bcg': 0.01}
    study = tolerance_study(SEM104, tolerances, samples=50, crank_angles=7, seed=3)
    errors = np.random.default_rng(3).uniform(-1.0, 1.0, (len(NUMBERS), 50))
    widths = np.array([tolerances.get(name, 0.0) for name in NUMBERS])
    numbers = np.array(SEM104.linkage.numbers) + widths * errors.T
    drawn = [SEM104.varied(dict(zip(NUMBERS, row, strict=True))) for row in numbers.tolist()]
    h = klann_poses(drawn, study.alphas).h
    shift = h - study.nominal
    distance = np.sort(np.linalg.norm(shift, axis=2), axis=0)
    stride, lift = np.ptp(h, axis=1).T
    for statistic, expected in (
        (study.mean, shift.mean(axis=0)),
        (study.rms, np.sqrt((distance**2).mean(axis=0))),
        (study.p95, distance[47]),
        (study.p99, distance[49]),
        (study.largest, distance[49]),
        (study.box, np.stack([h.min(axis=0), h.max(axis=0)], axis=1)),
        (study.stride, stride),
        (study.lift, lift),
    ):
        np.testing.assert_allclose(statistic, expected, atol=1e-15)
    gradients = klann_poses(SEM104, study.alphas, gradients=True).h_gradient
    np.testing.assert_array_equal(study.sensitivities, gradients.swapaxes(1, 2))


@pytest.mark.slow
def test_the_ranking_is_the_effect_of_small_tolerances() -> None:
    tolerances = {'l_ab': 1e-5, 'l_bc': 1e-5, 'l_dc': 1e-4, 'angle_fgh': 1e-6}
    study = tolerance_study(SEM104, tolerances)
    assert [value for _, value in study.ranking] == sorted(dict(study.ranking).values())[::-1]
    assert study.ranking[0][0] == 'l_dc'
    assert [value for _, value in study.ranking[4:]] == [0.0] * 9
    for name, width in tolerances.items():
        alone = tolerance_study(SEM104, {name: width}, samples=5000, crank_angles=30)
        # A uniform error's root mean square is a half-width / sqrt(3).
        half_width = math.sqrt(3 * (alone.rms**2).mean())
        assert half_width == pytest.approx(dict(study.ranking)[name], rel=0.05)


def test_the_seed_makes_it_repeatable_and_the_results_are_read_only() -> None:
    options: Any = {'samples': 20, 'crank_angles': 10}
    study = tolerance_study(SEM104, 0.01, seed=1, **options)
    repeated = tolerance_study(SEM104, 0.01, seed=1, **options)
    for field in fields(study):
        statistic = getattr(study, field.name)
        np.testing.assert_array_equal(statistic, getattr(repeated, field.name))
        assert not isinstance(statistic, np.ndarray) or not statistic.flags.writeable
    assert not np.array_equal(study.mean, tolerance_study(SEM104, 0.01, seed=2, **options).mean)


def test_unreachable_angles_have_no_statistics() -> None:
    study = tolerance_study(replace(SEM104, l_bc=0.33), 0.001, samples=50, crank_angles=36)
    missing = np.isnan(study.nominal[:, 0])
    assert 0 < missing.sum() < 36
    for values in (study.mean, study.rms, study.p95, study.p99, study.largest, study.box):
        assert np.isnan(values[missing]).all()
        assert np.isfinite(values[~missing]).all()
    assert study.non_turning_fraction == 1.0
    assert study.ranking[0][1] > 0.0


def test_progress_is_reported_to_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, 'MAX_STUDY_POSES', 1000)
    calls: list[tuple[int, int]] = []
    options: Any = {'samples': 400, 'crank_angles': 3}
    tolerance_study(SEM104, 0.01, progress=lambda *now: calls.append(now), **options)
    assert calls == [(800, 1200), (1200, 1200)]
