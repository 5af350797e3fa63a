"""The launch files, as far as they can be read without the launch package."""

import ast
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

ROOT = Path(__file__).resolve().parents[2]
FILES = {path.name: path for path in sorted((ROOT / 'launch').glob('*.launch.py'))}
FOLDERS = ('config', 'launch', 'rviz', 'urdf')


def calls(name: str, function: str) -> Iterator[ast.Call]:
    """Yield the calls of a function in a launch file."""
    for node in ast.walk(ast.parse(FILES[name].read_text())):
        if isinstance(node, ast.Call) and getattr(node.func, 'id', '') == function:
            yield node


def constants(nodes: list[ast.expr]) -> list[object]:
    return [node.value for node in nodes if isinstance(node, ast.Constant)]


def keywords(call: ast.Call) -> dict[str, object]:
    return {
        word.arg: word.value.value
        for word in call.keywords
        if isinstance(word.value, ast.Constant) and word.arg
    }


def declared(name: str) -> dict[str, object]:
    """Return the arguments of a launch file with their descriptions."""
    return {
        constants(call.args)[0]: keywords(call).get('description')
        for call in calls(name, 'DeclareLaunchArgument')
    }


def test_the_launch_files_are_those_of_the_interface() -> None:
    assert set(FILES) == {
        f'{name}.launch.py' for name in ('leg', 'walker', 'demo', 'replay', 'description')
    }


@pytest.mark.parametrize('name', FILES)
def test_every_argument_is_described(name: str) -> None:
    assert declared(name)
    for argument, description in declared(name).items():
        assert isinstance(description, str), argument
        assert description.endswith('.'), argument


@pytest.mark.parametrize('name', FILES)
def test_what_is_used_is_declared(name: str) -> None:
    used = {
        constant
        for function in ('LaunchConfiguration', 'value')
        for call in calls(name, function)
        for constant in constants(call.args)
    }
    assert used <= set(declared(name))


@pytest.mark.parametrize('name', FILES)
def test_the_same_argument_means_the_same_everywhere(name: str) -> None:
    for argument, description in declared(name).items():
        others = {declared(other).get(argument, description) for other in FILES}
        # The walker's file and the replay's time and topics are another matter.
        allowed = {'params_file': 2, 'use_sim_time': 2, 'namespace': 2}.get(argument, 1)
        assert len(others) <= allowed, argument


@pytest.mark.parametrize('name', FILES)
def test_every_file_that_is_named_is_shipped(name: str) -> None:
    for call in calls(name, 'PathJoinSubstitution'):
        (parts,) = call.args
        assert isinstance(parts, ast.List)
        words = constants(parts.elts)
        if len(words) == 2:
            assert words[0] in FOLDERS
            assert ROOT.joinpath(*words).is_file()


@pytest.mark.parametrize('name', FILES)
def test_every_node_is_of_a_package_that_is_depended_on(name: str) -> None:
    package = ET.parse(ROOT / 'package.xml').getroot()  # noqa: S314  # our own
    depended = {'klann_ros', *(element.text for element in package.iter('exec_depend'))}
    executables = {path.name for path in (ROOT / 'scripts' / 'launchers').iterdir()}
    for call in calls(name, 'Node'):
        node = keywords(call)
        assert node['package'] in depended
        assert node['package'] != 'klann_ros' or node['executable'] in executables
