"""
Calibrate robots that MuJoCo moves, and count the errors; a plain fit of SciPy beside ours.

Each robot is built with errors of 0.5 mm and 1 deg in all dimensions and a guessed encoder zero.
The engine moves it, not our kinematics; cameras see its points within 0.1 mm, 1,000 samples. The
plain fit is least_squares by finite differences, from the file's zero, whatever the outliers.
`--robots N` are built of each linkage (8, with --full 40), `--jobs N` at once.
"""

from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
import math
import time
from typing import Any, NamedTuple

from klann_ros.calibration import calibrate, Calibration, CrankSamples, MeasuredSeries, series_of
from klann_ros.kinematics import (
    GeometryError,
    klann_poses,
    KlannGeometry,
    KlannLeg,
    Linkage,
    linkage_poses,
    turns_fully,
)
from klann_ros.robot import Robot, robot_of
from klann_ros.twin import robot_mjcf
from klann_ros.twin.twin import engine
import numpy as np
from scipy.optimize import least_squares
from support.aims import exit_code, sized, SMOKE

# The linkages and their measured points; '' stands for all moving points.
LINKAGES = {'sem104': 'HG', 'jansen': '', 'quick_return': '', 'watt_six_bar': '', 'strider': ''}
# Noise of the cameras [m], and errors of the dimensions [m], [rad].
NOISE = 1e-4
LENGTH_ERROR = 5e-4
BEND_ERROR = math.radians(1.0)
SAMPLES = 1000
# Speed of the crank [rad/s], duration of the measurement and step of the engine [s].
SPEED = 3.0
SECONDS = 2.3
TIME_STEP = 5e-4
# Fraction of outliers, and their size [m].
OUTLIERS = 0.05
OUTLIER_SIZE = 0.05
# Poses of a path whose derivatives are timed.
PATH = sized(1000, 100_000)


class Outcome(NamedTuple):
    """Errors and time of the calibration of a robot."""

    # Errors over their reported standard errors.
    ratios: list[float]
    chi2_dof: float
    # Root mean square of the foot's residuals in a turn that was not fitted, over the noise.
    held_out: float
    # Largest standard error of a length [m], and errors with outliers over those without.
    length_error: float
    with_outliers: float
    seconds: float


def build_linkage(drawn: Linkage, rng: np.random.Generator) -> Linkage:
    """Return a leg with errors that turns fully, as the drawing does."""
    spreads = [LENGTH_ERROR if d.unit == 'm' else BEND_ERROR for d in drawn.structure.dimensions]
    while True:
        numbers = (np.array(drawn.numbers) + rng.normal(0.0, spreads)).tolist()
        try:
            linkage = drawn.varied(dict(zip(drawn.dimensions, numbers, strict=True)))
        except GeometryError:
            continue
        if turns_fully(linkage):
            return linkage


def simulate(robot: Robot, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, joint angles and points, shape (k, p, 2), of a leg that the engine turns."""
    (leg,) = robot.legs
    mujoco = engine()
    model = mujoco.MjModel.from_xml_string(robot_mjcf(robot, time_step=TIME_STEP))
    state = mujoco.MjData(model)
    steps_per_sample = max(1, int(SECONDS / TIME_STEP) // SAMPLES)
    times: list[float] = []
    crank_angles: list[float] = []
    points: list[list[np.ndarray]] = []
    mujoco.mj_forward(model, state)
    plane = state.body('leg_plane')
    axes = plane.xmat.reshape(3, 3)[:, :2].copy()
    state.ctrl[:] = SPEED
    for step in range(-int(0.2 / TIME_STEP), steps_per_sample * SAMPLES):
        mujoco.mj_step(model, state)
        if step >= 0 and step % steps_per_sample == 0:
            # The state of this very step: positions lag by one otherwise.
            mujoco.mj_kinematics(model, state)
            times.append(state.time)
            crank_angles.append(state.joint(leg.crank_joint).qpos[0])
            points.append([(state.site(n.lower()).xpos - plane.xpos) @ axes for n in names])
    return np.array(times), np.array(crank_angles), np.array(points)


def calibrate_robot(name: str, seed: int) -> Outcome:
    """Build, move, measure and calibrate a robot."""
    robot = robot_of(name)
    rng = np.random.default_rng([seed, *name.encode()])
    (leg,) = robot.legs
    structure = leg.linkage.structure
    names = [*LINKAGES[name]]
    if not names:
        names = [point for point in structure.points if point not in structure.pivots]
    phase = rng.normal(0.0, 0.1)
    real_leg = replace(leg, linkage=build_linkage(leg.linkage, rng), phase=phase)
    times, crank, points = simulate(replace(robot, legs=(real_leg,)), names)
    camera_points = points + rng.normal(0.0, NOISE, points.shape)
    encoder = CrankSamples.of(times, crank)

    def fit(positions: np.ndarray) -> Calibration:
        measured = [
            series_of('point', point, times, positions[:, n], encoder, noise=NOISE)
            for n, point in enumerate(names)
        ]
        return calibrate(leg.linkage, measured, direction=leg.direction, crank_noise=0.0)

    calibration = fit(camera_points)
    duration = cpu_time(lambda: fit(camera_points))
    true_numbers = np.array([*real_leg.linkage.numbers, phase])
    deviations = calibration.standard_errors
    is_observable = np.isfinite(deviations)
    ratios = (errors(calibration, true_numbers) / deviations)[is_observable]
    is_outlier = rng.random(camera_points.shape[:2]) < OUTLIERS
    outliers = is_outlier[..., None] * rng.normal(0.0, OUTLIER_SIZE, camera_points.shape)
    outlier_errors = errors(fit(camera_points + outliers), true_numbers)
    outlier_ratios = (outlier_errors / deviations)[is_observable]
    lengths = [d.is_length for d in structure.dimensions]
    length_deviations = deviations[: len(lengths)][lengths]
    # A turn with other noise, by the engine's own points.
    foot = names.index(structure.foot)
    predicted = linkage_poses(calibration.linkage, leg.direction * crank + calibration.phase).h
    held_out = points[:, foot] + rng.normal(0.0, NOISE, predicted.shape)
    return Outcome(
        ratios.tolist(),
        float(calibration.chi2_dof or np.nan),
        float(np.sqrt(np.mean((predicted - held_out) ** 2))) / NOISE,
        float(np.nanmax(length_deviations)),
        float(np.sqrt(np.nanmean(outlier_ratios**2) / np.mean(ratios**2))),
        duration,
    )


def errors(calibration: Calibration, true_numbers: np.ndarray) -> np.ndarray:
    """Return the errors of dimensions and encoder zero."""
    difference = calibration.values - true_numbers
    difference[-1] = math.remainder(difference[-1], 2.0 * math.pi)
    return np.array(difference)


def count(name: str, robots: int, jobs: int) -> bool:
    """Calibrate robots of a linkage; print and judge the counts."""
    with ProcessPoolExecutor(jobs) as pool:
        outcomes = list(pool.map(partial(calibrate_robot, name), range(robots)))
    ratios = np.concatenate([outcome.ratios for outcome in outcomes])
    coverage = float(np.mean(np.abs(ratios) < 1.96))
    figures = np.array([outcome[1:] for outcome in outcomes])
    chi2, held_out, length_errors, with_outliers, seconds = figures.T
    outliers = np.median(with_outliers)
    print(
        f'{name:14} {robots:4} robots, {100.0 * coverage:5.1f} % within 1.96 sigma, chi2/dof '
        f'{chi2.mean():.3f} ({chi2.min():.3f} .. {chi2.max():.3f}), held-out foot '
        f'{held_out.mean():.3f} noise, worst length {1e3 * length_errors.max():.3f} mm, outliers '
        f'x{outliers:.2f}, {np.median(seconds):.3f} s'
    )
    # The coverage varies more with few robots.
    is_covered = abs(coverage - 0.95) <= 0.02 * math.sqrt(40.0 / robots)
    is_consistent = 0.9 < chi2.mean() < 1.1 and held_out.mean() < 1.05
    return bool(is_covered and is_consistent and outliers < 1.5)


def fit_plainly(drawn: Linkage, times: np.ndarray, positions: dict[str, np.ndarray]) -> np.ndarray:
    """Return the dimensions and the encoder zero of a Klann leg by plain least squares."""

    def residuals(x: np.ndarray) -> np.ndarray:
        numbers = dict(zip(drawn.dimensions, x[:-1].tolist(), strict=True))
        points: Any = klann_poses(KlannGeometry(**numbers), times + x[-1], points=True).points
        differences = [points[:, 'ABCDEFGH'.index(p)] - positions[p] for p in positions]
        return np.concatenate(differences).ravel()

    return np.array(least_squares(residuals, np.array([*drawn.numbers, 0.0])).x)


def compare_fits() -> bool:
    """Fit one leg by both ways; print times and errors."""
    drawn = KlannGeometry.sem104().linkage
    rng = np.random.default_rng(1)
    real_linkage = build_linkage(drawn, rng)
    phase = 0.02
    times = np.linspace(0.0, 2.0 * math.pi, SAMPLES)
    crank = CrankSamples.of(times, times)
    noise = rng.normal(0.0, NOISE, (2, SAMPLES, 2))
    is_outlier = rng.random((2, SAMPLES, 1)) < OUTLIERS
    outliers = is_outlier * rng.normal(0.0, OUTLIER_SIZE, noise.shape)
    print('fit of the Klann leg by foot and G  seconds   rms error / mm, of lengths and pivots')
    # Median time of each fit [s], and root mean square of the errors of the lengths [mm].
    median_times: dict[str, float] = {}
    rms_errors: dict[str, float] = {}
    for suffix, added_errors in (('', noise), (' with outliers', noise + outliers)):
        positions: dict[str, np.ndarray] = {}
        measured: list[MeasuredSeries] = []
        for point, point_errors in zip('HG', added_errors, strict=True):
            true_positions = linkage_poses(real_linkage.with_foot(point), times + phase).h
            positions[point] = true_positions + point_errors
            measured.append(series_of('point', point, times, positions[point], crank, noise=NOISE))
        fits: dict[str, Callable[[], Any]] = {
            'calibrate': partial(calibrate, drawn, measured, crank_noise=0.0),
            'plain least_squares': partial(fit_plainly, drawn, times, positions),
        }
        for name, fit in fits.items():
            fitted = fit()
            numbers = fitted.values if isinstance(fitted, Calibration) else fitted
            length_errors = numbers[:11] - np.array(real_linkage.numbers[:11])
            rms_errors[name + suffix] = rms = 1e3 * float(np.sqrt(np.mean(length_errors**2)))
            seconds = float(np.median([cpu_time(fit) for _ in range(sized(1, 7))]))
            median_times[name + suffix] = seconds
            print(f'{name + suffix:34} {seconds:8.3f}   {rms:.4f}')
    plain_error = rms_errors['plain least_squares with outliers']
    return bool(
        median_times['calibrate'] <= 2.0 * median_times['plain least_squares']
        and rms_errors['calibrate'] <= 1.05 * rms_errors['plain least_squares']
        and rms_errors['calibrate with outliers'] < 0.2 * plain_error
    )


def time_gradients() -> bool:
    """Time poses with all their derivatives and poses without: of a path, and a million."""
    geometry = KlannGeometry.sem104()
    times = []
    for pose_count in (PATH, sized(500, 1_000_000)):
        alphas = np.linspace(0.0, 2.0 * math.pi, pose_count)
        calls = [
            partial(klann_poses, geometry, alphas, gradients=has_gradients, kernel='numba')
            for has_gradients in (False, True)
        ]
        # In turn, so that both have the same machine.
        rounds = [[cpu_time(call) / pose_count for call in calls] for _ in range(sized(2, 15))]
        times.append(np.median(rounds[1:], axis=0))
    (path_time, gradients_time), (_, bulk_time) = times
    ratio = gradients_time / path_time
    print(
        f'path of {PATH} poses: {1e9 * path_time:.1f} ns a pose, with 13 derivatives each '
        f'{1e9 * gradients_time:.1f} ns, {ratio:.2f} times the time; a million with derivatives: '
        f'{1e-6 / bulk_time:.1f} million a second'
    )
    leg = KlannLeg(geometry)
    pose = leg.solve(1.0)
    call_count = sized(20, 2000)
    pose_time = cpu_time(lambda: [leg.gradient(pose) for _ in range(call_count)]) / call_count
    print(f'all derivatives of one pose: {1e6 * pose_time:.0f} us')
    return bool(ratio <= 3.0 and bulk_time < 1e-7 and pose_time < 1e-4)


def cpu_time(call: Callable[[], object]) -> float:
    """Return the time of a call on the processor [s]."""
    start_time = time.process_time()
    call()
    return time.process_time() - start_time


def main() -> int:
    """Run all comparisons; return the exit code."""
    parser = ArgumentParser()
    parser.add_argument('--robots', type=int, default=sized(1, 8, 40))
    parser.add_argument('--jobs', type=int, default=2)
    options = parser.parse_args()
    met = [time_gradients(), compare_fits()]
    names = ['sem104'] if SMOKE else [*LINKAGES]
    met += [count(name, options.robots, options.jobs) for name in names]
    return exit_code(*met)


if __name__ == '__main__':
    raise SystemExit(main())
