"""The sheet's numbers are those of the kinematics, of the dynamics, and of virtual work."""

from dataclasses import replace
import json
from math import inf, pi
from pathlib import Path
import re

from change_point_linkages import change_point_file, FEET
from klann_ros.datasheet import data_sheet, DataSheet, Motor, SheetError
from klann_ros.datasheet.figures import joint_force_table
from klann_ros.datasheet.json_report import report
from klann_ros.datasheet.load import turn_angles, with_extremes
from klann_ros.datasheet.page import _leg_charts, page
from klann_ros.datasheet.sheet import cases
from klann_ros.datasheet.text import sheet_text
from klann_ros.gait import walk_figures
from klann_ros.kinematics import foot_path, KlannGeometry, KlannLeg, length_margins, linkage_poses
from klann_ros.robot import Robot, robot_from_file, robot_from_parameters, robot_of
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
TURN = 2.0 * pi


def bare(robot: Robot) -> Robot:
    return replace(robot, legs=tuple(replace(leg, masses=None) for leg in robot.legs))


def weighed(robot: Robot) -> Robot:
    return bare(robot).with_rods(1.0)


@pytest.fixture(scope='module')
def sem() -> Robot:
    return weighed(robot_of('sem104'))


@pytest.fixture(scope='module')
def sheet(sem: Robot) -> DataSheet:
    return data_sheet(sem, speed=2.0, load=10.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('speed', 'min_torque', 'max_torque', 'ripple'),
    # MuJoCo's actuator, whose servo lets the speed ripple, and by how much it may be off.
    [(2.0, -3.543, 1.581, 0.0025), (TURN, -8.389, 2.721, 0.011)],
)
def test_the_torque_is_that_of_an_actuator(
    sem: Robot, speed: float, min_torque: float, max_torque: float, ripple: float
) -> None:
    (crank,) = data_sheet(sem, speed=speed).cranks
    assert crank.empty.torque.min() == pytest.approx(min_torque, rel=ripple)
    assert crank.empty.torque.max() == pytest.approx(max_torque, rel=ripple)


def test_a_sheet_has_all_turns_until_the_linkage_is_back() -> None:
    name = str(change_point_file('two_turns'))
    full = data_sheet(weighed(robot_of(name)), load=2.0)
    (leg,) = full.legs
    (crank,) = full.cranks
    for angles in (leg.alphas, crank.loaded.alphas):
        assert 2.0 * TURN - 0.1 < angles[-1] < 2.0 * TURN
    stance = leg.stance
    assert stance.period == 2.0 * TURN
    # It is lowest once in both turns, where the other turn has its highest point.
    feet = FEET['two_turns'](leg.alphas)
    is_low = feet.imag <= feet.imag.min() + stance.ground
    is_backward = np.sign(np.gradient(feet.real, leg.alphas)) == stance.direction
    share = np.ptp(leg.alphas[is_low & is_backward]) / (2.0 * TURN)
    assert stance.duty_factor == pytest.approx(share, abs=2e-3)
    # The work of the load is that of the foot on the ground.
    difference = crank.loaded.mean - crank.empty.mean
    ends = FEET['two_turns'](np.array([stance.start, stance.end])).imag
    assert difference * 2.0 * TURN == pytest.approx(-2.0 * (ends[1] - ends[0]), abs=2e-4)
    assert 'of 2 turns' in page(full)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('name', 'unbounded'),
    [
        ('parallelogram', 'ABCD'),
        ('two_turns', 'ABCD'),
        ('level_foot', 'DEFG'),
        ('slotted_arm', ''),
        ('cardan', ''),
        ('four_bar', ''),
    ],
)
def test_forces_that_grow_without_bound_are_no_number(name: str, unbounded: str) -> None:
    (leg,) = data_sheet(weighed(robot_of(str(change_point_file(name))))).legs
    infinite = {joint.name for joint in leg.empty.joints if joint.greatest.value == inf}
    assert infinite == {*unbounded}
    assert ('without bound' in joint_force_table(leg).note) == bool(unbounded)
    # Their curves are drawn where they can be read.
    chart = [*_leg_charts(leg)][-1]
    for line in chart.lines:
        assert np.nanmax(line.heights) <= 30.0 * np.nanmedian(line.heights)


def test_the_motion_is_that_of_the_kinematics(sheet: DataSheet) -> None:
    content = json.loads(report(sheet))
    (leg,) = content['legs']
    path = foot_path(KlannLeg())
    for name in ('stride', 'lift', 'length', 'area'):
        assert leg['path'][name] == pytest.approx(getattr(path, name), rel=1e-9)
    stance = path.stance()
    for name in ('start', 'end', 'duty_factor', 'ground_covered', 'straightness'):
        assert leg['stance'][name] == pytest.approx(getattr(stance, name), rel=1e-9)
    assert leg['stance']['body_speed'] == pytest.approx(stance.speed(2.0))
    margins = length_margins(KlannGeometry.sem104())
    bars = {bar['name']: bar for bar in leg['bars']}
    assert bars.keys() == margins.keys()
    assert bars['l_bc']['least'] == pytest.approx(margins['l_bc'].least, abs=1e-9)
    assert bars['l_gh']['greatest'] is None
    sem104 = KlannGeometry.sem104()
    poses = linkage_poses(sem104, leg['crank_angle'], transmission_angles=True)
    assert np.allclose(np.transpose([leg['path']['x'], leg['path']['y']]), poses.h, atol=1e-12)
    reported = np.transpose([dyad['angle'] for dyad in leg['transmission']])
    assert np.allclose(reported, poses.transmission_angles, atol=1e-9)
    # The published extremes of SEM 104's dyads.
    dyad = leg['transmission'][0]
    extremes = np.degrees([dyad['least']['value'], dyad['greatest']['value']])
    assert extremes == pytest.approx([31.19, 156.15], abs=0.02)


def test_forces_are_those_of_the_dynamics(sem: Robot, sheet: DataSheet) -> None:
    content = json.loads(report(sheet))
    dynamics = sem.dynamics(sem.legs[0])
    alphas = np.array(content['legs'][0]['crank_angle'])
    up = np.where(stands(sheet, alphas), 10.0, 0.0)
    for case, loads in (('empty', None), ('loaded', {'H': (0.0, up)})):
        expected = dynamics.crank_torque(alphas, 2.0, 0.0, loads)
        assert content['legs'][0][case]['torque'] == pytest.approx(expected, abs=1e-9)
        crank = content['cranks'][0][case]
        torque = np.interp(crank['angle'], alphas, expected, period=TURN)
        assert crank['torque'] == pytest.approx(torque, abs=1e-3)
        pins = dynamics.reactions(alphas, 2.0, 0.0, loads).pins
        for joint in content['legs'][0][case]['joints']:
            forces = [abs(force) for (name, _), force in pins.items() if name == joint['name']]
            assert joint['force'] == pytest.approx(np.max(forces, axis=0), rel=1e-9)
            assert joint['greatest']['value'] == max(joint['force'])


def stands(sheet: DataSheet, alphas: np.ndarray) -> np.ndarray:
    stance = sheet.legs[0].stance
    turns = alphas + np.array([[0.0], [TURN]])
    return ((stance.start <= turns) & (turns <= stance.end)).any(axis=0)


def test_the_torque_of_a_load_follows_from_virtual_work(sheet: DataSheet) -> None:
    (crank,) = sheet.cranks
    path = foot_path(KlannLeg(), samples=7200)
    alphas = crank.loaded.alphas
    slope = np.interp(alphas, path.alphas, path.h_1[:, 1], period=TURN)
    expected = np.where(stands(sheet, alphas), -10.0 * slope, 0.0)
    assert crank.loaded.torque - crank.empty.torque == pytest.approx(expected, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    'name', ['klann_high_step', 'jansen', 'hoecken', 'config/walker6_two_motors.yaml']
)
def test_peaks_are_those_of_dense_sampling(name: str) -> None:
    robot = weighed(robot_of(str(ROOT / name) if '/' in name else name))
    # Two legs on one joint: the gait of all is another matter.
    robot = replace(robot, legs=robot.legs[:2])
    dense = peaks(data_sheet(robot, load=40.0, samples=2_500))
    assert peaks(data_sheet(robot, load=40.0)) == pytest.approx(dense, rel=1e-4)


def peaks(sheet: DataSheet) -> list[float]:
    turns = [turn for crank in sheet.cranks for turn in (crank.empty, crank.loaded) if turn]
    joints = [joint for leg in sheet.legs for _, forces in cases(leg) for joint in forces.joints]
    return [*(turn.peak for turn in turns), *(joint.greatest.value for joint in joints)]


@pytest.mark.slow
def test_a_leg_that_weighs_nothing_carries_a_load(sem: Robot, sheet: DataSheet) -> None:
    unloaded = data_sheet(bare(sem))
    assert unloaded.legs[0].path is not None
    assert unloaded.cranks[0].hardest is None
    light = data_sheet(bare(sem), speed=2.0, load=10.0)
    for massless in (unloaded, light):
        assert 'bar_density [kg/m]' in massless.no_forces
    assert light.cranks[0].empty is None
    (light_crank,) = light.cranks
    (heavy_crank,) = sheet.cranks
    difference = heavy_crank.loaded.torque - heavy_crank.empty.torque
    light = light_crank.loaded
    expected = np.interp(light.alphas, heavy_crank.loaded.alphas, difference, period=TURN)
    assert light.torque == pytest.approx(expected, abs=1e-4)


@pytest.mark.slow
def test_a_joint_carries_the_legs_that_it_turns_by_their_phases() -> None:
    robot = weighed(robot_from_file(ROOT / 'config' / 'walker6.yaml'))
    sheet = data_sheet(robot, speed=3.0, samples=30)
    assert [leg.names for leg in sheet.legs] == [tuple(leg.name for leg in robot.legs)]
    assert sheet.walk is not None
    for crank in sheet.cranks:
        expected = np.zeros(crank.empty.alphas.size)
        for leg in robot.on_joint(crank.joint):
            alphas = leg.crank_angles(crank.empty.alphas)
            expected += leg.direction * robot.dynamics(leg).crank_torque(alphas, 3.0)
        assert crank.empty.torque == pytest.approx(expected, abs=1e-9)


@pytest.mark.slow
def test_legs_that_differ_have_a_sheet_each() -> None:
    names = ['one', 'two', 'three', 'four']
    lengths = {f'{name}.{key}': value for name in names for key, value in LENGTHS.items()}
    on_its_side = {'four.mount_rpy': [0.0, 0.0, 0.0]}
    robot = robot_from_parameters(
        {'legs': names, **lengths, 'two.l_gh': 0.45, 'three.bar_density': 2.0, **on_its_side}
    )
    sheet = data_sheet(robot, samples=30)
    assert [leg.names for leg in sheet.legs] == [(name,) for name in names]
    assert 'missing for one, two, four' in sheet.no_forces


LENGTHS = KlannGeometry.sem104().as_dict()


def test_the_gait_of_many_legs_is_not_computed_and_more_legs_are_refused() -> None:
    (leg,) = robot_of('sem104').legs
    many = [replace(leg, name=f'leg_{n}', phase=0.1 * n) for n in range(101)]
    sheet = data_sheet(Robot('centipede', tuple(many[:25])), samples=30)
    assert sheet.walk is None
    assert sheet.no_walk == 'no gait is computed of 25 legs: at most 24'
    with pytest.raises(SheetError, match='101 legs are refused: at most 100'):
        data_sheet(Robot('centipede', tuple(many)))


def test_the_angle_of_a_joint_is_not_that_of_a_leg_with_a_phase() -> None:
    robot = robot_from_parameters(
        {**LENGTHS, 'bar_density': 1.0, 'phase': 0.5, 'direction': -1, 'crank_joint': 'axle'}
    )
    sheet = data_sheet(robot, samples=30)
    (crank,) = sheet.cranks
    assert not crank.is_own
    expected = -robot.dynamics(robot.legs[0]).crank_torque(0.5 - crank.empty.alphas, sheet.speed)
    assert crank.empty.torque == pytest.approx(expected, abs=1e-9)
    html = page(sheet)
    assert 'angle of axle / deg' in html
    assert 'Crank axle' in html


# Its links are in line twice a turn, where no velocity follows.
PARALLELOGRAM = """
name: Parallelogram
density: 1.0
pivots: {A: [0, 0], D: [0.2, 0]}
crank: a
foot: C
bodies:
  a: {bars: [{from: A, to: B, length: 0.1}]}
  b: {bars: [{from: B, to: C, length: 0.2}]}
  c: {bars: [{from: D, to: C, length: 0.1}]}
start: {a: 1.0, b: 0.0, c: 1.0}
"""


def test_a_torque_undefined_in_line_makes_the_motor_verdict_a_fault(tmp_path: Path) -> None:
    path = tmp_path / 'parallelogram.yaml'
    path.write_text(f'{PARALLELOGRAM}at_change_points: sign\n')
    strong = Motor(stall_torque=1e6, no_load_speed=1e3, gear_ratio=1.0, efficiency=1.0)
    sheet = data_sheet(robot_from_file(path), load=1.0, motor=strong, samples=360)
    assert 'links are in line' in sheet.no_forces
    assert not sheet.motor_turns
    verdict = sheet.cranks[0].motor
    assert verdict.faults == ('links are in line at 0.0 deg, where the torque is undefined',)
    assert 'NaN' not in report(sheet)
    attributes = re.findall(r' (?:d|x|y|width)="([^"]*)"', page(sheet))
    assert len(attributes) > 50
    assert not re.search('nan|inf', ' '.join(attributes))


@pytest.mark.slow
def test_the_cost_of_transport_is_power_by_weight_and_speed() -> None:
    robot = robot_from_file(ROOT / 'config' / 'walker6_two_motors.yaml')
    speed = -3.0
    sheet = data_sheet(robot, speed=speed, load=20.0, samples=180)
    assert sheet.costs_of_transport is not None
    positive, absolute = sheet.costs_of_transport
    body_mass = robot.body.mass if robot.body else 0.0
    mass = body_mass + sum(leg.masses.total * len(leg.names) for leg in sheet.legs)
    work = []
    for crank in sheet.cranks:
        # The work of a turn, in small steps of the shaft.
        angles = TURN * np.arange(20000) / 20000
        torque = np.interp(angles, crank.loaded.alphas, crank.loaded.torque, period=TURN)
        work.append([TURN * np.maximum(-torque, 0.0).mean(), TURN * np.abs(torque).mean()])
    distance = abs(walk_figures(robot).stride)
    expected = np.sum(work, axis=0) / (mass * 9.80665 * distance)
    assert (positive, absolute) == pytest.approx(expected, rel=2e-3)
    # Half of the absolute work is positive where a turn takes none in all.
    assert 0.0 < positive < absolute
    content = json.loads(report(sheet))['walk']['cost_of_transport']
    assert content == {'positive_power': positive, 'absolute_power': absolute}
    for other in (data_sheet(robot, samples=60), data_sheet(bare(robot), load=20.0, samples=60)):
        assert other.costs_of_transport is None
        assert json.loads(report(other))['walk']['cost_of_transport'] is None


def test_a_leg_without_full_turn_has_arcs_and_a_note() -> None:
    sheet = data_sheet(weighed(robot_of('chebyshev')), load=5.0, samples=60)
    (leg,) = sheet.legs
    assert leg.arcs
    assert leg.empty is None
    assert sheet.cranks[0].hardest is None
    assert 'does not turn fully' in sheet.no_forces
    assert leg.no_margins


# Its foot goes up and down, and nowhere along x.
UPRIGHT = """
name: Upright
pivots: {A: [0, 0]}
crank: crank
foot: C
bodies:
  crank: {bars: [{from: A, to: B, length: 0.05}]}
  rod: {bars: [{from: B, to: C, length: 0.15}]}
  piston: {slides: {along: ground, from: A, to: C, direction: 90}}
units: {length: m, angle: deg}
start: {crank: 60, rod: 100, piston: 0.19}
"""


def test_a_foot_without_a_stance_is_reported_and_carries_no_load(tmp_path: Path) -> None:
    path = tmp_path / 'upright.yaml'
    path.write_text(UPRIGHT)
    robot = robot_from_file(path)
    (leg,) = data_sheet(robot, samples=60).legs
    assert leg.turns_fully
    assert 'there is no stance' in leg.no_stance
    with pytest.raises(SheetError, match='a load on the foot has nowhere to be: there is no'):
        data_sheet(robot, load=1.0, samples=60)


@pytest.mark.parametrize(
    ('name', 'load', 'title'),
    [
        ('klann', 0.0, 'Foot H'),
        ('four_bar', 0.0, 'Coupler point B'),
        ('scotch_yoke', 0.0, 'Point E'),
        # What a load stands on is a foot.
        ('four_bar', 5.0, 'Foot B'),
    ],
)
def test_feet_strides_and_stances_are_of_legs(name: str, load: float, title: str) -> None:
    robot = replace(weighed(robot_of(name)), source='')
    full = data_sheet(robot, load=load, samples=60)
    markup = re.sub(r'<(script|style)\b.*?</\1>', '', page(full), flags=re.DOTALL)
    words = re.compile(r'\b(foot|leg|stride|lift|stance|ground|off straight)\b', re.IGNORECASE)
    text = sheet_text(full)
    assert f'\n{title}\n' in text
    for spoken in (text, re.sub('<[^>]*>', ' ', markup)):
        assert bool(words.search(spoken)) == title.startswith('Foot')
        assert ('Width of the path' in spoken) != title.startswith('Foot')
    assert json.loads(report(full))['legs'][0]['stance']


def test_margins_of_coupled_loops_are_computed_on_request() -> None:
    (leg,) = data_sheet(robot_of('stephenson'), samples=60).legs
    assert '--margins' in leg.no_margins
    assert {bar.margin for bar in leg.bars} == {None}


def test_forces_on_sliders_have_a_moment() -> None:
    (leg,) = data_sheet(weighed(robot_of('slider_crank')), samples=60).legs
    assert [joint.name for joint in leg.empty.joints if joint.moment is not None]


def test_a_curve_of_rounding_errors_has_no_steps_at_its_extremes() -> None:
    angles = turn_angles(360)
    curve = 1e-17 * np.sin(1e4 * angles)
    assert np.diff(with_extremes(angles, [curve])).min() > 1e-6
