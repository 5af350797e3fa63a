"""Refused parameters of nodes: one line with the reason and the right value."""

from collections.abc import Callable
from itertools import chain
import os
from pathlib import Path
from typing import Any

from klann_ros.cli import ArgumentParser
from klann_ros.kinematics.linkage.file import SHIPPED
from klann_ros.nodes import process
from klann_ros.nodes.parameters import StartError
import pytest
from ros_domain import Domain
from yaml_tables import read_table

CONFIG = str(Path(__file__).resolve().parents[2] / 'config')
LINKAGES = {
    'name: [': 'holds no linkage: line 1, column 8: expected the node content',
    'name: x': 'holds no linkage: crank, foot are missing',
    (SHIPPED / 'jansen.yaml').read_text(encoding='utf-8').replace('50.0', '5.0'): (
        'it cannot be assembled near its start'
    ),
}


def read(name: str) -> dict[str, Any]:
    """Return the rows of a table, by the names of nodes."""
    rows: dict[str, Any] = read_table(Path(__file__).with_name(name))
    return rows


def refusal(create: Callable[..., Any], name: str, *parameters: str) -> str:
    """Return the one line of a node that refuses its parameters."""
    arguments = chain.from_iterable(('-p', parameter) for parameter in parameters)
    with pytest.raises(StartError) as refused:
        create(name, *arguments)
    text = str(refused.value)
    assert '\n' not in text
    assert len(text) < 500
    return text


@pytest.mark.parametrize(
    ('name', 'parameters', 'reason'),
    [(name, *row) for name, rows in read('refused_parameters.yaml').items() for row in rows],
)
def test_a_refused_parameter_is_one_line_with_the_reason(
    create: Callable[..., Any], name: str, parameters: list[str], reason: str
) -> None:
    assert reason in refusal(create, name, *parameters)


def test_a_value_of_any_length_is_refused_on_a_short_line(
    create: Callable[..., Any], tmp_path: Path
) -> None:
    file = tmp_path / 'crank.yaml'
    file.write_text(f'/**:\n  ros__parameters:\n    mode: {"x" * 10**6}\n', encoding='utf-8')
    with pytest.raises(StartError, match='must be one of constant, sine, sweep') as refused:
        create('crank_node', '--params-file', str(file))
    assert len(str(refused.value)) < 300


@pytest.mark.parametrize('content', LINKAGES)
def test_an_invalid_linkage_file_is_refused(
    create: Callable[..., Any], tmp_path: Path, content: str
) -> None:
    file = tmp_path / 'x.yaml'
    file.write_text(content, encoding='utf-8')
    text = refusal(create, 'solver_node', f'linkage:={file}')
    assert text.startswith(f'{file} ')
    assert LINKAGES[content] in text


KINDS: dict[str, Callable[[Path], object]] = {
    'a named pipe': os.mkfifo,
    'a device': lambda file: file.symlink_to('/dev/zero'),
    'a folder': Path.mkdir,
}


@pytest.mark.parametrize('kind', [*KINDS, 'longer than'])
def test_a_special_file_as_linkage_is_refused(
    create: Callable[..., Any], tmp_path: Path, kind: str
) -> None:
    file = tmp_path / 'x.yaml'
    if kind in KINDS:
        KINDS[kind](file)
    else:
        file.touch()
        os.truncate(file, 2**40)
    text = refusal(create, 'solver_node', f'linkage:={file}')
    assert text.startswith(f'{file} cannot be read: it is {kind}')


def test_a_wrong_path_of_a_shipped_linkage_is_answered_with_its_name(
    create: Callable[..., Any],
) -> None:
    text = refusal(create, 'solver_node', 'linkage:=linkages/jansen.yaml')
    name = text.partition('the shipped one is called ')[2]
    assert create('solver_node', '-p', f'linkage:={name}')


@pytest.mark.parametrize(
    ('name', 'words', 'reason'),
    [(name, *row) for name, rows in read('refused_processes.yaml').items() for row in rows],
)
def test_a_refused_process_ends_with_one_line(
    ros: Domain, name: str, words: str, reason: str
) -> None:
    arguments = words.replace('CONFIG', CONFIG).split()
    node = ros.start(name, *(['--ros-args', *arguments] if arguments else []))
    assert node.wait() == 1
    (line,) = [line for line in node.errors.splitlines() if not line.startswith('[INFO]')]
    assert line.startswith(f'{name}: ')
    assert reason in line
    # An invalid start leaves no run.
    assert not (ros.folder / 'run').exists()


def test_a_parameter_file_that_is_not_there_is_refused(ros: Domain) -> None:
    solver = ros.start('solver_node', '--ros-args', '--params-file', '/not/there.yaml')
    assert solver.wait() == 1
    assert 'Traceback' not in solver.errors
    assert '/not/there.yaml' in solver.errors


@pytest.mark.parametrize('kind', KINDS)
def test_a_special_file_as_parameter_file_is_refused(
    ros: Domain, tmp_path: Path, kind: str
) -> None:
    file = tmp_path / 'x.yaml'
    KINDS[kind](file)
    solver = ros.start('solver_node', '--ros-args', '--params-file', str(file))
    assert solver.wait() == 1
    reason = f'{file} cannot be read: it is {kind}, not a regular file'
    assert solver.errors == f'solver_node: {reason}\n'


def test_a_parameter_file_may_be_a_process_substitution(ros: Domain) -> None:
    read, write = os.pipe()
    os.write(write, b'solver_node: {ros__parameters: {l_ab: -1.0}}')
    os.close(write)
    arguments = ('--ros-args', '--params-file', f'/dev/fd/{read}')
    solver = ros.start_by([], 'solver_node', *arguments, pass_fds=[read])
    os.close(read)
    assert solver.wait() == 1
    assert 'l_ab = -1 m is refused' in solver.errors


@pytest.mark.parametrize(
    ('arguments', 'hint'),
    [
        (['-p', 'l_ab:=0.1'], 'arguments for ROS go behind --ros-args'),
        (['crank_angle:=motor'], 'arguments for ROS go behind --ros-args'),
        (['sem104.yaml'], 'a parameter file is given as --ros-args --params-file FILE'),
    ],
)
def test_arguments_for_ros_in_the_wrong_place_get_a_hint(
    capsys: pytest.CaptureFixture[str], arguments: list[str], hint: str
) -> None:
    with pytest.raises(SystemExit) as end:
        process.arguments(ArgumentParser('solver_node', ''), ['solver_node', *arguments])
    assert end.value.code == 2
    assert capsys.readouterr().err.endswith(f'{hint}\n')
