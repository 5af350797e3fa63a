"""A review as plain text."""

from collections.abc import Iterator, Sequence
from math import degrees, isnan

from .figures import LegFigures
from .finding import Finding
from .recording import Recording, TopicFigures


def report(recording: Recording, figures: LegFigures, findings: Sequence[Finding]) -> str:
    """Return the report of a run."""
    parts = [_head(recording), *_topics(recording.topics), '', *_leg(figures), '']
    return '\n'.join([*parts, *recording.remarks, *_findings(recording, findings)])


def _head(recording: Recording) -> str:
    return f'{recording.path}: {recording.duration:.2f} s\n'


def _topics(topics: Sequence[TopicFigures]) -> Iterator[str]:
    width = max((len(topic.name) for topic in topics), default=5)
    yield f'{"topic":<{width}}  messages   rate/Hz  longest gap/ms  latency/ms  lost'
    for topic in topics:
        lost = '?' if topic.lost is None else str(topic.lost)
        yield (
            f'{topic.name:<{width}}  {topic.count:>8}  {_number(topic.rate, 8, 1)}  '
            f'{_number(topic.longest_gap * 1e3, 14, 1)}  {_number(topic.latency * 1e3, 10, 2)}  '
            f'{lost:>4}'
        )


def _leg(figures: LegFigures) -> Iterator[str]:
    mu = degrees(figures.worst_transmission_angle)
    yield f'turns of the crank         {_number(figures.turns, 10, 3)}'
    yield f'stride                     {_number(figures.stride, 10, 4)} m'
    yield f'lift                       {_number(figures.lift, 10, 4)} m'
    yield f'worst transmission angle   {_number(mu, 10, 2)} deg from in line'
    yield f'worst residual             {_power(figures.worst_residual)} m'
    yield f'worst angle, solved again  {_power(figures.worst_angle_error)} rad off'
    yield f'worst foot, solved again   {_power(figures.worst_foot_error)} m off'


def _findings(recording: Recording, findings: Sequence[Finding]) -> Iterator[str]:
    if not findings:
        yield _nothing(recording)
    for finding in findings:
        when = '' if finding.time is None else f' (first at {finding.time:.3f} s)'
        yield f'FOUND {finding.check}: {finding.text}{when}'


def _nothing(recording: Recording) -> str:
    """Return what it means that nothing is found: no more than was judged."""
    judged = len(recording.judged().poses)
    if not judged:
        return 'nothing found, but no pose was judged'
    which = 'every pose is' if judged == len(recording.poses) else f'each of the {judged} poses is'
    return f'nothing found: {which} the right one for its crank angle'


def _number(value: float, width: int, digits: int) -> str:
    text = '-' if isnan(value) else f'{value:.{digits}f}'
    return f'{text if len(text) <= width else format(value, ".1e"):>{width}}'


def _power(value: float) -> str:
    return f'{"-":>10}' if isnan(value) else f'{value:>10.1e}'
