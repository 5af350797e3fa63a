"""
How well a simulated walker walks: its phases, its odometry, its tilt, and what stops it.

    python3 benchmarks/walk.py [--seeds N]
    python3 benchmarks/walk.py --grid [FILE ...] [--friction MU] [--seconds S] [--imu | --no-imu]

With --grid: the mean twist in base_link over 60 s on a grid of 5 x 5 commands, with and without an
IMU. Errors are of the command, or of the grid's largest one where it is 0; `3 s` are the least and
the greatest mean yaw rate of any 3 s from the third on, by the command.
No ROS: the controller and the odometry of walker_node, and the twin in MuJoCo (the extra `sim`).
"""

import argparse
from collections.abc import Iterator
from itertools import product
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
GRID_SECONDS, WINDOW = 60.0, 3.0
# It stands for this time before it walks, to learn the bias of its accelerometer [s].
STANDS = 2.0
# The commands of walker_node, one after the other [m/s, rad/s].
GRID = (
    (0.15, 0.0), (0.1, 0.03), (0.05, 0.06), (0.0, 0.1), (0.1, -0.05),
    (-0.1, 0.0), (0.05, -0.03), (-0.05, 0.05), (0.0, -0.06), (0.12, 0.02),
)  # fmt: skip
FREE = MotionLimits(max_linear=1.0, max_angular=1.0)
# Walkers of --grid, and its commands: parts of the speed straight on, and of the yaw rate on the
# spot, at 1 rad/s.
WALKERS = ('walker6_two_motors', 'walker8_two_motors', 'walker_jansen')
SPEEDS, YAW_RATES = (-0.7, -0.35, 0.0, 0.35, 0.7), (-1.0, -0.5, 0.0, 0.5, 1.0)


class Walk(NamedTuple):
    """How a walk went."""

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
    """Walk, and return how it went."""
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
    begin = last = twin.truth()
    turned, yaws = 0.0, list[float]()
    rest, seconds = (0.1, 0.1) if SMOKE else (STANDS, seconds)
    for k in range(-round(rest / PERIOD), round(seconds / PERIOD)):
        now = k * PERIOD
        if imu:
            read = twin.imu()
            x, y, z, w = read.orientation
            a, b, c = read.angular_velocity
            fx, fy, fz = read.linear_acceleration
            walker.imu(imu_reading((x, y, z, w), (a, b, c), now, (fx, fy, fz)), now)
        at = walker.feedback(dict(twin.cranks()), now)
        truth = twin.truth()
        dx, dy = truth.position[0] - last.position[0], truth.position[1] - last.position[1]
        turn = wrap(yaw_of(*truth.orientation) - yaw_of(*last.orientation))
        heading = yaw_of(*last.orientation) + turn / 2.0
        path += hypot(dx, dy)
        forwards += dx * cos(heading) + dy * sin(heading)
        turned += turn
        yaws.append(turned)
        last = truth
        if now >= 0.0:
            walker.controller.command(*twist, now)
        command = walker.controller.step(now)
        for joint, rate in zip(feet.joints, command.velocity if command else (), strict=True):
            twin.command(joint, rate)
        twin.step(now + PERIOD + STANDS)
        tilt = max(tilt, twin.tilt)
        if now > 2.0 * pi:
            cranks = [crank.position for crank in twin.cranks().values()]
            phase = max(phase, abs(cranks[0] - cranks[1]) if not twist[1] else 0.0)
    if at is None:
        raise AssertionError('the cranks are known from the start')
    off = np.array(
        [
            at.x - last.position[0] + begin.position[0],
            at.y - last.position[1] + begin.position[1],
            wrap(at.yaw - turned),
        ]
    )
    return Walk(
        path,
        hypot(off[0], off[1]),
        off[2],
        float(off @ np.linalg.solve(np.array(at.covariance) + 1e-9 * np.eye(3), off)),
        degrees(tilt),
        degrees(phase),
        path / seconds,
        turned / seconds,
        forwards / seconds,
        yaws[slice(-round(seconds / PERIOD), None)],
    )


def straight(steering: Steering) -> Iterator[str]:
    """Yield how 25 s straight on went, with motors 5 % apart."""
    yield 'straight on at 0.15 m/s for 25 s, motors 5 % apart'
    for lock in (True, False):
        for friction in sized((0.4,), (0.4, 0.8)):
            went = walk(
                steering, (0.15, 0.0), seconds=25.0, friction=friction, factors=(1.0, 0.95),
                lock=lock,
            )  # fmt: skip
            yield (
                f'  friction {friction}, {"locked" if lock else "not locked"}: '
                f'odom {went.error / went.path:.1%} of {went.path:.2f} m, '
                f'cranks {went.phase:.2f} deg apart after the first turn, tilt {went.tilt:.1f} deg'
            )


def curves(steering: Steering) -> Iterator[str]:
    """Yield how each of the grid went, with and without an IMU."""
    yield 'friction 0.8, 15 s: odom by the way, without and with an IMU; yaw without; tilt'
    for twist in GRID[: sized(1, len(GRID))]:
        went = walk(steering, twist, seconds=15.0)
        held = walk(steering, twist, seconds=15.0, imu=True)
        yield (
            f'  {twist[0]:5.2f} m/s {twist[1]:5.2f} rad/s: {went.error / went.path:6.1%} '
            f'{held.error / held.path:6.1%} {degrees(went.yaw_error):7.1f} deg '
            f'{went.tilt:5.1f} deg; went at {went.yaw_rate:5.2f} rad/s'
        )


def doubt(steering: Steering, seeds: int) -> Iterator[str]:
    """Yield how the errors compare with what odom says of them."""
    rng = np.random.default_rng(1)
    for imu in (False, True):
        found = []
        for seed in range(seeds):
            friction, one, other = rng.uniform((0.4, 0.95, 0.95), (0.9, 1.05, 1.05))
            found.append(
                walk(
                    steering, GRID[seed % len(GRID)], seconds=14.0, friction=float(friction),
                    factors=(float(one), float(other)), imu=imu, seed=seed,
                ).nees
            )  # fmt: skip
        yield (
            f'NEES of x, y, yaw over {seeds} seeds, {"with" if imu else "without"} IMU: '
            f'mean {np.mean(found):.2f} of 3, {np.mean(np.array(found) < 7.81):.0%} below 7.81'
        )


def window(yaws: list[float], wanted: float) -> str:
    """Return the range of mean yaw rates over any `WINDOW`, by the commanded one."""
    size = round(WINDOW / PERIOD)
    at = np.array(yaws)[slice(size, None)]
    means = (at[slice(size, None)] - at[slice(None, -size)]) / WINDOW
    return f'{min(means / wanted):.2f}..{max(means / wanted):.2f}' if means.size else ''


def commands(run: tuple[str, bool, float, float]) -> Iterator[str]:
    """Yield commanded and reached twists on a grid, and their errors."""
    file, imu, friction, seconds = run
    steering = Steering(Feet(robot_of(file), foot_radius=FOOT_RADIUS))
    spot = steering.motion(Rates(-1.0, 1.0)).angular
    most = SPEEDS[-1] * steering.speed, YAW_RATES[-1] * spot
    yield (
        f'{Path(file).stem}, friction {friction:g}, {"with" if imu else "without"} an IMU: '
        'commanded, reached, error'
    )
    yield '             v [m/s]                    w [rad/s]            tilt       3 s'
    for part, turn in product(SPEEDS, YAW_RATES):
        wanted = part * steering.speed, turn * spot
        went = walk(steering, wanted, seconds=seconds, friction=friction, imu=imu)
        off = [
            (is_ - was) / (abs(was) or full)
            for was, is_, full in zip(wanted, (went.forwards, went.yaw_rate), most, strict=True)
        ]
        yield (
            f'  {wanted[0]:8.4f} {went.forwards:8.4f} {off[0]:9.1%} '
            f'{wanted[1]:9.4f} {went.yaw_rate:8.4f} {off[1]:9.1%} {went.tilt:5.1f} deg  '
            + (window(went.yaws, wanted[1]) if turn else '')
        )


def main() -> None:
    """Print it."""
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
        runs = [
            (file, imu, options.friction, options.seconds)
            for file in options.grid or shipped
            for imu in imus
        ]
        for run in runs:
            for line in commands(run):
                print(line, flush=True)
        return
    steering = Steering(Feet(robot_of(str(WALKER)), foot_radius=FOOT_RADIUS))
    for part in (straight(steering), curves(steering), doubt(steering, options.seeds)):
        for line in part:
            print(line, flush=True)


if __name__ == '__main__':
    main()
