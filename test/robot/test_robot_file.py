"""The files of a leg, a walker and a linkage; invalid ones are refused in one line."""

from math import pi
from pathlib import Path
from typing import Any

from klann_ros.dynamics import MassBasis, rods
from klann_ros.kinematics import KlannGeometry, SHIPPED, shipped_linkages
from klann_ros.robot import (
    CrankDrive,
    robot_from_file,
    robot_from_text,
    robot_of,
    RobotFileError,
    solver_parameters,
)
from klann_ros.sanitize.yaml_text import dump
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
LEG = 'l_ab: 0.12\nbar_density: 1.0\n'
PRESS = """
name: press
density: 4.0
pivots: {O: [0, 0], P: [0, 0]}
crank: crank
foot: B
bodies:
  crank: {bars: [{from: O, to: A, length: 0.1}]}
  rod: {bars: [{from: A, to: B, length: 0.5}]}
  block: {slides: {along: ground, from: P, to: B}, mass: 3.0}
start: {crank: 0.0, rod: 0.0, block: 0.6}
"""


def test_a_leg_file_is_one_unnamed_leg_hung_up_upright() -> None:
    (leg,) = robot_from_file(ROOT / 'config' / 'sem104.yaml').legs
    assert leg.linkage == KlannGeometry.sem104().linkage
    assert (leg.name, leg.prefix, leg.crank_joint) == ('', '', 'crank')
    assert leg.mount.transform([[0.2, -0.3]]) == pytest.approx(np.array([[0.2, 0.0, -0.3]]))


def test_a_walker_has_its_legs_where_its_file_mounts_them() -> None:
    walker = robot_from_file(ROOT / 'config' / 'walker6.yaml')
    assert [leg.name for leg in walker.legs][::5] == ['front_left', 'rear_right']
    rear = walker.legs[-1]
    assert (rear.direction, rear.phase) == (-1, 0.0)
    # Turned by pi about the vertical: what is in front of its own plane is behind.
    assert rear.mount.transform([0.1, -0.4]) == pytest.approx([-0.3, -0.2, -0.4])
    assert walker.is_walker


def test_an_explicit_density_wins_over_the_masses_of_a_file() -> None:
    leg = robot_from_text(f'{LEG}foot_mass: 0.25\n', 'leg.yaml')
    (light,) = leg.with_rods(0.1).legs
    rods_only = leg.legs[0].masses.total - 0.25
    assert light.masses.total == pytest.approx(0.1 * rods_only + 0.25)
    assert light.masses.basis is MassBasis.RODS
    assert leg.legs[0].masses.basis is MassBasis.ASSUMED_RODS
    # The file of a linkage with a density, with its sliding block's mass and springs.
    slider = robot_of('andrews').with_rods(2.0).legs[0]
    assert slider.masses.springs == robot_of('andrews').legs[0].masses.springs
    assert slider.masses.total == pytest.approx(rods(slider.linkage, 2.0).total)
    press = robot_from_text(PRESS, 'press.yaml')
    assert [body.mass for body in press.with_rods(1.0).legs[0].masses.bodies] == [0.1, 0.5, 3.0]


def test_a_density_of_parameters_leaves_a_linkage_its_springs_and_sliding_bodies() -> None:
    springs = 'springs: [{from: P, to: B, stiffness: 40.0}]\n'
    text = dump({'linkage_description': PRESS + springs, 'bar_density': 2.0})
    (leg,) = robot_from_text(text, 'leg.yaml').legs
    assert [body.mass for body in leg.masses.bodies] == [0.2, 1.0, 3.0]
    assert [spring.stiffness for spring in leg.masses.springs] == [40.0]


def test_the_mass_of_a_foot_is_added_to_the_masses_of_a_linkage() -> None:
    description = (SHIPPED / 'andrews.yaml').read_text()
    text = dump({'linkage_description': description, 'foot_mass': 0.25})
    (leg,) = robot_from_text(text, 'leg.yaml').legs
    masses = robot_of('andrews').legs[0].masses
    assert leg.masses.total == pytest.approx(masses.total + 0.25)
    assert leg.masses.basis is MassBasis.BODIES


@pytest.mark.parametrize(
    ('name', 'basis'),
    [
        ('sem104', MassBasis.ASSUMED_RODS),
        ('jansen', MassBasis.ASSUMED_RODS),
        ('andrews', MassBasis.BODIES),
        (str(ROOT / 'examples' / 'my_walker' / 'config' / 'desk_walker.yaml'), MassBasis.RODS),
        (str(ROOT / 'config' / 'walker6.yaml'), MassBasis.ASSUMED_RODS),
    ],
)
def test_what_masses_come_from_is_known(name: str, basis: MassBasis) -> None:
    masses = robot_of(name).legs[0].masses
    assert masses is not None
    assert masses.basis is basis
    is_assumption = basis is MassBasis.ASSUMED_RODS
    assert masses.origin.startswith('assumed, not measured') == is_assumption


@pytest.mark.parametrize('name', ['sem104', 'patent', *shipped_linkages()])
def test_every_shipped_name_is_a_robot_with_masses(name: str) -> None:
    (leg,) = robot_of(name).legs
    assert leg.linkage.foot
    # Sliding bodies without a bar included.
    assert all(body.mass > 0.0 for body in leg.masses.bodies)


def test_weight_is_down_in_base_link_however_a_leg_is_mounted(tmp_path: Path) -> None:
    file = tmp_path / 'leg.yaml'
    file.write_text(LEG + f'mount_rpy: [{-pi / 2}, 0.0, 0.0]\n')
    robot = robot_from_file(file)
    gravity = robot.dynamics(robot.legs[0]).gravity
    assert (gravity.real, gravity.imag) == pytest.approx((0.0, 9.80665))


@pytest.mark.parametrize('name', ['sem104', 'patent'])
def test_a_preset_has_the_masses_of_its_parameter_file(name: str) -> None:
    (leg,), (of_file,) = robot_of(name).legs, robot_of(str(ROOT / 'config' / f'{name}.yaml')).legs
    assert leg.masses == of_file.masses
    assert leg.linkage == of_file.linkage


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('[]', 'must be a mapping'),
        ('a: 1', 'none of l_ab'),
        ('l_ab: -1', 'l_ab'),
        ('l_ab: 0.12\nbar_density: -1', 'density'),
        ('l_ab: 0.12\nbar_density: heavy', 'bar_density'),
        ('l_ab: 0.12\nbar_density: .nan', 'finite'),
        ('l_ab: 0.12\ndirection: 2', 'direction'),
        ('l_ab: 0.12\nmount_rpy: [90, 0, 0]', 'radians, not degrees'),
        ('l_ab: 0.12\nmount_xyz: [0, 0]', 'mount_xyz'),
        ('l_ab: 0.12\nbody_mass: 20', 'body_size'),
        ('l_ab: 0.12\nbody_mass: 0\nbody_size: [1, 1, 1]', 'body_mass'),
        ('legs: [a, a]', 'legs'),
        (
            'l_ab: 0.12\ncranks: {crank: {sign: -1}}',
            'cranks.crank.sign is none of encoder_ratio, ',
        ),
        ('l_ab: 0.12\ncranks: {crnk: {zero: 1}}', 'cranks.crnk: no leg .* did you mean crank'),
        ('l_ab: 0.12\ncranks: {crank: {encoder_ratio: 0}}', 'not 0'),
        ('l_ab: 0.12\ncranks: {crank: {motor_ratio: 0.0}}', 'not 0'),
        ('l_ab: 0.12\ncranks: {crank: {zero: .nan}}', 'finite'),
        ('linkage: not_there.yaml', 'not_there.yaml'),
        ('l_ab: 0.12\ncrank_joint: "\\u202ea"', 'crank_joint = .* must be a text of printable'),
        ('l_ab: 0.12\ncrank_joint: [a]', 'crank_joint = .* must be a text of printable'),
        ('l_ab: 0.12\ncrank_joint: "\\x1b"', 'is a character that YAML does not allow'),
        ('linkage: ~nosuchuser/x', 'nosuchuser/x is in the home folder of no user here'),
        (
            ''.join(f'n{n}: {{ros__parameters: {{l_ab: 0.12}}}}\n' for n in range(201)),
            '201 sections of nodes, more than 200',
        ),
        (f'{"/a" * 200}: {{ros__parameters: {{l_ab: 0.12}}}}', 'is no name in ROS'),
        (f'legs: [{", ".join(f"l{n}" for n in range(101))}]', 'up to 100 names'),
    ],
)
def test_an_invalid_robot_is_refused_in_one_line(text: str, reason: str, tmp_path: Path) -> None:
    file = tmp_path / 'robot.yaml'
    file.write_text(text)
    with pytest.raises(RobotFileError, match=reason) as refused:
        robot_from_file(file)
    assert '\n' not in str(refused.value)


def test_a_file_has_encoder_and_motor_of_each_crank(tmp_path: Path) -> None:
    text = (ROOT / 'config' / 'walker6_two_motors.yaml').read_text()
    file = tmp_path / 'robot.yaml'
    cranks = 'cranks: {left_crank: {encoder_ratio: -4, motor_ratio: -2.0, zero: 0.3}}'
    file.write_text(f'{text}    {cranks}\n')
    robot = robot_from_file(file)
    left, right = robot.drives.values()
    assert list(robot.drives) == ['left_crank', 'right_crank']
    assert (left, right) == (CrankDrive(-4.0, -2.0, 0.3), CrankDrive())
    # At an encoder of -2 rad the crank is at 0.5 rad, 0.3 rad of which are its zero.
    assert left.measured(-2.0, 8.0) == pytest.approx((0.2, -2.0))
    assert left.measured(-2.0, None) == (pytest.approx(0.2), None)
    assert left.commanded(0.2, 1.5) == pytest.approx((-2.0, -3.0))
    for leg in robot.legs:
        # What follows from the encoder is what follows from the crank.
        by_encoder = leg.encoder_direction * -2.0 + leg.encoder_phase
        angle = leg.drive.measured(-2.0, None)[0]
        assert by_encoder == pytest.approx(float(leg.crank_angles(angle)))


@pytest.mark.parametrize(
    ('section', 'is_for_it'),
    [
        ('/**', True),
        ('/**/solver_node', True),
        ('/a/*/solver_node', True),
        ('/a/**/solver_node', True),
        ('/a/b/**/solver_node', True),
        ('/*/solver_node', False),
        ('/a/*', False),
        ('/*/*/*/*', False),
        ('/b/**', False),
        ('/a/b/solver_node/**', True),
        # A pattern with many wildcards takes no longer.
        ('/**' * 60, True),
        ('/**' * 60 + '/x', False),
    ],
)
def test_sections_with_wildcards_apply_as_in_ros(section: str, is_for_it: bool) -> None:
    first = {'ros__parameters': {'l_ab': 0.12}}
    document = {'/a/b/solver_node': first, section: {'ros__parameters': {'l_ab': 0.13}}}
    assert solver_parameters(document) == {'l_ab': 0.13 if is_for_it else 0.12}


SEM = {'ros__parameters': {'l_ab': 0.1}}
RATE = {'ros__parameters': {'rate': 50.0}}


@pytest.mark.parametrize(
    ('content', 'expected'),
    [
        ({'sim_node': SEM, 'recorder_node': RATE}, {'l_ab': 0.1}),
        ({'solver_node': RATE, 'sim_node': SEM}, {'l_ab': 0.1}),
        ({'solver_node': SEM, 'sim_node': RATE}, {'l_ab': 0.1}),
        ({'solver_node': RATE, 'recorder_node': RATE}, {}),
    ],
)
def test_the_robot_is_that_of_the_solver_or_of_another_node(
    content: dict[str, Any], expected: dict[str, Any]
) -> None:
    assert solver_parameters(content) == expected


def test_two_nodes_with_different_robots_are_refused() -> None:
    content = {'a_node': SEM, 'b_node': {'ros__parameters': {'l_ab': 0.2}}}
    with pytest.raises(ValueError, match='several robots, /a_node, /b_node'):
        solver_parameters(content)
