"""What a node says at its start, and what its help says before it."""

from pathlib import Path
import re

from bags import write_bag
from klann_ros.log.run_parameters import LINKAGE_PARAMETER
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import pytest
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
from ros_world import Process, World

ROOT = Path(__file__).resolve().parents[2]
LINKAGES = ROOT / 'klann_ros' / 'linkages'
# What every node of rclpy has, and what nobody may set.
OF_ALL = {'use_sim_time', 'start_type_description_service', LINKAGE_PARAMETER}
TURNED = 'turned by /crank_angle and /crank_state (joint crank)'


def told(ros: World, process: Process) -> list[str]:
    """Return what a node has said at its start."""
    ros.probe.until(lambda: 'ready' in process.errors)
    ros.probe.spin(0.2)
    return [line.partition(']: ')[2] for line in process.errors.splitlines()]


@pytest.mark.parametrize(
    ('arguments', 'line'),
    [
        ([], f'ready: Klann leg sem104, {TURNED}'),
        (
            ['--params-file', str(ROOT / 'config' / 'patent.yaml')],
            f'ready: Klann leg patent, {TURNED}',
        ),
        (['-p', 'l_ab:=0.121'], f'ready: Klann leg of its own lengths, {TURNED}'),
        (
            ['-p', f'linkage:={LINKAGES / "jansen.yaml"}'],
            f'ready: linkage Jansen leg ({LINKAGES / "jansen.yaml"}), {TURNED}',
        ),
        (
            ['--params-file', str(ROOT / 'config' / 'walker4.yaml')],
            (
                'ready: 4 legs (front_left, front_right, rear_left, rear_right), each a Klann leg '
                f'sem104, {TURNED}'
            ),
        ),
        (
            ['-p', 'legs:=[a, b]', '-p', 'b.l_gh:=0.44', '-p', 'b.crank_joint:=axle'],
            (
                'ready: 2 legs: a a Klann leg sem104, b a Klann leg of its own lengths, turned by '
                '/crank_angle and /crank_state (joints crank, axle)'
            ),
        ),
        (
            ['-r', '__ns:=/left', '-r', 'crank_angle:=motor'],
            'ready: Klann leg sem104, turned by /left/motor and /left/crank_state (joint crank)',
        ),
    ],
)
def test_a_solver_says_in_one_line_what_it_solves_and_what_turns_it(
    ros: World, arguments: list[str], line: str
) -> None:
    solver = ros.start('solver_node', *(['--ros-args', *arguments] if arguments else []))
    assert told(ros, solver) == [line]


@pytest.mark.parametrize(
    ('given', 'line'),
    [
        (
            {'revolutions': 3, 'min_subscribers': 2},
            (
                'ready: constant (6.28319 rad/s), 3 revolutions, 100 messages a second on '
                '/crank_angle, as soon as 2 subscribe'
            ),
        ),
        (
            {'mode': 'sine', 'output': 'crank_state', 'rate': 50.0},
            'ready: sine (0.523599 rad at 0.5 Hz), endless, 50 messages a second on /crank_state',
        ),
    ],
)
def test_a_crank_says_in_one_line_what_it_will_do(
    ros: World, given: dict[str, object], line: str
) -> None:
    assert told(ros, ros.start('crank_node', **given)) == [line]


def test_a_player_says_in_one_line_what_it_plays(ros: World, tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag.mcap')
    arguments = ['--start-offset', '0.5', '--loop', '--start-paused', '--topics', 'number']
    player = ros.start('player_node', str(bag), *arguments, rate=2)
    line = f'ready: {bag}, 1 topic, 0.990 s at rate 2, from 0.5 s, again and again, paused'
    assert line in told(ros, player)


def test_a_number_given_as_an_integer_is_held_as_its_default_is(ros: World) -> None:
    given = {'phase': 3, 'direction': -1}
    ros.start('solver_node', **given)
    request = GetParameters.Request(names=list(given))
    phase, direction = ros.probe.call(GetParameters, 'solver_node/get_parameters', request).values
    assert (phase.type, phase.double_value) == (ParameterType.PARAMETER_DOUBLE, 3.0)
    assert (direction.type, direction.integer_value) == (ParameterType.PARAMETER_INTEGER, -1)
    described = DescribeParameters.Request(names=list(given))
    service = 'solver_node/describe_parameters'
    for descriptor in ros.probe.call(DescribeParameters, service, described).descriptors:
        assert descriptor.read_only
        assert descriptor.description


def test_what_legs_weigh_can_be_asked_for_where_it_is_given(ros: World) -> None:
    given = {'legs': '[one]', 'bar_density': 1, 'one.foot_mass': 0.2}
    ros.start('solver_node', **given)
    names = ['bar_density', 'foot_mass', 'one.foot_mass']
    service = 'solver_node/list_parameters'
    listed = ros.probe.call(ListParameters, service, ListParameters.Request()).result.names
    assert [name in listed for name in names] == [True, False, True]
    request = GetParameters.Request(names=[names[0], names[2]])
    density, mass = ros.probe.call(GetParameters, 'solver_node/get_parameters', request).values
    assert (density.integer_value, mass.double_value) == (1, 0.2)


def test_a_managed_solver_tells_each_transition(ros: World) -> None:
    solver = ros.start('solver_node', '--lifecycle')
    names = ('CONFIGURE', 'ACTIVATE', 'DEACTIVATE', 'CLEANUP', 'UNCONFIGURED_SHUTDOWN')
    for name in names:
        number = getattr(Transition, f'TRANSITION_{name}')
        request = ChangeState.Request(transition=Transition(id=number))
        assert ros.probe.call(ChangeState, 'solver_node/change_state', request).success
    assert told(ros, solver) == [
        f'ready, unconfigured: Klann leg sem104, {TURNED}, while it is active',
        'configured',
        'activated: it answers',
        'deactivated: it does not listen',
        'cleaned up: unconfigured',
        'shut down: it answers no more',
    ]


@pytest.mark.parametrize(
    ('name', 'given'),
    [
        ('solver_node', {}),
        ('solver_node', {'legs': '[LEG]'}),
        ('crank_node', {}),
        ('recorder_node', {}),
    ],
)
def test_the_help_has_every_parameter(ros: World, name: str, given: dict[str, object]) -> None:
    helped = ros.start(name, '--help')
    ros.start(name, **given)
    service = f'{name}/list_parameters'
    names = set(ros.probe.call(ListParameters, service, ListParameters.Request()).result.names)
    plain = {n for n in names if not n.startswith('qos_overrides.')} - OF_ALL
    assert helped.wait() == 0
    assert len(plain) > 5
    assert plain <= set(re.findall(r'[\w.]+', helped.output))
