"""A review as plain text."""

from collections.abc import Iterator, Sequence
from math import degrees, isnan

from .checks import Finding
from .figures import LegFigures
from .recording import Recording, TopicFigures


def report(recording: Recording, figures: LegFigures, findings: Sequence[Finding]) -> str:
    """Return the report of a run."""
    parts = [_head(recording), *_topics(recording.topics), '', *_leg(figures), '']
    return '\n'.join([*parts, *_findings(findings)])


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
    yield f'worst residual             {figures.worst_residual:>10.1e} m'
    yield f'worst angle, solved again  {figures.worst_angle_error:>10.1e} rad off'
    yield f'worst foot, solved again   {figures.worst_foot_error:>10.1e} m off'


def _findings(findings: Sequence[Finding]) -> Iterator[str]:
    if not findings:
        yield 'nothing found: every pose is the right one for its crank angle'
    for finding in findings:
        when = '' if finding.time is None else f' (first at {finding.time:.3f} s)'
        yield f'FOUND {finding.check}: {finding.text}{when}'


def _number(value: float, width: int, digits: int) -> str:
    return f'{"-":>{width}}' if isnan(value) else f'{value:>{width}.{digits}f}'
