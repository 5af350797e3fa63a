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

COUNTS, NOISE = 64, 0.002
# Samples by which a command precedes its rate; rates that are those of standing motors [rad/s].
LEAD, STANDING = 2, 1e-3
SECONDS = sized(2.0, 40.0)
# Parts of the greatest speed and yaw rate, one after the other.
PARTS = (
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
    # Of the motors [rad/s].
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
    """What the monitors came to: see the top."""

    fault: str
    ratio: float
    turn_ratio: float
    tilt: float
    force: float


class Observer:
    """The monitors of cranks and body, and how near they came to a fault."""

    def __init__(self, monitors: list[FollowingMonitor], latch: FaultLatch) -> None:
        self.monitors, self.latch, self.body = monitors, latch, BodyMonitor()
        self.ratios = [inf, inf]
        self.tilt, self.force = 0.0, inf

    def feel(self, orientation: Any, angular: Any, force: Any, now: float) -> None:
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
        """Return what came out."""
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
    """Return what encoders read of cranks."""
    readings: dict[str, tuple[float, float | None]] = {}
    for joint, (position, velocity) in angles.items():
        measured = position + random.gauss(0.0, noise)
        if counts:
            measured = round(measured * counts / (2.0 * pi)) * 2.0 * pi / counts
        readings[joint] = measured, velocity if has_velocity else None
    return readings


def replayed(walk: Walk, seed: int, factor: float, counts: int) -> Margins:
    """Return the margins of a recorded walk, of motors that reach a part of their command."""
    settings, random = ControllerSettings(), Random(seed)  # noqa: S311 - noise
    joints = [f'crank_{k}' for k in range(walk.positions.shape[1])]
    cranks = [CrankFeedback(joint, 12.0) for joint in joints]
    error, delay = settings.max_following_error, settings.feedback_timeout
    monitors = [FollowingMonitor(crank, error, delay) for crank in cranks]
    observer = Observer(monitors, FaultLatch())
    commands = (walk.velocities[LEAD:] / factor).tolist()
    velocities = walk.velocities.tolist()
    for k, rates in enumerate(commands):
        now = k * PERIOD
        both = zip(walk.positions[k].tolist(), velocities[k], strict=True)
        readings = encoded(dict(zip(joints, both, strict=True)), random, NOISE, counts)
        for crank, monitor, rate in zip(cranks, monitors, rates, strict=True):
            crank.read(*readings[crank.joint], now)
            if fault := monitor.update(rate if abs(rate) > STANDING else 0.0, PERIOD, now):
                observer.latch.trip(fault)
        observer.judge()
        orientation, gyro, force = walk.orientation[k], walk.gyro[k], walk.force[k]
        observer.feel(orientation.tolist(), gyro.tolist(), force.tolist(), now)
    return observer.margins


def recorded_margins(task: tuple[Path, str, str, int]) -> list[tuple[str, Margins]]:
    """Return the margins of one recorded walk, of both encoders and motors."""
    folder, name, floor, seed = task
    walk = recorded(folder, name, floor, seed)
    margins = []
    for counts in (0, COUNTS):
        for factor in (1.0, 0.5):
            encoder = f'{counts} counts' if counts else '2 mrad'
            label = f'{name}, {encoder}, motors at {factor:g}'
            margins.append((label, replayed(walk, seed, factor, counts)))
    return margins


def six_motors(made: Robot) -> Robot:
    """Return a robot with a motor for each leg."""
    legs = tuple(replace(leg, crank_joint=f'{leg.name}_crank') for leg in made.legs)
    return replace(made, legs=legs)


def simulated_margins(task: tuple[Condition, float]) -> list[tuple[str, Margins]]:
    """Return the margins of a walk in closed loop."""
    condition, seconds = task
    made = robot_of(str(CONFIG / f'{condition.file}.yaml'))
    made = six_motors(made) if condition.is_six else made
    steering = Steering(Feet(made, foot_radius=FOOT_RADIUS))
    control = WalkController(steering, ControllerSettings())
    joints = steering.feet.joints
    factors = dict(zip(joints, condition.factors, strict=False))
    twin = Twin(
        made,
        floor=Floor(condition.friction),
        motors=Motors(bandwidth=condition.bandwidth, factors=factors),
        sensors=Sensors(imu_sampling=condition.sampling),
        compliance=condition.compliance,
    )
    observer, random = Observer(control.monitors, control.latch), Random(1)  # noqa: S311 - noise
    spot = steering.motion(Rates(-1.0, 1.0)).angular
    for k in range(round(seconds / PERIOD)):
        now = k * PERIOD
        readings = encoded(
            twin.cranks(), random, condition.noise, condition.counts,
            has_velocity=condition.has_velocity,
        )  # fmt: skip
        control.feedback(readings, now)
        linear, angular = PARTS[int(now / seconds * len(PARTS))]
        turn = angular * spot if steering.can_turn else 0.0
        control.command(linear * steering.speed, turn, now)
        command = control.step(now)
        for joint, rate in zip(joints, command.velocity if command else (), strict=True):
            twin.command(joint, rate)
        observer.judge()
        imu = twin.imu()
        observer.feel(imu.orientation, imu.angular_velocity, imu.linear_acceleration, now)
        twin.step(now + PERIOD)
    return [(condition.name, observer.margins)]


def recorded_tasks(folder: Path) -> Iterator[tuple[Path, str, str, int]]:
    """Yield the recorded walks of a folder."""
    for name in ROBOTS:
        for floor in FLOORS:
            for seed in range(100):
                path = folder / f'{name.replace(" ", "_")}-{floor}-first-{seed:02}.npz'
                if path.exists():
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
    rows: dict[str, list[Margins]] = {}
    with Pool(options.processes) as pool:
        if options.walks:
            margins = pool.imap(recorded_margins, recorded_tasks(options.walks))
        else:
            tasks = [(condition, options.seconds) for condition in CONDITIONS]
            margins = pool.imap(simulated_margins, tasks)
        for walk_margins in margins:
            for name, one_walk in walk_margins:
                rows.setdefault(name, []).append(one_walk)
    print('walks faults  ratio  half turn  tilt  force  condition')
    faults = 0
    for name, walks in rows.items():
        texts = [walk.fault for walk in walks if walk.fault]
        faults += len(texts)
        least = [min(walk[k] for walk in walks) for k in (1, 2, 4)]
        tilt = max(walk.tilt for walk in walks)
        print(
            f'{len(walks):5} {len(texts):6} {least[0]:6.2f} {least[1]:10.2f} {tilt:5.1f} '
            f'{least[2]:6.2f}  {name} {"; ".join(texts[:1])}'
        )
    return exit_code(is_met('faults in healthy walks', faults, 0.0))


if __name__ == '__main__':
    raise SystemExit(main())
