"""
Healthy walks with the monitors of faults: none may be reported.

    python3 benchmarks/walker_faults.py [--walks FOLDER] [--seconds S] [--processes N]

With --walks the monitors run over the recorded walks of `benchmarks/odometry.py`. The command of
a motor is its rate 20 ms later, or the double of it: that of a motor which reaches half of its
commanded rate. The encoder has 2 mrad of noise, or also the counts of one of 64 a turn. The
monitor of the body takes the recorded IMU.

Without, walkers are simulated in MuJoCo (the extra `sim`) in closed loop, with slow motors, six
motors, friction 0.3 to 1.2, joints that give way, an IMU that samples an instant, and both
encoders. Each walks straight on, in curves, on the spot, slowly and backwards, with standstills.

Printed for each condition: walks, faults, the smallest part of its commanded path that a crank
moved in a window of the following error (a fault is below 0.1), and in half a turn (0.22); the
largest tilt [deg] and the smallest mean specific force [m/s^2] (faults: 30, 3).
"""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import product
from math import degrees, inf, pi
from multiprocessing import Pool
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from klann_ros.gait import Feet, Rates, Steering
from klann_ros.robot import Robot, robot_of
from klann_ros.twin import Floor, ImuSampling, Motors, Sensors, Twin
from klann_ros.walker import ControllerSettings, FaultLatch, imu_reading, WalkController
from klann_ros.walker.feedback import CrankFeedback
from klann_ros.walker.monitors import BodyMonitor, FollowingMonitor, PathMark, PathWindow
from support.aims import exit_code, is_met, sized
from support.odometry_walks import (
    CONFIG,
    FLOORS,
    FOOT_RADIUS,
    PERIOD,
    recorded,
    ROBOTS,
    STANDS,
    Walk,
)  # fmt: skip

# Counts a turn of a coarse encoder, and the noise of a fine one [rad].
COUNTS = 64
NOISE = 0.002
# Samples by which a command precedes its rate.
LEAD = 2
# Rate below which a motor is commanded to stand [rad/s].
STANDSTILL_RATE = 1e-3
SECONDS = sized(0.8, 40.0)
# Fractions of the greatest speed and yaw rate, one after the other.
COMMANDS = (
    (1.0, 0.0), (0.7, 0.4), (0.0, 0.0), (0.0, 1.0), (0.0, -0.1), (-0.8, 0.0), (0.05, 0.0),
    (-0.6, -0.4), (0.3, 0.6), (0.0, 0.0),
)  # fmt: skip


class Condition(NamedTuple):
    """A healthy walker, and what may be uncommon about it."""

    name: str
    file: str = 'walker6_two_motors'
    factors: tuple[float, ...] = (1.0,)
    friction: float = 0.8
    compliance: float = 0.0
    noise: float = 0.0
    counts: int = 0
    has_velocity: bool = True
    sampling: ImuSampling = ImuSampling.MEAN
    # Bandwidth of the motors [rad/s].
    bandwidth: float = 50.0
    is_six: bool = False


CONDITIONS = (
    Condition('as it is'),
    Condition('all motors at half of their speed', factors=(0.5, 0.5)),
    Condition('one motor at half of its speed', factors=(1.0, 0.5)),
    Condition(
        'one at half, 2 mrad, no velocity', factors=(0.5, 1.0), noise=NOISE, has_velocity=False
    ),
    Condition('one at half, 64 counts', factors=(0.5, 1.0), counts=COUNTS),
    Condition('64 counts, no velocity', counts=COUNTS, has_velocity=False),
    Condition('friction 0.3', friction=0.3, noise=NOISE),
    Condition('friction 1.2', friction=1.2, noise=NOISE),
    Condition('joints of 2 ms', compliance=0.002, noise=NOISE),
    Condition('joints of 8 ms, an instant', compliance=0.008, sampling=ImuSampling.INSTANT),
    Condition('slow motors: 5 rad/s', bandwidth=5.0),
    Condition('six motors', 'walker6', is_six=True, noise=NOISE),
    Condition('six motors, one at half', 'walker6', (1.0, 1.0, 0.5), is_six=True, counts=COUNTS),
    Condition('one motor', 'walker6', friction=0.5),
    Condition('eight legs', 'walker8_two_motors', sampling=ImuSampling.INSTANT, noise=NOISE),
    Condition('Jansen legs', 'walker_jansen', sampling=ImuSampling.INSTANT, counts=COUNTS),
)


class Margins(NamedTuple):
    """The margins to the faults: see the top."""

    fault: str
    ratio: float
    turn_ratio: float
    tilt: float
    force: float


class Observer:
    """The monitors of cranks and body, and how near they came to a fault."""

    def __init__(self, monitors: list[FollowingMonitor], latch: FaultLatch) -> None:
        self.monitors = monitors
        self.latch = latch
        self.body = BodyMonitor()
        self.ratios = [inf, inf]
        self.tilt = 0.0
        self.force = inf

    def read_imu(self, orientation: Any, angular: Any, force: Any, now: float) -> None:
        """Take a reading of the IMU."""
        reading = imu_reading(orientation, angular, now, force)
        if fault := self.body.update(reading, now, ControllerSettings().max_tilt):
            self.latch.trip(fault)
        self.tilt = max(self.tilt, degrees(self.body.tilt))
        # The first reading of the simulated IMU is zero.
        if now > STANDS:
            self.force = min(self.force, self.body._norm)  # noqa: SLF001

    def judge(self) -> None:
        """Take note of the paths of all cranks."""
        for monitor in self.monitors:
            windows = monitor._window, monitor._turn_window  # noqa: SLF001
            for k, window in enumerate(windows):
                self.ratios[k] = min(self.ratios[k], ratio(monitor, window))

    @property
    def margins(self) -> Margins:
        """Return the margins so far."""
        fault = self.latch.fault
        ratio, turn_ratio = self.ratios
        return Margins(fault.text if fault else '', ratio, turn_ratio, self.tilt, self.force)


def ratio(monitor: FollowingMonitor, window: PathWindow) -> float:
    """Return the part of the commanded path of a window that the crank moved."""
    path: PathMark = monitor._path  # noqa: SLF001
    if not window.marks:
        return inf
    commanded = window.marks[-1].commanded - window.marks[0].commanded
    if commanded < window.length:
        return inf
    return (path.measured - window.marks[0].measured) / commanded


def encoded(
    angles: Mapping[str, tuple[float, float]], random: Random, noise: float, counts: int,
    *, has_velocity: bool = True,
) -> dict[str, tuple[float, float | None]]:  # fmt: skip
    """Return the readings of the encoders of cranks."""
    readings: dict[str, tuple[float, float | None]] = {}
    for joint, (position, velocity) in angles.items():
        measured = position + random.gauss(0.0, noise)
        if counts:
            measured = round(measured * counts / (2.0 * pi)) * 2.0 * pi / counts
        readings[joint] = measured, velocity if has_velocity else None
    return readings


def replayed(walk: Walk, seed: int, factor: float, counts: int) -> Margins:
    """Return the margins of a recorded walk, of motors that reach a fraction of their command."""
    settings = ControllerSettings()
    random = Random(seed)  # noqa: S311 - noise
    cranks = [CrankFeedback(f'crank_{k}', 12.0) for k in range(walk.positions.shape[1])]
    monitors = [
        FollowingMonitor(crank, settings.max_following_error, settings.feedback_timeout)
        for crank in cranks
    ]
    observer = Observer(monitors, FaultLatch())
    commands = (walk.velocities[LEAD:] / factor).tolist()
    positions = walk.positions.tolist()
    velocities = walk.velocities.tolist()
    for k, rates in enumerate(commands):
        now = k * PERIOD
        states = {}
        for n, crank in enumerate(cranks):
            states[crank.joint] = (positions[k][n], velocities[k][n])
        readings = encoded(states, random, NOISE, counts)
        for crank, monitor, rate in zip(cranks, monitors, rates, strict=True):
            crank.read(*readings[crank.joint], now)
            command = rate if abs(rate) > STANDSTILL_RATE else 0.0
            if fault := monitor.update(command, PERIOD, now):
                observer.latch.trip(fault)
        observer.judge()
        gyro = walk.gyro[k].tolist()
        observer.read_imu(walk.orientation[k].tolist(), gyro, walk.force[k].tolist(), now)
    return observer.margins


def recorded_margins(task: tuple[Path, str, str, int]) -> list[tuple[str, Margins]]:
    """Return the margins of one recorded walk, of both encoders and motors."""
    folder, name, floor, seed = task
    walk = recorded(folder, name, floor, seed)
    margins = []
    for counts, factor in product((0, COUNTS), (1.0, 0.5)):
        encoder = f'{counts} counts' if counts else '2 mrad'
        label = f'{name}, {encoder}, motors at {factor:g}'
        margins.append((label, replayed(walk, seed, factor, counts)))
    return margins


def with_six_motors(robot: Robot) -> Robot:
    """Return a robot with a motor for each leg."""
    legs = tuple(replace(leg, crank_joint=f'{leg.name}_crank') for leg in robot.legs)
    return replace(robot, legs=legs)


def simulated_margins(task: tuple[Condition, float]) -> list[tuple[str, Margins]]:
    """Return the margins of a walk in closed loop."""
    condition, seconds = task
    robot = robot_of(str(CONFIG / f'{condition.file}.yaml'))
    if condition.is_six:
        robot = with_six_motors(robot)
    steering = Steering(Feet(robot, foot_radius=FOOT_RADIUS))
    control = WalkController(steering, ControllerSettings())
    joints = steering.feet.joints
    factors = dict(zip(joints, condition.factors, strict=False))
    twin = Twin(
        robot,
        floor=Floor(condition.friction),
        motors=Motors(bandwidth=condition.bandwidth, factors=factors),
        sensors=Sensors(imu_sampling=condition.sampling),
        compliance=condition.compliance,
    )
    observer = Observer(control.monitors, control.latch)
    random = Random(1)  # noqa: S311 - noise
    spot = steering.motion(Rates(-1.0, 1.0)).angular
    for k in range(round(seconds / PERIOD)):
        now = k * PERIOD
        readings = encoded(
            twin.cranks(), random, condition.noise, condition.counts,
            has_velocity=condition.has_velocity,
        )  # fmt: skip
        control.feedback(readings, now)
        linear, angular = COMMANDS[int(now / seconds * len(COMMANDS))]
        turn = angular * spot if steering.can_turn else 0.0
        control.command(linear * steering.speed, turn, now)
        command = control.step(now)
        for joint, rate in zip(joints, command.velocity if command else (), strict=True):
            twin.command(joint, rate)
        observer.judge()
        imu = twin.imu()
        observer.read_imu(imu.orientation, imu.angular_velocity, imu.linear_acceleration, now)
        twin.step(now + PERIOD)
    return [(condition.name, observer.margins)]


def recorded_tasks(folder: Path) -> Iterator[tuple[Path, str, str, int]]:
    """Yield the recorded walks of a folder."""
    for name, floor, seed in product(ROBOTS, FLOORS, range(100)):
        if (folder / f'{name.replace(" ", "_")}-{floor}-first-{seed:02}.npz').exists():
            yield folder, name, floor, seed


def main() -> int:
    """Run the benchmark; return 0 if no fault is reported."""
    parser = argparse.ArgumentParser(
        description='Count faults that are reported in healthy walks.'
    )
    parser.add_argument('--walks', type=Path, help='replay the recorded walks of this folder')
    parser.add_argument('--seconds', type=float, default=SECONDS, help='of a simulated walk [s]')
    parser.add_argument('--processes', type=int, default=2)
    options = parser.parse_args()
    margins_of_names: dict[str, list[Margins]] = {}
    with Pool(options.processes) as pool:
        if options.walks:
            margins = pool.imap(recorded_margins, recorded_tasks(options.walks))
        else:
            tasks = [(condition, options.seconds) for condition in CONDITIONS]
            margins = pool.imap(simulated_margins, tasks)
        for walk_margins in margins:
            for name, margins_of_walk in walk_margins:
                margins_of_names.setdefault(name, []).append(margins_of_walk)
    print('walks faults  ratio  half turn  tilt  force  condition')
    faults = 0
    for name, walks in margins_of_names.items():
        texts, ratios, turn_ratios, tilts, forces = zip(*walks, strict=True)
        fault_texts = [*filter(None, texts)]
        faults += len(fault_texts)
        print(
            f'{len(walks):5} {len(fault_texts):6} {min(ratios):6.2f} {min(turn_ratios):10.2f} '
            f'{max(tilts):5.1f} {min(forces):6.2f}  {name} {"; ".join(fault_texts[:1])}'
        )
    return exit_code(is_met('faults in healthy walks', faults, 0.0))


if __name__ == '__main__':
    raise SystemExit(main())
