"""A review as text for a terminal, or for a pipe."""

from collections.abc import Callable, Iterator, Sequence
from math import degrees, isnan

from klann_ros.review.model.compare import Comparison
from klann_ros.review.model.review import Finding, located, Review, ReviewedLeg, Severity
from klann_ros.review.model.topics import DELAY_MEANING, LOWER_BOUND_MEANING, TopicFigures
from klann_ros.review.model.walks import WalkFigures
from klann_ros.sanitize.text import counted, decimal, printable, printable_line

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
_GOOD = '1;32'
_HEAD = '1'
_FAINT = '2'
_DIFFERENT = '1;33'


def report(review: Review, *, colour: bool = False, details: bool = False) -> str:
    """Return the report of a run; `details` are for those who know the method."""
    paint: _Paint = _painted if colour else lambda text, _: text
    recording = review.recording
    size = sum(size for _, size in recording.files) / 1e6
    files = counted(len(recording.files), 'file')
    path = printable(recording.path)
    lines = [paint(f'{path}: {recording.duration:.2f} s, {files}, {size:.1f} MB', _HEAD), '']
    lines += _topics(review.topics, paint, details=details)
    for leg in review.legs:
        lines += _leg(leg, paint)
        if details:
            lines += _accuracy(leg)
    for walk in review.walks:
        lines += _walk(walk, paint)
    lines += ['', *_findings(review, paint)]
    return '\n'.join(lines)


def differences(comparison: Comparison, *, colour: bool = False) -> str:
    """Return in what two runs differ."""
    paint: _Paint = _painted if colour else lambda text, _: text
    lines = []
    for difference in comparison.differences:
        text = located(difference.leg, difference.text)
        lines.append(f'{paint("DIFFERS", _DIFFERENT)} {printable(difference.what)}: {text}')
    if not lines:
        lines = [paint(comparison.alike, _GOOD)]
    return '\n'.join((*lines, *map(printable_line, comparison.remarks)))


def _topics(topics: Sequence[TopicFigures], paint: _Paint, *, details: bool) -> Iterator[str]:
    names = [printable(topic.name) for topic in topics]
    width = min(max(map(len, names), default=5), _WIDEST)
    head = f'{"topic":<{width}}  messages   rate/Hz  longest gap/ms  delay/ms'
    if details:
        head += '  99 %/ms'
    yield paint(f'{head}  lost', _FAINT)
    for name, topic in zip(names, topics, strict=True):
        row = (
            f'{name:<{width}}  {topic.count:>8}  {_number(topic.rate, 8, 1)}  '
            f'{_number(topic.longest_gap * 1e3, 14, 1)}  {_number(topic.latency_p50 * 1e3, 8, 2)}'
        )
        if details:
            row += f'  {_number(topic.latency_p99 * 1e3, 7, 2)}'
        yield f'{row}  {topic.lost_in_words:>4}'
    yield paint(DELAY_MEANING, _FAINT)
    if any(topic.has_unknown_losses for topic in topics):
        yield paint(LOWER_BOUND_MEANING, _FAINT)


def _leg(leg: ReviewedLeg, paint: _Paint) -> Iterator[str]:
    title = leg.recording.title
    source = leg.recording.solver.source
    figures = leg.figures
    mu = degrees(figures.worst_transmission_angle)
    yield ''
    if title:
        yield paint(f'leg {printable(title)}', _HEAD)
    yield f'turns of the crank         {_number(figures.turns, 10, 3)}'
    yield f'stride                     {_number(1e3 * figures.stride, 10, 1)} mm'
    yield f'lift                       {_number(1e3 * figures.lift, 10, 1)} mm'
    yield f'foot on the ground         {_number(1e2 * figures.duty_factor, 10, 1)} % of a turn'
    bend = _number(1e2 * figures.straightness, 10, 2)
    yield f'stance off a straight line {bend} % of its length'
    yield f'smallest transmission angle{_number(mu, 10, 2)} deg; at 0 deg two links are in line'
    if source:
        yield paint(f'the geometry is that of {source}', _FAINT)


def _accuracy(leg: ReviewedLeg) -> Iterator[str]:
    """Yield how exactly the recorded poses fulfil the loop equations."""
    figures = leg.figures
    yield f'worst residual             {_power(1e3 * figures.worst_residual)} mm'
    yield f'worst angle, solved again  {_power(degrees(figures.worst_angle_error))} deg off'
    yield f'worst foot, by its angles  {_power(1e3 * figures.worst_foot_error)} mm off'


def _walk(walk: WalkFigures, paint: _Paint) -> Iterator[str]:
    lines = []
    for name, figure, unit in (
        ('distance of the body', walk.distance, 'm'),
        ('odometry, worst', walk.odometry_error, 'm off the ground truth'),
        ('heading, worst', degrees(walk.heading_error), 'deg off the ground truth'),
        ('crank, worst', degrees(walk.crank_lag), 'deg off its command'),
        ('phase of two cranks, worst', degrees(walk.phase_error), 'deg off its command'),
    ):
        if not isnan(figure):
            lines.append(f'{name:<28} {figure:>8.3f} {unit}')
    if lines:
        yield ''
        yield paint(f'walk {printable(walk.namespace.lstrip("/"))}'.rstrip(), _HEAD)
        yield from lines


def _findings(review: Review, paint: _Paint) -> Iterator[str]:
    if not any(finding.is_fault for finding in review.findings):
        yield paint(_nothing(review), _GOOD)
    for finding in review.findings:
        yield from _finding(finding, paint)
    for leg in review.legs:
        if len(leg.recording.poses) > len(leg.evaluated.poses):
            change = review.since_start(leg.recording.solver.leg_time)
            text = f'the leg changed during the run; poses before {change:.2f} s are not checked'
            yield located(leg.recording.title, text)


def _finding(finding: Finding, paint: _Paint) -> Iterator[str]:
    severity, colour = _WORDS[finding.severity]
    text = f'{finding.check}: {located(finding.leg, finding.text)}'
    if finding.time is not None:
        text += f' (first at {finding.time:.3f} s)'
    yield f'{paint(severity, colour)} {text}'
    yield paint(f'    {printable_line(finding.meaning)}', _FAINT)


def _nothing(review: Review) -> str:
    """Return what it means that nothing is found: no more than was checked."""
    pose_count = sum(len(leg.recording.poses) for leg in review.legs)
    judged_legs = [leg for leg in review.legs if leg.errors is not None]
    judged_count = sum(len(leg.evaluated.poses) for leg in judged_legs)
    if not judged_count:
        return 'nothing found, but no pose could be checked'
    poses = 'every pose'
    if judged_count < pose_count:
        poses = f'each of the {counted(judged_count, "checked pose")}'
    return f'nothing found: {poses} is the right one for its crank angle'


def _painted(text: str, code: str) -> str:
    return f'\x1b[{code}m{text}\x1b[0m'


def _number(value: float, width: int, digits: int) -> str:
    text = '-' if isnan(value) else decimal(value, f'.{digits}f')
    return f'{text if len(text) <= width else format(value, ".1e"):>{width}}'


def _power(value: float) -> str:
    return f'{"-":>10}' if isnan(value) else f'{value:>10.1e}'
