"""The first turns of motors: each fault that is injected has its verdict, and its correction."""

from math import cos, degrees, pi, radians, sin

from klann_ros.gait import Feet, stance
from klann_ros.robot import CrankDrive
from klann_ros.twin import FaultInjector, Imu, injected_faults, SimulatedCrank
from klann_ros.walker import Commissioning, CommissioningSettings
from klann_ros.walker.commissioning import predicted_tilt
from klann_ros.walker.crank_answers import Verdict
import numpy as np
import pytest

JOINTS = ('left_crank', 'right_crank')
DT = 0.01


class Plant:
    """Motors that follow at once, on a body that stands on its feet, with faults."""

    def __init__(
        self, faults: str, feet: Feet | None, *options: object, noise: float = 0.0
    ) -> None:
        self.injector = FaultInjector(injected_faults(faults, JOINTS), JOINTS)
        self.feet = feet
        self.noise = noise
        self.random = np.random.default_rng(1)
        settings = CommissioningSettings()
        self.commissioning = Commissioning(JOINTS, settings, *options)
        self.angles = dict.fromkeys(JOINTS, 0.0)
        self.time = 0.0
        self.tilt = self._tilt()
        self.largest = 0.0
        self.last: tuple[dict[str, tuple[float, float | None]], float] = {}, 0.0

    def _tilt(self) -> complex:
        if self.feet is None:
            return 0j
        positions, _, centre = self.feet.at([*self.angles.values()]).tolist()
        body_support = stance.support(positions, centre)
        return complex(body_support.roll, body_support.pitch)

    def tick(self, commands: dict[str, float]) -> None:
        self.time += DT
        rates = self.injector.commands(commands, self.time)
        for joint, rate in rates.items():
            self.angles[joint] += rate * DT
            self.largest = max(self.largest, abs(self.angles[joint]))
        cranks = {joint: SimulatedCrank(self.angles[joint], rates[joint]) for joint in JOINTS}
        readings = {}
        for joint, crank in self.injector.cranks(cranks, commands, self.time).items():
            angle = crank.position + self.noise * self.random.standard_normal()
            readings[joint] = angle, crank.velocity
        repeats = any(fault.kind.label == 'driver_repeats' for fault in self.injector._faults)
        if not repeats or not self.last[0]:
            self.last = dict(readings), self.time
        self.commissioning.now = self.time
        self.commissioning.feedback(*self.last)
        if self.feet is not None:
            imu = self.injector.imu(self.imu(), self.time)
            force, gyro = imu.linear_acceleration, imu.angular_velocity
            self.commissioning.imu(force, gyro)

    def imu(self) -> Imu:
        last_tilt = self.tilt
        self.tilt = self._tilt()
        roll, pitch = self.tilt.real, self.tilt.imag
        rate = (self.tilt - last_tilt) / DT
        noise = 0.01 * self.random.standard_normal(3)
        force = np.array([-sin(pitch), cos(pitch) * sin(roll), cos(pitch) * cos(roll)]) * 9.80665
        return Imu((0.0, 0.0, 0.0, 1.0), (rate.real, rate.imag, 0.0), (*(force + noise).tolist(),))

    def run(self, steps: object = None) -> None:
        # The driver is there before.
        self.tick(dict.fromkeys(JOINTS, 0.0))
        for rates in steps or self.commissioning.turn_all():
            self.tick({joint: rates.get(joint, 0.0) for joint in JOINTS})

    @property
    def verdicts(self) -> set[tuple[str, Verdict]]:
        findings = self.commissioning.findings
        return {(finding.subject.partition('_')[0], finding.verdict) for finding in findings}


LEFT_OK, RIGHT_OK = ('left', Verdict.OK), ('right', Verdict.OK)
EARLY = ('left', Verdict.ABORTED)
PLAIN = CrankDrive()


@pytest.mark.parametrize('noise', [0.0, 0.002])
@pytest.mark.parametrize(
    ('faults', 'backwards', 'left', 'drive'),
    [
        ('', None, [Verdict.OK], PLAIN),
        ('left_crank_reversed', None, [Verdict.REVERSED], None),
        ('left_crank_reversed', ['left_crank'], [Verdict.REVERSED], CrankDrive(1.0, -1.0)),
        ('left_crank_encoder_reversed', ['none'], [Verdict.REVERSED], CrankDrive(-1.0, 1.0)),
        (
            'left_crank_reversed, left_crank_encoder_reversed',
            ['left_crank'],
            [Verdict.REVERSED],
            CrankDrive(-1.0, -1.0),
        ),
        ('left_crank_degrees', None, [Verdict.DEGREES, Verdict.ABORTED], None),
        ('left_crank_gear_ratio=30', None, [Verdict.RATIO, Verdict.ABORTED], None),
        ('left_crank_rpm', None, [Verdict.RPM], None),
        ('left_crank_gear_ratio=2.9', None, [Verdict.RATIO], CrankDrive(3.0)),
        ('left_crank_gear_ratio=4', None, [Verdict.RATIO, Verdict.ABORTED], CrankDrive(4.0)),
        (
            'left_crank_gear_ratio=-4',
            ['none'],
            [Verdict.RATIO, Verdict.ABORTED, Verdict.REVERSED],
            CrankDrive(-4.0),
        ),
        ('left_crank_motor_ratio=0.25', None, [Verdict.RATIO], None),
        ('left_crank_command_rpm', None, [Verdict.RPM], None),
        ('left_crank_encoder_frozen', None, [Verdict.FROZEN], None),
        ('left_crank_encoder_echo', None, [Verdict.FROZEN], None),
        ('left_crank_encoder_missing', None, [Verdict.MISSING], None),
        ('left_crank_dead', None, [Verdict.DEAD], None),
    ],
)
def test_a_fault_has_its_verdict_and_its_correction(
    faults: str,
    backwards: list[str] | None,
    left: list[Verdict],
    drive: CrankDrive | None,
    noise: float,
) -> None:
    plant = Plant(faults, None, backwards, noise=noise)
    plant.run()
    assert plant.verdicts == {RIGHT_OK, *(('left', verdict) for verdict in left)}
    drives = plant.commissioning.drives
    assert drives['right_crank'] == PLAIN
    assert ('left_crank' in drives) == (drive is not None)
    assert bool(plant.commissioning.problem) == (drive is None)
    if drive is not None:
        assert drives['left_crank'] == drive
    # No crank turned further than it was said, whatever its encoder shows.
    assert plant.largest < radians(11.0)
    assert abs(plant.angles['left_crank']) < radians(1.0)


def test_commands_in_degrees_are_found_where_the_encoder_is_fine_enough() -> None:
    plant = Plant('left_crank_command_degrees', None)
    plant.run()
    assert ('left', Verdict.DEGREES) in plant.verdicts
    assert 'left_crank' not in plant.commissioning.drives


def test_both_swapped_cranks_are_named() -> None:
    for fault in ('swapped', 'encoder_swapped'):
        plant = Plant(fault, None)
        plant.run()
        wrong = {Verdict.SWAPPED, Verdict.ABORTED}
        assert plant.verdicts == {(side, v) for side in ('left', 'right') for v in wrong}
        text = plant.commissioning.findings[0].text
        assert text.startswith('right_crank answers: exchange the motors')
        assert plant.largest < radians(7.0)


def test_repeated_messages_turn_nothing_on() -> None:
    plant = Plant('driver_repeats', None)
    plant.run()
    assert plant.verdicts == {('left', Verdict.REPEATED), ('right', Verdict.REPEATED)}


def test_a_slipping_coupling_turns_differently_both_ways() -> None:
    plant = Plant('', None)
    steps = plant.commissioning.turn_all()
    plant.tick(dict.fromkeys(JOINTS, 0.0))
    for rates in steps:
        slipped = {joint: rate * (0.5 if rate < 0.0 else 1.0) for joint, rate in rates.items()}
        plant.tick({joint: slipped.get(joint, 0.0) for joint in JOINTS})
    assert plant.verdicts == {('left', Verdict.SLIPPING), ('right', Verdict.SLIPPING)}
    assert not plant.commissioning.drives


def test_silence_stops_a_turn() -> None:
    plant = Plant('', None)
    steps = plant.commissioning.turn_all()
    plant.tick(dict.fromkeys(JOINTS, 0.0))
    commanded = 0
    for rates in steps:
        is_turning = any(rates.values())
        commanded += is_turning
        if is_turning:
            plant.time += DT
            plant.commissioning.now = plant.time
        else:
            plant.tick(dict.fromkeys(JOINTS, 0.0))
    assert ('left', Verdict.ABORTED) in plant.verdicts
    # 0.3 s for each turn.
    assert commanded <= 2 * 3 * 2 * 33
    assert not plant.commissioning.drives


@pytest.mark.parametrize(
    ('faults', 'verdict', 'words'),
    [
        ('', None, ''),
        ('imu_frozen', Verdict.FROZEN_IMU, 'all readings are the same'),
        ('imu_g', Verdict.UNITS, 'at rest its acceleration is 1 m/s^2, not 9.81: it is in units'),
        ('imu_tilted', Verdict.AXES, 'gravity is along its y, not z'),
        ('imu_tilted=-90', Verdict.AXES, 'gravity is along its -y, not z'),
        ('imu_tilted=180', Verdict.AXES, 'gravity is along its -z, not z'),
        ('imu_degrees', Verdict.UNITS, 'its gyro is in deg/s'),
        ('imu_turned', Verdict.AXES, 'it is turned about z by some 90 deg'),
        ('imu_turned=-90', Verdict.AXES, 'it is turned about z by some -90 deg'),
        ('imu_turned=180', Verdict.AXES, 'it is turned about z by some '),
    ],
)
def test_an_imu_is_judged_by_gravity_and_the_tilt_of_the_body(
    faults: str, verdict: Verdict | None, words: str, two_motors: Feet
) -> None:
    plant = Plant(faults, two_motors)
    plant.run()
    plant.commissioning.judge_imu(two_motors)
    of_imu = [f for f in plant.commissioning.findings if f.subject == 'imu']
    assert [f.verdict for f in of_imu] == ([verdict] if verdict else [])
    assert plant.verdicts >= {LEFT_OK, RIGHT_OK}
    if of_imu:
        assert words in of_imu[0].text
        assert plant.commissioning.problem == 'repair first: imu'


def test_the_tilt_of_a_crank_at_zero_is_that_of_its_feet(two_motors: Feet) -> None:
    tilt = predicted_tilt(two_motors, 'left_crank', radians(10.0))
    assert degrees(tilt.real) == pytest.approx(2.08, abs=0.1)


@pytest.mark.parametrize(
    ('faults', 'backwards'),
    [
        ('left_crank_zero=0.4', ['none']),
        ('left_crank_gear_ratio=-4', ['none']),
        # Its motor has to be commanded backwards.
        ('left_crank_reversed', ['left_crank']),
    ],
)
@pytest.mark.parametrize('start', [-0.5, 0.1])
def test_homing_finds_the_edge_of_the_switch(
    faults: str, backwards: list[str], start: float
) -> None:
    plant = Plant(faults, None, backwards)
    plant.angles['left_crank'] = start
    plant.run()
    home = plant.commissioning.home(
        'left_crank', lambda: 0.0 <= plant.angles['left_crank'] % (2.0 * pi) < 0.2
    )
    plant.run(home)
    drive = plant.commissioning.drives['left_crank']
    zero = 0.4 if 'zero' in faults else 0.0
    assert drive.zero == pytest.approx(zero, abs=0.01)
    assert set(plant.commissioning.cranks['left_crank']) == {
        'encoder_ratio', 'motor_ratio', 'zero'
    }  # fmt: skip
    assert 'zero' not in plant.commissioning.cranks['right_crank']


def test_a_switch_that_never_closes_ends_the_homing_after_a_turn() -> None:
    plant = Plant('', None)
    plant.run()
    plant.run(plant.commissioning.home('left_crank', lambda: False))
    assert ('left', Verdict.ABORTED) in plant.verdicts
    assert plant.commissioning.problem == 'repair first: left_crank'
    assert 2.0 * pi < plant.angles['left_crank'] < 2.3 * pi


@pytest.mark.parametrize('readings', [0, 100])
def test_silence_stops_the_homing(readings: int) -> None:
    plant = Plant('', None)
    plant.run()
    commissioning = plant.commissioning
    for count, rates in enumerate(commissioning.home('left_crank', lambda: False)):
        if count < readings:
            plant.tick({joint: rates.get(joint, 0.0) for joint in JOINTS})
        commissioning.now += DT
        assert count < 300
    assert not rates
    assert commissioning.problem == 'repair first: left_crank'


def test_the_angles_before_the_turns_may_be_the_zeros() -> None:
    plant = Plant('left_crank_zero=0.4, right_crank_gear_ratio=2', None)
    plant.angles['right_crank'] = 0.3
    plant.run()
    # Nothing brings the crank back exactly.
    plant.angles['left_crank'] += 0.1
    plant.tick(dict.fromkeys(JOINTS, 0.0))
    plant.commissioning.set_zero()
    cranks = plant.commissioning.cranks
    assert cranks['left_crank']['zero'] == pytest.approx(0.4, abs=0.02)
    assert cranks['right_crank']['zero'] == pytest.approx(0.3, abs=0.02)


def test_play_of_a_gear_before_the_other_crank_is_no_answer() -> None:
    """An encoder before a gear of 4 shows the play of its crank, 0.05 rad, four times as large."""
    plant = Plant('left_crank_gear_ratio=4', None, ['none'])
    plant.tick(dict.fromkeys(JOINTS, 0.0))
    for rates in plant.commissioning.turn_all():
        if rates.get('right_crank'):
            plant.angles['left_crank'] = 0.05
        plant.tick({joint: rates.get(joint, 0.0) for joint in JOINTS})
    assert RIGHT_OK in plant.verdicts
    assert plant.commissioning.drives['right_crank'] == PLAIN
