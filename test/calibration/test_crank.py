"""The crank between the samples of its encoder: a smoothing spline with its covariance."""

import math

from klann_ros.calibration import CrankSamples
from klann_ros.calibration.crank import CrankSpline, CrankWhitening
import numpy as np
import pytest

CRANK_NOISE = 1e-3


def uneven(times: np.ndarray) -> np.ndarray:
    """Return the angles of a crank whose speed changes [rad]."""
    angles: np.ndarray = 1.3 * times + 0.8 * np.sin(2.0 * times)
    return angles


def random_motion(seed: int, step: float, count: int) -> np.ndarray:
    """Return angles whose third derivative is white noise, at even times [rad]."""
    jerks = 0.1 * np.random.default_rng(seed).standard_normal(count) / math.sqrt(step)
    angles = jerks
    for _ in range(3):
        angles = np.cumsum(angles) * step
    return angles


def covariance(motion: CrankSpline, times: np.ndarray) -> np.ndarray:
    """Return the covariance of the angles at times, by the dense inverse of the information."""
    width, count = motion.factor.shape
    root = np.zeros((count, count))
    for n in range(width):
        root += np.diag(motion.factor[n, : count - n], -n)
    weights = motion.weights(times)[0].toarray()
    return np.array(weights @ np.linalg.inv(root @ root.T) @ weights.T)


def test_samples_at_10_hz_show_a_smooth_motion_between_them() -> None:
    samples = np.arange(0.0, 6.0, 0.1)
    times = np.linspace(0.0, 5.9, 500)
    angles, rates = CrankSpline(samples, uneven(samples)).at(times)
    # Chords miss it by 4e-3 rad.
    assert np.abs(angles - uneven(times)).max() < 2e-4
    np.testing.assert_allclose(rates, 1.3 + 1.6 * np.cos(2.0 * times), atol=0.015)


def test_the_rate_is_the_derivative_of_the_angle() -> None:
    samples = np.arange(0.0, 6.0, 0.03)
    noise = np.random.default_rng(2).normal(0.0, CRANK_NOISE, len(samples))
    motion = CrankSpline(samples, uneven(samples) + noise)
    times = np.linspace(0.2, 5.7, 300)
    differences = motion.at(times + 1e-5)[0] - motion.at(times - 1e-5)[0]
    np.testing.assert_allclose(motion.at(times)[1], differences / 2e-5, atol=1e-6)


def test_noise_is_smoothed_and_its_size_is_found() -> None:
    samples = np.arange(0.0, 6.0, 0.01)
    noise = np.random.default_rng(3).normal(0.0, CRANK_NOISE, len(samples))
    motion = CrankSpline(samples, uneven(samples) + noise)
    assert motion.noise == pytest.approx(CRANK_NOISE, rel=0.1)
    assert np.std(motion.at(samples)[0] - uneven(samples)) < 0.4 * CRANK_NOISE
    stated = CrankSpline(samples, uneven(samples) + noise, 2.0 * CRANK_NOISE)
    assert stated.noise == pytest.approx(2.0 * CRANK_NOISE)


@pytest.mark.slow
@pytest.mark.parametrize('noise', [0.0, 1e-4, 1e-3])
def test_errors_between_samples_are_as_large_as_their_covariance(noise: float) -> None:
    squares = []
    variances = []
    for seed in range(12):
        angles = random_motion(seed, 0.01, 1000)
        samples = np.arange(0, 1000, 20)
        measured = angles[samples] + np.random.default_rng(seed).normal(0.0, noise, len(samples))
        motion = CrankSpline(0.01 * samples, measured)
        times = 0.01 * np.arange(50, 900, 7)
        variances.append(motion.variances(times))
        squares.append((motion.at(times)[0] - angles[50:900:7]) ** 2)
    # Without noise the samples leave it open whether there is any.
    assert 0.6 < np.sqrt(np.mean(squares) / np.mean(variances)) < 1.25


def test_a_gap_separates_motions_that_nothing_joins() -> None:
    times = np.concatenate([np.arange(0.0, 1.0, 0.01), np.arange(2.0, 3.0, 0.01)])
    motion = CrankSpline(times, uneven(times) + (times > 1.5))
    moments = np.array([-0.02, -0.009, 0.505, 1.5, 2.505, 2.99 + 0.009, 9.0, np.nan])
    assert motion.knows(moments).tolist() == [False, True, True, False, True, True, False, False]
    angles = motion.at(np.array([0.505, 2.505]))[0] - uneven(np.array([0.505, 2.505]))
    np.testing.assert_allclose(angles, [0.0, 1.0], atol=1e-6)
    assert not CrankSpline(times[:3], times[:3]).knows(moments).any()


def test_whitened_numbers_have_the_square_of_the_dense_covariance() -> None:
    samples = np.arange(0.0, 3.0, 0.1)
    rng = np.random.default_rng(4)
    motion = CrankSpline(samples, uneven(samples) + rng.normal(0.0, 1e-2, len(samples)))
    times = np.sort(rng.uniform(0.0, 2.9, 40))
    slopes = rng.normal(0.0, 300.0, 40)
    numbers = rng.standard_normal((40, 3))
    dense = np.eye(40) + np.outer(slopes, slopes) * covariance(motion, times)
    whitening = CrankWhitening(motion, times, slopes)
    whitened = whitening(numbers)
    np.testing.assert_allclose(
        whitened.T @ whitened, numbers.T @ np.linalg.solve(dense, numbers), rtol=1e-6, atol=1e-9
    )
    assert whitening.log_determinant == pytest.approx(np.linalg.slogdet(dense)[1], rel=1e-6)
    # What the errors have after the numbers are known.
    expected = np.diag(dense - np.eye(40)) - np.diag(
        (dense - np.eye(40)) @ np.linalg.solve(dense, dense - np.eye(40))
    )
    assert whitening.variances().sum() == pytest.approx(expected.sum(), rel=0.1)


def test_variances_are_those_of_the_dense_covariance() -> None:
    samples = np.arange(0.0, 3.0, 0.1)
    noise = np.random.default_rng(5).normal(0.0, 1e-2, len(samples))
    motion = CrankSpline(samples, uneven(samples) + noise)
    times = np.linspace(0.0, 2.9, 200)
    expected = np.diag(covariance(motion, times)).mean()
    assert motion.variances(times).mean() == pytest.approx(expected, rel=0.2)


def test_samples_that_are_no_measurements_are_left_out() -> None:
    times = np.array([0.0, 0.1, 0.2, 0.3, 1e308])
    positions = np.array([0.0, 1e308, np.nan, 0.3, 0.4])
    samples = CrankSamples.of(times, positions)
    assert samples.times.tolist() == [0.0, 0.3]
    assert samples.positions.tolist() == [0.0, 0.3]
