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
    """What a calibration of a robot came to."""

    # Errors over standard errors of what was reported.
    ratios: list[float]
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
            found = drawn.varied(dict(zip(drawn.dimensions, numbers, strict=True)))
        except GeometryError:
            continue
        if turns_fully(found):
            return found


def moved(robot: Robot, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, joint angles and points, shape (k, p, 2), of a leg that the engine turns."""
    (leg,), mujoco = robot.legs, engine()
    model = mujoco.MjModel.from_xml_string(robot_mjcf(robot, time_step=5e-4))
    data = mujoco.MjData(model)
    every, settled = max(1, int(SECONDS / 5e-4) // SAMPLES), int(0.2 / 5e-4)
    rows = []
    mujoco.mj_forward(model, data)
    plane = data.body('leg_plane')
    axes = plane.xmat.reshape(3, 3)[:, :2].copy()
    data.ctrl[:] = SPEED
    for step in range(settled + every * SAMPLES):
        mujoco.mj_step(model, data)
        if step >= settled and (step - settled) % every == 0:
            # The state of this very step: positions lag by one otherwise.
            mujoco.mj_kinematics(model, data)
            at = [(data.site(name.lower()).xpos - plane.xpos) @ axes for name in names]
            rows.append((data.time, data.joint(leg.crank_joint).qpos[0], at))
    times, crank, points = zip(*rows, strict=True)
    return np.array(times), np.array(crank), np.array(points)


def outcome(name: str, seed: int) -> Outcome:
    """Build, move, measure and calibrate a robot."""
    robot, rng = robot_of(name), np.random.default_rng([seed, *name.encode()])
    (leg,) = robot.legs
    drawn, structure = leg.linkage, leg.linkage.structure
    moving = [point for point in structure.points if point not in structure.pivots]
    names = [*LINKAGES[name]] or moving
    phase = rng.normal(0.0, 0.1)
    real = replace(leg, linkage=built(drawn, rng), phase=phase)
    times, crank, points = moved(replace(robot, legs=(real,)), names)
    seen = points + rng.normal(0.0, NOISE, points.shape)
    encoder = CrankSamples.of(times, crank)

    def measured(values: np.ndarray) -> list[MeasuredSeries]:
        return [
            series_of('point', point, times, values[:, n], encoder, noise=NOISE)
            for n, point in enumerate(names)
        ]

    fit = partial(calibrate, drawn, direction=leg.direction, crank_noise=0.0)
    found = fit(measured(seen))
    duration = seconds(lambda: fit(measured(seen)))
    true = np.array([*real.linkage.numbers, phase])
    known = np.isfinite(found.standard_errors)
    ratios = (errors(found, true) / found.standard_errors)[known]
    wrong = rng.random(seen.shape[:2]) < OUTLIERS
    dirty = seen + wrong[..., None] * rng.normal(0.0, OUTLIER_SIZE, seen.shape)
    more = errors(fit(measured(dirty)), true) / found.standard_errors
    lengths = [d.is_length for d in structure.dimensions]
    sizes = found.standard_errors[: len(lengths)][lengths]
    # A turn with other noise, by the engine's own points.
    foot = names.index(structure.foot)
    predicted = linkage_poses(found.linkage, leg.direction * crank + found.phase).h
    new = points[:, foot] + rng.normal(0.0, NOISE, predicted.shape)
    return Outcome(
        ratios.tolist(),
        float(found.chi2_dof or np.nan),
        float(np.sqrt(np.mean((predicted - new) ** 2))) / NOISE,
        float(np.nanmax(sizes)),
        float(np.sqrt(np.nanmean(more[known] ** 2) / np.mean(ratios**2))),
        duration,
    )


def errors(found: Calibration, true: np.ndarray) -> np.ndarray:
    """Return the errors of dimensions and encoder zero."""
    difference = found.values - true
    difference[-1] = math.remainder(difference[-1], 2.0 * math.pi)
    return np.array(difference)


def count(name: str, robots: int, jobs: int) -> bool:
    """Calibrate robots of a linkage; print and judge the counts."""
    with ProcessPoolExecutor(jobs) as pool:
        found = list(pool.map(partial(outcome, name), range(robots)))
    ratios = np.concatenate([each.ratios for each in found])
    within = float(np.mean(np.abs(ratios) < 1.96))
    chi2 = np.array([each.chi2_dof for each in found])
    outliers = float(np.median([each.with_outliers for each in found]))
    held_out = float(np.mean([each.held_out for each in found]))
    print(
        f'{name:14} {robots:4} robots, {100.0 * within:5.1f} % within 1.96 sigma, chi2/dof '
        f'{chi2.mean():.3f} ({chi2.min():.3f} .. {chi2.max():.3f}), held-out foot {held_out:.3f} '
        f'noise, worst length {1e3 * max(each.length_error for each in found):.3f} mm, outliers '
        f'x{outliers:.2f}, {np.median([each.seconds for each in found]):.3f} s'
    )
    # Of few robots the share varies more.
    enough = abs(within - 0.95) <= 0.02 * math.sqrt(40.0 / robots)
    return bool(enough and 0.9 < chi2.mean() < 1.1 and held_out < 1.05 and outliers < 1.5)


def side_by_side() -> bool:
    """Fit one leg by both ways; print times and errors."""
    drawn = KlannGeometry.sem104().linkage
    rng = np.random.default_rng(1)
    real, phase = built(drawn, rng), 0.02
    times = np.linspace(0.0, 2.0 * math.pi, SAMPLES)
    crank = CrankSamples.of(times, times)
    noise = rng.normal(0.0, NOISE, (2, SAMPLES, 2))
    dirty = noise + (rng.random((2, SAMPLES, 1)) < OUTLIERS) * rng.normal(
        0.0, OUTLIER_SIZE, noise.shape
    )
    true = np.array([*real.numbers, phase])
    print('fit of the Klann leg by foot and G  seconds   rms error / mm, of lengths and pivots')
    totals = {}
    for what, added in (('', noise), (' with outliers', dirty)):
        seen = [
            linkage_poses(real.with_foot(point), times + phase).h + own
            for point, own in zip('HG', added, strict=True)
        ]
        measured = [
            series_of('point', point, times, values, crank, noise=NOISE)
            for point, values in zip('HG', seen, strict=True)
        ]

        def plain(seen: Sequence[np.ndarray] = seen) -> np.ndarray:
            def residuals(x: np.ndarray) -> np.ndarray:
                numbers = dict(zip(drawn.dimensions, x[:-1].tolist(), strict=True))
                geometry = KlannGeometry(**numbers)
                points: Any = klann_poses(geometry, times + x[-1], points=True).points
                return np.concatenate(
                    [
                        (points[:, 'ABCDEFGH'.index(p)] - s).ravel()
                        for p, s in zip('HG', seen, strict=True)
                    ]
                )

            return np.array(least_squares(residuals, np.array([*drawn.numbers, 0.0])).x)

        def ours(measured: Sequence[MeasuredSeries] = measured) -> np.ndarray:
            return calibrate(drawn, measured, crank_noise=0.0).values

        for way, fit in (('calibrate', ours), ('plain least_squares', plain)):
            fit()
            rounds = [seconds(fit) for _ in range(sized(1, 7))]
            lengths = fit()[:11] - true[:11]
            rms = 1e3 * float(np.sqrt(np.mean(lengths**2)))
            totals[way + what] = np.median(rounds), rms
            print(f'{way + what:34} {np.median(rounds):8.3f}   {rms:.4f}')
    return bool(
        totals['calibrate'][0] <= 2.0 * totals['plain least_squares'][0]
        and totals['calibrate'][1] <= 1.05 * totals['plain least_squares'][1]
        and totals['calibrate with outliers'][1]
        < 0.2 * totals['plain least_squares with outliers'][1]
    )


def speed() -> bool:
    """Time poses with all their derivatives and poses without: of a path, and a million."""
    geometry, times = KlannGeometry.sem104(), []
    for count in (PATH, sized(500, 1_000_000)):
        alphas = np.linspace(0.0, 2.0 * math.pi, count)
        ways = [
            partial(klann_poses, geometry, alphas, gradients=wanted, kernel='numba')
            for wanted in (False, True)
        ]
        # In turn, so that both have the same machine.
        rounds = [[seconds(way) / count for way in ways] for _ in range(sized(2, 15))]
        times.append(np.median(rounds[1:], axis=0))
    (path, with_gradients), (_, many) = times
    ratio = with_gradients / path
    print(
        f'path of {PATH} poses: {1e9 * path:.1f} ns a pose, with 13 derivatives each '
        f'{1e9 * with_gradients:.1f} ns, {ratio:.2f} times the time; a million with derivatives: '
        f'{1e-6 / many:.1f} million a second'
    )
    leg, calls = KlannLeg(geometry), sized(20, 2000)
    pose = leg.solve(1.0)
    one = seconds(lambda: [leg.gradient(pose) for _ in range(calls)]) / calls
    print(f'all derivatives of one pose: {1e6 * one:.0f} us')
    return bool(ratio <= 3.0 and many < 1e-7 and one < 1e-4)


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
