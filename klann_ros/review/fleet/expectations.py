"""Expectations of a fleet of runs: topics, allowed findings and a baseline."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import inf, isfinite
from pathlib import Path
from typing import Any

from klann_ros.log.errors import LogError
from klann_ros.review.model.compare import compare
from klann_ros.review.model.review import Finding, Review, Severity
from klann_ros.review.model.topics import TopicFigures
from klann_ros.sanitize.text import did_you_mean, printable, printable_line
from klann_ros.sanitize.yaml_text import parse_file

CHECK, BASELINE = 'expected', 'baseline'
_KEYS = ('topics', 'allow', 'baseline')
_TOPIC_KEYS = ('min_rate', 'max_gap', 'max_lost')


class ExpectationsFileError(LogError):
    """A file without valid expectations; the text gives the reason."""


@dataclass(frozen=True)
class ExpectedTopic:
    """
    Expectations of a topic.

    Attributes
    ----------
    min_rate : float
        Least mean rate [Hz].
    max_gap : float
        Longest gap [s].
    max_lost : float
        Largest share of its messages that may be lost, 0 to 1.

    """

    min_rate: float = 0.0
    max_gap: float = inf
    max_lost: float = 1.0


@dataclass(frozen=True)
class Expectations:
    """
    Expectations of every run.

    Attributes
    ----------
    topics : mapping of str to ExpectedTopic
        The required topics.
    allow : frozenset of str
        Checks whose findings do not count.
    baseline : str
        A run from which no other may differ beyond the limits; '' for none.

    """

    topics: Mapping[str, ExpectedTopic] = field(default_factory=dict)
    allow: frozenset[str] = frozenset()
    baseline: str = ''

    def unmet(self, review: Review, baseline: Review | None) -> Iterator[Finding]:
        """Yield the unmet expectations of a reviewed run."""
        known = {topic.name: topic for topic in review.topics}
        for name, expected in self.topics.items():
            for text in _unmet(known.get(name), expected):
                yield Finding(
                    CHECK,
                    Severity.ERROR if name not in known else Severity.WARNING,
                    f'{printable(name)} {text}',
                    'the run does not meet the expectations (--expect)',
                )
        if baseline is not None:
            for difference in compare(baseline, review).differences:
                yield Finding(
                    BASELINE,
                    Severity.WARNING,
                    difference.text,
                    'it differs from the baseline, the first run in the text',
                    leg=difference.leg,
                )


def _unmet(topic: TopicFigures | None, expected: ExpectedTopic) -> Iterator[str]:
    if topic is None:
        yield 'is missing'
        return
    # One message has no rate.
    rate = topic.rate if isfinite(topic.rate) else 0.0
    if rate < expected.min_rate:
        yield f'has {rate:.4g} Hz, at least {expected.min_rate:g} Hz are expected'
    if topic.longest_gap > expected.max_gap:
        yield f'has a gap of {topic.longest_gap:.4g} s, at most {expected.max_gap:g} s are allowed'
    lost = topic.lost or 0
    share = lost / (lost + topic.count) if lost else 0.0
    if share > expected.max_lost:
        yield f'lost {share:.3%} of its messages, at most {expected.max_lost:.3%} are allowed'


def expectations_from_file(path: str) -> Expectations:
    """
    Return the expectations in a YAML file; a relative baseline is looked for beside the file.

    Raises
    ------
    ExpectationsFileError
        The file cannot be read, or holds none.

    """
    try:
        return _expectations(parse_file(path), Path(path).parent)
    except OSError as error:
        raise ExpectationsFileError(f'{path} cannot be read: {error.strerror}') from error
    except ValueError as error:
        what = f'{path} holds no expectations: {printable_line(error)}'
        raise ExpectationsFileError(what) from error


def _expectations(content: Any, folder: Path) -> Expectations:
    _must(isinstance(content, Mapping), f'it must be a mapping of {", ".join(_KEYS)}')
    _only(content, _KEYS)
    topics, allow, baseline = (content.get(key) for key in _KEYS)
    example = '"/joint_states: {min_rate: 190}"'
    _must(isinstance(topics, Mapping | None), f'topics must be a mapping, such as {example}')
    are_names = isinstance(allow, list | None) and all(isinstance(one, str) for one in allow or ())
    _must(are_names, 'allow must be a list of checks, such as [latency, gap]')
    _must(isinstance(baseline, str | None), 'baseline must be the path of a run')
    return Expectations(
        {str(name): _topic(name, of) for name, of in (topics or {}).items()},
        frozenset(allow or ()),
        str(folder / Path(baseline).expanduser()) if baseline else '',
    )


def _topic(name: Any, content: Any) -> ExpectedTopic:
    if content is None:
        return ExpectedTopic()
    _must(isinstance(content, Mapping), f'{name} must be a mapping of {", ".join(_TOPIC_KEYS)}')
    _only(content, _TOPIC_KEYS)
    for key, value in content.items():
        most = 1.0 if key == 'max_lost' else inf
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and 0 <= value <= most):
            what = 'a share, 0 to 1' if key == 'max_lost' else 'a number >= 0'
            raise ValueError(f'{name} {key} = {value!r} is refused: it must be {what}')
    return ExpectedTopic(**{key: float(value) for key, value in content.items()})


def _must(condition: bool, text: str) -> None:
    if not condition:
        raise ValueError(text)


def _only(content: Mapping[Any, Any], keys: tuple[str, ...]) -> None:
    for key in content:
        if key not in keys:
            raise ValueError(f'{key}: there is {", ".join(keys)}{did_you_mean(key, keys)}')
