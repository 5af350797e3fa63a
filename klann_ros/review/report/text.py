"""A review as text for a terminal, or for a pipe."""

from collections.abc import Callable, Iterator, Sequence
from math import degrees, isnan

from klann_ros.review.comparing import Comparison
from klann_ros.review.figures import LegFigures
from klann_ros.review.finding import Finding, Severity
from klann_ros.review.reviewed import Review
from klann_ros.review.topic_figures import TopicFigures

# Gives a text a colour (SGR code), or leaves it as it is.
_Paint = Callable[[str, str], str]
# How findings of a severity are called, and their colour in a terminal.
_WORDS = {
    Severity.ERROR: ('ERROR', '1;31'),
    Severity.WARNING: ('WARNING', '1;33'),
    Severity.NOTE: ('NOTE', '36'),
}
# A log may be anybody's: what it says does not move the cursor or change the colours.
_CONTROLS = dict.fromkeys((*range(32), *range(127, 160)), '?')
_GOOD, _HEAD, _FAINT, _DIFFERENT = '1;32', '1', '2', '1;33'


def report(review: Review, *, colour: bool = False) -> str:
    """Return the report of a run."""
    paint = _painted if colour else _plain
    recording = review.recording
    size = sum(size for _, size in recording.files) / 1e6
    files = f'{len(recording.files)} files' if len(recording.files) > 1 else '1 file'
    path = _shown(recording.path)
    lines = [
        paint(f'{path}: {recording.duration:.2f} s, {files}, {size:.1f} MB', _HEAD),
        '',
        *_topics(review.topics, paint),
        *(line for leg in review.legs for line in _leg(leg.recording.title, leg.figures, paint)),
        '',
        *_findings(review, paint),
    ]
    return '\n'.join(lines)


def differences(comparison: Comparison, *, colour: bool = False) -> str:
    """Return in what two runs differ."""
    paint = _painted if colour else _plain
    word = paint('DIFFERS', _DIFFERENT)
    lines = [
        f'{word} {_shown(found.what)}: {_of(found.leg)}{_shown(found.text)}'
        for found in comparison.differences
    ]
    if not lines:
        lines = [paint(comparison.alike, _GOOD)]
    return '\n'.join((*lines, *map(_shown, comparison.remarks)))


def _topics(topics: Sequence[TopicFigures], paint: _Paint) -> Iterator[str]:
    width = max((len(topic.name) for topic in topics), default=5)
    head = 'messages   rate/Hz  longest gap/ms  latency p50/ms   p99/ms  lost'
    yield paint(f'{"topic":<{width}}  {head}', _FAINT)
    for topic in topics:
        lost = '?' if topic.lost is None else str(topic.lost)
        yield (
            f'{_shown(topic.name):<{width}}  {topic.count:>8}  {_number(topic.rate, 8, 1)}  '
            f'{_number(topic.longest_gap * 1e3, 14, 1)}  '
            f'{_number(topic.latency_p50 * 1e3, 14, 2)}  '
            f'{_number(topic.latency_p99 * 1e3, 7, 2)}  {lost:>4}'
        )


def _leg(title: str, figures: LegFigures, paint: _Paint) -> Iterator[str]:
    mu = degrees(figures.worst_transmission_angle)
    yield ''
    if title:
        yield paint(f'leg {_shown(title)}', _HEAD)
    yield f'turns of the crank         {_number(figures.turns, 10, 3)}'
    yield f'stride                     {_number(figures.stride, 10, 4)} m'
    yield f'lift                       {_number(figures.lift, 10, 4)} m'
    yield f'duty factor                {_number(figures.duty_factor, 10, 3)} of the poses'
    yield f'straightness of the stance {_number(figures.straightness, 10, 4)} of its length off'
    yield f'worst transmission angle   {_number(mu, 10, 2)} deg from in line'
    yield f'worst residual             {_power(figures.worst_residual)} m'
    yield f'worst angle, solved again  {_power(figures.worst_angle_error)} rad off'
    yield f'worst foot, by its angles  {_power(figures.worst_foot_error)} m off'


def _findings(review: Review, paint: _Paint) -> Iterator[str]:
    if not any(finding.is_fault for finding in review.findings):
        yield paint(_nothing(review), _GOOD)
    for finding in review.findings:
        yield from _finding(finding, paint)
    for leg in review.legs:
        left_out = len(leg.recording.poses) - len(leg.judged.poses)
        if left_out:
            since = review.recording.since_start(leg.recording.solver.leg_time)
            yield (
                f'{_of(leg.recording.title)}the leg changed during the run; the poses before '
                f'{since:.2f} s were not judged'
            )


def _finding(finding: Finding, paint: _Paint) -> Iterator[str]:
    word, colour = _WORDS[finding.severity]
    when = '' if finding.time is None else f' (first at {finding.time:.3f} s)'
    yield f'{paint(word, colour)} {finding.check}: {_of(finding.leg)}{_shown(finding.text)}{when}'
    yield paint(f'    {finding.meaning}', _FAINT)


def _of(title: str) -> str:
    return f'{_shown(title)}: ' if title else ''


def _shown(text: str) -> str:
    return text.translate(_CONTROLS)


def _nothing(review: Review) -> str:
    """Return what it means that nothing is found: no more than was judged."""
    judged = sum(len(leg.judged.poses) for leg in review.legs if leg.resolved is not None)
    if not judged:
        return 'nothing found, but no pose was judged'
    whole = sum(len(leg.recording.poses) for leg in review.legs)
    which = 'every pose is' if judged == whole else f'each of the {judged} poses is'
    return f'nothing found: {which} the right one for its crank angle'


def _plain(text: str, _: str) -> str:
    return text


def _painted(text: str, code: str) -> str:
    return f'\x1b[{code}m{text}\x1b[0m'


def _number(value: float, width: int, digits: int) -> str:
    text = '-' if isnan(value) else f'{value:.{digits}f}'
    return f'{text if len(text) <= width else format(value, ".1e"):>{width}}'


def _power(value: float) -> str:
    return f'{"-":>10}' if isnan(value) else f'{value:>10.1e}'
