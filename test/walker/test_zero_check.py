"""A wrong zero of a crank is found by the tilt of the body, and never in healthy walks."""

from math import cos, pi, radians, sin
from pathlib import Path

from klann_ros.gait import Feet, stance, Steering
from klann_ros.robot import robot_of
from klann_ros.twin import Floor, Sensors, Twin
from klann_ros.walker import imu_reading, Walker
from klann_ros.walker.zero_check import ZeroCheck, ZeroOffset
import numpy as np
import pytest

CONFIG = Path(__file__).resolve().parents[2] / 'config'

PERIOD = 0.02
# Cranks of an offset are named after 20 s, or 23.6 for a small one.
SECONDS = 25.0
SENSORS = Sensors(encoder_noise=0.002, gyro_noise=0.005, orientation_noise=0.002)


def checked(
    feet: Feet,
    offsets: tuple[float, float],
    *,
    slope: complex = 0j,
    noise: float = 0.002,
    count: int = 600,
) -> ZeroOffset | None:
    """Return the offset after a walk whose body rests on its feet on a slope."""
    check, random = ZeroCheck(feet), np.random.default_rng(1)
    for k in range(count):
        # Left and right drift apart, as in a curve.
        angles = 0.05 * k, 0.04 * k
        positions, _, centre = feet.at(angles).tolist()
        body_support = stance.support(positions, centre)
        attitude = complex(body_support.roll, body_support.pitch) + slope
        attitude += noise * complex(*random.standard_normal(2))
        encoders = [angle + offset for angle, offset in zip(angles, offsets, strict=True)]
        check.update(encoders, (attitude.real, attitude.imag))
    return check.offset


@pytest.mark.parametrize('slope', [0j, 0.05 - 0.03j])
@pytest.mark.parametrize(
    ('offsets', 'expected'),
    [
        ((0.0, 0.0), None),
        ((0.3, 0.0), ('left_crank', 0.3)),
        ((0.0, 0.3), ('right_crank', 0.3)),
        ((0.0, -0.3), ('right_crank', -0.3)),
        ((-0.5, 0.0), ('left_crank', -0.5)),
        # A whole turn is none.
        ((2.0 * pi, 0.0), None),
    ],
)
def test_the_crank_and_its_offset_are_found(
    two_motors: Feet,
    slope: complex,
    offsets: tuple[float, float],
    expected: tuple[str, float] | None,
) -> None:
    offset = checked(two_motors, offsets, slope=slope)
    assert offset == (expected and (expected[0], pytest.approx(expected[1], abs=0.101)))


def test_noise_alone_shows_no_offset(two_motors: Feet) -> None:
    assert checked(two_motors, (0.0, 0.0), noise=radians(2.0)) is None
    assert checked(two_motors, (0.1, 0.0), noise=radians(2.0)) is None
    # An offset explains little of it.
    assert checked(two_motors, (0.1, 0.0), noise=radians(0.4)) is None


def test_a_single_cause_is_confirmed_before_it_is_reported(two_motors: Feet) -> None:
    assert checked(two_motors, (0.3, 0.0), count=600).joint == 'left_crank'
    # Thirty samples show it, and 32 more have to.
    assert checked(two_motors, (0.3, 0.0), count=50 * 6) is None


def test_cranks_that_stand_are_no_evidence(two_motors: Feet) -> None:
    check = ZeroCheck(two_motors)
    for k in range(1000):
        check.update((0.3, 0.0), (0.1 * sin(k), 0.1 * cos(k)))
    assert check.offset is None
    assert check._count == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ('name', 'offsets', 'twist', 'slope'),
    [
        ('walker6_two_motors', (0.3, 0.0), (0.15, 0.0), 0.0),
        ('walker6_two_motors', (0.0, 0.1), (0.15, 0.0), 0.0),
        ('walker6_two_motors', (0.0, 0.0), (0.15, 0.0), 0.05),
        ('walker6_two_motors', (0.0, 0.0), (0.08, 0.04), 0.05),
    ],
)
def test_a_walk_in_mujoco_shows_the_offset_of_its_zero(
    name: str, offsets: tuple[float, float], twist: tuple[float, float], slope: float
) -> None:
    robot = robot_of(str(CONFIG / f'{name}.yaml'))
    walker = Walker(Steering(Feet(robot, foot_radius=0.004)))
    twin = Twin(robot, floor=Floor(slope=slope), sensors=SENSORS)
    for k in range(round(SECONDS / PERIOD)):
        now = PERIOD * k
        imu = twin.imu()
        x, y, z, w = imu.orientation
        a, b, c = imu.angular_velocity
        fx, fy, fz = imu.linear_acceleration
        walker.imu(imu_reading((x, y, z, w), (a, b, c), now, (fx, fy, fz)), now)
        cranks = zip(twin.cranks().items(), offsets, strict=True)
        readings = {j: (crank.position + offset, crank.velocity) for (j, crank), offset in cranks}
        walker.feedback(readings, now)
        walker.controller.command(*(twist if now > 1.0 else (0.0, 0.0)), now)
        command = walker.controller.step(now)
        for joint, rate in zip(twin.joints, command.velocity if command else (), strict=True):
            twin.command(joint, rate)
        twin.step(now + PERIOD)
    _, text = walker.verdict(SECONDS)
    reported_offset = walker.values(SECONDS)['zero_offset']
    if not any(offsets):
        assert reported_offset == ''
        assert 'the zero of' not in text
        return
    k = 0 if offsets[0] else 1
    assert reported_offset.startswith(
        f'the zero of {twin.joints[k]} is wrong by about {offsets[k]:+.1f} rad'
    )
    assert reported_offset in text
