"""The launch files: loaded by Jazzy's first launch, checked first, their arguments described."""

import ast
from importlib import import_module
from importlib.util import find_spec
import re
import sys
from xml.etree import ElementTree as ET

from launch_api import FLAT, NAMES
from launch_syntax import calls, constants, declared, FILES, included, keywords, nodes, ROOT
import pytest

# Looked for at the start, with its package named; not every user needs it.
OPTIONAL = {'robot_localization', 'mujoco_ros2_control'}
KEYWORDS = {name: words for names in NAMES.values() for name, words in names.items()}

COMMAND = re.compile(r'ros2 launch klann_ros (\w+\.launch\.py)((?: [\w-]+:=[\w./]+)*)')
DOCUMENTS = [
    ROOT / 'README.md',
    *(ROOT / 'docs').glob('*.md'),
    *FILES.values(),
    *(ROOT / 'config').glob('*.yaml'),
]
COMMANDS = sorted({command for path in DOCUMENTS for command in COMMAND.findall(path.read_text())})


def others_programs(name: str) -> set[tuple[object, object]]:
    """Return package and executable of every node that is not ours."""
    named = [keywords(call) for call in calls(name, 'Node')]
    return {(n['package'], n['executable']) for n in named if n['package'] != 'klann_ros'}


def test_the_launch_files_are_those_of_the_manual() -> None:
    page = (ROOT / 'docs' / 'viewing.md').read_text()
    assert set(FILES) == {
        f'{name}.launch.py'
        for name in ('leg', 'walker', 'walk', 'ros2_control', 'demo', 'replay', 'description')
    } | {'checks.py'}
    assert [name for name in FILES if f'| `{name}` |' not in page] == []
    assert len(COMMANDS) > 5


@pytest.mark.parametrize('name', FILES)
def test_every_name_is_one_that_jazzys_first_launch_has(name: str) -> None:
    for imported in nodes(name, ast.ImportFrom):
        if imported.module.split('.')[0] not in {*sys.stdlib_module_names, 'klann_ros'}:
            assert {alias.name for alias in imported.names} <= set(NAMES[imported.module])
    for imported in nodes(name, ast.Import):
        assert {alias.name.split('.')[0] for alias in imported.names} <= sys.stdlib_module_names


@pytest.mark.parametrize('name', FILES)
def test_every_name_of_klann_ros_is_there(name: str) -> None:
    for imported in nodes(name, ast.ImportFrom):
        if imported.module.split('.')[0] == 'klann_ros':
            module = import_module(imported.module)
            for alias in imported.names:
                name = f'{imported.module}.{alias.name}'
                assert hasattr(module, alias.name) or find_spec(name), name


@pytest.mark.parametrize('name', FILES)
def test_every_argument_is_one_that_jazzys_first_launch_takes(name: str) -> None:
    for call in calls(name, *KEYWORDS):
        assert {word.arg for word in call.keywords} <= KEYWORDS[call.func.id], ast.unparse(call)
    # Some take no list within a list.
    for call in calls(name, *FLAT):
        for argument in (*call.args, *(word.value for word in call.keywords)):
            for part in argument.elts if isinstance(argument, ast.List) else []:
                assert isinstance(part, ast.Constant | ast.Name | ast.Call), ast.unparse(call)


@pytest.mark.parametrize('name', FILES)
def test_nothing_to_do_at_an_exit_is_none_and_not_an_empty_list(name: str) -> None:
    # With an empty list launch 3.4 fails when the process ends.
    for call in calls(name, 'Node', 'OnProcessExit'):
        for word in call.keywords:
            if word.arg == 'on_exit':
                lists = [part for part in ast.walk(word.value) if isinstance(part, ast.List)]
                assert all(part.elts for part in lists), ast.unparse(call)


def test_every_launch_file_includes_the_checks() -> None:
    assert {name: included(name) for name in FILES} == {
        'checks.py': set(),
        'demo.launch.py': {'leg.launch.py'},
        'description.launch.py': {'checks.py'},
        'leg.launch.py': {'description.launch.py'},
        'replay.launch.py': {'description.launch.py'},
        'ros2_control.launch.py': {'checks.py'},
        'walk.launch.py': {'leg.launch.py'},
        'walker.launch.py': {'demo.launch.py', 'leg.launch.py'},
    }


def test_every_program_of_others_is_looked_for() -> None:
    looked_for = {
        tuple(constants(node.value.elts)[1:])
        for node in nodes('checks.py', ast.Yield)
        if isinstance(node.value, ast.Tuple)
    }
    started = {program for name in FILES for program in others_programs(name)}
    assert looked_for == started


@pytest.mark.parametrize('name', FILES)
def test_every_node_and_import_is_of_a_package_that_is_depended_on(name: str) -> None:
    package = ET.parse(ROOT / 'package.xml').getroot()  # noqa: S314  # our own
    depended = {'klann_ros', *OPTIONAL, *(element.text for element in package.iter('exec_depend'))}
    executables = {path.name for path in (ROOT / 'scripts' / 'launchers').iterdir()}
    for call in calls(name, 'Node'):
        node = keywords(call)
        assert node['package'] in depended
        assert node['package'] != 'klann_ros' or node['executable'] in executables
    for imported in nodes(name, ast.ImportFrom):
        assert imported.module.split('.')[0] in depended | sys.stdlib_module_names


def known(name: str) -> set[object]:
    """Return the arguments of a launch file and of those that it includes."""
    return set(declared(name)).union(*(known(included_name) for included_name in included(name)))


@pytest.mark.parametrize(('name', 'arguments'), COMMANDS)
def test_shown_commands_have_existing_arguments(name: str, arguments: str) -> None:
    assert {argument.split(':=')[0] for argument in arguments.split()} <= known(name)


@pytest.mark.parametrize('name', FILES)
def test_boolean_arguments_take_only_true_or_false(name: str) -> None:
    for call in calls(name, 'DeclareLaunchArgument'):
        has_flag = any(
            word.arg == 'choices' and ast.unparse(word.value) == 'FLAG' for word in call.keywords
        )
        assert has_flag == (keywords(call).get('default_value') in {'true', 'false'})
    for assign in nodes(name, ast.Assign):
        if ast.unparse(assign.targets[0]) == 'FLAG':
            assert ast.literal_eval(assign.value) == ['true', 'false', 'True', 'False']


@pytest.mark.parametrize('name', FILES)
def test_every_argument_is_declared_and_described(name: str) -> None:
    used = calls(name, 'LaunchConfiguration', 'value')
    assert {argument for call in used for argument in constants(call.args)} <= set(declared(name))
    # The checks look at the arguments of those that include them.
    assert bool(declared(name)) == (name != 'checks.py')
    for argument, description in declared(name).items():
        assert isinstance(description, str), argument
        assert description.endswith('.'), argument


@pytest.mark.parametrize('name', FILES)
def test_the_same_argument_means_the_same_everywhere(name: str) -> None:
    for argument, description in declared(name).items():
        descriptions = {declared(file).get(argument, description) for file in FILES}
        # The walker's file and the replay's time and topics are another matter.
        allowed = {'params_file': 2, 'use_sim_time': 2, 'namespace': 2}.get(argument, 1)
        assert len(descriptions) <= allowed, argument


def test_the_end_of_the_watchdog_ends_its_launch() -> None:
    (watchdog,) = (
        call
        for call in calls('ros2_control.launch.py', 'Node')
        if keywords(call)['executable'] == 'watchdog_node'
    )
    words = {word.arg: ast.unparse(word.value) for word in watchdog.keywords}
    assert words['on_exit'].startswith('Shutdown(')
    # It hears what walker_node sends.
    assert words['remappings'] == '[commands]'
