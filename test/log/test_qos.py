"""Quality of service: text and data say the same, and malformed text is refused."""

from contextlib import suppress

from hypothesis import given, strategies as st
from klann_ros.log.errors import MalformedQosError
from klann_ros.log.qos import INFINITE, POLICIES, Qos, qos_for_writing, qos_from_yaml, qos_to_yaml
import pytest
from rosbags.rosbag2.metadata import parse_qos
import yaml

durations = st.integers(0, INFINITE)
profiles = st.builds(
    Qos,
    **{key: st.sampled_from(words) for key, words in POLICIES.items()},
    depth=st.integers(0, 2**31),
    deadline=durations,
    lifespan=durations,
    liveliness_lease_duration=durations,
    avoid_ros_namespace_conventions=st.booleans(),
)

NUMBERED = """\
- history: 1
  depth: 5
  reliability: 2
  durability: 1
  deadline: {sec: 2147483647, nsec: 4294967295}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 1, nsec: 500}
  avoid_ros_namespace_conventions: true
"""


@given(st.lists(profiles, max_size=4))
def test_profiles_read_back_are_equal(offered) -> None:
    assert qos_from_yaml(qos_to_yaml(offered)) == offered


@given(st.lists(profiles, min_size=1, max_size=3))
def test_rosbags_reads_the_same_words(offered) -> None:
    for ours, theirs in zip(offered, parse_qos(qos_to_yaml(offered)), strict=True):
        assert theirs.history.name.lower() == ours.history
        assert theirs.reliability.name.lower() == ours.reliability
        assert theirs.durability.name.lower() == ours.durability
        assert theirs.liveliness.name.lower() == ours.liveliness
        assert theirs.deadline.sec * 10**9 + theirs.deadline.nsec == ours.deadline


def test_the_text_is_as_rosbag2_writes_it() -> None:
    text = qos_to_yaml([Qos()])
    (item,) = yaml.safe_load(text)
    keys = 'history depth reliability durability deadline lifespan liveliness'
    keys += ' liveliness_lease_duration avoid_ros_namespace_conventions'
    assert list(item) == keys.split()
    assert item['deadline'] == {'sec': 9223372036, 'nsec': 854775807}


def test_numbers_and_old_infinities_are_read() -> None:
    assert qos_from_yaml(NUMBERED) == [
        Qos('keep_last', 5, 'best_effort', 'transient_local', INFINITE, INFINITE,
            'automatic', 1_000_000_500, True)
    ]  # fmt: skip


def test_words_stay_as_they_are_in_a_new_file() -> None:
    text = qos_to_yaml([Qos()]) + '\n'
    assert qos_for_writing(text) == text


def test_no_profile_is_an_empty_list_and_an_empty_text() -> None:
    assert [qos_from_yaml(text) for text in ('', '~', '[]')] == [[], [], []]
    assert qos_to_yaml([]) == ''


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('history: keep_last', 'a dict, not a sequence'),
        ('- 1', 'not a mapping'),
        ('- history: keep_last', 'depth is missing'),
        (NUMBERED.replace('depth: 5', 'depth: many'), "depth is 'many'"),
        (NUMBERED.replace('{sec: 1, nsec: 500}', '1'), 'not sec and nsec'),
        ('[' * 200, 'not YAML'),
        ('- !!timestamp x', 'not YAML'),
        ('\x00', 'not YAML'),
    ],
)
def test_malformed_text_is_an_error_of_one_line(text, reason) -> None:
    with pytest.raises(MalformedQosError, match=reason) as caught:
        qos_from_yaml(text)
    assert '\n' not in str(caught.value)


@given(st.text())
def test_any_text_is_read_or_is_a_malformed_qos_error(text) -> None:
    with suppress(MalformedQosError):
        assert isinstance(qos_from_yaml(text), list)


@pytest.mark.parametrize('profile', [Qos(history='some'), Qos(depth=-1), Qos(deadline=-1)])
def test_a_profile_that_rosbag2_could_not_read_is_not_written(profile) -> None:
    with pytest.raises(MalformedQosError):
        qos_to_yaml([profile])
