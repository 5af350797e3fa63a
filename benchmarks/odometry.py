"""
Odometry compared: walker_node's and that of others, on the same simulated walks.

    python3 benchmarks/odometry.py [--walks FOLDER] [--seeds N] [--held-out N] [--processes N]
        [--stiction-speed M/S]
    python3 benchmarks/odometry.py --evo
    python3 benchmarks/odometry.py --run RUN

Six robots walk on flat floors, slopes within 3 deg and rough floors of +-10 mm, friction 0.4 to
1.0, with noise on all sensors, a gyro bias and yaw drift of 0.003 rad/s (0.17 deg/s) and an
accelerometer bias of 0.1 m/s^2. Walks are simulated in MuJoCo (the extra `sim`) and kept in
FOLDER. Held-out walks have a second contact model: softer, with pyramids of friction.

Printed for each robot, floor and method, in the median over the walks: APE (root mean square of
the position error along the walk, of the path), RPE over 1 m of path (position, and yaw), as evo
defines them, and NEES of x, y and yaw at the end, in the mean; 3 is right. With --evo: APE and RPE
of three walks beside those of evo (M. Grupp; pip install evo), with pairs from the true path. With
--run: the same of `odom` against `ground_truth` in a recorded run (ROS 2).
"""

import argparse
from collections.abc import Iterator
from functools import cache, partial
from math import cos, pi, sin
from multiprocessing import Pool
from pathlib import Path
import tempfile
from typing import NamedTuple

from klann_ros.gait import Feet
from klann_ros.kinematics.angles import yaw_of
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.log import LogError, open_log
from klann_ros.walker import imu_reading, Odometry, OdometryNoise
import numpy as np
from numpy.typing import NDArray
from support.aims import sized, SMOKE
from support.invariant_ekf import InvariantEkf
from support.odometry_baselines import NoSlip, RobotLocalization, Sample
from support.odometry_walks import (
    FLOORS,
    FOOT_RADIUS,
    PERIOD,
    recorded,
    robot,
    ROBOTS,
    STANDS,
    Walk,
)

# Errors of the sensors: see the top.
ENCODER, CRANK_RATE, GYRO, FORCE, ORIENTATION = 0.002, 0.01, 0.005, 0.03, 0.002
GYRO_BIAS, FORCE_BIAS = 0.003, 0.1
METHODS = ('ours, no IMU', 'no slip', 'ours, IMU', 'no slip + gyro', 'robot_loc.', 'inv. EKF')
# A kilometre is no walk: RPE over this distance [m].
RPE_DISTANCE = sized(0.1, 1.0)
# Of a walk [s].
SECONDS = sized(2.0, 24.0)
SECOND_SEEDS = 100


Indices = NDArray[np.int64]


class Result(NamedTuple):
    """Errors of an estimate: see the top; NEES is NaN without a covariance."""

    ape: float
    rpe: float
    rpe_yaw: float
    nees: float


def samples(walk: Walk, seed: int) -> Iterator[Sample]:
    """Yield what sensors with errors read along a walk."""
    rng = np.random.default_rng([seed, 77])
    count, joints = walk.positions.shape
    cranks = walk.positions + ENCODER * rng.standard_normal((count, joints))
    rates = walk.velocities + CRANK_RATE * rng.standard_normal((count, joints))
    gyro_bias, bias = GYRO_BIAS * rng.choice([-1, 1], 3), FORCE_BIAS * rng.choice([-1, 1], 3)
    gyro = walk.gyro + GYRO * rng.standard_normal((count, 3)) + gyro_bias
    force = walk.force + FORCE * rng.standard_normal((count, 3)) + bias
    # The yaw of an orientation without a magnetometer drifts as the gyro does.
    half = gyro_bias[2] * PERIOD * np.arange(count) / 2.0
    drift = np.stack([0.0 * half, 0.0 * half, np.sin(half), np.cos(half)], axis=1)
    noise = np.ones((count, 4))
    noise[:, :3] = ORIENTATION / 2.0 * rng.standard_normal((count, 3))
    orientation = _product(_product(drift, walk.orientation), noise)
    orientation /= np.linalg.norm(orientation, axis=1)[:, None]
    for k in range(count):
        (x, y, z, w), (a, b, c), (u, v, f) = (
            values[k].tolist() for values in (orientation, gyro, force)
        )
        yield Sample(
            cranks[k].tolist(),
            rates[k].tolist(),
            imu_reading((x, y, z, w), (a, b, c), k * PERIOD, (u, v, f)),
            [x, y, z, w],
            (a, b, c),
            (u, v, f),
            k * PERIOD < STANDS,
        )


def _product(p: FloatArray, q: FloatArray) -> FloatArray:
    (a, b, c, d), (e, f, g, h) = p.T, q.T
    return np.stack(
        [
            d * e + a * h + b * g - c * f,
            d * f - a * g + b * h + c * e,
            d * g + a * f - b * e + c * h,
            d * h - a * e - b * f - c * g,
        ],
        axis=1,
    )


def estimates(
    feet: Feet, walk: Walk, seed: int, noise: OdometryNoise | None = None
) -> dict[str, tuple[FloatArray, FloatArray | None]]:
    """Return poses x, y, yaw along a walk and the last covariance, by method."""
    ours, without = Odometry(feet, noise), Odometry(feet, noise)
    dead, gyro = NoSlip(feet, with_gyro=False), NoSlip(feet, with_gyro=True)
    fused, invariant = RobotLocalization(), InvariantEkf(feet)
    poses: dict[str, list[list[float]]] = {method: [] for method in METHODS}
    dt = 0.0
    for sample in samples(walk, seed):
        ours.imu(sample.imu, ORIENTATION**2)
        one = ours.update(sample.cranks, sample.rates, dt)
        other = without.update(sample.cranks, sample.rates, dt)
        if dt:
            fused.predict(dt)
        fused.measure((3, 4), other.linear, other.rate_variances[:2])
        fused.measure((5,), (sample.imu.yaw_rate,), (GYRO**2,))
        for baseline in (dead, gyro, invariant):
            baseline.update(sample, dt)
        dt = PERIOD
        found = (
            [other.x, other.y, other.yaw], [*dead.pose], [one.x, one.y, one.yaw], [*gyro.pose],
            fused.pose, invariant.pose,
        )  # fmt: skip
        for method, pose in zip(METHODS, found, strict=True):
            poses[method].append(pose)
    ends = other.covariance, None, one.covariance, None, fused.covariance, invariant.covariance
    return {
        method: (np.array(poses[method]), None if end is None else np.array(end))
        for method, end in zip(METHODS, ends, strict=True)
    }


def truth(walk: Walk) -> FloatArray:
    """Return x, y and yaw from the start on, shape (k, 3)."""
    yaw = yaw_of(*walk.orientation[0])
    away = walk.position[:, :2] - walk.position[0, :2]
    c, s = cos(yaw), sin(yaw)
    return np.column_stack([away @ [[c, -s], [s, c]], walk.yaw])


def result(true: FloatArray, found: FloatArray, covariance: FloatArray | None) -> Result:
    """Return the errors of an estimate."""
    error = found - true
    error[:, 2] = (error[:, 2] + pi) % (2.0 * pi) - pi
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(true[:, :2], axis=0).T))])
    ape = float(np.sqrt((error[:, :2] ** 2).sum(axis=1).mean())) / way[-1]
    ends = np.searchsorted(way, way + RPE_DISTANCE)
    begins = np.flatnonzero(ends < len(way))
    rpe = rpe_yaw = nees = np.nan
    if len(begins):
        away = _relative(found, begins, ends[begins]) - _relative(true, begins, ends[begins])
        away[:, 2] = (away[:, 2] + pi) % (2.0 * pi) - pi
        rpe = float(np.sqrt((away[:, :2] ** 2).sum(axis=1).mean()))
        rpe_yaw = float(np.sqrt((away[:, 2] ** 2).mean()))
    if covariance is not None:
        nees = float(error[-1] @ np.linalg.solve(covariance + 1e-9 * np.eye(3), error[-1]))
    return Result(ape, rpe, rpe_yaw, nees)


def _relative(poses: FloatArray, begins: Indices, ends: Indices) -> FloatArray:
    """Return poses seen from earlier ones."""
    away = poses[ends] - poses[begins]
    yaw = poses[begins, 2]
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = away[:, 0], away[:, 1]
    return np.column_stack([c * x + s * y, c * y - s * x, away[:, 2]])


@cache
def feet_of(name: str) -> Feet:
    """Return the feet of a robot of the comparison."""
    return Feet(robot(name), foot_radius=FOOT_RADIUS)


Task = tuple[Path, str, str, int, bool]


def compared(task: Task, noise: OdometryNoise) -> tuple[Task, dict[str, Result]]:
    """Return the errors of all methods on a walk."""
    folder, name, floor, seed, second = task
    walk = recorded(folder, name, floor, seed, second=second, seconds=SECONDS)
    true = truth(walk)
    found = estimates(feet_of(name), walk, seed, noise)
    return task, {method: result(true, *each) for method, each in found.items()}


def table(results: dict[Task, dict[str, Result]], *, second: bool) -> Iterator[str]:
    """Yield the lines of the table."""
    yield '| robot | floor | ' + ' | '.join(METHODS) + ' |'
    yield '|---|---|' + '---|' * len(METHODS)
    rows = {(task[1], 'all' if second else task[2]): None for task in results if task[4] == second}
    for name, floor in rows:
        cells = []
        for method in METHODS:
            found = [
                each[method]
                for task, each in results.items()
                if task[1] == name and task[4] == second and floor in (task[2], 'all')
            ]
            ape, rpe, yaw = np.nanmedian(np.array(found)[:, :3], axis=0).tolist()
            nees = float(np.mean([each.nees for each in found]))
            consistency = '-' if np.isnan(nees) else f'{nees:.1f}' if nees < 100 else f'{nees:.0f}'
            cells.append(f'{ape:.1%} / {100 * rpe:.1f} / {np.degrees(yaw):.2f} / {consistency}')
        yield f'| {name} | {floor} | ' + ' | '.join(cells) + ' |'


def summary(results: dict[Task, dict[str, Result]]) -> Iterator[str]:
    """Yield each method's median RPE and APE over all walks."""
    for method in METHODS:
        found = np.array([each[method] for each in results.values()])
        ape, rpe, yaw = np.nanmedian(found[:, :3], axis=0).tolist()
        yield (
            f'{method}: median APE {ape:.2%}, RPE {100 * rpe:.2f} cm, {np.degrees(yaw):.2f} deg '
            f'over 1 m, {len(found)} walks'
        )


def checked(folder: Path) -> Iterator[str]:
    """Yield APE and RPE of walks by `result`, and by evo."""
    from evo.core import metrics, trajectory  # noqa: PLC0415

    def path(poses: FloatArray) -> object:
        x, y, yaw = poses.T
        zero = np.zeros(len(poses))
        return trajectory.PoseTrajectory3D(
            np.stack([x, y, zero], axis=1),
            np.stack([np.cos(yaw / 2.0), zero, zero, np.sin(yaw / 2.0)], axis=1),
            PERIOD * np.arange(len(poses)),
        )

    metre = {
        'delta': RPE_DISTANCE,
        'delta_unit': metrics.Unit.meters,
        'all_pairs': True,
        'pairs_from_reference': True,
    }
    moved, turned = metrics.PoseRelation.translation_part, metrics.PoseRelation.rotation_angle_rad
    walks = ('jansen', 'rough'), ('six', 'flat'), ('eight', 'slope')
    for name, floor in walks[: sized(1, 3)]:
        walk = recorded(folder, name, floor, 1, seconds=SECONDS)
        true = truth(walk)
        poses, _ = estimates(feet_of(name), walk, 1)['ours, IMU']
        ours, found = result(true, poses, None), []
        for metric in (
            metrics.APE(moved),
            metrics.RPE(moved, rel_delta_tol=0.01, **metre),
            metrics.RPE(turned, rel_delta_tol=0.01, **metre),
        ):
            metric.process_data((path(true), path(poses)))
            found.append(metric.get_statistic(metrics.StatisticsType.rmse))
        way = float(np.hypot(*np.diff(true[:, :2], axis=0).T).sum())
        yield (
            f'{name}, {floor}: APE {100 * ours.ape * way:.2f} cm, evo {100 * found[0]:.2f}; RPE '
            f'{100 * ours.rpe:.2f} cm, evo {100 * found[1]:.2f}; yaw '
            f'{np.degrees(ours.rpe_yaw):.3f} deg, evo {np.degrees(found[2]):.3f}'
        )


def of_run(run: Path) -> Result:
    """Return the errors of odom in a recorded run, of the messages of equal stamps."""
    from nav_msgs.msg import Odometry as Message  # noqa: PLC0415
    from rclpy.serialization import deserialize_message  # noqa: PLC0415

    poses: dict[str, dict[int, tuple[float, float, float]]] = {'/ground_truth': {}, '/odom': {}}
    covariance = np.zeros((3, 3))
    with open_log(run) as log:
        for message in log.messages():
            if message.topic.name not in poses:
                continue
            read = deserialize_message(message.data, Message)
            at, q, stamp = read.pose.pose.position, read.pose.pose.orientation, read.header.stamp
            yaw = yaw_of(q.x, q.y, q.z, q.w)
            time = stamp.sec * 10**9 + stamp.nanosec
            poses[message.topic.name][time] = at.x, at.y, yaw
            if message.topic.name == '/odom':
                places = np.ix_([0, 1, 5], [0, 1, 5])
                covariance = np.array(read.pose.covariance).reshape(6, 6)[places]
    times = sorted(poses['/odom'].keys() & poses['/ground_truth'].keys())
    if not times:
        raise SystemExit(f'{run} holds no /odom and /ground_truth of equal stamps')
    true, found = (
        _relative(values, np.zeros(len(values), dtype=np.int64), np.arange(len(values)))
        for values in (np.array([poses[name][at] for at in times]) for name in poses)
    )
    return result(true, found, covariance)


def main() -> None:
    """Print it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    default = Path(tempfile.gettempdir()) / f'klann_ros_walks{"_smoke" if SMOKE else ""}'
    parser.add_argument('--walks', type=Path, default=default, help='folder of recorded walks')
    parser.add_argument('--seeds', type=int, default=sized(1, 1, 10), help='walks a row')
    parser.add_argument('--held-out', type=int, default=sized(0, 0, 10), help='walks a robot')
    parser.add_argument('--processes', type=int, default=sized(1, 2))
    default_speed, text = OdometryNoise.stiction_speed, 'parameter of walker_node [m/s]'
    parser.add_argument('--stiction-speed', type=float, default=default_speed, help=text)
    parser.add_argument('--run', type=Path, help='folder or file of a recorded run')
    parser.add_argument('--evo', action='store_true', help='check three walks against evo')
    options = parser.parse_args()
    if options.run:
        try:
            ape, rpe, yaw, nees = of_run(options.run)
        except LogError as error:
            raise SystemExit(str(error)) from None
        print(
            f'APE {ape:.2%} of the path, RPE over 1 m {100 * rpe:.2f} cm and '
            f'{np.degrees(yaw):.2f} deg, NEES at the end {nees:.1f}'
        )
        return
    if options.evo:
        print(*checked(options.walks), sep='\n')
        return
    names, floors = (['eight'], FLOORS[:1]) if SMOKE else ([*ROBOTS], FLOORS)
    tasks: list[Task] = [
        (options.walks, name, floor, seed, False)
        for name in names for floor in floors for seed in range(options.seeds)
    ]  # fmt: skip
    tasks += [
        (options.walks, name, FLOORS[seed % 3], seed, True)
        for name in names for seed in range(SECOND_SEEDS, SECOND_SEEDS + options.held_out)
    ]  # fmt: skip
    noise = OdometryNoise(stiction_speed=options.stiction_speed)
    with Pool(options.processes) as pool:
        results = dict(pool.imap_unordered(partial(compared, noise=noise), tasks, chunksize=1))
    results = {task: results[task] for task in tasks}
    print('APE of the path / RPE over 1 m [cm] / yaw over 1 m [deg] / NEES of 3')
    print(*table(results, second=False), sep='\n')
    if options.held_out:
        print('\nHeld-out walks with the second contact model')
        print(*table(results, second=True), sep='\n')
    print('', *summary(results), sep='\n')


if __name__ == '__main__':
    main()
