"""A type's name is a module only where ament has it, a topic's is refused before ROS gets it."""

from pathlib import Path
import re
import sys

from hypothesis import example, given, strategies as st
from klann_ros.log.definitions import default_prefixes, INDEX
from klann_ros.nodes.endpoints import message_class, name_refusal, UnknownMessageTypeError
import pytest
from std_msgs.msg import Float64
import yaml

NAMES_FILE = Path(__file__).with_name('hostile_names.yaml')
HOSTILE = [*yaml.safe_load(NAMES_FILE.read_text('utf-8'))['types'], 'x' * 100_000 + '/msg/X']
LETTERS = st.text('abcXYZ0_./\n\0\u202e', max_size=6)
NAMES = st.one_of(
    st.text(),
    st.sampled_from(HOSTILE),
    st.builds(
        '{}/{}/{}'.format,
        st.sampled_from(sorted(sys.stdlib_module_names)) | LETTERS,
        st.sampled_from(['msg', 'srv', 'action', '']),
        LETTERS | st.just('Float64'),
    ),
)
# https://docs.ros.org: a slash before each part, which begins with a letter or an underscore.
FULL_NAME = re.compile('(/[A-Za-z_][A-Za-z0-9_]*)+')
# What a good message brings along is there by now.
message_class('std_msgs/msg/Float64')


def installed() -> set[str]:
    return {path.name for prefix in default_prefixes() for path in (prefix / INDEX).glob('*')}


@given(NAMES)
@example('this/msg/X')
@example('turtledemo/msg/Float64')
def test_type_names_import_only_interface_packages(name: str) -> None:
    before = set(sys.modules)
    try:
        kind = message_class(name)
    except UnknownMessageTypeError as error:
        assert str(error).isprintable()
        assert len(str(error)) < 1000
    else:
        assert kind.get_fields_and_field_types() is not None
    new = {module.partition('.')[0] for module in set(sys.modules) - before}
    assert new <= installed()


@pytest.mark.parametrize('name', HOSTILE)
def test_an_invalid_type_is_refused_in_one_short_line(name: str) -> None:
    with pytest.raises(UnknownMessageTypeError) as caught:
        message_class(name)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 1000


def test_every_type_that_is_installed_is_one() -> None:
    assert message_class('std_msgs/msg/Float64') is Float64
    for name in sorted(installed()):
        for prefix in default_prefixes():
            for path in sorted((prefix / 'share' / name / 'msg').glob('*.msg')):
                assert message_class(f'{name}/msg/{path.stem}').__name__ == path.stem


def broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, *, known: bool) -> Path:
    """Make a package of interfaces that is none; return the file that it writes when it is run."""
    marker = tmp_path / 'marker'
    folder = tmp_path / 'lib' / f'half_msgs_{tmp_path.name}' / 'msg'
    folder.mkdir(parents=True)
    (folder / '__init__.py').write_text(
        f'import pathlib\npathlib.Path({str(marker)!r}).touch()\n{text}\n'
    )
    if known:
        index = tmp_path / INDEX
        index.mkdir(parents=True)
        (index / folder.parent.name).touch()
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    monkeypatch.syspath_prepend(tmp_path / 'lib')
    return marker


def test_a_package_outside_the_ament_index_is_not_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    marker = broken(tmp_path, monkeypatch, 'X = 1', known=False)
    with pytest.raises(UnknownMessageTypeError, match="X' is not installed"):
        message_class(f'half_msgs_{tmp_path.name}/msg/X')
    assert not marker.exists()


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('X = 1', 'cannot be used: .* has no attribute'),
        ('from std_srvs.srv import Trigger as X', 'cannot be used: .* might be a service'),
        ('raise KeyError("\\x1b[2J")', r"cannot be used: '\\x1b\[2J'"),
        ('import no_such_thing', 'cannot be used: No module named'),
        ('Y = 1', 'is not installed'),
    ],
)
def test_an_unknown_message_of_an_installed_package_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, reason: str
) -> None:
    marker = broken(tmp_path, monkeypatch, text, known=True)
    with pytest.raises(UnknownMessageTypeError, match=reason):
        message_class(f'half_msgs_{tmp_path.name}/msg/X')
    assert marker.exists()


@given(st.text('/ab1_{}~ \u00e9\0\n', max_size=8) | st.text() | st.from_regex(FULL_NAME))
@example('/' + 'x' * 246)
@example('/' + 'x' * 247)
@example('/a\0')
@example('/\udcff')
def test_just_the_full_names_of_ros_are_taken(name: str) -> None:
    good = FULL_NAME.fullmatch(name) is not None and len(name) <= 247
    reason = name_refusal(name)
    assert (reason == '') == good
    assert reason.isprintable()
    assert len(reason) < 120
