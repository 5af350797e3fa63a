"""A review as text for a terminal, or for a pipe."""

from collections.abc import Callable, Iterator, Sequence
from math import degrees, isnan

from klann_ros.review.model.compare import Comparison
from klann_ros.review.model.review import Finding, located, Review, ReviewedLeg, Severity
from klann_ros.review.model.topics import LOWER_BOUND_MARK, LOWER_BOUND_REASON, TopicFigures
from klann_ros.review.model.walks import WalkFigures
from klann_ros.sanitize.text import counted, printable, printable_line

# Gives a text a colour (SGR code), or leaves it as it is.
_Paint = Callable[[str, str], str]
# How findings of a severity are called, and their colour in a terminal.
_WORDS = {
    Severity.ERROR: ('ERROR', '1;31'),
    Severity.WARNING: ('WARNING', '1;33'),
    Severity.NOTE: ('NOTE', '36'),
}
# A longer name moves its own line only.
_WIDEST = 60
_GOOD, _HEAD, _FAINT, _DIFFERENT = '1;32', '1', '2', '1;33'


def report(review: Review, *, colour: bool = False) -> str:
    """Return the report of a run."""
    paint: _Paint = _painted if colour else lambda text, _: text
    recording = review.recording
    size = sum(size for _, size in recording.files) / 1e6
    files = counted(len(recording.files), 'file')
    path = printable(recording.path)
    lines = [
        paint(f'{path}: {recording.duration:.2f} s, {files}, {size:.1f} MB', _HEAD),
        '',
        *_topics(review.topics, paint),
        *(line for leg in review.legs for line in _leg(leg, paint)),
        *(line for walk in review.walks for line in _walk(walk, paint)),
        '',
        *_findings(review, paint),
    ]
    return '\n'.join(lines)


def differences(comparison: Comparison, *, colour: bool = False) -> str:
    """Return in what two runs differ."""
    paint: _Paint = _painted if colour else lambda text, _: text
    word = paint('DIFFERS', _DIFFERENT)
    lines = [
        f'{word} {printable(found.what)}: {located(found.leg, found.text)}'
        for found in comparison.differences
    ]
    if not lines:
        lines = [paint(comparison.alike, _GOOD)]
    return '\n'.join((*lines, *map(printable_line, comparison.remarks)))


def _topics(topics: Sequence[TopicFigures], paint: _Paint) -> Iterator[str]:
    names = [printable(topic.name) for topic in topics]
    width = min(max(map(len, names), default=5), _WIDEST)
    head = 'messages   rate/Hz  longest gap/ms  latency p50/ms   p99/ms  lost'
    yield paint(f'{"topic":<{width}}  {head}', _FAINT)
    for name, topic in zip(names, topics, strict=True):
        yield (
            f'{name:<{width}}  {topic.count:>8}  {_number(topic.rate, 8, 1)}  '
            f'{_number(topic.longest_gap * 1e3, 14, 1)}  '
            f'{_number(topic.latency_p50 * 1e3, 14, 2)}  '
            f'{_number(topic.latency_p99 * 1e3, 7, 2)}  {topic.lost_in_words:>4}'
        )
    if any(topic.lost_in_words.endswith(LOWER_BOUND_MARK) for topic in topics):
        yield paint(f'{LOWER_BOUND_MARK}: {LOWER_BOUND_REASON}', _FAINT)


def _leg(leg: ReviewedLeg, paint: _Paint) -> Iterator[str]:
    title, source, figures = leg.recording.title, leg.recording.solver.source, leg.figures
    mu = degrees(figures.worst_transmission_angle)
    yield ''
    if title:
        yield paint(f'leg {printable(title)}', _HEAD)
    yield f'turns of the crank         {_number(figures.turns, 10, 3)}'
    yield f'stride                     {_number(figures.stride, 10, 4)} m'
    yield f'lift                       {_number(figures.lift, 10, 4)} m'
    yield f'duty factor                {_number(figures.duty_factor, 10, 3)} of the poses'
    yield f'straightness of the stance {_number(figures.straightness, 10, 4)} of its length off'
    yield f'worst transmission angle   {_number(mu, 10, 2)} deg from in line'
    yield f'worst residual             {_power(figures.worst_residual)} m'
    yield f'worst angle, solved again  {_power(figures.worst_angle_error)} rad off'
    yield f'worst foot, by its angles  {_power(figures.worst_foot_error)} m off'
    if source:
        yield paint(f'the geometry is that of {source}', _FAINT)


def _walk(walk: WalkFigures, paint: _Paint) -> Iterator[str]:
    rows = (
        ('distance of the body', walk.distance, 1.0, 'm'),
        ('odometry, worst', walk.odometry_error, 1.0, 'm off the ground truth'),
        ('heading, worst', walk.heading_error, degrees(1.0), 'deg off the ground truth'),
        ('crank, worst', walk.crank_lag, degrees(1.0), 'deg off its command'),
        ('phase of two cranks, worst', walk.phase_error, degrees(1.0), 'deg off its command'),
    )
    known = [(what, value * scale, unit) for what, value, scale, unit in rows if not isnan(value)]
    if known:
        yield ''
        yield paint(f'walk {printable(walk.namespace.lstrip("/"))}'.rstrip(), _HEAD)
        yield from (f'{what:<28} {value:>8.3f} {unit}' for what, value, unit in known)


def _findings(review: Review, paint: _Paint) -> Iterator[str]:
    if not any(finding.is_fault for finding in review.findings):
        yield paint(_nothing(review), _GOOD)
    for finding in review.findings:
        yield from _finding(finding, paint)
    for leg in review.legs:
        left_out = len(leg.recording.poses) - len(leg.evaluated.poses)
        if left_out:
            since = review.since_start(leg.recording.solver.leg_time)
            text = f'the leg changed during the run; poses before {since:.2f} s were not judged'
            yield located(leg.recording.title, text)


def _finding(finding: Finding, paint: _Paint) -> Iterator[str]:
    word, colour = _WORDS[finding.severity]
    when = '' if finding.time is None else f' (first at {finding.time:.3f} s)'
    text = f'{finding.check}: {located(finding.leg, finding.text)}'
    yield f'{paint(word, colour)} {text}{when}'
    yield paint(f'    {printable_line(finding.meaning)}', _FAINT)


def _nothing(review: Review) -> str:
    """Return what it means that nothing is found: no more than was judged."""
    evaluated = sum(len(leg.evaluated.poses) for leg in review.legs if leg.errors is not None)
    if not evaluated:
        return 'nothing found, but no pose was judged'
    whole = sum(len(leg.recording.poses) for leg in review.legs)
    which = (
        'every pose is'
        if evaluated == whole
        else f'each of the {counted(evaluated, "judged pose")} is'
    )
    return f'nothing found: {which} the right one for its crank angle'


def _painted(text: str, code: str) -> str:
    return f'\x1b[{code}m{text}\x1b[0m'


def _number(value: float, width: int, digits: int) -> str:
    text = '-' if isnan(value) else f'{value:.{digits}f}'
    return f'{text if len(text) <= width else format(value, ".1e"):>{width}}'


def _power(value: float) -> str:
    return f'{"-":>10}' if isnan(value) else f'{value:>10.1e}'
