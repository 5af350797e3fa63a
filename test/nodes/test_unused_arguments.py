"""Arguments without effect are reported, with the nearest name that has one."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from klann_ros.nodes.parameters import MAX_NAME_LENGTH
from klann_ros.nodes.process import MAX_LINES, unused_arguments
import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from ros_domain import Domain

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
CASES: dict[str, tuple[str, list[str], str, list[str]]] = {
    'a misspelt name': (
        'solver_node',
        ['-p', 'l_bla:=1.0'],
        '',
        ["parameter l_bla is none of solver_node's; did you mean l_bc?"],
    ),
    'a name like no other': (
        'crank_node',
        ['-p', 'zzzzzz:=1.0'],
        '',
        ["parameter zzzzzz is none of crank_node's; crank_node --help lists them"],
    ),
    'each mistake in a shared file': (
        'solver_node',
        [],
        MISSPELT,
        [
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
        ],
    ),
    'typed for another node': (
        'solver_node',
        ['-p', 'revolutions:=3', '-p', 'solver:l_ab:=0.1'],
        '',
        [
            "parameter revolutions is none of solver_node's; it is crank_node's",
            '-p solver:l_ab:=0.1 is not for /solver_node',
        ],
    ),
    'a file for other nodes': (
        'solver_node',
        [],
        'solver:\n  ros__parameters:\n    l_ab: 0.11\n',
        ['FILE has nothing for /solver_node; it is for solver'],
    ),
    'a file without parameters': (
        'solver_node',
        [],
        'l_ab 0.11\n',
        ['FILE holds no parameters (NODE: ros__parameters: NAME: VALUE)'],
    ),
    **{
        f'a shipped walker for {name}': (
            name,
            ['--params-file', str(CONFIG / 'walker6.yaml')],
            '',
            [],
        )
        for name in ('solver_node', 'crank_node', 'recorder_node')
    },
}


@pytest.fixture
def warnings(create: Callable[..., Any], tmp_path: Path) -> Callable[..., list[str]]:
    """Return a function that creates a node, and returns its warnings."""

    def warn(name: str, arguments: list[str], content: str = '') -> list[str]:
        given, file = [*arguments], tmp_path / 'parameters.yaml'
        if content:
            file.write_text(content, encoding='utf-8')
            given += ['--params-file', str(file)]
        lines = unused_arguments(create(name, *given), name, given)
        return [line.replace(str(file), 'FILE') for line in lines]

    return warn


@pytest.mark.parametrize('case', CASES)
def test_an_argument_without_effect_is_reported(
    warnings: Callable[..., list[str]], case: str
) -> None:
    name, arguments, content, lines = CASES[case]
    assert warnings(name, arguments, content) == lines


def test_a_file_of_nonsense_is_reported_in_a_few_short_lines(
    warnings: Callable[..., list[str]],
) -> None:
    names = [f'{k}x' * 40 for k in range(400)] + ['\N{RIGHT-TO-LEFT OVERRIDE}l_ab', 'y' * 1000]
    content = ''.join(f'    "{name}": 1.0\n' for name in names)
    lines = warnings('solver_node', [], f'/**:\n  ros__parameters:\n{content}')
    assert len(lines) == MAX_LINES + 1
    assert lines[-1] == '... and more of the kind'
    assert all(len(line) < 2 * MAX_NAME_LENGTH for line in lines)


def test_a_process_logs_them_as_warnings(ros: Domain) -> None:
    node = ros.start('solver_node', l_bla=1.0)
    ros.probe.until(lambda: '[WARN]' in node.errors)
    assert "parameter l_bla is none of solver_node's; did you mean l_bc?" in node.errors
    assert node.stop() == 0


def set_parameter(ros: Domain, message: ParameterMessage) -> Any:
    request = SetParameters.Request(parameters=[message])
    return ros.probe.call(SetParameters, 'solver_node/set_parameters', request).results[0]


def test_a_running_node_suggests_the_nearest_parameter(ros: Domain) -> None:
    ros.solve(legs='[left]')
    wrong = Parameter('left.l_bla', value=0.2).to_parameter_msg()
    reason = "parameter left.l_bla is none of solver_node's; did you mean left.l_bc?"
    assert set_parameter(ros, wrong).reason == reason
    for name in ('', 'z' * 10**6, '\x1b[2Jz'):
        answer = set_parameter(ros, Parameter(name, value=0.2).to_parameter_msg())
        assert not answer.successful
        assert answer.reason.isprintable()
        assert len(answer.reason) < 2 * MAX_NAME_LENGTH
    right = Parameter('left.l_ab', value=0.12).to_parameter_msg()
    request = SetParametersAtomically.Request(parameters=[right, wrong])
    service = 'solver_node/set_parameters_atomically'
    assert not ros.probe.call(SetParametersAtomically, service, request).result.successful
    assert set_parameter(ros, right).successful


def test_a_value_of_any_length_is_refused_on_a_short_line(ros: Domain) -> None:
    ros.solve()
    answer = set_parameter(ros, Parameter('assembly', value=[1] * 10**6).to_parameter_msg())
    assert answer.reason.endswith('it must be two signs, each +1 or -1')
    assert len(answer.reason) < 300
    empty = ParameterMessage(name='l_ab', value=ParameterValue())
    assert not set_parameter(ros, empty).successful
