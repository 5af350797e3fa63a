"""
Quality of service profiles as rosbag2 writes them into a log.

The text is a YAML sequence, one profile a publisher. Since metadata version 9 (Jazzy) the policies
are words, before they were the numbers of rmw; both are read, words are written. An infinite
duration is 9223372036 s and 854775807 ns, which is the largest signed 64 bit number of ns. What is
malformed raises a MalformedQosError; rosbag2 cannot open a file with such a text.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from klann_ros.sanitize import yaml_text
from klann_ros.sanitize.text import printable

from .errors import MalformedQosError

INFINITE = 2**63 - 1
"""A duration without end [ns]."""

MOST_LATCHED = 2000
"""More messages than these count for nobody who comes late."""

LONGEST = 2**18
"""A longer text is refused [characters]; 800 publishers of one topic need so much."""

MOST_TEXTS, MOST_DIFFERENT = 2**22, 2**20
"""So much text is taken for all topics of a log, and so much that differs [characters]."""

# A topic is looked at when it is read, when it is written, and when the run is finished.
_REMEMBERED = 64

_NS = 10**9

# Each policy's words, at the place of its number in rmw.
POLICIES = {
    'history': ('system_default', 'keep_last', 'keep_all', 'unknown'),
    'reliability': ('system_default', 'reliable', 'best_effort', 'unknown', 'best_available'),
    'durability': ('system_default', 'transient_local', 'volatile', 'unknown', 'best_available'),
    'liveliness': (
        'system_default', 'automatic', 'manual_by_node', 'manual_by_topic', 'unknown',
        'best_available',
    ),
}  # fmt: skip

# What middlewares of Foxy called infinite (sec, nsec).
_OLD_INFINITE = {(0x7FFFFFFF, 0xFFFFFFFF), (0x7FFFFFFF, 0x7FFFFFFF)}


@dataclass(frozen=True)
class Qos:
    """One profile; policies are rosbag2's words, durations are in [ns], INFINITE without end."""

    history: str = 'unknown'
    depth: int = 0
    reliability: str = 'reliable'
    durability: str = 'volatile'
    deadline: int = INFINITE
    lifespan: int = INFINITE
    liveliness: str = 'automatic'
    liveliness_lease_duration: int = INFINITE
    avoid_ros_namespace_conventions: bool = False


def qos_to_data(profile: Qos) -> dict[str, object]:
    """
    Return a profile as rosbag2's mapping of all nine keys, in rosbag2's order.

    A MalformedQosError for a word that is none of rosbag2's, a negative depth or duration.
    """
    for key, words in POLICIES.items():
        word = getattr(profile, key)
        if word not in words:
            raise MalformedQosError(f'{key} is {_shown(word)}, not one of {words}')
    if profile.depth < 0:
        raise MalformedQosError(f'depth is {profile.depth}, not at least 0')
    return {
        'history': profile.history,
        'depth': profile.depth,
        'reliability': profile.reliability,
        'durability': profile.durability,
        'deadline': _time('deadline', profile.deadline),
        'lifespan': _time('lifespan', profile.lifespan),
        'liveliness': profile.liveliness,
        'liveliness_lease_duration': _time(
            'liveliness_lease_duration', profile.liveliness_lease_duration
        ),
        'avoid_ros_namespace_conventions': profile.avoid_ros_namespace_conventions,
    }


def qos_to_yaml(profiles: Iterable[Qos]) -> str:
    """Return the text of ``offered_qos_profiles``; '' for no profile."""
    data = [qos_to_data(profile) for profile in profiles]
    return yaml_text.dump(data) if data else ''


def qos_from_yaml(text: str) -> list[Qos]:
    """
    Return the profiles in the text of ``offered_qos_profiles``; none for '' or a null.

    A MalformedQosError for what is no sequence of mappings with all nine keys, or longer than
    LONGEST.
    """
    return list(_read(text)[0])


class QosTexts:
    """
    Reads the texts of one log's channels, each once, and no more of them than is ever meant.

    To take a text apart costs a thousand times what it costs to unpack it from a chunk, so that a
    file of some kilobytes could ask for hours.
    """

    def __init__(self) -> None:
        self._left, self._different = MOST_TEXTS, MOST_DIFFERENT
        self._known: dict[str, list[Qos] | MalformedQosError] = {}

    def profiles(self, text: str) -> list[Qos]:
        """Return the profiles in a text, unless the log's texts are too long together."""
        if len(text) > self._left:
            raise MalformedQosError(
                f'the profiles of all topics have more than {MOST_TEXTS} characters'
            )
        if text not in self._known:
            self._known[text] = self._first(text)
        found = self._known[text]
        if isinstance(found, MalformedQosError):
            raise found.with_traceback(None)
        self._left -= len(text)
        return found

    def _first(self, text: str) -> list[Qos] | MalformedQosError:
        # What is too long is refused before it is looked at.
        size = len(text) if len(text) <= LONGEST else 0
        if size > self._different:
            return MalformedQosError(
                f'the profiles that differ have more than {MOST_DIFFERENT} characters'
            )
        self._different -= size
        try:
            return qos_from_yaml(text)
        except MalformedQosError as error:
            return error


def latched_count(profiles: Iterable[Qos]) -> int:
    """
    Return how many messages the publishers of a topic keep for those who come late.

    Discovery does not tell a depth, so most logs do not know it; then it counts as 1.
    """
    counts = (
        MOST_LATCHED if profile.history == 'keep_all' else max(1, profile.depth)
        for profile in profiles
        if profile.durability == 'transient_local'
    )
    return min(sum(counts), MOST_LATCHED)


def qos_for_writing(text: str) -> str:
    """Return a recorded text as a new file may hold it: unchanged, but numbers become words."""
    profiles, numbered = _read(text)
    return qos_to_yaml(profiles) if numbered else text


@lru_cache(maxsize=_REMEMBERED)
def _read(text: str) -> tuple[tuple[Qos, ...], bool]:
    """Return the profiles in a text, and whether there are numbers in it for words."""
    if len(text) > LONGEST:
        raise MalformedQosError(f'it has {len(text)} characters, more than {LONGEST}')
    try:
        data = yaml_text.load(text)
    except ValueError as error:
        raise MalformedQosError(str(error)) from None
    if data is None:
        return (), False
    if not isinstance(data, list):
        raise MalformedQosError(f'a {type(data).__name__}, not a sequence of profiles')
    profiles = tuple(map(_profile, data))
    return profiles, any(isinstance(item[key], int) for item in data for key in POLICIES)


def _profile(item: object) -> Qos:
    if not isinstance(item, dict):
        raise MalformedQosError(f'a profile is {_shown(item)}, not a mapping')
    return Qos(
        history=_word(item, 'history'),
        depth=_count(item, 'depth'),
        reliability=_word(item, 'reliability'),
        durability=_word(item, 'durability'),
        deadline=_duration(item, 'deadline'),
        lifespan=_duration(item, 'lifespan'),
        liveliness=_word(item, 'liveliness'),
        liveliness_lease_duration=_duration(item, 'liveliness_lease_duration'),
        avoid_ros_namespace_conventions=bool(_value(item, 'avoid_ros_namespace_conventions')),
    )


def _shown(value: object) -> str:
    return printable(repr(value))


def _value(item: Mapping[str, Any], key: str) -> Any:
    try:
        return item[key]
    except KeyError:
        raise MalformedQosError(f'{key} is missing') from None


def _word(item: Mapping[str, Any], key: str) -> str:
    """Return a policy's word; one that is not known is 'unknown', as rmw has it."""
    value = _value(item, key)
    words = POLICIES[key]
    if isinstance(value, int):
        return words[value] if 0 <= value < len(words) else 'unknown'
    return value if value in words else 'unknown'


def _count(item: Mapping[str, Any], key: str) -> int:
    value = _value(item, key)
    if not isinstance(value, int) or value < 0:
        raise MalformedQosError(f'{key} is {_shown(value)}, not a number from 0')
    return value


def _duration(item: Mapping[str, Any], key: str) -> int:
    value = _value(item, key)
    if not isinstance(value, dict):
        raise MalformedQosError(f'{key} is {_shown(value)}, not sec and nsec')
    sec, nsec = _count(value, 'sec'), _count(value, 'nsec')
    return INFINITE if (sec, nsec) in _OLD_INFINITE else min(sec * _NS + nsec, INFINITE)


def _time(key: str, duration: int) -> dict[str, int]:
    if not 0 <= duration <= INFINITE:
        raise MalformedQosError(f'{key} is {duration} ns, not within 0 and {INFINITE} ns')
    return {'sec': duration // _NS, 'nsec': duration % _NS}
