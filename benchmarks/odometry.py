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
from itertools import product
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
ENCODER = 0.002
CRANK_RATE = 0.01
GYRO = 0.005
FORCE = 0.03
ORIENTATION = 0.002
GYRO_BIAS = 0.003
FORCE_BIAS = 0.1
METHODS = ('ours, no IMU', 'no slip', 'ours, IMU', 'no slip + gyro', 'robot_loc.', 'inv. EKF')
# Distance of the RPE [m]; evo's default of a kilometre is longer than a walk.
RPE_DISTANCE = sized(0.1, 1.0)
# Duration of a walk [s].
SECONDS = sized(2.0, 24.0)
# Seeds of the held-out walks begin here.
HELD_OUT_SEED = 100


Indices = NDArray[np.int64]
# Poses x, y, yaw along a walk, and the covariance at its end.
Estimate = tuple[FloatArray, FloatArray | None]


class Task(NamedTuple):
    """A walk of the comparison: see `recorded`."""

    folder: Path
    robot: str
    floor: str
    seed: int
    is_held_out: bool


class Errors(NamedTuple):
    """Errors of an estimate: see the top; NEES is NaN without a covariance."""

    ape: float
    rpe: float
    rpe_yaw: float
    nees: float


def samples(walk: Walk, seed: int) -> Iterator[Sample]:
    """Yield the readings of sensors with errors along a walk."""
    rng = np.random.default_rng([seed, 77])
    count, joints = walk.positions.shape
    cranks = walk.positions + ENCODER * rng.standard_normal((count, joints))
    rates = walk.velocities + CRANK_RATE * rng.standard_normal((count, joints))
    gyro_bias = GYRO_BIAS * rng.choice([-1, 1], 3)
    force_bias = FORCE_BIAS * rng.choice([-1, 1], 3)
    gyro = walk.gyro + GYRO * rng.standard_normal((count, 3)) + gyro_bias
    force = walk.force + FORCE * rng.standard_normal((count, 3)) + force_bias
    # The yaw of an orientation without a magnetometer drifts as the gyro does.
    half = gyro_bias[2] * PERIOD * np.arange(count) / 2.0
    drift = np.stack([0.0 * half, 0.0 * half, np.sin(half), np.cos(half)], axis=1)
    noise = np.ones((count, 4))
    noise[:, :3] = ORIENTATION / 2.0 * rng.standard_normal((count, 3))
    orientation = _product(_product(drift, walk.orientation), noise)
    orientation /= np.linalg.norm(orientation, axis=1)[:, None]
    for k in range(count):
        quaternion = orientation[k].tolist()
        rate = gyro[k].tolist()
        specific_force = force[k].tolist()
        time = k * PERIOD
        yield Sample(
            cranks[k].tolist(),
            rates[k].tolist(),
            imu_reading(quaternion, rate, time, specific_force),
            quaternion,
            rate,
            specific_force,
            time < STANDS,
        )


def _product(p: FloatArray, q: FloatArray) -> FloatArray:
    a, b, c, d = p.T
    e, f, g, h = q.T
    return np.stack(
        [
            d * e + a * h + b * g - c * f,
            d * f - a * g + b * h + c * e,
            d * g + a * f - b * e + c * h,
            d * h - a * e - b * f - c * g,
        ],
        axis=1,
    )


def estimate_walk(
    feet: Feet, walk: Walk, seed: int, noise: OdometryNoise | None = None
) -> dict[str, Estimate]:
    """Return the estimates of a walk, by method."""
    ours = Odometry(feet, noise)
    ours_without_imu = Odometry(feet, noise)
    no_slip = NoSlip(feet, with_gyro=False)
    no_slip_with_gyro = NoSlip(feet, with_gyro=True)
    ekf = RobotLocalization()
    invariant_ekf = InvariantEkf(feet)
    poses: dict[str, list[list[float]]] = {method: [] for method in METHODS}
    dt = 0.0
    for sample in samples(walk, seed):
        ours.imu(sample.imu, ORIENTATION**2)
        with_imu = ours.update(sample.cranks, sample.rates, dt)
        without_imu = ours_without_imu.update(sample.cranks, sample.rates, dt)
        if dt:
            ekf.predict(dt)
        ekf.measure((3, 4), without_imu.linear, without_imu.rate_variances[:2])
        ekf.measure((5,), (sample.imu.yaw_rate,), (GYRO**2,))
        for baseline in (no_slip, no_slip_with_gyro, invariant_ekf):
            baseline.update(sample, dt)
        dt = PERIOD
        poses['ours, no IMU'].append([without_imu.x, without_imu.y, without_imu.yaw])
        poses['no slip'].append([*no_slip.pose])
        poses['ours, IMU'].append([with_imu.x, with_imu.y, with_imu.yaw])
        poses['no slip + gyro'].append([*no_slip_with_gyro.pose])
        poses['robot_loc.'].append(ekf.pose)
        poses['inv. EKF'].append(invariant_ekf.pose)
    covariances = {
        'ours, no IMU': np.array(without_imu.covariance),
        'ours, IMU': np.array(with_imu.covariance),
        'robot_loc.': ekf.covariance,
        'inv. EKF': invariant_ekf.covariance,
    }
    return {method: (np.array(poses[method]), covariances.get(method)) for method in METHODS}


def true_poses(walk: Walk) -> FloatArray:
    """Return x, y and yaw from the start on, shape (k, 3)."""
    yaw = yaw_of(*walk.orientation[0].tolist())
    displacements = walk.position[:, :2] - walk.position[0, :2]
    c, s = cos(yaw), sin(yaw)
    return np.column_stack([displacements @ [[c, -s], [s, c]], walk.yaw])


def errors_of(true: FloatArray, poses: FloatArray, covariance: FloatArray | None) -> Errors:
    """Return the errors of an estimate."""
    errors = poses - true
    errors[:, 2] = (errors[:, 2] + pi) % (2.0 * pi) - pi
    path = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(true[:, :2], axis=0).T))])
    ape = float(np.sqrt((errors[:, :2] ** 2).sum(axis=1).mean())) / path[-1]
    ends = np.searchsorted(path, path + RPE_DISTANCE)
    begins = np.flatnonzero(ends < len(path))
    rpe = rpe_yaw = nees = np.nan
    if len(begins):
        relative_errors = _relative(poses, begins, ends[begins])
        relative_errors -= _relative(true, begins, ends[begins])
        relative_errors[:, 2] = (relative_errors[:, 2] + pi) % (2.0 * pi) - pi
        rpe = float(np.sqrt((relative_errors[:, :2] ** 2).sum(axis=1).mean()))
        rpe_yaw = float(np.sqrt((relative_errors[:, 2] ** 2).mean()))
    if covariance is not None:
        nees = float(errors[-1] @ np.linalg.solve(covariance + 1e-9 * np.eye(3), errors[-1]))
    return Errors(ape, rpe, rpe_yaw, nees)


def _relative(poses: FloatArray, begins: Indices, ends: Indices) -> FloatArray:
    """Return later poses in the frames of earlier ones."""
    displacements = poses[ends] - poses[begins]
    yaw = poses[begins, 2]
    c, s = np.cos(yaw), np.sin(yaw)
    x, y, turn = displacements.T
    return np.column_stack([c * x + s * y, c * y - s * x, turn])


@cache
def feet_of(name: str) -> Feet:
    """Return the feet of a robot of the comparison."""
    return Feet(robot(name), foot_radius=FOOT_RADIUS)


def compare_methods(task: Task, noise: OdometryNoise) -> tuple[Task, dict[str, Errors]]:
    """Return the errors of all methods on a walk."""
    folder, name, floor, seed, is_held_out = task
    walk = recorded(folder, name, floor, seed, second=is_held_out, seconds=SECONDS)
    true = true_poses(walk)
    estimates = estimate_walk(feet_of(name), walk, seed, noise)
    return task, {method: errors_of(true, *estimates[method]) for method in METHODS}


def table(walk_errors: dict[Task, dict[str, Errors]], *, is_held_out: bool) -> Iterator[str]:
    """Yield the lines of the table."""
    yield '| robot | floor | ' + ' | '.join(METHODS) + ' |'
    yield '|---|---|' + '---|' * len(METHODS)
    # The errors of the methods on the walks of each line.
    groups: dict[tuple[str, str], list[dict[str, Errors]]] = {}
    for task, errors in walk_errors.items():
        if task.is_held_out == is_held_out:
            floor = 'all' if is_held_out else task.floor
            groups.setdefault((task.robot, floor), []).append(errors)
    for (name, floor), group in groups.items():
        cells = []
        for method in METHODS:
            figures = np.array([errors[method] for errors in group])
            ape, rpe, yaw = np.nanmedian(figures[:, :3], axis=0).tolist()
            nees = float(np.mean(figures[:, 3]))
            consistency = '-' if np.isnan(nees) else f'{nees:.1f}' if nees < 100 else f'{nees:.0f}'
            cells.append(f'{ape:.1%} / {100 * rpe:.1f} / {np.degrees(yaw):.2f} / {consistency}')
        yield f'| {name} | {floor} | ' + ' | '.join(cells) + ' |'


def summary(walk_errors: dict[Task, dict[str, Errors]]) -> Iterator[str]:
    """Yield each method's median RPE and APE over all walks."""
    for method in METHODS:
        figures = np.array([errors[method] for errors in walk_errors.values()])
        ape, rpe, yaw = np.nanmedian(figures[:, :3], axis=0).tolist()
        yield (
            f'{method}: median APE {ape:.2%}, RPE {100 * rpe:.2f} cm, {np.degrees(yaw):.2f} deg '
            f'over 1 m, {len(figures)} walks'
        )


def compare_with_evo(folder: Path) -> Iterator[str]:
    """Yield APE and RPE of walks by `errors_of`, and by evo."""
    from evo.core import metrics, trajectory  # noqa: PLC0415

    def path(poses: FloatArray) -> object:
        x, y, yaw = poses.T
        zero = np.zeros(len(poses))
        return trajectory.PoseTrajectory3D(
            np.stack([x, y, zero], axis=1),
            np.stack([np.cos(yaw / 2.0), zero, zero, np.sin(yaw / 2.0)], axis=1),
            PERIOD * np.arange(len(poses)),
        )

    rpe_options = {
        'delta': RPE_DISTANCE,
        'delta_unit': metrics.Unit.meters,
        'rel_delta_tol': 0.01,
        'all_pairs': True,
        'pairs_from_reference': True,
    }
    position = metrics.PoseRelation.translation_part
    rotation = metrics.PoseRelation.rotation_angle_rad
    walks = ('jansen', 'rough'), ('six', 'flat'), ('eight', 'slope')
    for name, floor in walks[: sized(1, 3)]:
        walk = recorded(folder, name, floor, 1, seconds=SECONDS)
        true = true_poses(walk)
        poses, _ = estimate_walk(feet_of(name), walk, 1)['ours, IMU']
        ours = errors_of(true, poses, None)
        evo_errors = []
        for metric in (
            metrics.APE(position),
            metrics.RPE(position, **rpe_options),
            metrics.RPE(rotation, **rpe_options),
        ):
            metric.process_data((path(true), path(poses)))
            evo_errors.append(metric.get_statistic(metrics.StatisticsType.rmse))
        evo_ape, evo_rpe, evo_rpe_yaw = evo_errors
        length = float(np.hypot(*np.diff(true[:, :2], axis=0).T).sum())
        yield (
            f'{name}, {floor}: APE {100 * ours.ape * length:.2f} cm, evo {100 * evo_ape:.2f}; RPE '
            f'{100 * ours.rpe:.2f} cm, evo {100 * evo_rpe:.2f}; yaw '
            f'{np.degrees(ours.rpe_yaw):.3f} deg, evo {np.degrees(evo_rpe_yaw):.3f}'
        )


def errors_of_run(run: Path) -> Errors:
    """Return the errors of odom in a recorded run, by the messages of equal stamps."""
    from nav_msgs.msg import Odometry as Message  # noqa: PLC0415
    from rclpy.serialization import deserialize_message  # noqa: PLC0415

    poses: dict[str, dict[int, tuple[float, float, float]]] = {'/ground_truth': {}, '/odom': {}}
    covariance = np.zeros((3, 3))
    with open_log(run) as log:
        for message in log.messages():
            if message.topic.name not in poses:
                continue
            odometry = deserialize_message(message.data, Message)
            position = odometry.pose.pose.position
            q = odometry.pose.pose.orientation
            yaw = yaw_of(q.x, q.y, q.z, q.w)
            stamp = odometry.header.stamp
            time = stamp.sec * 10**9 + stamp.nanosec
            poses[message.topic.name][time] = position.x, position.y, yaw
            if message.topic.name == '/odom':
                indices = np.ix_([0, 1, 5], [0, 1, 5])
                covariance = np.array(odometry.pose.covariance).reshape(6, 6)[indices]
    times = sorted(poses['/odom'].keys() & poses['/ground_truth'].keys())
    if not times:
        raise SystemExit(f'{run} holds no /odom and /ground_truth of equal stamps')
    starts = np.zeros(len(times), dtype=np.int64)
    relative_poses = {}
    for name, poses_of_topic in poses.items():
        common_poses = np.array([poses_of_topic[time] for time in times])
        relative_poses[name] = _relative(common_poses, starts, np.arange(len(times)))
    return errors_of(relative_poses['/ground_truth'], relative_poses['/odom'], covariance)


def main() -> None:
    """Print the comparison, or the errors of a run."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    default = Path(tempfile.gettempdir()) / f'klann_ros_walks{"_smoke" if SMOKE else ""}'
    parser.add_argument('--walks', type=Path, default=default, help='folder of recorded walks')
    parser.add_argument('--seeds', type=int, default=sized(1, 1, 10), help='walks a row')
    parser.add_argument('--held-out', type=int, default=sized(0, 0, 10), help='walks a robot')
    parser.add_argument('--processes', type=int, default=sized(1, 2))
    parser.add_argument(
        '--stiction-speed',
        type=float,
        default=OdometryNoise.stiction_speed,
        help='parameter of walker_node [m/s]',
    )
    parser.add_argument('--run', type=Path, help='folder or file of a recorded run')
    parser.add_argument('--evo', action='store_true', help='check three walks against evo')
    options = parser.parse_args()
    if options.run:
        try:
            ape, rpe, yaw, nees = errors_of_run(options.run)
        except LogError as error:
            raise SystemExit(str(error)) from None
        print(
            f'APE {ape:.2%} of the path, RPE over 1 m {100 * rpe:.2f} cm and '
            f'{np.degrees(yaw):.2f} deg, NEES at the end {nees:.1f}'
        )
        return
    if options.evo:
        print(*compare_with_evo(options.walks), sep='\n')
        return
    names = ['eight'] if SMOKE else [*ROBOTS]
    tasks = []
    for name, floor in product(names, FLOORS[:1] if SMOKE else FLOORS):
        seeds = range(options.seeds)
        tasks += [Task(options.walks, name, floor, seed, False) for seed in seeds]
    for name in names:
        seeds = range(HELD_OUT_SEED, HELD_OUT_SEED + options.held_out)
        tasks += [Task(options.walks, name, FLOORS[seed % 3], seed, True) for seed in seeds]
    compare = partial(compare_methods, noise=OdometryNoise(stiction_speed=options.stiction_speed))
    with Pool(options.processes) as pool:
        walk_errors = dict(pool.imap(compare, tasks))
    print('APE of the path / RPE over 1 m [cm] / yaw over 1 m [deg] / NEES of 3')
    print(*table(walk_errors, is_held_out=False), sep='\n')
    if options.held_out:
        print('\nHeld-out walks with the second contact model')
        print(*table(walk_errors, is_held_out=True), sep='\n')
    print('', *summary(walk_errors), sep='\n')


if __name__ == '__main__':
    main()
