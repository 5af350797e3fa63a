"""A calibration as one HTML page that opens offline, without scripts."""

from collections.abc import Iterator, Sequence
from typing import Any

from klann_ros.datasheet import Chart, ChartLine, grid, PAGE_PARTS
from klann_ros.kinematics import linkage_poses, LinkageLeg, pose_svg
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray, IndexArray
from klann_ros.web import element, Markup, Parts, scrolling_table
import numpy as np

from .fit import Calibration
from .model import PHASE, SCALES
from .observability import Suggestion
from .report import combinations, series_line, suggestion_lines, table, verdict

PARTS = Parts(styles=PAGE_PARTS.styles, scripts=())
# Bins of the crank angle in the charts of residuals, close enough to be one line.
BINS = 120
# The largest drawn correction and semi-axis of an ellipse, relative to the leg.
CORRECTION_SHARE = 0.07
ELLIPSE_SHARE = 0.035
# Drawn radius of an ellipse of 95 %, as a factor of a standard deviation in two dimensions.
ELLIPSE_95 = 2.4477
ELLIPSE_POINTS = 48


def page(calibration: Calibration, further: Sequence[Suggestion], run: str, built: str) -> str:
    """Return the page; `built` is the text of the leg file."""
    lines = [f'Unobservable: {text}' for text in combinations(calibration)]
    lines += map(str.strip, suggestion_lines(calibration, further))
    heads = ('Parameter', 'Drawn', 'Built', 'Standard error', 'Unit')
    parameters = []
    for line in table(calibration):
        parameters.append(line._replace(error=line.error.replace('+-', '±')))
    numbers = scrolling_table('Dimensions', heads, parameters)
    leg_file = []
    for text in built.splitlines():
        leg_file += [text, Markup('\n')]
    scrolls = {'class_': 'card scrolls', 'tabindex': '0', 'role': 'region'}
    residuals = [element('p', series_line(fit), class_='quiet') for fit in calibration.series]
    bullets = [element('li', line) for line in lines]
    observable = [element('p', verdict(calibration)), element('ul', *bullets)]
    tables = element('div', numbers, class_='beside')
    drawing = element('div', _drawing(calibration), tables, class_='stage')
    leg_text = element('div', element('pre', *leg_file), **scrolls, aria_label='Leg file')
    is_unknown = bool(combinations(calibration))
    title = f'Calibration of {calibration.drawn.name or "leg"}'
    header = element('header', element('div', element('h1', title), element('p', run)))
    return PARTS.page(
        title,
        header,
        element('section', element('h2', 'Dimensions as built'), drawing),
        element('section', element('h2', 'Residuals'), grid([*_charts(calibration)]), *residuals),
        element('details', element('summary', 'Observability'), *observable, open=is_unknown),
        element('details', element('summary', 'Leg file'), leg_text),
    )


def _charts(calibration: Calibration) -> Iterator[Chart]:
    """Yield the residuals of each series over the crank angle, as drawn and as built."""
    for fit in calibration.series:
        factor, unit = SCALES['rad' if fit.series.kind == 'angle' else 'm']
        is_used = fit.inliers & np.isfinite(fit.before).all(axis=1)
        alphas = calibration.model.crank_angles(fit.series, calibration.values)[is_used] % TURN
        bins = np.minimum((alphas / TURN * BINS).astype(np.intp), BINS - 1)
        drawn = factor * _binned_rms(bins, fit.before[is_used])
        built = factor * _binned_rms(bins, fit.after[is_used])
        lines = [ChartLine('as drawn', drawn, is_dashed=True), ChartLine('as built', built, 1)]
        text = 'Root mean square of the residuals at each crank angle, without rejected samples.'
        angles = (np.arange(BINS) + 0.5) * TURN / BINS
        yield Chart(f'Residuals of {fit.series.title}', unit, angles, lines, text, moves=False)


def _binned_rms(bins: IndexArray, residuals: FloatArray) -> FloatArray:
    counts = np.bincount(bins, minlength=BINS)
    with np.errstate(invalid='ignore', divide='ignore'):
        rms: FloatArray = np.sqrt(np.bincount(bins, (residuals**2).mean(axis=1), BINS) / counts)
    return rms


def _drawing(calibration: Calibration) -> Markup:
    """Return the leg as drawn, its corrections enlarged, and the ellipse of each point's error."""
    legs = (calibration.drawn, calibration.linkage)
    structure = calibration.drawn.structure
    alphas = np.linspace(0.0, TURN, BINS, endpoint=False)
    reached = np.all([linkage_poses(leg, alphas).reason == 0 for leg in legs], axis=0)
    alpha = alphas[np.argmax(reached)]
    drawn = linkage_poses(legs[0], [alpha], points=True)
    built = linkage_poses(legs[1], [alpha], points=True, velocities=True, gradients=True)
    points = np.asarray(drawn.points)[0]
    corrections = np.asarray(built.points)[0] - points
    covariances = _covariances(calibration, built)
    size = float(np.ptp(points, axis=0).max())
    max_correction = max(np.abs(corrections).max(), 1e-9)
    max_error = max(ELLIPSE_95 * np.sqrt(np.linalg.eigvalsh(covariances).max()), 1e-9)
    correction_scale = max(1.0, CORRECTION_SHARE * size / max_correction)
    ellipse_scale = max(1.0, ELLIPSE_SHARE * size / max_error)
    built_points = points + correction_scale * corrections
    place_of = dict(zip(structure.points, built_points, strict=True))
    lines = [np.array([place_of[bar.start], place_of[bar.end]]) for _, bar in structure.bars]
    angles = np.linspace(0.0, TURN, ELLIPSE_POINTS)
    circle = ELLIPSE_95 * ellipse_scale * np.column_stack([np.cos(angles), np.sin(angles)])
    for point, covariance in zip(built_points, covariances, strict=True):
        sizes, axes = np.linalg.eigh(covariance)
        lines.append(point + (circle * np.sqrt(np.maximum(sizes, 0.0))) @ axes.T)
    text = (
        f'The leg as drawn; grey: as built, corrections enlarged {correction_scale:.3g} times. '
        f'Ellipses: 95 % of the errors of each point, enlarged {ellipse_scale:.3g} times. The '
        f'crank is at {np.degrees(alpha):.0f} deg.'
    )
    picture = Markup(pose_svg(LinkageLeg(calibration.drawn).closed_form(float(alpha)), lines))
    return element('figure', picture, element('figcaption', text), class_='card chart')


def _covariances(calibration: Calibration, poses: Any) -> FloatArray:
    """Return the covariance of each point of a pose, shape (p, 2, 2) [m^2]."""
    model = calibration.model
    jacobian = np.zeros((*poses.points_1.shape[1:], len(model.names)))
    jacobian[..., : model.count] = poses.points_gradient[0]
    if model.has_encoder:
        jacobian[..., model.names.index(PHASE)] = poses.points_1[0]
    scaled = jacobian * model.units
    covariances: FloatArray = scaled @ calibration.covariance @ scaled.transpose(0, 2, 1)
    return np.nan_to_num(covariances)
