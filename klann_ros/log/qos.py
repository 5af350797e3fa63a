"""
Quality of service profiles as rosbag2 writes them into a log.

The text is a YAML sequence of one profile per publisher. Policies are words since metadata version
9 (Jazzy), and numbers of rmw before; both are read, words are written. An infinite duration is
9223372036 s and 854775807 ns, the largest signed 64 bit number of ns. A malformed text raises a
MalformedQosError; rosbag2 cannot open a file with one.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any

from klann_ros.sanitize import yaml_text
from klann_ros.sanitize.text import printable

from .errors import MalformedQosError

INFINITE = 2**63 - 1
"""Infinite duration [ns]."""

MAX_LATCHED = 2000
"""Latched messages that a late subscriber gets at most."""

MAX_QOS_TEXT = 2**18
"""Maximum length of a text, enough for 800 publishers [characters]."""

MAX_QOS_TOTAL, MAX_QOS_DISTINCT = 2**22, 2**20
"""Maximum length of all texts of a log, and of its distinct ones [characters]."""

_CACHE_SIZE = 64
_NS = 10**9

# Each policy's words, in the order of its numbers in rmw.
POLICIES = {
    'history': ('system_default', 'keep_last', 'keep_all', 'unknown'),
    'reliability': ('system_default', 'reliable', 'best_effort', 'unknown', 'best_available'),
    'durability': ('system_default', 'transient_local', 'volatile', 'unknown', 'best_available'),
    'liveliness': (
        'system_default', 'automatic', 'manual_by_node', 'manual_by_topic', 'unknown',
        'best_available',
    ),
}  # fmt: skip

_DURATIONS = ('deadline', 'lifespan', 'liveliness_lease_duration')
# Infinite durations of middlewares of Foxy (sec, nsec).
_OLD_INFINITE = {(0x7FFFFFFF, 0xFFFFFFFF), (0x7FFFFFFF, 0x7FFFFFFF)}


@dataclass(frozen=True)
class Qos:
    """One profile; policies are rosbag2's words, durations are in [ns] or INFINITE."""

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
    data: dict[str, object] = asdict(profile)
    for key, words in POLICIES.items():
        if data[key] not in words:
            raise MalformedQosError(f'{key} is {_quoted(data[key])}, not one of {words}')
    if profile.depth < 0:
        raise MalformedQosError(f'depth is {profile.depth}, not at least 0')
    for key in _DURATIONS:
        duration = getattr(profile, key)
        if not 0 <= duration <= INFINITE:
            raise MalformedQosError(f'{key} is {duration} ns, not within 0 and {INFINITE} ns')
        data[key] = {'sec': duration // _NS, 'nsec': duration % _NS}
    return data


def qos_to_yaml(profiles: Iterable[Qos]) -> str:
    """Return the text of ``offered_qos_profiles``; '' for no profile."""
    data = [qos_to_data(profile) for profile in profiles]
    return yaml_text.dump(data) if data else ''


def qos_from_yaml(text: str) -> list[Qos]:
    """
    Return the profiles in the text of ``offered_qos_profiles``; none for '' or a null.

    A MalformedQosError if it is no sequence of mappings with all nine keys, or too long.
    """
    return list(_read(text)[0])


class QosTexts:
    """
    Parses the texts of one log's channels, each once, up to a total length.

    Parsing costs a thousand times as much as unpacking: a file of kilobytes could take hours.
    """

    def __init__(self) -> None:
        # Characters that all further texts, and the distinct ones, may have.
        self._left = MAX_QOS_TOTAL
        self._distinct = MAX_QOS_DISTINCT
        self._parsed: dict[str, list[Qos] | MalformedQosError] = {}

    def profiles(self, text: str) -> list[Qos]:
        """Return the profiles in a text; a MalformedQosError if all texts are too long."""
        if len(text) > self._left:
            raise MalformedQosError(
                f'the profiles of all topics have more than {MAX_QOS_TOTAL} characters'
            )
        if text not in self._parsed:
            self._parsed[text] = self._parse(text)
        profiles = self._parsed[text]
        if isinstance(profiles, MalformedQosError):
            raise profiles.with_traceback(None)
        self._left -= len(text)
        return profiles

    def _parse(self, text: str) -> list[Qos] | MalformedQosError:
        # A longer text is refused without parsing.
        size = len(text) if len(text) <= MAX_QOS_TEXT else 0
        if size > self._distinct:
            return MalformedQosError(
                f'the profiles that differ have more than {MAX_QOS_DISTINCT} characters'
            )
        self._distinct -= size
        try:
            return qos_from_yaml(text)
        except MalformedQosError as error:
            return error


def latched_count(profiles: Iterable[Qos]) -> int:
    """
    Return the number of messages that the publishers of a topic repeat to late subscribers.

    An unknown depth counts as 1: discovery does not report it.
    """
    counts = (
        MAX_LATCHED if profile.history == 'keep_all' else max(1, profile.depth)
        for profile in profiles
        if profile.durability == 'transient_local'
    )
    return min(sum(counts), MAX_LATCHED)


def qos_for_writing(text: str) -> str:
    """Return a recorded text as a new file may hold it: unchanged, but numbers become words."""
    profiles, numbered = _read(text)
    return qos_to_yaml(profiles) if numbered else text


@lru_cache(maxsize=_CACHE_SIZE)
def _read(text: str) -> tuple[tuple[Qos, ...], bool]:
    """Return the profiles in a text, and whether policies are numbers."""
    if len(text) > MAX_QOS_TEXT:
        raise MalformedQosError(f'it has {len(text)} characters, more than {MAX_QOS_TEXT}')
    try:
        data = yaml_text.load(text)
    except ValueError as error:
        raise MalformedQosError(str(error)) from None
    if data is None:
        return (), False
    if not isinstance(data, list):
        raise MalformedQosError(f'a {type(data).__name__}, not a sequence of profiles')
    profiles = tuple(map(_profile, data))
    return profiles, any(isinstance(profile[key], int) for profile in data for key in POLICIES)


def _profile(mapping: object) -> Qos:
    if not isinstance(mapping, dict):
        raise MalformedQosError(f'a profile is {_quoted(mapping)}, not a mapping')
    try:
        settings: dict[str, Any] = {'depth': _count(mapping, 'depth')}
        for key, words in POLICIES.items():
            settings[key] = _word(words, mapping[key])
        for key in _DURATIONS:
            settings[key] = _duration(mapping, key)
        avoids_conventions = bool(mapping['avoid_ros_namespace_conventions'])
    except KeyError as error:
        raise MalformedQosError(f'{error.args[0]} is missing') from None
    return Qos(**settings, avoid_ros_namespace_conventions=avoids_conventions)


def _quoted(setting: object) -> str:
    return printable(repr(setting))


def _word(words: Sequence[str], policy: Any) -> str:
    """Return a policy's word; 'unknown' for any other, as in rmw."""
    if isinstance(policy, int):
        return words[policy] if 0 <= policy < len(words) else 'unknown'
    return policy if policy in words else 'unknown'


def _count(mapping: Mapping[str, Any], key: str) -> int:
    count = mapping[key]
    if not isinstance(count, int) or count < 0:
        raise MalformedQosError(f'{key} is {_quoted(count)}, not a number from 0')
    return count


def _duration(mapping: Mapping[str, Any], key: str) -> int:
    time = mapping[key]
    if not isinstance(time, dict):
        raise MalformedQosError(f'{key} is {_quoted(time)}, not sec and nsec')
    sec = _count(time, 'sec')
    nsec = _count(time, 'nsec')
    return INFINITE if (sec, nsec) in _OLD_INFINITE else min(sec * _NS + nsec, INFINITE)
