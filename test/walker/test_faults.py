"""Cranks that do not follow their commands, a body that fell, and healthy motors of all kinds."""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from math import copysign, cos, inf, nan, pi, radians, sin
from random import Random

from klann_ros.gait import Steering
from klann_ros.walker import (
    ControllerSettings,
    DiagnosticLevel,
    FaultKind,
    imu_reading,
    MotionLimits,
    WalkController,
    Walker,
)
from klann_ros.walker.feedback import CrankFeedback
from klann_ros.walker.monitors import FollowingMonitor
import numpy as np
import pytest

DT = 0.01


@dataclass
class Motor:
    """A motor with an encoder, either of which may be faulty."""

    # Speed by its command, and the delay between command and speed [s].
    factor: float = 1.0
    delay: float = 0.0
    time_constant: float = 0.0
    # The encoder: its sense, resolution [rad], noise [rad], and whether it repeats one angle.
    sense: float = 1.0
    resolution: float = 0.0
    noise: float = 0.0
    is_frozen: bool = False
    # The velocity in the feedback: of the motor, of the command, of noise alone, or none.
    velocity: str = 'true'
    max_rate: float = inf
    position: float = 0.0
    rate: float = 0.0
    command: float = 0.0

    def __post_init__(self) -> None:
        self._commands = deque([0.0] * round(self.delay / DT))
        self._random = Random(5)  # noqa: S311 - noise
        self._frozen: float | None = None

    def turn(self) -> None:
        self._commands.append(self.command)
        wanted = self.factor * self._commands.popleft()
        wanted = copysign(min(abs(wanted), self.max_rate), wanted)
        share = DT / (DT + self.time_constant)
        self.rate += share * (wanted - self.rate)
        self.position += self.rate * DT

    @property
    def reading(self) -> tuple[float, float | None]:
        angle = self.sense * self.position
        if self.resolution:
            angle = round(angle / self.resolution) * self.resolution
        angle += self._random.gauss(0.0, self.noise)
        if not self.is_frozen:
            self._frozen = None
        elif self._frozen is None:
            self._frozen = angle
        velocities = {
            'true': self.sense * self.rate,
            'echoed': self.command,
            'noise': self._random.uniform(-0.1, 0.1),
            'none': None,
        }
        return angle if self._frozen is None else self._frozen, velocities[self.velocity]


class FaultyWalk:
    """A controller with motors."""

    def __init__(self, steering: Steering, motors: list[Motor], **changes: object) -> None:
        settings = ControllerSettings(**changes)
        self.control = WalkController(steering, settings)
        self.motors = motors
        self.now = 0.0
        self.twist = (0.15, 0.0)
        # Ticks of a feedback, and its delay [s].
        self.feedback_ticks = 1
        self.feedback_delay = 0.0
        self._readings: deque[tuple[float, dict[str, tuple[float, float | None]]]] = deque()
        # Rates commanded after the fault that are not 0 [rad/s].
        self.turned_after: list[float] = []
        self._ticks = 0

    def run(self, seconds: float) -> 'FaultyWalk':
        for _ in range(round(seconds / DT)):
            self._ticks += 1
            self.now = self._ticks * DT
            for motor in self.motors:
                motor.turn()
            if self._ticks % self.feedback_ticks == 0:
                joints = [crank.joint for crank in self.control.cranks]
                readings = dict(zip(joints, [motor.reading for motor in self.motors], strict=True))
                self._readings.append((self.now, readings))
            while self._readings and self._readings[0][0] <= self.now - self.feedback_delay:
                read_time, readings = self._readings.popleft()
                self.control.feedback(readings, self.now, at=read_time)
            self.control.command(*self.twist, self.now)
            command = self.control.step(self.now)
            rates = command.velocity if command else [0.0] * len(self.motors)
            for motor, rate in zip(self.motors, rates, strict=True):
                motor.command = rate
            if self.control.latch.fault:
                self.turned_after += [rate for rate in rates if rate]
        return self


FAULTS = {
    'wrong way': (Motor(factor=-1.0), FaultKind.WRONG_WAY),
    'counts backwards': (Motor(sense=-1.0), FaultKind.WRONG_WAY),
    'counts backwards, echoed': (Motor(sense=-1.0, velocity='echoed'), FaultKind.WRONG_WAY),
    'frozen': (Motor(is_frozen=True), FaultKind.FROZEN),
    'frozen, echoed': (Motor(is_frozen=True, velocity='echoed'), FaultKind.FROZEN),
    'frozen, no velocity': (Motor(is_frozen=True, velocity='none'), FaultKind.NOT_TURNING),
    'dead, noise': (Motor(factor=0.0, velocity='noise'), FaultKind.NOT_TURNING),
    'dead, noise of both': (
        Motor(factor=0.0, velocity='noise', noise=0.003), FaultKind.NOT_TURNING,
    ),
    'dead, coarse': (Motor(factor=0.0, resolution=2.0 * pi / 64), FaultKind.NOT_TURNING),
    'wrong way, coarse': (Motor(factor=-1.0, resolution=2.0 * pi / 64), FaultKind.WRONG_WAY),
    'slips': (Motor(factor=0.15), FaultKind.SLIPPING),
}  # fmt: skip


@pytest.mark.parametrize('name', FAULTS)
@pytest.mark.parametrize(('linear', 'patience'), [(0.15, 1.3), (-0.02, 3.8)])
@pytest.mark.parametrize('begin', [0.0, 2.0])
def test_a_crank_that_does_not_follow_stops_all(
    steering: Steering, name: str, linear: float, patience: float, begin: float
) -> None:
    faulty, kind = FAULTS[name]
    if kind is FaultKind.SLIPPING:
        linear, patience = copysign(0.15, linear), 8.0
    walk = FaultyWalk(steering, [Motor(), Motor()])
    walk.twist = (linear, 0.0)
    walk.run(begin)
    now = replace(faulty)
    now.position = walk.motors[1].position * (now.sense if not begin else 1.0)
    if now.sense < 0.0 and begin:
        # A sense that changes is an offset, too.
        now.position *= now.sense
    walk.motors[1] = now
    walk.run(patience)
    fault = walk.control.latch.fault
    assert fault.joint == 'right_crank'
    assert fault.kind is kind
    level, text = walk.control.verdict(walk.now)
    assert text.startswith(f'stopped: right_crank {kind.value}')
    assert level is DiagnosticLevel.ERROR
    walk.run(3.0)
    assert walk.turned_after == []


@pytest.mark.parametrize(
    'motor',
    [
        Motor(),
        Motor(factor=0.5),
        Motor(factor=0.5, noise=0.002, velocity='none'),
        Motor(factor=0.4, delay=0.1),
        Motor(factor=0.5, resolution=2.0 * pi / 64),
        Motor(factor=0.5, resolution=2.0 * pi / 64, velocity='none'),
        Motor(delay=0.2, time_constant=0.1),
        Motor(factor=1.5),
        Motor(max_rate=0.5),
        Motor(noise=0.01, velocity='noise'),
    ],
)
@pytest.mark.parametrize('ticks', [1, 5])
def test_a_motor_that_obeys_is_no_fault_however_slow(
    steering: Steering, motor: Motor, ticks: int
) -> None:
    """Straight on, in curves, on the spot, forwards and back, with standstills, slow and fast."""
    random = Random(ticks)  # noqa: S311 - commands
    walk = FaultyWalk(steering, [Motor(delay=motor.delay), replace(motor)])
    walk.feedback_ticks = ticks
    for _ in range(6):
        size = random.choice([0.05, 0.3, 1.0])
        linear = random.choice([-0.2, -0.1, 0.0, 0.1, 0.2]) * size
        walk.twist = (linear, random.choice([-0.1, 0.0, 0.1]) * size)
        walk.run(random.choice([0.5, 1.5, 3.0]))
        assert walk.control.latch.fault is None
        assert walk.motors[1].position != 0.0 or walk.twist == (0.0, 0.0)


class Body:
    """A walker that is commanded to walk, its cranks in step with it, and its IMU."""

    def __init__(self, steering: Steering, *, has_orientation: bool = True) -> None:
        self.walker = Walker(steering)
        self.has_orientation = has_orientation
        self.random = Random(1)  # noqa: S311 - noise
        self.ticks = 0
        self.rates = [0.0, 0.0]
        self.positions = [0.0, 0.0]

    def feel(self, seconds: float, pitch: float = 0.0, gravity: float = 9.8) -> None:
        for _ in range(round(seconds / DT)):
            self.ticks += 1
            now = self.ticks * DT
            # The specific force of a body that is pitched.
            force = -gravity * sin(pitch), 0.0, gravity * cos(pitch)
            orientation = (0.0, sin(pitch / 2.0), 0.0, cos(pitch / 2.0))
            # A gyro without noise is a frozen one.
            rates = self.random.gauss(0.0, 1e-3), self.random.gauss(0.0, 1e-3), 0.0
            reading = imu_reading(orientation if self.has_orientation else None, rates, now, force)
            self.walker.imu(reading, now)
            joints = [crank.joint for crank in self.walker.controller.cranks]
            self.positions = (np.array(self.positions) + DT * np.array(self.rates)).tolist()
            readings = zip(self.positions, self.rates, strict=True)
            self.walker.feedback(dict(zip(joints, readings, strict=True)), now)
            self.walker.controller.command(0.15, 0.0, now)
            command = self.walker.controller.step(now)
            self.rates = list(command.velocity) if command else [0.0, 0.0]

    @property
    def kind(self) -> FaultKind | None:
        fault = self.walker.controller.latch.fault
        return fault.kind if fault else None


@pytest.mark.parametrize('has_orientation', [True, False])
@pytest.mark.parametrize('degrees', [35.0, -90.0, 180.0])
def test_a_body_that_falls_over_stops(
    steering: Steering, degrees: float, *, has_orientation: bool
) -> None:
    body = Body(steering, has_orientation=has_orientation)
    body.feel(2.0, radians(25.0))
    assert body.kind is None
    assert min(body.rates) > 0.5
    body.feel(0.15, radians(degrees))
    body.feel(0.5)
    # A blow is no fall.
    assert body.kind is None
    body.feel(0.3 if has_orientation else 1.2, radians(degrees))
    assert body.kind is FaultKind.TILTED
    assert body.rates == [0.0, 0.0]
    text = body.walker.verdict(body.ticks * DT)[1]
    assert FaultKind.TILTED.value in text
    assert 'it has fallen' in text
    assert f'{abs(degrees):.0f} deg' in text or not has_orientation
    body.walker.controller.latch.reset()
    # It lies as before.
    body.feel(0.05, radians(degrees))
    assert body.kind is FaultKind.TILTED
    assert body.rates == [0.0, 0.0]
    body.walker.controller.latch.reset()
    body.feel(2.0)
    assert (body.kind is None) == has_orientation
    assert body.walker.values(body.ticks * DT)['imu'] == 'used'


@pytest.mark.parametrize('degrees', [90.0, 180.0])
def test_an_imu_on_its_head_never_drives(steering: Steering, degrees: float) -> None:
    body = Body(steering)
    body.feel(DT, radians(degrees))
    assert body.kind is FaultKind.TILTED
    assert 'check its axes' in body.walker.verdict(DT)[1]
    body.feel(2.0, radians(degrees))
    assert body.positions == [0.0, 0.0]
    values = body.walker.values(body.ticks * DT)
    assert values['fault'] == 'TILTED'
    # The attitude of a body on its head says nothing about its feet.
    assert values['imu'] == 'none'


def test_a_body_that_falls_freely_stops(steering: Steering) -> None:
    body = Body(steering)
    # The first message of a driver may be empty.
    body.feel(DT, gravity=0.0)
    body.feel(2.0)
    body.feel(0.08, gravity=0.3)
    # Between two steps it may be light.
    assert body.kind is None
    body.feel(0.12, gravity=0.3)
    assert body.kind is FaultKind.FREE_FALL
    assert body.rates == [0.0, 0.0]
    assert FaultKind.FREE_FALL.value in body.walker.verdict(body.ticks * DT)[1]


@pytest.mark.parametrize('gravity', [0.0, 1.0, nan])
def test_an_accelerometer_without_gravity_shows_no_fall(
    steering: Steering, gravity: float
) -> None:
    body = Body(steering)
    body.feel(1.0, gravity=gravity)
    assert body.kind is None


@pytest.mark.parametrize('delay', [0.1, 0.3, 0.4])
def test_feedback_that_is_late_makes_no_motor_swing(steering: Steering, delay: float) -> None:
    walk = FaultyWalk(steering, [Motor(), Motor(factor=0.95)])
    walk.feedback_delay = delay
    rates = []
    for tick in range(1500):
        walk.control.lock.take_delay(delay)
        # The clock of another machine says nothing.
        walk.control.lock.take_delay(3600.0)
        walk.control.lock.take_delay(-40.0)
        walk.run(DT)
        if tick > 800:
            rates += [abs(motor.command) for motor in walk.motors]
    assert 0.9 < min(rates) < max(rates) < 1.2
    assert walk.control.lock.delay == pytest.approx(delay, rel=0.01)
    assert ('s old by its stamps' in walk.control.verdict(walk.now)[1]) == (delay > 0.2)


@pytest.mark.parametrize(
    ('angles', 'velocities', 'words'),
    [
        (180.0 / pi, 1.0, 'angles may be in degrees'),
        (1.0, 180.0 / pi, 'velocities may be in deg/s'),
        (1.0, 30.0 / pi, 'velocities may be in rpm'),
        (0.5 / pi, 1.0, 'angles may be in turns'),
        (1.0, 0.5 / pi, 'velocities may be in turns/s'),
        (1.0, 1.0, ''),
        (1.0, -1.4, ''),
        # A gear is no unit.
        (4.0, 1.0, ''),
    ],
)
@pytest.mark.parametrize('noise', [0.0, 0.002])
def test_units_of_the_feedback_are_suspected(
    angles: float, velocities: float, words: str, noise: float
) -> None:
    random = Random(1)  # noqa: S311 - noise
    crank = CrankFeedback('crank', 12.0)
    for k in range(300):
        now = k * DT
        # The encoder begins again after a turn.
        angle = (0.8 * now + random.gauss(0.0, noise)) % (2.0 * pi)
        crank.read(angles * angle, velocities * 0.8, now)
    assert words in crank.units.suspicion
    assert bool(words) == bool(crank.units.suspicion)


def test_a_driver_that_repeats_its_stamp_is_silent(steering: Steering) -> None:
    walk = FaultyWalk(steering, [Motor(), Motor()]).run(2.0)
    last = {crank.joint: (crank.position, 1.0) for crank in walk.control.cranks}
    for _ in range(40):
        walk.now += DT
        walk.control.feedback(last, walk.now, at=2.0)
        walk.control.command(0.15, 0.0, walk.now)
        command = walk.control.step(walk.now)
    assert command.velocity == (0.0, 0.0)
    reason = walk.control.stop_reason(walk.now)
    assert 'no valid feedback of left_crank, right_crank' in reason
    assert 'its stamp repeats' in reason
    assert walk.control.latch.fault is None
    # With measurements it goes on.
    walk._ticks = round(walk.now / DT)
    walk.run(1.0)
    assert walk.control.stop_reason(walk.now) == ''
    assert all(motor.command > 0.5 for motor in walk.motors)


@pytest.mark.parametrize(('period', 'is_slow'), [(0.25, True), (0.1, False)])
def test_a_clock_that_is_too_slow_is_named(
    steering: Steering, period: float, *, is_slow: bool
) -> None:
    steady = [100.0]
    control = WalkController(steering, ControllerSettings(), lambda: steady[0])
    now = 1.0
    for k in range(300):
        steady[0] += DT
        now = 1.0 + period * (k * DT // period)
        readings = {crank.joint: (0.01 * k, 1.0) for crank in control.cranks}
        control.feedback(readings, now)
        control.command(0.15, 0.0, now)
        control.step(now)
    level, text = control.verdict(now)
    assert ('/clock advances every 0.25 s only' in text) == is_slow
    assert (level is DiagnosticLevel.WARN) or not is_slow
    assert control.latch.fault is None


def test_the_first_message_of_a_clock_is_no_pause(steering: Steering) -> None:
    steady = [100.0]
    control = WalkController(steering, ControllerSettings(), lambda: steady[0])
    for now in (0.0, 0.0, 0.0, 5000.0, 5000.01, 5000.02):
        steady[0] += 1.0 if not now else DT
        control.feedback({crank.joint: (0.0, 0.0) for crank in control.cranks}, now)
        control.command(0.15, 0.0, now)
        control.step(now)
    assert control.loop.pauses == 0
    assert not control.events


@pytest.mark.parametrize('rate', [1.0, -2.0])
@pytest.mark.parametrize('ticks', [2, 4, 6])
def test_a_late_cycle_that_stamps_itself_is_no_offset(rate: float, ticks: int) -> None:
    """A broadcaster stamps its cycles evenly, measures late, and then makes up for the delay."""
    crank = CrankFeedback('crank', 12.0)
    now, stamp = 0.0, 0.0
    for k in range(600):
        stamp += DT
        # One cycle is late, and the next ones follow at once.
        late = max(0, ticks - (k - 300)) if k >= 300 else 0
        now = max(now + 1e-4, stamp + late * DT)
        assert crank.read(rate * now, rate, now, at=stamp) == 0.0
    assert crank.counts.offsets == 0


@pytest.mark.parametrize('resolution', [0.0, 2.0 * pi / 64])
@pytest.mark.parametrize('offset', [-0.1, -0.3, 0.3, 2.0 * pi])
def test_an_encoder_that_slips_or_restarts_is_no_fault(
    steering: Steering, offset: float, resolution: float
) -> None:
    for begin in (0.6, 1.53):
        walk = FaultyWalk(steering, [Motor(), Motor(resolution=resolution)]).run(begin)
        walk.motors[1].position += offset
        walk.run(2.5)
        assert walk.control.latch.fault is None


@pytest.mark.parametrize('linear', [0.005, -0.05])
def test_an_encoder_of_few_counts_shows_a_slow_motor(steering: Steering, linear: float) -> None:
    """At 64 counts a turn a creeping crank stands still for a second, by its encoder."""
    walk = FaultyWalk(steering, [Motor(), Motor(factor=0.5, resolution=2.0 * pi / 64)])
    walk.twist = (linear, 0.0)
    walk.run(40.0)
    assert walk.control.latch.fault is None
    assert abs(walk.motors[1].position) > 0.3


@pytest.mark.parametrize('delay', [0.1, 0.29])
def test_a_motor_that_is_reversed_has_time_to_stop(steering: Steering, delay: float) -> None:
    limits = MotionLimits(max_linear_acceleration=10.0)
    walk = FaultyWalk(steering, [Motor(delay=delay), Motor(delay=delay)], limits=limits)
    for linear in (0.25, -0.25, 0.25, -0.25):
        walk.twist = (linear, 0.0)
        walk.run(1.2)
        assert walk.control.latch.fault is None


@pytest.mark.parametrize('angle', [-0.5, 0.5])
def test_a_crank_that_is_turned_by_hand_at_standstill_is_no_fault(
    steering: Steering, angle: float
) -> None:
    walk = FaultyWalk(steering, [Motor(), Motor()]).run(1.0)
    walk.twist = (0.0, 0.0)
    walk.run(1.5)
    for _ in range(100):
        walk.motors[1].position += angle / 100.0
        walk.run(DT)
    walk.twist = (0.15, 0.0)
    walk.run(3.0)
    assert walk.control.latch.fault is None


def test_a_simulation_that_restarts_is_no_fault(steering: Steering) -> None:
    walk = FaultyWalk(steering, [Motor(), Motor()])
    for seconds in (2.0, 2.3, 1.7):
        walk.run(seconds)
        walk._ticks = 0
        walk._readings.clear()
        for motor in walk.motors:
            motor.position = motor.rate = motor.command = 0.0
        walk.run(3.0)
        assert walk.control.latch.fault is None
        assert all(motor.command > 0.5 for motor in walk.motors)


def test_motors_that_pause_with_their_feedback_are_no_fault(steering: Steering) -> None:
    walk = FaultyWalk(steering, [Motor(), Motor()]).run(2.0)
    for pause in (0.15, 0.25, 0.28, 0.6):
        # The motors hold, nobody publishes, and the walker goes on.
        for _ in range(round(pause / DT)):
            walk._ticks += 1
            walk.now = walk._ticks * DT
            walk.control.command(*walk.twist, walk.now)
            command = walk.control.step(walk.now)
        assert command is not None
        walk.run(1.5)
        assert walk.control.latch.fault is None
        assert all(motor.command > 0.5 for motor in walk.motors)


def test_a_joystick_that_wobbles_does_not_reset_a_fault_for_ever(steering: Steering) -> None:
    walk = FaultyWalk(steering, [Motor(factor=-1.0), Motor()], auto_reset=True)
    latch = walk.control.latch

    def wobble(seconds: float) -> float:
        """Command 0 and motion in turn; return the path of the first motor since [rad]."""
        first = walk.motors[0].position
        for _ in range(round(seconds / 0.2)):
            walk.twist = (0.0, 0.0)
            walk.run(0.1)
            walk.twist = (0.15, 0.0)
            walk.run(0.1)
        return abs(walk.motors[0].position - first)

    assert wobble(15.0) > 0.1
    assert wobble(10.0) == 0.0
    assert latch.fault is not None
    assert 'after 3 resets: repair it and call ~/reset_fault' in latch.reason
    # A user who has repaired it says so, and then walks.
    walk.motors[0].factor = 1.0
    latch.reset()
    walk.run(8.0)
    for _ in range(5):
        walk.motors[0].factor = -1.0
        walk.run(3.0)
        assert latch.fault is not None
        walk.motors[0].factor = 1.0
        walk.twist = (0.0, 0.0)
        walk.run(0.1)
        walk.twist = (0.15, 0.0)
        walk.run(8.0)
        assert latch.fault is None


def test_a_long_feedback_timeout_delays_no_fault(steering: Steering) -> None:
    walk = FaultyWalk(steering, [Motor(factor=-1.0), Motor()], feedback_timeout=10.0).run(3.0)
    assert walk.control.latch.fault is not None
    assert abs(walk.motors[0].position) < 1.0


def following_fault(path: Callable[[float], float], times: Iterable[float]) -> bool:
    """Return whether a crank that is commanded at 1 rad/s has a fault on a path [rad]."""
    crank = CrankFeedback('crank', 12.0)
    monitor = FollowingMonitor(crank, 0.15, 0.02)
    arrivals = deque(times)
    for tick in range(500):
        now = tick * DT
        if arrivals and arrivals[0] <= now:
            crank.read(path(arrivals.popleft()), 1.0, now)
        if monitor.update(1.0, DT, now):
            return True
    return False


@pytest.mark.parametrize(('stop', 'has_fault'), [(0.2, False), (0.4, True)])
def test_a_crank_that_hesitates_has_no_fault(stop: float, has_fault: bool) -> None:
    # After 0.15 s without motion eight readings have to confirm it.
    def path(time: float) -> float:
        return min(time, 1.0) + max(0.0, time - 1.0 - stop)

    assert following_fault(path, [tick * DT for tick in range(500)]) is has_fault


def test_a_silent_publisher_shows_no_following_error() -> None:
    # A simulation that is paused with its publisher turns no crank: for 2 s, and more slowly then.
    def path(time: float) -> float:
        return min(time, 1.0) + 0.11 * max(0.0, time - 3.0)

    times = [tick * DT for tick in range(314) if not 1.0 < tick * DT < 3.0]
    assert not following_fault(path, times)
