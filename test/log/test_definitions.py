"""Definitions: the exact text of types, from the .msg files that are installed."""

import os
from pathlib import Path
import sys

from klann_ros.log.definitions import default_prefixes, definition
from klann_ros.log.errors import UnknownTypeError
import pytest
from rosbags.typesys import get_types_from_msg

LINE = '=' * 80 + '\n'


def message_file(package, name):
    """Return the text of an installed .msg file, found independently."""
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    paths = [Path(prefix, 'share', package, 'msg', f'{name}.msg') for prefix in prefixes if prefix]
    return next(path.read_bytes().decode() for path in paths if path.exists())


@pytest.mark.parametrize(
    ('package', 'name', 'others'),
    [
        ('std_msgs', 'Float64', ''),
        (
            'geometry_msgs',
            'PointStamped',
            'std_msgs/Header builtin_interfaces/Time geometry_msgs/Point',
        ),
        ('sensor_msgs', 'JointState', 'std_msgs/Header builtin_interfaces/Time'),
    ],
)
def test_a_definition_is_the_files_depth_first(package, name, others) -> None:
    parts = [f'{LINE}MSG: {kind}\n{message_file(*kind.split("/"))}' for kind in others.split()]
    assert definition(f'{package}/msg/{name}') == message_file(package, name) + ''.join(parts)


@pytest.mark.parametrize(
    'name', ['visualization_msgs/msg/MarkerArray', 'diagnostic_msgs/msg/DiagnosticArray']
)
def test_each_dependency_stands_there_once_and_the_text_parses(name) -> None:
    text = definition(name)
    heads = [line for line in text.splitlines() if line.startswith('MSG: ')]
    assert len(heads) == len(set(heads)) > 2
    assert name in get_types_from_msg(text, name)


def test_constants_defaults_bounds_and_comments_are_ignored(tmp_path) -> None:
    folder = tmp_path / 'share' / 'my_msgs' / 'msg'
    folder.mkdir(parents=True)
    (folder / 'Inner.msg').write_text('int8 x')
    (folder / 'Outer.msg').write_text(
        '# Comment other/Type\nuint8 A=1\nstring<=10 name "a#b"\nInner[<=3] many\n'
        'my_msgs/Inner one\n  Inner[2] two # Other'
    )
    text = definition('my_msgs/msg/Outer', [tmp_path])
    assert text.endswith('# Other\n' + LINE + 'MSG: my_msgs/Inner\nint8 x')
    assert text.count('MSG: ') == 1


def test_a_type_that_contains_itself_ends(tmp_path) -> None:
    folder = tmp_path / 'share' / 'my_msgs' / 'msg'
    folder.mkdir(parents=True)
    (folder / 'Loop.msg').write_text('Loop again\n')
    assert definition('my_msgs/msg/Loop', [tmp_path]) == 'Loop again\n'


@pytest.mark.parametrize(
    'field', ['my_msgs/../../x/Y', 'my_msgs/msg/../Y', 'a/b/c/Y', 'my_msgs/', 'x/Y/', 'Y__']
)
def test_a_field_leads_nowhere_but_to_a_message(tmp_path, field) -> None:
    for name in ('my_msgs', 'x'):
        (tmp_path / 'share' / name / 'msg').mkdir(parents=True)
    (tmp_path / 'share' / 'x' / 'Y.msg').write_text('int8 secret\n')
    (tmp_path / 'share' / 'my_msgs' / 'Y.msg').write_text('int8 secret\n')
    (tmp_path / 'share' / 'my_msgs' / 'msg' / 'Outer.msg').write_text(f'{field} y\n')
    with pytest.raises(UnknownTypeError):
        definition('my_msgs/msg/Outer', [tmp_path])


def test_the_first_prefix_wins_and_a_sourced_ros_comes_first(tmp_path, monkeypatch) -> None:
    for place in ('a', 'b'):
        folder = tmp_path / place / 'share' / 'my_msgs' / 'msg'
        folder.mkdir(parents=True)
        (folder / 'Same.msg').write_text(f'int8 {place}\n')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{tmp_path / "a"}{os.pathsep}{tmp_path / "b"}')
    assert [str(prefix) for prefix in default_prefixes()][-1] == sys.prefix
    assert definition('my_msgs/msg/Same') == 'int8 a\n'


@pytest.mark.parametrize(
    'name',
    ['no_such_msgs/msg/Thing', 'std_msgs/msg/NoSuch', 'std_msgs/srv/Empty', '../msg/x', '', 'x'],
)
def test_an_unknown_type_is_reported(name) -> None:
    with pytest.raises(UnknownTypeError) as caught:
        definition(name)
    assert '\n' not in str(caught.value)
