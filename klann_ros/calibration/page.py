"""A calibration as one HTML page that opens offline, without scripts."""

from collections.abc import Iterator, Sequence
from string import Template

from klann_ros.datasheet.chart import Chart, ChartLine, grid
from klann_ros.datasheet.page import PAGE_PARTS
from klann_ros.kinematics import Linkage, linkage_poses
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray, IndexArray
from klann_ros.sanitize.text import printable
from klann_ros.web.markup import element, joined, Markup, scrolling_table
from klann_ros.web.parts import Parts
import numpy as np

from . import report
from .fit import Calibration, SeriesFit
from .model import MeasurementModel, PHASE
from .observability import Suggestion

PARTS = Parts(styles=PAGE_PARTS.styles, scripts=())
PAGE = Template("""\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
$policy
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
$title
$styles
</head>
<body>
<main>
$content
</main>
</body>
</html>
""")
# Bins of the crank angle in the charts of residuals.
BINS = 72
# Size of the drawing, its margin, and of the largest drawn correction [px].
WIDTH, MARGIN, LARGEST = 640.0, 40.0, 40.0
# Drawn radius of an ellipse of 95 %, as a factor of a standard deviation in two dimensions.
ELLIPSE_95 = 2.4477
ELLIPSE_POINTS = 48


def page(calibration: Calibration, further: Sequence[Suggestion], run: str, built: str) -> str:
    """Return the page."""
    name = calibration.drawn.name or 'leg'
    header = element(
        'header',
        element('div', element('h1', f'Calibration of {name}'), element('p', run, class_='path')),
    )
    rows = [
        (n, drawn, built, error, unit)
        for n, drawn, built, error, unit in report.table(calibration)
    ]
    heads = ('Parameter', 'Drawn', 'Built', 'Standard error', 'Unit')
    sections = [
        header,
        _verdict(calibration, further),
        element(
            'section',
            element('h2', 'Dimensions'),
            element(
                'div',
                _drawing(calibration),
                scrolling_table('Dimensions', heads, rows),
                class_='stage',
            ),
        ),
        element(
            'section',
            element('h2', 'Residuals'),
            grid(list(_charts(calibration))),
            *map(_series, calibration.series),
        ),
        element('section', element('h2', 'Correlation'), _correlation(calibration)),
        element('section', element('h2', 'Leg file'), element('pre', built)),
    ]
    return PAGE.substitute(
        title=element('title', f'Calibration of {printable(name)}'),
        policy=PARTS.policy(),
        styles=PARTS.style_elements(),
        content=joined(sections),
    )


def _verdict(calibration: Calibration, further: Sequence[Suggestion]) -> Markup:
    model = calibration.model
    items = [
        element('li', f'Not told apart: {combination.text(model)}')
        for combination in calibration.observability.combinations
    ]
    items += [element('li', line.strip()) for line in report.suggestion_lines(further)]
    listed = element('ul', *items) if items else Markup()
    return element(
        'section',
        element('h2', 'Observability'),
        element('p', report.verdict(calibration)),
        listed,
    )


def _series(fit: SeriesFit) -> Markup:
    return element('p', report.series_line(fit), class_='quiet')


def _charts(calibration: Calibration) -> Iterator[Chart]:
    """Yield the residuals of each series over the crank angle, as drawn and as built."""
    edges = np.linspace(0.0, TURN, BINS + 1)
    for fit in calibration.series:
        factor, unit = report.SCALES['rad' if fit.series.kind == 'angle' else 'm']
        alphas = calibration.model.crank_angles(fit.series, calibration.values) % TURN
        own = (np.digitize(alphas, edges) - 1).astype(np.intp)
        lines = [
            ChartLine(name, factor * _rms_by_bin(errors, fit, own), number, is_dashed=number == 0)
            for number, (name, errors) in enumerate(
                (('as drawn', fit.before), ('as built', fit.after))
            )
        ]
        text = 'Root mean square of the residuals at each crank angle, without rejected samples.'
        middle = (edges[:-1] + edges[1:]) / 2.0
        yield Chart(f'Residuals of {fit.series.title}', unit, middle, lines, text, moves=False)


def _rms_by_bin(errors: FloatArray, fit: SeriesFit, bins: IndexArray) -> FloatArray:
    good = fit.inliers & np.isfinite(errors).all(axis=1)
    own = bins[good]
    squares = np.bincount(own, (errors[good] ** 2).mean(axis=1), BINS)
    with np.errstate(invalid='ignore', divide='ignore'):
        found: FloatArray = np.sqrt(squares / np.bincount(own, minlength=BINS))
    return found


def _correlation(calibration: Calibration) -> Markup:
    names = calibration.model.names
    rows = [
        (name, *(f'{value:.2f}' if np.isfinite(value) else '' for value in row))
        for name, row in zip(names, calibration.correlation.tolist(), strict=True)
    ]
    return scrolling_table('Correlation', ('', *names), rows)


# The drawing.


def _drawing(calibration: Calibration) -> Markup:
    """Return the leg as drawn, its corrections enlarged, and the ellipse of each point's error."""
    drawn, built = calibration.drawn, calibration.linkage
    alpha = _reachable(drawn, built)
    one, other = (linkage_poses(each, [alpha], points=True).points for each in (drawn, built))
    if one is None or other is None:
        raise AssertionError('points were requested')
    points, moves = one[0], other[0] - one[0]
    covariances = _point_covariances(calibration, alpha)
    spread = max(float(np.abs(moves).max()), 3.0 * float(np.sqrt(np.abs(covariances).max())), 1e-9)
    low, high = points.min(axis=0), points.max(axis=0)
    scale = (WIDTH - 2.0 * MARGIN) / max(float((high - low)[0]), 1e-9)
    enlarged = max(1.0, LARGEST / (scale * spread))
    height = scale * float((high - low)[1]) + 2.0 * MARGIN

    def at(place: FloatArray) -> str:
        x, y = scale * (place - low)
        return f'{MARGIN + x:.1f} {height - MARGIN - y:.1f}'

    structure = drawn.structure
    names = structure.points
    bars = [(names.index(bar.start), names.index(bar.end)) for _, bar in structure.bars]
    moved = points + enlarged * moves
    parts = [
        element(
            'path',
            d=''.join(f'M{at(points[a])}L{at(points[b])}' for a, b in bars),
            class_='grid zero',
        ),
        element(
            'path',
            d=''.join(f'M{at(moved[a])}L{at(moved[b])}' for a, b in bars),
            class_='curve colour-0',
        ),
    ]
    for n, name in enumerate(names):
        ellipse = _ellipse(moved[n], enlarged**2 * covariances[n])
        if ellipse is not None:
            parts.append(
                element('path', d=f'M{"L".join(map(at, ellipse))}Z', class_='curve colour-1')
            )
        x, y = at(moved[n]).split()
        parts.append(element('text', name, x=str(float(x) + 6.0), y=str(float(y) - 6.0)))
    text = (
        f'Thin: as drawn. Thick: as built, corrections enlarged {enlarged:.3g} times, with the '
        f'ellipse of 95 % of each point at the crank angle {np.degrees(alpha):.0f} deg.'
    )
    svg = element(
        'svg', *parts, viewBox=f'0 0 {WIDTH:g} {height:.0f}', role='img', aria_label=text
    )
    return element('figure', svg, element('figcaption', text), class_='card chart')


def _reachable(*linkages: Linkage) -> float:
    """Return a crank angle that all linkages reach [rad]."""
    alphas = np.linspace(0.0, TURN, BINS, endpoint=False)
    good = np.all([linkage_poses(each, alphas).reason == 0 for each in linkages], axis=0)
    return float(alphas[np.argmax(good)])


def _point_covariances(calibration: Calibration, alpha: float) -> FloatArray:
    """Return the covariance of each point at a crank angle of the joint, shape (p, 2, 2) [m^2]."""
    model: MeasurementModel = calibration.model
    poses = linkage_poses(
        calibration.linkage, [alpha], points=True, velocities=True, gradients=True
    )
    if poses.points_gradient is None or poses.points_1 is None:
        raise AssertionError('they were requested')
    jacobian = np.zeros((len(calibration.drawn.structure.points), 2, len(model.names)))
    jacobian[..., : model.count] = poses.points_gradient[0]
    jacobian[..., model.names.index(PHASE)] = poses.points_1[0]
    scaled = jacobian * model.units
    found: FloatArray = scaled @ calibration.covariance @ scaled.transpose(0, 2, 1)
    return np.nan_to_num(found)


def _ellipse(centre: FloatArray, covariance: FloatArray) -> FloatArray | None:
    sizes, axes = np.linalg.eigh(covariance)
    if sizes[-1] <= 0.0:
        return None
    angles = np.linspace(0.0, TURN, ELLIPSE_POINTS, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    found: FloatArray = centre + ELLIPSE_95 * (circle * np.sqrt(np.maximum(sizes, 0.0))) @ axes.T
    return found
