"""A type's name is a module only where ament has it, a topic's is refused before ROS gets it."""

from pathlib import Path
import re
import sys

from hypothesis import example, given, strategies as st
from klann_ros.log.definitions import default_prefixes, INDEX
from klann_ros.nodes.endpoints import (
    diagnostic_status,
    INPUT,
    LAST_MESSAGES,
    LAST_PERIOD,
    LAST_TIMEOUT,
    message_class,
    name_refusal,
    OUTPUT,
    publish_last,
    UnknownMessageTypeError,
)
import pytest
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from ros_domain import Domain
from std_msgs.msg import Float64
from yaml_tables import read_table

NAMES_FILE = Path(__file__).with_name('hostile_names.yaml')
HOSTILE = [
    *read_table(NAMES_FILE)['types'],
    'x' * 100_000 + '/msg/X',
]
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
    modules_before = set(sys.modules)
    try:
        kind = message_class(name)
    except UnknownMessageTypeError as error:
        assert str(error).isprintable()
        assert len(str(error)) < 1000
    else:
        assert kind.get_fields_and_field_types() is not None
    new = {module.partition('.')[0] for module in set(sys.modules) - modules_before}
    assert new <= installed()


def test_an_invalid_type_is_refused_in_one_short_line() -> None:
    for name in HOSTILE:
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


@pytest.mark.parametrize(
    ('text', 'is_indexed', 'reason'),
    [
        ('X = 1', False, "X' is not installed"),
        ('X = 1', True, 'cannot be used: .* has no attribute'),
        ('from std_srvs.srv import Trigger as X', True, 'cannot be used: .* might be a service'),
        ('raise KeyError("\\x1b[2J")', True, r"cannot be used: '\\x1b\[2J'"),
        ('import no_such_thing', True, 'cannot be used: No module named'),
        ('Y = 1', True, 'is not installed'),
    ],
)
def test_a_package_of_no_interfaces_is_imported_only_from_the_ament_index(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, is_indexed: bool, reason: str
) -> None:
    marker = tmp_path / 'marker'
    name = f'half_msgs_{tmp_path.name}'
    folder = tmp_path / 'lib' / name / 'msg'
    folder.mkdir(parents=True)
    code = f'import pathlib\npathlib.Path({str(marker)!r}).touch()\n{text}\n'
    (folder / '__init__.py').write_text(code)
    if is_indexed:
        (tmp_path / INDEX).mkdir(parents=True)
        (tmp_path / INDEX / name).touch()
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    monkeypatch.syspath_prepend(tmp_path / 'lib')
    with pytest.raises(UnknownMessageTypeError, match=reason):
        message_class(f'{name}/msg/X')
    assert marker.exists() == is_indexed


@given(st.text('/ab1_{}~ \u00e9\0\n', max_size=8) | st.text() | st.from_regex(FULL_NAME))
@example('/' + 'x' * 246)
@example('/' + 'x' * 247)
@example('/a\0')
@example('/\udcff')
def test_just_the_full_names_of_ros_are_taken(name: str) -> None:
    is_full_name = FULL_NAME.fullmatch(name) is not None and len(name) <= 247
    reason = name_refusal(name)
    assert (reason == '') == is_full_name
    assert reason.isprintable()
    assert len(reason) < 120


def test_diagnostics_contain_no_control_of_a_terminal(ros: Domain) -> None:
    joint = 'left\x1b[31m\ncrank\u202e'
    figures = [(f'{joint} silent', joint)]
    status = diagnostic_status(ros.probe.node, 'walker', b'\0', f'{joint} lags', figures)
    assert status.message == 'left\\x1b[31m crank\\u202e lags'
    (figure,) = status.values
    assert (figure.key + figure.value).isprintable()


class SilentPublisher:
    """A publisher whose subscribers do not acknowledge; `calls` are its messages and waits [s]."""

    def __init__(self, qos_profile: QoSProfile) -> None:
        self.qos_profile = qos_profile
        self.calls: list[str | float] = []

    def publish(self, message: str) -> None:
        """Publish a message."""
        self.calls.append(message)

    def wait_for_all_acked(self, timeout: Duration) -> bool:
        """Return that nothing was acknowledged."""
        self.calls.append(timeout.nanoseconds / 1e9)
        return False


def test_the_last_message_is_repeated_then_its_acknowledgement_awaited() -> None:
    reliable = SilentPublisher(OUTPUT)
    publish_last(reliable, 'stand')  # type: ignore[arg-type]
    *messages, timeout = reliable.calls
    assert messages == ['stand'] * LAST_MESSAGES
    assert isinstance(timeout, float)
    assert 0.0 < timeout <= LAST_TIMEOUT - LAST_MESSAGES * LAST_PERIOD
    best_effort = SilentPublisher(INPUT)
    publish_last(best_effort, 'stand')  # type: ignore[arg-type]
    assert best_effort.calls == ['stand'] * LAST_MESSAGES
