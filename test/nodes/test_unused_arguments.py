"""Arguments without effect are reported, with the nearest name that has one."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from klann_ros.nodes.parameters import MAX_NAME_LENGTH
from klann_ros.nodes.process import MAX_LINES, unused_arguments
import pytest
from ros_domain import Domain
from yaml_tables import read_table

CONFIG = str(Path(__file__).resolve().parents[2] / 'config')
CASES = read_table(Path(__file__).with_name('unused_arguments.yaml'))


@pytest.fixture
def warnings(create: Callable[..., Any], tmp_path: Path) -> Callable[..., list[str]]:
    """Return a function that creates a node, and returns its warnings."""

    def warn(name: str, arguments: list[str], content: str = '') -> list[str]:
        words = [*arguments]
        file = tmp_path / 'parameters.yaml'
        if content:
            file.write_text(content, encoding='utf-8')
            words += ['--params-file', str(file)]
        lines = unused_arguments(create(name, *words), name, words)
        return [line.replace(str(file), 'FILE') for line in lines]

    return warn


@pytest.mark.parametrize('case', CASES)
def test_an_argument_without_effect_is_reported(
    warnings: Callable[..., list[str]], case: str
) -> None:
    row = {'arguments': [], 'file': '', 'lines': [], **CASES[case]}
    arguments = [word.replace('CONFIG', CONFIG) for word in row['arguments']]
    assert warnings(row['node'], arguments, row['file']) == row['lines']


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


def test_a_running_node_suggests_the_nearest_parameter(ros: Domain) -> None:
    ros.solve(legs='[left]')
    # YAML takes 12e-2 for a text.
    right, wrong = {'left.l_ab': '12e-2'}, {'left.l_bla': 0.2}
    reason = "parameter left.l_bla is none of solver_node's; did you mean left.l_bc?"
    assert ros.probe.set_parameters('solver_node', wrong).reason == reason
    for name in ('', 'z' * 10**6, '\x1b[2Jz'):
        answer = ros.probe.set_parameters('solver_node', {name: 0.2})
        assert not answer.successful
        assert answer.reason.isprintable()
        assert len(answer.reason) < 2 * MAX_NAME_LENGTH
    assert not ros.probe.set_parameters('solver_node', right | wrong, atomic=True).successful
    assert ros.probe.set_parameters('solver_node', right).successful


def test_a_value_of_any_length_is_refused_on_a_short_line(ros: Domain) -> None:
    ros.solve()
    answer = ros.probe.set_parameters('solver_node', {'assembly': [1] * 10**5})
    assert answer.reason.endswith('it must be two signs, each +1 or -1')
    assert len(answer.reason) < 300
    assert not ros.probe.set_parameters('solver_node', {'l_ab': None}).successful
