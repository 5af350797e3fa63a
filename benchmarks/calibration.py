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
from dataclasses import dataclass, replace
from functools import partial
import math
import time
from typing import Any

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

# The linkages and their measured points; '' for all that move.
LINKAGES = {'sem104': 'HG', 'jansen': '', 'quick_return': '', 'watt_six_bar': '', 'strider': ''}
NOISE, LENGTH_ERROR, BEND_ERROR = 1e-4, 5e-4, math.radians(1.0)
SAMPLES, SPEED, SECONDS = 1000, 3.0, 2.3
OUTLIERS, OUTLIER_SIZE = 0.05, 0.05
# Poses of a path whose derivatives are timed.
PATH = sized(1000, 100_000)


@dataclass(frozen=True)
class Outcome:
    """The errors of the calibration of a robot."""

    ratios: list[float]  # errors over reported standard errors
    chi2_dof: float
    # Root mean square of the foot's residuals in a turn that was not fitted, over the noise.
    held_out: float
    # Largest standard error of a length [m], and errors with outliers over those without.
    length_error: float
    with_outliers: float
    seconds: float


def built(drawn: Linkage, rng: np.random.Generator) -> Linkage:
    """Return a leg with errors that turns fully, as the drawing does."""
    scale = [LENGTH_ERROR if d.unit == 'm' else BEND_ERROR for d in drawn.structure.dimensions]
    while True:
        numbers = (np.array(drawn.numbers) + rng.normal(0.0, scale)).tolist()
        try:
            linkage = drawn.varied(dict(zip(drawn.dimensions, numbers, strict=True)))
        except GeometryError:
            continue
        if turns_fully(linkage):
            return linkage


def moved(robot: Robot, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, joint angles and points, shape (k, p, 2), of a leg that the engine turns."""
    (leg,) = robot.legs
    mujoco = engine()
    model = mujoco.MjModel.from_xml_string(robot_mjcf(robot, time_step=5e-4))
    data = mujoco.MjData(model)
    step_count = max(1, int(SECONDS / 5e-4) // SAMPLES)  # of a sample
    settling_steps = int(0.2 / 5e-4)
    samples = []
    mujoco.mj_forward(model, data)
    plane = data.body('leg_plane')
    axes = plane.xmat.reshape(3, 3)[:, :2].copy()
    data.ctrl[:] = SPEED
    for step in range(settling_steps + step_count * SAMPLES):
        mujoco.mj_step(model, data)
        if step >= settling_steps and (step - settling_steps) % step_count == 0:
            # The state of this very step: positions lag by one otherwise.
            mujoco.mj_kinematics(model, data)
            positions = [(data.site(name.lower()).xpos - plane.xpos) @ axes for name in names]
            samples.append((data.time, data.joint(leg.crank_joint).qpos[0], positions))
    times, crank, points = zip(*samples, strict=True)
    return np.array(times), np.array(crank), np.array(points)


def outcome(name: str, seed: int) -> Outcome:
    """Build, move, measure and calibrate a robot."""
    robot = robot_of(name)
    rng = np.random.default_rng([seed, *name.encode()])
    (leg,) = robot.legs
    drawn = leg.linkage
    structure = drawn.structure
    moving = [point for point in structure.points if point not in structure.pivots]
    names = [*LINKAGES[name]] or moving
    phase = rng.normal(0.0, 0.1)
    real = replace(leg, linkage=built(drawn, rng), phase=phase)
    times, crank, points = moved(replace(robot, legs=(real,)), names)
    seen = points + rng.normal(0.0, NOISE, points.shape)
    encoder = CrankSamples.of(times, crank)

    def measured(positions: np.ndarray) -> list[MeasuredSeries]:
        return [
            series_of('point', point, times, positions[:, n], encoder, noise=NOISE)
            for n, point in enumerate(names)
        ]

    fit = partial(calibrate, drawn, direction=leg.direction, crank_noise=0.0)
    calibration = fit(measured(seen))
    duration = seconds(lambda: fit(measured(seen)))
    true = np.array([*real.linkage.numbers, phase])
    is_observable = np.isfinite(calibration.standard_errors)
    ratios = (errors(calibration, true) / calibration.standard_errors)[is_observable]
    is_outlier = rng.random(seen.shape[:2]) < OUTLIERS
    with_outliers = seen + is_outlier[..., None] * rng.normal(0.0, OUTLIER_SIZE, seen.shape)
    outlier_ratios = errors(fit(measured(with_outliers)), true) / calibration.standard_errors
    lengths = [d.is_length for d in structure.dimensions]
    length_errors = calibration.standard_errors[: len(lengths)][lengths]
    # A turn with other noise, by the engine's own points.
    foot = names.index(structure.foot)
    predicted = linkage_poses(calibration.linkage, leg.direction * crank + calibration.phase).h
    held_out = points[:, foot] + rng.normal(0.0, NOISE, predicted.shape)
    return Outcome(
        ratios.tolist(),
        float(calibration.chi2_dof or np.nan),
        float(np.sqrt(np.mean((predicted - held_out) ** 2))) / NOISE,
        float(np.nanmax(length_errors)),
        float(np.sqrt(np.nanmean(outlier_ratios[is_observable] ** 2) / np.mean(ratios**2))),
        duration,
    )


def errors(calibration: Calibration, true: np.ndarray) -> np.ndarray:
    """Return the errors of dimensions and encoder zero."""
    difference = calibration.values - true
    difference[-1] = math.remainder(difference[-1], 2.0 * math.pi)
    return np.array(difference)


def count(name: str, robots: int, jobs: int) -> bool:
    """Calibrate robots of a linkage; print and judge the counts."""
    with ProcessPoolExecutor(jobs) as pool:
        outcomes = list(pool.map(partial(outcome, name), range(robots)))
    ratios = np.concatenate([robot.ratios for robot in outcomes])
    within = float(np.mean(np.abs(ratios) < 1.96))
    chi2 = np.array([robot.chi2_dof for robot in outcomes])
    outliers = float(np.median([robot.with_outliers for robot in outcomes]))
    held_out = float(np.mean([robot.held_out for robot in outcomes]))
    worst = max(robot.length_error for robot in outcomes)
    duration = np.median([robot.seconds for robot in outcomes])
    print(
        f'{name:14} {robots:4} robots, {100.0 * within:5.1f} % within 1.96 sigma, chi2/dof '
        f'{chi2.mean():.3f} ({chi2.min():.3f} .. {chi2.max():.3f}), held-out foot {held_out:.3f} '
        f'noise, worst length {1e3 * worst:.3f} mm, outliers x{outliers:.2f}, {duration:.3f} s'
    )
    # Of few robots the share varies more.
    enough = abs(within - 0.95) <= 0.02 * math.sqrt(40.0 / robots)
    return bool(enough and 0.9 < chi2.mean() < 1.1 and held_out < 1.05 and outliers < 1.5)


def side_by_side() -> bool:
    """Fit one leg by both ways; print times and errors."""
    drawn = KlannGeometry.sem104().linkage
    rng = np.random.default_rng(1)
    real = built(drawn, rng)
    phase = 0.02
    times = np.linspace(0.0, 2.0 * math.pi, SAMPLES)
    crank = CrankSamples.of(times, times)
    noise = rng.normal(0.0, NOISE, (2, SAMPLES, 2))
    with_outliers = noise + (rng.random((2, SAMPLES, 1)) < OUTLIERS) * rng.normal(
        0.0, OUTLIER_SIZE, noise.shape
    )
    true = np.array([*real.numbers, phase])
    print('fit of the Klann leg by foot and G  seconds   rms error / mm, of lengths and pivots')
    totals = {}
    for suffix, errors_of_points in (('', noise), (' with outliers', with_outliers)):
        seen = []
        measured = []
        for point, point_errors in zip('HG', errors_of_points, strict=True):
            path = linkage_poses(real.with_foot(point), times + phase).h + point_errors
            seen.append(path)
            measured.append(series_of('point', point, times, path, crank, noise=NOISE))

        def plain(seen: Sequence[np.ndarray] = seen) -> np.ndarray:
            def residuals(x: np.ndarray) -> np.ndarray:
                numbers = dict(zip(drawn.dimensions, x[:-1].tolist(), strict=True))
                geometry = KlannGeometry(**numbers)
                points: Any = klann_poses(geometry, times + x[-1], points=True).points
                foot, g = (points[:, 'ABCDEFGH'.index(name)] for name in 'HG')
                return np.concatenate([(foot - seen[0]).ravel(), (g - seen[1]).ravel()])

            return np.array(least_squares(residuals, np.array([*drawn.numbers, 0.0])).x)

        def ours(measured: Sequence[MeasuredSeries] = measured) -> np.ndarray:
            return calibrate(drawn, measured, crank_noise=0.0).values

        for way, fit in (('calibrate', ours), ('plain least_squares', plain)):
            fit()
            rounds = [seconds(fit) for _ in range(sized(1, 7))]
            lengths = fit()[:11] - true[:11]
            rms = 1e3 * float(np.sqrt(np.mean(lengths**2)))
            totals[way + suffix] = np.median(rounds), rms
            print(f'{way + suffix:34} {np.median(rounds):8.3f}   {rms:.4f}')
    return bool(
        totals['calibrate'][0] <= 2.0 * totals['plain least_squares'][0]
        and totals['calibrate'][1] <= 1.05 * totals['plain least_squares'][1]
        and totals['calibrate with outliers'][1]
        < 0.2 * totals['plain least_squares with outliers'][1]
    )


def speed() -> bool:
    """Time poses with all their derivatives and poses without: of a path, and a million."""
    geometry = KlannGeometry.sem104()
    times = []
    for count in (PATH, sized(500, 1_000_000)):
        alphas = np.linspace(0.0, 2.0 * math.pi, count)
        solve = partial(klann_poses, geometry, alphas, kernel='numba')
        ways = [partial(solve, gradients=has_gradients) for has_gradients in (False, True)]
        # In turn, so that both have the same machine.
        rounds = [[seconds(way) / count for way in ways] for _ in range(sized(2, 15))]
        times.append(np.median(rounds[1:], axis=0))
    (path, with_gradients), (_, of_many) = times
    ratio = with_gradients / path
    print(
        f'path of {PATH} poses: {1e9 * path:.1f} ns a pose, with 13 derivatives each '
        f'{1e9 * with_gradients:.1f} ns, {ratio:.2f} times the time; a million with derivatives: '
        f'{1e-6 / of_many:.1f} million a second'
    )
    leg = KlannLeg(geometry)
    calls = sized(20, 2000)
    pose = leg.solve(1.0)
    single = seconds(lambda: [leg.gradient(pose) for _ in range(calls)]) / calls
    print(f'all derivatives of one pose: {1e6 * single:.0f} us')
    return bool(ratio <= 3.0 and of_many < 1e-7 and single < 1e-4)


def seconds(call: Callable[[], object]) -> float:
    """Return the time of a call on the processor [s]."""
    start = time.process_time()
    call()
    return time.process_time() - start


def main() -> int:
    """Run all parts; return the exit code."""
    parser = ArgumentParser()
    parser.add_argument('--robots', type=int, default=sized(1, 8, 40))
    parser.add_argument('--jobs', type=int, default=2)
    options = parser.parse_args()
    passed = [speed(), side_by_side()]
    names = ['sem104'] if SMOKE else [*LINKAGES]
    passed += [count(name, options.robots, options.jobs) for name in names]
    return exit_code(*passed)


if __name__ == '__main__':
    raise SystemExit(main())
