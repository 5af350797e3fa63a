"""One leg file is one leg: every program reads it by `klann_ros.robot`."""

from collections.abc import Callable
from itertools import permutations
import json
from pathlib import Path
import re
import sys

from domain import own_domain
from klann_ros.datasheet.command import main as describe
from klann_ros.export.command import main as export
from klann_ros.kinematics import KlannGeometry, Linkage, shipped_linkage
from klann_ros.kinematics.linkage.file import SHIPPED
from klann_ros.nodes.parameters import StartError
from klann_ros.nodes.robot_parameters import declared_robot
from klann_ros.nodes.solver.leg_parameters import LegParameters
from klann_ros.review.load.geometry import klann_legs_in_urdf, published_legs
from klann_ros.review.reviewing import review_run
from klann_ros.robot import Robot, robot_of, RobotFileError
from klann_ros.robot.file import solver_parameters
from klann_ros.sanitize.units import UnitWarning
from leg_runs import LegRun
import pytest
from rclpy.context import Context
from rclpy.node import Node

FIRST = 'recorder_node: {ros__parameters: {l_gh: 0.99}}\n'
JANSEN, STRIDER = shipped_linkage('jansen'), shipped_linkage('strider')
WALKER = """\
/**: {ros__parameters: {legs: [left, right], bar_density: 1.0, linkage: strider,
  body_mass: 1.0, body_size: [1, 1, 1], left: {linkage: beside.yaml}, right: {phase: 1.0}}}
"""


MILLIMETRES = """\
{l_ab: 120, l_bc: 350, l_dc: 140, l_cg: 360, l_ef: 270, l_fg: 360, l_gh: 430,
  x_d: 350, y_a: 90, x_e: 290, y_e: 230}
"""


def klann(l_gh: float) -> Linkage:
    return KlannGeometry(l_gh=l_gh).linkage


@pytest.fixture
def node() -> Callable[..., Node]:
    with own_domain() as domain:
        context = Context()
        nodes: list[Node] = []

        def make(file: Path, name: str, namespace: str = '') -> Node:
            if not context.ok():
                context.init(domain_id=domain)
            words = ['--ros-args', '--params-file', str(file)]
            nodes.append(Node(name, context=context, namespace=namespace, cli_args=words))
            return nodes[-1]

        yield make
        for node in nodes:
            node.destroy_node()
        context.try_shutdown()


CASES = {
    'another node first': (
        f'{FIRST}solver_node: {{ros__parameters: {{l_gh: 0.45}}}}',
        {'': klann(0.45)},
    ),
    'a linkage beside the file': (
        'solver_node: {ros__parameters: {linkage: beside.yaml}}',
        {'': JANSEN},
    ),
    'a shipped name': ('/**: {ros__parameters: {linkage: jansen}}', {'': JANSEN}),
    'a wildcard after the node': (
        'solver_node: {ros__parameters: {l_gh: 0.45}}\n/**: {ros__parameters: {l_gh: 0.44}}',
        {'': klann(0.44)},
    ),
    'a walker with two linkages': (WALKER, {'left': JANSEN, 'right': STRIDER}),
}


@pytest.mark.parametrize('case', CASES)
def test_all_programs_read_the_same_legs(
    case: str, node: Callable[..., Node], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, expected = CASES[case]
    file = tmp_path / 'leg.yaml'
    file.write_text(text)
    (tmp_path / 'beside.yaml').write_bytes((SHIPPED / 'jansen.yaml').read_bytes())
    monkeypatch.setattr(sys, 'argv', ['node', '--ros-args', '--params-file', str(file)])

    def legs(robot: Robot) -> dict[str, Linkage]:
        return {leg.name: leg.linkage for leg in robot.legs}

    # describe, export and review take the file; so does the solver.
    assert legs(robot_of(str(file))) == expected
    solved = LegParameters(node(file, 'solver_node')).legs
    assert {leg.name: leg.leg.linkage for leg in solved} == expected
    if '/**' in text:
        assert legs(declared_robot(node(file, 'sim_node'))).keys() == expected.keys()
    sheet = tmp_path / 'sheet.json'
    assert describe([str(file), '--bar-density', '1', '--json', str(sheet)]) == 0
    described = json.loads(sheet.read_text())['legs']
    for leg, linkage in zip(described, expected.values(), strict=True):
        assert [bar['value'] for bar in leg['bars']] == pytest.approx(linkage.numbers)
    assert export([str(file), '--urdf', str(tmp_path / 'leg.urdf')]) == 0
    run = LegRun(count=20).write(tmp_path / 'run')
    (reviewed,) = review_run(run, robot=robot_of(str(file))).legs
    unnamed_leg = expected.get('')
    assert (reviewed.recording.solver.leg and reviewed.recording.solver.leg.linkage) == unnamed_leg


SECTIONS = ('/**', '/*', 'solver_node', '/solver_node', '/**/solver_node', '/*/solver_node')


@pytest.mark.parametrize('namespace', ['', '/left'])
def test_sections_apply_as_ros_applies_them(
    namespace: str, node: Callable[..., Node], tmp_path: Path
) -> None:
    file = tmp_path / 'p.yaml'
    names = [name for name in SECTIONS if not namespace or '*' in name]
    for pair in list(permutations(names, 2))[::3]:
        # A name with dots is a nested one.
        numbers = {'leg': {'l_gh': 0.4, 'l_cg': 0.3}}, {'leg.l_gh': 0.5}
        sections = {}
        for name, number in zip(pair, numbers, strict=True):
            sections[name] = {'ros__parameters': number}
        content = sections | {f'{namespace}/solver_node': {'ros__parameters': {'l_ab': 0.1}}}
        file.write_text(json.dumps(content))
        solver = node(file, 'solver_node', namespace)
        overrides = {name: p.value for name, p in solver._parameter_overrides.items()}
        assert solver_parameters(content) == overrides, pair


def test_several_robots_in_one_file_are_refused_by_their_nodes(tmp_path: Path) -> None:
    file = tmp_path / 'two.yaml'
    template = '{solver_node: {ros__parameters: {l_gh: 0.4%d}}}'
    file.write_text(f'left: {template % 1}\nright: {template % 2}\n')
    with pytest.raises(RobotFileError, match='several robots, /left/solver_node, /right/solver'):
        robot_of(str(file))


@pytest.mark.parametrize(
    ('text', 'warning'),
    [
        (MILLIMETRES, 'l_gh = 430 is read as 430 m: if it is in mm, write 0.43'),
        ('phase: 90\nl_ab: 0.12', 'phase = 90 is read as 90 rad (5156.62 deg): if it is in deg'),
        ('', 'is read as 200 m: if it is in mm, write units: {length: mm, angle: deg}'),
        ('l_ab: 0.12\nmount_xyz: [0, -110, 9]', 'mount_xyz = -110 is read as -110 m: if it is in'),
        (
            'l_ab: 0.12\nbody_mass: 2\nbody_size: [220, 0.1, 0.1]',
            'body_size = 220 is read as 220 m: if it is in mm, write 0.22',
        ),
    ],
)
def test_doubtful_units_are_reported_once_in_one_line(
    text: str, warning: str, tmp_path: Path
) -> None:
    file = tmp_path / 'leg.yaml'
    four_bar = (SHIPPED / 'four_bar.yaml').read_text(encoding='utf-8')
    file.write_text(text or four_bar.replace('length: mm, ', ''))
    with pytest.warns(UnitWarning) as warned:
        robot_of(str(file))
    (message,) = {str(record.message) for record in warned}
    assert warning in message


def test_exported_joints_have_the_names_that_a_solver_publishes(
    node: Callable[..., Node], tmp_path: Path
) -> None:
    file, urdf = tmp_path / 'walker.yaml', tmp_path / 'walker.urdf'
    file.write_text('/**: {ros__parameters: {legs: [a, a_b], joint_separator: _}}')
    solved = LegParameters(node(file, 'solver_node')).legs
    published = [name for leg in solved for name in leg.joint_names]
    assert published[0] == 'a_alpha'
    assert export([str(file), '--urdf', str(urdf)]) == 0
    joints = re.findall(r'<joint name="([^"]*)" type="(\w+)"', urdf.read_text())
    moving = {name for name, kind in joints if kind != 'fixed' and not name.endswith('_back')}
    assert moving == {*published}
    assert not any('/' in name for name, _ in joints)
    # A log without the solver's parameters can be attributed by these names, too.
    assert dict(published_legs(published, solved[0].leg.joint_names)) == {'a': '_', 'a_b': '_'}
    assert klann_legs_in_urdf(urdf.read_text()).keys() == {'a', 'a_b'}


def test_legs_whose_joints_would_have_one_name_are_refused(
    node: Callable[..., Node], tmp_path: Path
) -> None:
    text = (SHIPPED / 'four_bar.yaml').read_text(encoding='utf-8')
    (tmp_path / 'b.yaml').write_text(text.replace('theta2', 'b_theta2'))
    file = tmp_path / 'walker.yaml'
    file.write_text(
        '/**: {ros__parameters: {legs: [a, a_b], joint_separator: _, linkage: four_bar,'
        f' a: {{linkage: {tmp_path}/b.yaml}}}}}}'
    )
    with pytest.raises(StartError, match='legs a and a_b both have a joint a_b_theta2'):
        LegParameters(node(file, 'solver_node'))
    assert export([str(file), '--urdf', str(tmp_path / 'x.urdf')]) == 2
    assert export([str(file), '--urdf', str(tmp_path / 'x.urdf'), '--joint-separator', '/']) == 0
