"""A calibration as one HTML page that opens offline, without scripts."""

from collections.abc import Iterator, Sequence
from typing import Any

from klann_ros.datasheet.chart import Chart, ChartLine, grid
from klann_ros.datasheet.page import PAGE_PARTS
from klann_ros.kinematics import linkage_poses
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.web.markup import element, joined, Markup, scrolling_table
from klann_ros.web.parts import Parts
import numpy as np

from . import report
from .fit import Calibration
from .model import PHASE
from .observability import Suggestion

PARTS = Parts(styles=PAGE_PARTS.styles, scripts=())
# Bins of the crank angle in the charts of residuals, close enough to be one line.
BINS = 120
# Width of the drawing, its margin, the largest drawn correction and semi-axis of an ellipse [px].
WIDTH, MARGIN, LARGEST_CORRECTION, LARGEST_ELLIPSE = 640.0, 40.0, 40.0, 20.0
# Drawn radius of an ellipse of 95 %, as a factor of a standard deviation in two dimensions.
ELLIPSE_95, ELLIPSE_POINTS = 2.4477, 48


def page(calibration: Calibration, further: Sequence[Suggestion], run: str, built: str) -> str:
    """Return the page; `built` is the text of the leg file."""
    name = calibration.drawn.name or 'leg'
    lines = [f'Unobservable: {text}' for text in report.combinations(calibration)]
    lines += map(str.strip, report.suggestion_lines(calibration, further))
    heads = ('Parameter', 'Drawn', 'Built', 'Standard error', 'Unit')
    rows = [[text.replace('+-', '±') for text in row] for row in report.table(calibration)]
    numbers = scrolling_table('Dimensions', heads, rows)
    leg_file = joined(part for line in built.splitlines() for part in (line, Markup('\n')))
    scrolls = {'class_': 'card scrolls', 'tabindex': '0', 'role': 'region'}
    residuals = [
        grid([*_charts(calibration)]),
        *(element('p', report.series_line(fit), class_='quiet') for fit in calibration.series),
    ]
    sections = {
        'Observability': [
            element('p', report.verdict(calibration)),
            element('ul', *(element('li', line) for line in lines)),
        ],
        'Dimensions': [element('div', _drawing(calibration), numbers, class_='stage')],
        'Residuals': residuals,
        'Correlation': [_correlation(calibration)],
        'Leg file': [element('div', element('pre', leg_file), **scrolls, aria_label='Leg file')],
    }
    title = element('div', element('h1', f'Calibration of {name}'), element('p', run))
    content = [element('section', element('h2', head), *own) for head, own in sections.items()]
    return PARTS.page(f'Calibration of {name}', element('header', title), *content)


def _charts(calibration: Calibration) -> Iterator[Chart]:
    """Yield the residuals of each series over the crank angle, as drawn and as built."""
    for fit in calibration.series:
        factor, unit = report.SCALES['rad' if fit.series.kind == 'angle' else 'm']
        good = fit.inliers & np.isfinite(fit.before).all(axis=1)
        alphas = calibration.model.crank_angles(fit.series, calibration.values)[good] % TURN
        own = np.minimum((alphas / TURN * BINS).astype(np.intp), BINS - 1)
        count = np.bincount(own, minlength=BINS)
        with np.errstate(invalid='ignore', divide='ignore'):
            drawn, built = (
                factor * np.sqrt(np.bincount(own, (each[good] ** 2).mean(axis=1), BINS) / count)
                for each in (fit.before, fit.after)
            )
        lines = [ChartLine('as drawn', drawn, is_dashed=True), ChartLine('as built', built, 1)]
        text = 'Root mean square of the residuals at each crank angle, without rejected samples.'
        angles = (np.arange(BINS) + 0.5) * TURN / BINS
        yield Chart(f'Residuals of {fit.series.title}', unit, angles, lines, text, moves=False)


def _correlation(calibration: Calibration) -> Markup:
    names = calibration.model.names
    rows = [
        (name, *(f'{value:.2f}' if np.isfinite(value) else '' for value in row))
        for name, row in zip(names, calibration.correlation.tolist(), strict=True)
    ]
    return scrolling_table('Correlation', ('', *names), rows)


def _drawing(calibration: Calibration) -> Markup:
    """Return the leg as drawn, its corrections enlarged, and the ellipse of each point's error."""
    legs, structure = (calibration.drawn, calibration.linkage), calibration.drawn.structure
    alphas = np.linspace(0.0, TURN, BINS, endpoint=False)
    reached = np.all([linkage_poses(leg, alphas).reason == 0 for leg in legs], axis=0)
    alpha = alphas[np.argmax(reached)]
    poses: list[Any] = [
        linkage_poses(leg, [alpha], points=True, velocities=True, gradients=True) for leg in legs
    ]
    points, moves = poses[0].points[0], poses[1].points[0] - poses[0].points[0]
    covariances = _point_covariances(calibration, poses[1])
    error = ELLIPSE_95 * np.sqrt(np.linalg.eigvalsh(covariances).max())
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    scale = (WIDTH - 2.0 * MARGIN) / max(size[0], 1e-9)
    enlarged, ellipses = (
        max(1.0, largest / (scale * max(actual, 1e-9)))
        for largest, actual in (
            (LARGEST_CORRECTION, np.abs(moves).max()),
            (LARGEST_ELLIPSE, error),
        )
    )
    height = scale * size[1] + 2.0 * MARGIN

    def at(place: FloatArray) -> str:
        x, y = scale * (place - low)
        return f'{MARGIN + x:.1f} {height - MARGIN - y:.1f}'

    def bars(places: FloatArray) -> str:
        ends = ((bar.start, bar.end) for _, bar in structure.bars)
        index = structure.points.index
        return ''.join(f'M{at(places[index(a)])}L{at(places[index(b)])}' for a, b in ends)

    moved = points + enlarged * moves
    parts = [
        element('path', d=bars(points), class_='grid zero'),
        element('path', d=bars(moved), class_='curve colour-0'),
    ]
    angles = np.linspace(0.0, TURN, ELLIPSE_POINTS, endpoint=False)
    circle = ELLIPSE_95 * ellipses * np.column_stack([np.cos(angles), np.sin(angles)])
    for name, place, covariance in zip(structure.points, moved, covariances, strict=True):
        sizes, axes = np.linalg.eigh(covariance)
        ellipse = place + (circle * np.sqrt(np.maximum(sizes, 0.0))) @ axes.T
        parts.append(element('path', d=f'M{"L".join(map(at, ellipse))}Z', class_='curve colour-1'))
        x, y = at(place).split()
        parts.append(element('text', name, x=x, y=y, dx='6', dy='-6'))
    text = (
        f'Thin: as drawn. Thick: as built, corrections enlarged {enlarged:.3g} times. Ellipses: '
        f'95 % of the errors of each point, enlarged {ellipses:.3g} times. The crank is at '
        f'{np.degrees(alpha):.0f} deg.'
    )
    view = f'0 0 {WIDTH:g} {height:.0f}'
    svg = element('svg', *parts, viewBox=view, role='img', aria_label=text)
    return element('figure', svg, element('figcaption', text), class_='card chart')


def _point_covariances(calibration: Calibration, poses: Any) -> FloatArray:
    """Return the covariance of each point of a pose, shape (p, 2, 2) [m^2]."""
    model = calibration.model
    jacobian = np.zeros((*poses.points_1.shape[1:], len(model.names)))
    jacobian[..., : model.count] = poses.points_gradient[0]
    jacobian[..., model.names.index(PHASE)] = poses.points_1[0]
    scaled = jacobian * model.units
    found: FloatArray = scaled @ calibration.covariance @ scaled.transpose(0, 2, 1)
    return np.nan_to_num(found)
