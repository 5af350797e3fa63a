"""The simulated robot: motors with speed commands, noisy sensors, repeatable runs."""

import math
from pathlib import Path
import sys

from klann_ros.dynamics import GRAVITY, MassError
from klann_ros.gait import walk_figures
from klann_ros.robot import Robot, robot_from_parameters, robot_of
from klann_ros.twin import (
    agreement,
    DivergedError,
    ImuSampling,
    Motors,
    NoMujocoError,
    robot_mjcf,
    Sensors,
    Twin,
    TwinError,
)
from klann_ros.twin.twin import Pace
import numpy as np
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]


def two_motors() -> Robot:
    return robot_of(str(ROOT / 'config' / 'walker6_two_motors.yaml'))


def axes(twin: Twin) -> np.ndarray:
    x, y, z, w = twin.truth().orientation
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def yaw(twin: Twin) -> float:
    return math.atan2(axes(twin)[1, 0], axes(twin)[0, 0])


def driven(seconds: float, left: float, right: float, **options: object) -> Twin:
    twin = Twin(two_motors(), **options)
    twin.command('left_crank', left)
    twin.command('right_crank', right)
    twin.step(seconds)
    return twin


def test_it_walks_on_two_motors_and_publishes_its_true_pose() -> None:
    twin = driven(4.0, 1.0, 1.0)
    truth = twin.truth()
    assert truth.position[0] == pytest.approx(0.56, abs=0.04)
    assert abs(truth.position[1]) <= 0.05
    assert abs(yaw(twin)) <= 0.05
    assert math.degrees(twin.tilt) <= 1.0
    assert 0.1 <= truth.linear[0] <= 0.2
    assert twin.time == pytest.approx(4.0)
    assert twin.state == ''


def test_it_turns_to_the_side_of_the_slower_motor() -> None:
    assert yaw(driven(2.0, 1.0, -1.0)) < -0.05


def test_a_motor_turns_at_its_factor_of_the_commanded_rate() -> None:
    twin = driven(1.5, 2.0, 2.0, motors=Motors(factors={'right_crank': 0.9}))
    cranks = twin.cranks()
    assert cranks['left_crank'].position == pytest.approx(3.0, abs=0.1)
    ratio = cranks['right_crank'].position / cranks['left_crank'].position
    assert ratio == pytest.approx(0.9, abs=0.01)


def test_the_speed_of_a_motor_has_its_bandwidth_and_its_limit() -> None:
    twin = Twin(robot_of('sem104'), motors=Motors(bandwidth=10.0, max_velocity=2.0))
    assert twin.command('crank', -1e300) == -2.0
    assert twin.command('crank', 1.0) == 1.0
    assert twin.command('crank', 1e9) == 2.0
    for t in (0.05, 0.1, 0.3):
        twin.step(t)
        expected = 2.0 * (1.0 - math.exp(-10.0 * t))
        assert twin.cranks()['crank'].velocity == pytest.approx(expected, abs=0.01)


def test_a_leg_that_hangs_is_a_robot_as_well() -> None:
    twin = Twin(robot_of('sem104'))
    twin.command('crank', 2.0)
    twin.step(1.0)
    assert twin.cranks()['crank'].velocity == pytest.approx(2.0, abs=1e-3)
    assert twin.truth().position == (0.0, 0.0, 0.0)
    assert twin.imu().linear_acceleration == pytest.approx((0.0, 0.0, GRAVITY))
    (leg,) = robot_of('sem104').legs
    expected = robot_of('sem104').dynamics(leg).crank_torque(twin.cranks()['crank'].position, 2.0)
    assert twin.efforts() == pytest.approx(expected, rel=0.01)


def test_noise_has_the_spread_and_the_offset_that_are_reported() -> None:
    sensors = Sensors(
        encoder_noise=0.01, velocity_noise=0.2, encoder_offset=0.5, gyro_noise=0.03,
        accelerometer_noise=0.3, accelerometer_offset=0.7, orientation_noise=0.02,
    )  # fmt: skip
    twin = Twin(two_motors(), sensors=sensors)
    cranks = np.array([twin.cranks()['left_crank'] for _ in range(2000)])
    assert cranks.mean(0) == pytest.approx([0.5, 0.0], abs=0.02)
    assert cranks.std(0) == pytest.approx([0.01, 0.2], rel=0.1)
    imus = [twin.imu() for _ in range(2000)]
    assert np.std([imu.angular_velocity for imu in imus], axis=0) == pytest.approx(0.03, rel=0.1)
    felt = np.array([imu.linear_acceleration for imu in imus])
    assert felt.std(0) == pytest.approx(0.3, rel=0.1)
    still = np.array(Twin(two_motors()).imu().linear_acceleration)
    assert felt.mean(0) == pytest.approx(still + 0.7, abs=0.03)
    halves = np.array([imu.orientation[:3] for imu in imus])
    assert 2.0 * halves.std(0) == pytest.approx(0.02, rel=0.1)
    assert np.linalg.norm([imu.orientation for imu in imus], axis=1) == pytest.approx(1.0)


def test_the_same_seed_is_the_same_robot_to_the_last_digit() -> None:
    sensors = Sensors(encoder_noise=0.01, gyro_noise=0.1)

    def run(seed: int) -> tuple[object, ...]:
        twin = driven(0.3, 2.0, 1.0, sensors=sensors, seed=seed)
        return twin.cranks(), twin.imu(), twin.truth()

    assert run(3) == run(3)
    assert run(3) != run(4)


def test_imu_readings_integrate_the_whole_interval() -> None:
    # However hard the feet hit the ground: it adds up to the velocity that the body has.
    twin = Twin(two_motors())
    for joint in twin.joints:
        twin.command(joint, 2.0)
    twin.imu()
    gained, lay = np.zeros(3), axes(twin)
    began = lay @ twin.truth().linear
    for k in range(100):
        twin.step(0.01 * (k + 1))
        imu = twin.imu()
        assert imu == twin.imu()
        lies = axes(twin)
        gained += ((lay + lies) / 2.0 @ imu.linear_acceleration - (0.0, 0.0, GRAVITY)) * 0.01
        lay = lies
    has = lay @ twin.truth().linear - began
    assert np.linalg.norm(has) > 0.05
    assert gained == pytest.approx(has, abs=0.01)


def test_an_imu_may_read_an_instant() -> None:
    # The mean over one step of the engine is the reading of its end.
    sampled = driven(0.5, 2.0, 2.0, sensors=Sensors(imu_sampling=ImuSampling.INSTANT))
    averaged = driven(0.499, 2.0, 2.0)
    averaged.imu()
    averaged.step(0.5)
    assert sampled.imu() == averaged.imu()
    assert sampled.imu() != driven(0.5, 2.0, 2.0).imu()
    leg = Twin(robot_of('sem104'), sensors=Sensors(imu_sampling=ImuSampling.INSTANT))
    assert leg.imu().linear_acceleration == pytest.approx((0.0, 0.0, GRAVITY))


def test_legs_whose_loops_give_way_let_the_body_sink_and_walk_all_the_same() -> None:
    sunk = []
    for compliance in (0.0, 0.002, 0.008):
        twin = Twin(two_motors(), compliance=compliance)
        start = twin.truth().position[2]
        twin.step(0.5)
        sunk.append(start - twin.truth().position[2])
    rigid, stiff, soft = sunk
    assert rigid < stiff < soft
    assert 1e-4 < soft - rigid < 0.01
    assert driven(4.0, 1.0, 1.0, compliance=0.008).truth().position[0] == pytest.approx(
        0.56, abs=0.06
    )


def over_a_turn(name: str, rate: float, settle: float) -> tuple[np.ndarray, np.ndarray]:
    """Return places and tilts [deg] of a walker over a turn of its crank, after it has settled."""
    twin = Twin(robot_of(str(ROOT / 'config' / f'{name}.yaml')))
    for joint in twin.joints:
        twin.command(joint, rate)
    places, tilts = [], []
    for time in settle + np.linspace(0.0, 2.0 * math.pi / rate, 200):
        twin.step(time)
        places.append(twin.truth().position)
        tilts.append(math.degrees(twin.tilt))
    return np.array(places), np.array(tilts)


def test_six_legs_walk_straight_and_level_at_the_speed_of_their_stance() -> None:
    places, tilts = over_a_turn('walker6', 1.0, 2.0)
    expected = walk_figures(robot_of(str(ROOT / 'config' / 'walker6.yaml')))
    assert expected.speed == pytest.approx(0.1485, rel=0.005)
    gone = places[-1] - places[0]
    assert gone[0] == pytest.approx(2.0 * math.pi * expected.speed, rel=0.04)
    assert abs(gone[1]) <= 0.02
    assert tilts.max() <= 1.0
    assert np.ptp(places[:, 2]) == pytest.approx(0.019, abs=0.001)


def test_four_legs_waddle_slowly_and_tip_over_fast() -> None:
    places, tilts = over_a_turn('walker4', 1.0, 1.0)
    assert places[-1, 0] - places[0, 0] > 0.1 * 2.0 * math.pi
    assert 20.0 <= tilts.max() <= 30.0
    assert over_a_turn('walker4', 2.0, 0.5)[1].max() >= 90.0


def test_divergence_is_reported_without_a_file_and_a_reset_restarts_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    twin = driven(0.1, 2.0, 2.0)
    twin._data.qvel[:] = 1e12
    with pytest.raises(DivergedError, match='became unstable'):
        twin.step(0.2)
    assert [*tmp_path.iterdir()] == []
    twin.reset()
    assert (twin.time, twin.truth()) == (0.0, Twin(two_motors()).truth())
    twin.step(0.1)
    assert twin.cranks()['left_crank'].velocity == pytest.approx(0.0, abs=0.02)


def test_a_fallen_robot_reports_it() -> None:
    twin = Twin(two_motors())
    twin._data.qpos[3:7] = (math.cos(0.8), math.sin(0.8), 0.0, 0.0)
    assert twin.state == 'it has fallen, tilted by 92 deg'


@pytest.mark.parametrize(
    ('wrong', 'reason'),
    [
        ({'bar_density': 0.0, 'foot_mass': 0.0}, 'weighs nothing'),
        ({'bar_density': 1e-300}, 'the engine takes no such robot'),
        ({'body_mass': 1e-300}, 'the engine takes no such robot'),
        ({'body_centre': [1e300, 0.0, 0.0]}, 'became unstable'),
        ({'body_mass': 1e300}, 'became unstable'),
    ],
)
def test_masses_and_sizes_of_no_robot_are_reported_in_one_line(
    wrong: dict[str, object], reason: str
) -> None:
    content = yaml.safe_load((ROOT / 'config' / 'walker6_two_motors.yaml').read_text())
    parameters = content['/**']['ros__parameters'] | wrong
    with pytest.raises((MassError, TwinError), match=reason) as refused:
        Twin(robot_from_parameters(parameters)).step(0.1)
    assert '\n' not in str(refused.value)


@pytest.mark.parametrize(
    ('make', 'reason'),
    [
        (lambda: Twin(two_motors(), motors=Motors(factors={'left': 1.0})), 'left turns no crank'),
        (lambda: Motors(bandwidth=0.0), 'bandwidth = 0.0 is refused'),
        (lambda: Motors(factors={'a': math.nan}), 'factor of a'),
        (lambda: Sensors(encoder_noise=-1.0), 'encoder_noise = -1.0'),
        (lambda: Sensors(encoder_offset=math.inf), 'encoder_offset'),
        (lambda: Twin(two_motors(), compliance=0.001), 'compliance'),
        (lambda: Twin(two_motors(), compliance=math.nan), 'compliance'),
        (lambda: Twin(robot_of('sem104')).command('crank', math.nan), 'velocity of crank'),
        (lambda: Twin(robot_of('sem104')).command('crank', -math.inf), 'velocity of crank'),
        (lambda: Twin(robot_of('sem104')).command('lift', 1.0), 'lift turns no crank'),
    ],
)
def test_invalid_robots_and_commands_are_refused(make: object, reason: str) -> None:
    with pytest.raises(TwinError, match=reason):
        make()


@pytest.mark.parametrize('factor', [1.0, 4.0])
def test_a_pace_that_is_kept_loses_no_tick(factor: float) -> None:
    pace = Pace(0.01, factor, 100.0)
    ticks = sum(pace.due(100.0 + 0.0101 * n) for n in range(1, 1001))
    assert ticks == int(factor * 0.0101 * 1000 / 0.01)
    assert pace.real_time_factor(100.0 + 10.1) == pytest.approx(factor, abs=1e-3)
    assert pace.slipped == 0.0


def test_a_delay_beyond_the_limit_is_dropped_and_reported() -> None:
    pace = Pace(0.01, 1.0, 0.0)
    assert pace.due(0.01) == 1
    assert pace.due(0.15) == 14
    assert pace.due(10.15) == 1
    assert pace.slipped == pytest.approx(9.99)
    assert pace.due(10.16) == 1
    assert pace.real_time_factor(10.16) == pytest.approx(17 / 1016)
    assert pace.due(11.17) == 1
    assert pace.slipped == pytest.approx(9.99 + 1.0)


def test_without_the_engine_the_error_has_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    with pytest.raises(NoMujocoError, match=r"pip install 'klann_ros\[sim\]'"):
        Twin(robot_of('sem104'))
    with pytest.raises(NoMujocoError):
        agreement(robot_of('sem104'), 1.0)
    # The model needs none.
    assert robot_mjcf(robot_of('sem104')).startswith('<mujoco')
