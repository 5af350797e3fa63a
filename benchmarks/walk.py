"""
How well a simulated walker walks: its phases, its odometry, its tilt, and what stops it.

    python3 benchmarks/walk.py [--seeds N]
    python3 benchmarks/walk.py --grid [FILE ...] [--friction MU] [--seconds S] [--imu | --no-imu]

With --grid: the mean twist in base_link over 60 s on a grid of 5 x 5 commands, with and without an
IMU. Errors are relative to the command, or to the grid's largest one where it is 0; `3 s` are the
least and the greatest mean yaw rate of any 3 s from the third on, relative to the command.
No ROS: the controller and the odometry of walker_node, and the twin in MuJoCo (the extra `sim`).
"""

import argparse
from collections.abc import Iterator
from itertools import chain, product
from math import cos, degrees, hypot, pi, sin
from pathlib import Path
from typing import NamedTuple

from klann_ros.gait import Feet, Rates, Steering
from klann_ros.kinematics.angles import wrap, yaw_of
from klann_ros.robot import robot_of
from klann_ros.twin import Floor, Motors, Sensors, Twin
from klann_ros.walker import ControllerSettings, imu_reading, MotionLimits, Walker
import numpy as np
from support.aims import sized, SMOKE

WALKER = Path(__file__).resolve().parents[1] / 'config' / 'walker6_two_motors.yaml'
FOOT_RADIUS = 0.004
PERIOD = 0.01
GRID_SECONDS = 60.0
WINDOW = 3.0
# Standstill before the walk, in which the bias of the accelerometer is estimated [s].
STANDS = 2.0
# The commands of walker_node, one after the other [m/s, rad/s].
GRID = (
    (0.15, 0.0), (0.1, 0.03), (0.05, 0.06), (0.0, 0.1), (0.1, -0.05),
    (-0.1, 0.0), (0.05, -0.03), (-0.05, 0.05), (0.0, -0.06), (0.12, 0.02),
)  # fmt: skip
FREE = MotionLimits(max_linear=1.0, max_angular=1.0)
# Walkers of --grid, and its commands: fractions of the speed straight on, and of the yaw rate on
# the spot, at 1 rad/s.
WALKERS = ('walker6_two_motors', 'walker8_two_motors', 'walker_jansen')
SPEEDS = (-0.7, -0.35, 0.0, 0.35, 0.7)
YAW_RATES = (-1.0, -0.5, 0.0, 0.5, 1.0)


class Walk(NamedTuple):
    """Figures of a walk."""

    path: float
    error: float
    yaw_error: float
    nees: float
    tilt: float
    phase: float
    speed: float
    yaw_rate: float
    forwards: float
    yaws: list[float]


def walk(
    steering: Steering,
    twist: tuple[float, float],
    *,
    seconds: float,
    friction: float = 0.8,
    factors: tuple[float, float] = (1.0, 1.0),
    imu: bool = False,
    lock: bool = True,
    gain: float = ControllerSettings().motion_gain,
    seed: int = 0,
) -> Walk:
    """Walk, and return the figures of the walk."""
    feet = steering.feet
    sensors = Sensors(
        encoder_noise=0.002,
        velocity_noise=0.01,
        gyro_noise=0.005,
        accelerometer_noise=0.03,
        accelerometer_offset=0.1,
        orientation_noise=0.002,
    )
    motors = Motors(factors=dict(zip(feet.joints, factors, strict=True)))
    twin = Twin(feet.robot, floor=Floor(friction), motors=motors, sensors=sensors, seed=seed)
    walker = Walker(steering, ControllerSettings(limits=FREE, phase_lock=lock, motion_gain=gain))
    tilt = phase = path = forwards = 0.0
    start = last = twin.truth()
    yaw = 0.0
    yaws: list[float] = []
    standstill = STANDS
    if SMOKE:
        standstill = seconds = 0.1
    for k in range(-round(standstill / PERIOD), round(seconds / PERIOD)):
        now = k * PERIOD
        if imu:
            sample = twin.imu()
            x, y, z, w = sample.orientation
            a, b, c = sample.angular_velocity
            fx, fy, fz = sample.linear_acceleration
            walker.imu(imu_reading((x, y, z, w), (a, b, c), now, (fx, fy, fz)), now)
        odometry = walker.feedback(dict(twin.cranks()), now)
        truth = twin.truth()
        dx = truth.position[0] - last.position[0]
        dy = truth.position[1] - last.position[1]
        last_yaw = yaw_of(*last.orientation)
        turn = wrap(yaw_of(*truth.orientation) - last_yaw)
        heading = last_yaw + turn / 2.0
        path += hypot(dx, dy)
        forwards += dx * cos(heading) + dy * sin(heading)
        yaw += turn
        yaws.append(yaw)
        last = truth
        if now >= 0.0:
            walker.controller.command(*twist, now)
        command = walker.controller.step(now)
        for joint, rate in zip(feet.joints, command.velocity if command else (), strict=True):
            twin.command(joint, rate)
        twin.step(now + PERIOD + STANDS)
        tilt = max(tilt, twin.tilt)
        if now > 2.0 * pi:
            left, right, *_ = twin.cranks().values()
            phase = max(phase, abs(left.position - right.position) if not twist[1] else 0.0)
    if odometry is None:
        raise AssertionError('the cranks are known from the start')
    x_error = odometry.x - last.position[0] + start.position[0]
    y_error = odometry.y - last.position[1] + start.position[1]
    errors = np.array([x_error, y_error, wrap(odometry.yaw - yaw)])
    covariance = np.array(odometry.covariance) + 1e-9 * np.eye(3)
    return Walk(
        path,
        hypot(x_error, y_error),
        errors[2],
        float(errors @ np.linalg.solve(covariance, errors)),
        degrees(tilt),
        degrees(phase),
        path / seconds,
        yaw / seconds,
        forwards / seconds,
        yaws[slice(-round(seconds / PERIOD), None)],
    )


def straight(steering: Steering) -> Iterator[str]:
    """Yield how 25 s straight on went, with motors 5 % apart."""
    yield 'straight on at 0.15 m/s for 25 s, motors 5 % apart'
    for lock in (True, False):
        for friction in sized((0.4,), (0.4, 0.8)):
            figures = walk(
                steering, (0.15, 0.0), seconds=25.0, friction=friction, factors=(1.0, 0.95),
                lock=lock,
            )  # fmt: skip
            yield (
                f'  friction {friction}, {"locked" if lock else "not locked"}: '
                f'odom {figures.error / figures.path:.1%} of {figures.path:.2f} m, cranks '
                f'{figures.phase:.2f} deg apart after the first turn, tilt {figures.tilt:.1f} deg'
            )


def curves(steering: Steering) -> Iterator[str]:
    """Yield how each of the grid went, with and without an IMU."""
    yield 'friction 0.8, 15 s: odom by the way, without and with an IMU; yaw without; tilt'
    for twist in GRID[: sized(1, len(GRID))]:
        without_imu = walk(steering, twist, seconds=15.0)
        with_imu = walk(steering, twist, seconds=15.0, imu=True)
        yield (
            f'  {twist[0]:5.2f} m/s {twist[1]:5.2f} rad/s: '
            f'{without_imu.error / without_imu.path:6.1%} '
            f'{with_imu.error / with_imu.path:6.1%} {degrees(without_imu.yaw_error):7.1f} deg '
            f'{without_imu.tilt:5.1f} deg; went at {without_imu.yaw_rate:5.2f} rad/s'
        )


def consistency(steering: Steering, seeds: int) -> Iterator[str]:
    """Yield how the errors compare with the covariances of odom."""
    rng = np.random.default_rng(1)
    for imu in (False, True):
        nees = np.zeros(seeds)
        for seed in range(seeds):
            friction, *factors = rng.uniform((0.4, 0.95, 0.95), (0.9, 1.05, 1.05)).tolist()
            nees[seed] = walk(
                steering, GRID[seed % len(GRID)], seconds=14.0, friction=friction,
                factors=(factors[0], factors[1]), imu=imu, seed=seed,
            ).nees  # fmt: skip
        yield (
            f'NEES of x, y, yaw over {seeds} seeds, {"with" if imu else "without"} IMU: '
            f'mean {nees.mean():.2f} of 3, {np.mean(nees < 7.81):.0%} below 7.81'
        )


def yaw_rate_range(yaws: list[float], commanded_rate: float) -> str:
    """Return the range of mean yaw rates over any `WINDOW`, relative to the commanded one."""
    size = round(WINDOW / PERIOD)
    starts = yaws[slice(size, -size)]
    ends = yaws[slice(2 * size, None)]
    ratios = (np.array(ends) - np.array(starts)) / (WINDOW * commanded_rate)
    return f'{ratios.min():.2f}..{ratios.max():.2f}' if ratios.size else ''


def commands(file: str, imu: bool, friction: float, seconds: float) -> Iterator[str]:
    """Yield commanded and reached twists on a grid, and their errors."""
    steering = Steering(Feet(robot_of(file), foot_radius=FOOT_RADIUS))
    spot = steering.motion(Rates(-1.0, 1.0)).angular
    max_linear = SPEEDS[-1] * steering.speed
    max_angular = YAW_RATES[-1] * spot
    yield (
        f'{Path(file).stem}, friction {friction:g}, {"with" if imu else "without"} an IMU: '
        'commanded, reached, error'
    )
    yield '             v [m/s]                    w [rad/s]            tilt       3 s'
    for speed_fraction, yaw_rate_fraction in product(SPEEDS, YAW_RATES):
        linear = speed_fraction * steering.speed
        angular = yaw_rate_fraction * spot
        figures = walk(steering, (linear, angular), seconds=seconds, friction=friction, imu=imu)
        linear_error = (figures.forwards - linear) / (abs(linear) or max_linear)
        angular_error = (figures.yaw_rate - angular) / (abs(angular) or max_angular)
        yield (
            f'  {linear:8.4f} {figures.forwards:8.4f} {linear_error:9.1%} '
            f'{angular:9.4f} {figures.yaw_rate:8.4f} {angular_error:9.1%} {figures.tilt:5.1f} deg '
            f' {yaw_rate_range(figures.yaws, angular) if angular else ""}'
        )


def main() -> None:
    """Print the walks, or the grid."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seeds', type=int, default=sized(1, 3, 20))
    parser.add_argument('--grid', nargs='*', metavar='FILE', help='walkers; default: the shipped')
    parser.add_argument('--friction', type=float, default=0.8)
    parser.add_argument('--seconds', type=float, default=GRID_SECONDS)
    parser.add_argument('--imu', action=argparse.BooleanOptionalAction)
    options = parser.parse_args()
    if options.grid is not None:
        shipped = [str(WALKER.with_name(f'{name}.yaml')) for name in WALKERS]
        imus = (True, False) if options.imu is None else (options.imu,)
        for file, imu in product(options.grid or shipped, imus):
            for line in commands(file, imu, options.friction, options.seconds):
                print(line, flush=True)
        return
    steering = Steering(Feet(robot_of(str(WALKER)), foot_radius=FOOT_RADIUS))
    consistency_lines = consistency(steering, options.seeds)
    for line in chain(straight(steering), curves(steering), consistency_lines):
        print(line, flush=True)


if __name__ == '__main__':
    main()
