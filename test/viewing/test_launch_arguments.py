"""The arguments of the launch files: declared, described, the same everywhere, as shown."""

import ast
import re

from launch_syntax import calls, constants, declared, FILES, included, keywords, nodes, ROOT
import pytest

COMMAND = re.compile(r'ros2 launch klann_ros (\w+\.launch\.py)((?: [\w-]+:=[\w./]+)*)')
DOCUMENTS = [
    ROOT / 'README.md',
    *(ROOT / 'docs').glob('*.md'),
    *FILES.values(),
    *(ROOT / 'config').glob('*.yaml'),
]
COMMANDS = sorted({found for path in DOCUMENTS for found in COMMAND.findall(path.read_text())})


def known(name: str) -> set[object]:
    """Return the arguments of a launch file and of those that it includes."""
    return set(declared(name)).union(*(known(other) for other in included(name)))


def test_the_manual_shows_commands() -> None:
    assert len(COMMANDS) > 5


@pytest.mark.parametrize(('name', 'arguments'), COMMANDS)
def test_a_command_that_is_shown_names_arguments_that_there_are(name: str, arguments: str) -> None:
    assert {argument.split(':=')[0] for argument in arguments.split()} <= known(name)


@pytest.mark.parametrize('name', FILES)
def test_what_is_true_or_false_takes_nothing_else(name: str) -> None:
    for call in calls(name, 'DeclareLaunchArgument'):
        has_flag = any(
            word.arg == 'choices' and ast.unparse(word.value) == 'FLAG' for word in call.keywords
        )
        assert has_flag == (keywords(call).get('default_value') in {'true', 'false'})
    for assign in nodes(name, ast.Assign):
        if ast.unparse(assign.targets[0]) == 'FLAG':
            assert ast.literal_eval(assign.value) == ['true', 'false', 'True', 'False']


@pytest.mark.parametrize('name', FILES)
def test_every_argument_is_described(name: str) -> None:
    # The checks look at the arguments of those that include them.
    assert bool(declared(name)) == (name != 'checks.py')
    for argument, description in declared(name).items():
        assert isinstance(description, str), argument
        assert description.endswith('.'), argument


@pytest.mark.parametrize('name', FILES)
def test_what_is_used_is_declared(name: str) -> None:
    used = {
        constant
        for call in calls(name, 'LaunchConfiguration', 'value')
        for constant in constants(call.args)
    }
    assert used <= set(declared(name))


def test_what_is_checked_is_declared() -> None:
    checked = {
        constant for call in calls('checks.py', 'asked') for constant in constants(call.args)
    }
    checked |= {
        node.value.value
        for node in nodes('checks.py', ast.Yield)
        if isinstance(node.value, ast.Constant)
    }
    assert checked == {'linkage', 'params_file', 'rviz', 'rviz_config', 'slider'}
    assert checked <= set(declared('leg.launch.py')) | set(declared('description.launch.py'))


@pytest.mark.parametrize('name', FILES)
def test_the_same_argument_means_the_same_everywhere(name: str) -> None:
    for argument, description in declared(name).items():
        others = {declared(other).get(argument, description) for other in FILES}
        # The walker's file and the replay's time and topics are another matter.
        allowed = {'params_file': 2, 'use_sim_time': 2, 'namespace': 2}.get(argument, 1)
        assert len(others) <= allowed, argument
