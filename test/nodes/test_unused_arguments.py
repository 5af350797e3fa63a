"""What is given to a node and is no parameter of it is told, with the nearest name that is."""

from pathlib import Path
from typing import Any

from klann_ros.nodes.parameters import MAX_NAME_LENGTH
from klann_ros.nodes.unused_arguments import MAX_LINES
import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from ros_world import World

CONFIG = Path(__file__).resolve().parents[2] / 'config'
MISSPELT = """
/**:
  ros__parameters:
    l_bla: 0.11
    foot_mass: 1.0
    mode: sine
    legs: [front_left]
    front_left: {phase: 1, direktion: 1, foot_mass: 2.0}
    rear_left: {phase: 1, direction: -1}
    qos_overrides: {/joint_state: {publisher: {depth: 3}}, /crank_angle: {publisher: {depth: 3}}}
"""


def warnings(ros: World, name: str, *arguments: str, file: str = '') -> list[str]:
    """Start a node, and return what it warns of."""
    given = list(arguments)
    if file:
        path = ros.folder / 'parameters.yaml'
        path.write_text(file, encoding='utf-8')
        given += ['--params-file', str(path)]
    node = ros.start(name, *(['--ros-args', *given] if given else []))
    ros.probe.until(lambda: 'ready: ' in node.errors or 'recording to' in node.errors)
    # What is wrong is told before it serves anything, so also before it is stopped.
    assert node.stop() == 0
    lines = node.errors.splitlines()
    return [line.partition(']: ')[2] for line in lines if line.startswith('[WARN]')]


def test_a_misspelt_parameter_is_told_with_the_nearest_name(ros: World) -> None:
    assert warnings(ros, 'solver_node', '-p', 'l_bla:=1.0') == [
        "parameter l_bla is none of solver_node's; did you mean l_bc?"
    ]


def test_what_is_like_nothing_leads_to_the_help(ros: World) -> None:
    assert warnings(ros, 'recorder_node', '-p', 'zzzzzz:=1.0') == [
        "parameter zzzzzz is none of recorder_node's; recorder_node --help lists them"
    ]


def test_each_mistake_in_a_file_is_told_once_and_what_others_need_is_not(ros: World) -> None:
    assert warnings(ros, 'solver_node', file=MISSPELT) == [
        (
            "parameter front_left.direktion is none of solver_node's; "
            'did you mean front_left.direction?'
        ),
        "parameter l_bla is none of solver_node's; did you mean l_bc?",
        (
            "parameter qos_overrides./joint_state.publisher.depth is none of solver_node's; "
            'did you mean qos_overrides./joint_states.publisher.depth?'
        ),
        (
            "rear_left.direction, rear_left.phase: none of solver_node's parameters: "
            'rear_left is not in legs'
        ),
    ]


@pytest.mark.parametrize('name', ['solver_node', 'crank_node', 'recorder_node'])
def test_a_shipped_walker_is_no_mistake_for_any_node(ros: World, name: str) -> None:
    assert warnings(ros, name, '--params-file', str(CONFIG / 'walker6.yaml')) == []


def test_what_is_typed_for_the_wrong_node_is_told(ros: World) -> None:
    assert warnings(ros, 'solver_node', '-p', 'revolutions:=3', '-p', 'solver:l_ab:=0.1') == [
        "parameter revolutions is none of solver_node's; it is crank_node's",
        '-p solver:l_ab:=0.1 is not for /solver_node',
    ]


@pytest.mark.parametrize(
    ('content', 'complaint'),
    [
        (
            'solver:\n  ros__parameters:\n    l_ab: 0.11\n',
            'has nothing for /solver_node; it is for',
        ),
        ('l_ab 0.11\n', 'holds no parameters (NODE: ros__parameters: NAME: VALUE)'),
    ],
)
def test_a_file_without_effect_is_told(ros: World, content: str, complaint: str) -> None:
    (told,) = warnings(ros, 'solver_node', file=content)
    assert complaint in told


def test_a_file_of_nonsense_is_told_in_a_few_short_lines(ros: World) -> None:
    names = [f'{k}x' * 40 for k in range(400)] + ['\N{RIGHT-TO-LEFT OVERRIDE}l_ab', 'y' * 1000]
    lines = ''.join(f'    "{name}": 1.0\n' for name in names)
    told = warnings(ros, 'solver_node', file=f'/**:\n  ros__parameters:\n{lines}')
    assert len(told) == MAX_LINES + 1
    assert told[-1] == '... and more of the kind'
    assert all(len(line) < 2 * MAX_NAME_LENGTH for line in told)


def sets(ros: World, name: str, value: Any) -> Any:
    """Ask a solver to set a parameter; return its answer."""
    parameter = Parameter(name, value=value).to_parameter_msg()
    request = SetParameters.Request(parameters=[parameter])
    return ros.probe.call(SetParameters, 'solver_node/set_parameters', request).results[0]


def test_a_running_node_names_the_nearest_parameter_too(ros: World) -> None:
    solver = ros.start('solver_node', legs='[left]')
    answer = sets(ros, 'left.l_bla', 0.2)
    assert not answer.successful
    assert (
        answer.reason == "parameter left.l_bla is none of solver_node's; did you mean left.l_bc?"
    )
    for name in ('', 'z' * 10**6, '\x1b[2Jz'):
        answer = sets(ros, name, 0.2)
        assert not answer.successful
        assert answer.reason.isprintable()
        assert len(answer.reason) < 2 * MAX_NAME_LENGTH
    both = [Parameter(n, value=0.12).to_parameter_msg() for n in ('left.l_ab', 'left.l_bla')]
    request = SetParametersAtomically.Request(parameters=both)
    service = 'solver_node/set_parameters_atomically'
    assert not ros.probe.call(SetParametersAtomically, service, request).result.successful
    assert sets(ros, 'left.l_ab', 0.121).successful
    assert solver.stop() == 0


def test_a_value_of_any_length_is_refused_on_a_short_line(ros: World) -> None:
    ros.start('solver_node')
    answer = sets(ros, 'assembly', [1] * 10**6)
    assert not answer.successful
    assert answer.reason.endswith('it must be two signs, each +1 or -1')
    assert len(answer.reason) < 300
    empty = ParameterMessage(name='l_ab', value=ParameterValue())
    request = SetParameters.Request(parameters=[empty])
    response = ros.probe.call(SetParameters, 'solver_node/set_parameters', request)
    assert not response.results[0].successful
