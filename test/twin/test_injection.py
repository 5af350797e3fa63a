"""Faults injected between a robot and its messages."""

from math import cos, degrees, pi, sin

from klann_ros.twin import FaultInjector, Imu, injected_faults, SimulatedCrank, TwinError
import pytest

JOINTS = ('left', 'right')
COMMANDS = {'left': 1.0, 'right': 2.0}
CRANKS = {'left': SimulatedCrank(0.5, 1.0), 'right': SimulatedCrank(1.5, 2.0)}
# Yaw of 0.6 rad.
LEVEL = Imu((0.0, 0.0, sin(0.3), cos(0.3)), (0.1, 0.2, 0.3), (1.0, 2.0, 9.80665))


def injector(text: str) -> FaultInjector:
    return FaultInjector(injected_faults(text, JOINTS), JOINTS)


@pytest.mark.parametrize(
    ('text', 'left', 'right'),
    [
        ('', 1.0, 2.0),
        ('reversed', -1.0, -2.0),
        ('right_reversed', 1.0, -2.0),
        ('left_dead', 0.0, 2.0),
        ('left_slipping', 0.2, 2.0),
        ('left_slipping=0.5', 0.5, 2.0),
        ('left_motor_ratio=3', 3.0, 2.0),
        ('command_degrees', pi / 180.0, pi / 90.0),
        ('command_rpm', pi / 30.0, pi / 15.0),
        ('swapped', 2.0, 1.0),
        ('right_swapped', 2.0, 1.0),
        # The leads are exchanged at the left motor, which has the right command.
        ('swapped, left_reversed', -2.0, 1.0),
        ('left_dead@5', 1.0, 2.0),
        ('encoder_reversed, imu_frozen', 1.0, 2.0),
    ],
)
def test_motors_are_driven_as_the_faults_have_it(text: str, left: float, right: float) -> None:
    commands = injector(text).commands(COMMANDS, 4.9)
    assert commands == pytest.approx({'left': left, 'right': right})
    assert COMMANDS == {'left': 1.0, 'right': 2.0}


@pytest.mark.parametrize(
    ('text', 'left'),
    [
        ('', (0.5, 1.0)),
        ('left_encoder_reversed', (-0.5, -1.0)),
        ('right_encoder_reversed', (0.5, 1.0)),
        ('left_gear_ratio=30', (15.0, 30.0)),
        ('degrees', (degrees(0.5), degrees(1.0))),
        ('left_rpm', (0.5, 30.0 / pi)),
        ('encoder_swapped', (1.5, 2.0)),
        ('left_zero=-0.1', (0.4, 1.0)),
        ('left_zero=0.2, left_degrees', (degrees(0.7), degrees(1.0))),
        ('left_reversed, swapped, left_dead', (0.5, 1.0)),
        ('left_encoder_reversed@1.01', (0.5, 1.0)),
    ],
)
def test_encoders_read_as_the_faults_have_it(text: str, left: tuple[float, float]) -> None:
    assert injector(text).cranks(CRANKS, COMMANDS, 1.0)['left'] == pytest.approx(left)


def test_a_frozen_encoder_stays_from_its_start_on() -> None:
    faults = injector('left_encoder_frozen@2, right_encoder_echo@2')
    readings = []
    for time in (1.0, 2.0, 3.0):
        cranks = {joint: SimulatedCrank(time, 0.5) for joint in JOINTS}
        readings.append(faults.cranks(cranks, COMMANDS, time))
    assert [reading['left'] for reading in readings] == [(1.0, 0.5), (2.0, 0.5), (2.0, 0.5)]
    assert [reading['right'] for reading in readings] == [(1.0, 0.5), (2.0, 2.0), (2.0, 2.0)]


def test_a_missing_encoder_is_not_among_the_readings() -> None:
    assert list(injector('left_encoder_missing').cranks(CRANKS, COMMANDS, 0.0)) == ['right']
    assert not injector('encoder_missing').cranks(CRANKS, COMMANDS, 0.0)


@pytest.mark.parametrize(
    ('text', 'orientation', 'rates', 'force'),
    [
        ('', LEVEL.orientation, LEVEL.angular_velocity, LEVEL.linear_acceleration),
        ('imu_degrees', LEVEL.orientation, [*map(degrees, (0.1, 0.2, 0.3))], (1.0, 2.0, 9.80665)),
        ('imu_g', LEVEL.orientation, (0.1, 0.2, 0.3), (1.0 / 9.80665, 2.0 / 9.80665, 1.0)),
        (
            'imu_yaw_reversed',
            (0.0, 0.0, -sin(0.3), cos(0.3)),
            (0.1, 0.2, -0.3),
            (1.0, 2.0, 9.80665),
        ),
        # Its x is the body's y.
        (
            'imu_turned',
            (0.0, 0.0, sin(0.3 + pi / 4), cos(0.3 + pi / 4)),
            (0.2, -0.1, 0.3),
            (2.0, -1.0, 9.80665),
        ),
        ('imu_turned=0', LEVEL.orientation, LEVEL.angular_velocity, LEVEL.linear_acceleration),
        ('imu_no_orientation', (0.0, 0.0, 0.0, 0.0), (0.1, 0.2, 0.3), (1.0, 2.0, 9.80665)),
        # The second jump.
        (
            'imu_heading_jumps=0.2@2',
            (0.0, 0.0, sin(0.3 + 0.2), cos(0.3 + 0.2)),
            (0.1, 0.2, 0.3),
            (1.0, 2.0, 9.80665),
        ),
    ],
)
def test_the_imu_reads_as_the_faults_have_it(
    text: str, orientation: tuple[float, ...], rates: tuple[float, ...], force: tuple[float, ...]
) -> None:
    imu = injector(text).imu(LEVEL, 7.5)
    assert imu.orientation == pytest.approx(orientation)
    assert imu.angular_velocity == pytest.approx(rates)
    assert imu.linear_acceleration == pytest.approx(force)


def test_a_tilted_imu_feels_gravity_along_its_side() -> None:
    level = Imu((0.0, 0.0, 0.0, 1.0), (0.1, 0.2, 0.3), (0.0, 0.0, 9.80665))
    imu = injector('imu_tilted').imu(level, 0.0)
    assert imu.linear_acceleration == pytest.approx((0.0, 9.80665, 0.0))
    assert imu.angular_velocity == pytest.approx((0.1, 0.3, -0.2))
    assert imu.orientation == pytest.approx((sin(pi / 4), 0.0, 0.0, cos(pi / 4)))


def test_a_frozen_imu_stays() -> None:
    faults = injector('imu_frozen@1')
    later = LEVEL._replace(angular_velocity=(0.0, 0.0, 9.0))
    assert faults.imu(LEVEL, 0.0) == LEVEL
    assert faults.imu(LEVEL, 1.0) == LEVEL
    assert faults.imu(later, 2.0) == LEVEL


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('left_reversd', 'fault left_reversd is unknown; did you mean left_reversed?'),
        ('middle_dead', 'there are reversed, dead, '),
        ('left_imu_frozen', 'is unknown'),
        ('left_slipping=a', "fault = 'left_slipping=a' is refused"),
        ('left_dead@', 'it must be FAULT=SIZE@START'),
        ('left_dead@inf', 'with finite numbers'),
        ('dead=', 'with finite numbers'),
        ('x\x1b[2J', r'x\x1b'),
    ],
)
def test_a_wrong_list_is_refused(text: str, words: str) -> None:
    with pytest.raises(TwinError) as caught:
        injected_faults(text, JOINTS)
    assert words in str(caught.value)
