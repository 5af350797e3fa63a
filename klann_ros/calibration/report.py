"""A calibration as text for a terminal, and as data for JSON."""

from collections.abc import Iterator, Sequence
from math import degrees
from typing import Any, NamedTuple

from klann_ros.sanitize.text import counted, decimal, finite, printable
import numpy as np

from .fit import Calibration, MAX_MISFIT, SeriesFit
from .model import CAMERA, SCALES
from .observability import GOOD_CONDITION, Suggestion


def text_lines(calibration: Calibration, further: Sequence[Suggestion]) -> Iterator[str]:
    """Yield the calibration as lines."""
    lines = table(calibration)
    width = max(len(line.name) for line in lines)
    yield f'{"":{width}}  {"drawn":>10}  {"built":>10}  {"error":>9}'
    for name, drawn, built, error, unit in lines:
        yield f'{printable(name):{width}}  {drawn:>10}  {built:>10}  {error:>9}  {unit}'
    yield ''
    yield from map(series_line, calibration.series)
    if calibration.crank_noise:
        yield f'crank angle: noise {degrees(calibration.crank_noise):.2g} deg'
    if calibration.crank_gap:
        error = f'{degrees(calibration.crank_gap):.2g} deg'
        yield f'crank angle: unknown by {error} between samples of its encoder, which are too far'
        yield '  apart: record it at a higher rate, or turn more evenly'
    if calibration.chi2_dof is not None:
        yield f'chi2/dof: {calibration.chi2_dof:.3f}'
    if calibration.held_out is not None:
        yield f'last turn, predicted by the others: {calibration.held_out:.2f} times the noise'
    if calibration.camera_rotation:
        rotation = f'{degrees(calibration.camera_rotation):.2g} deg'
        yield f'a camera turned by {rotation} explains the corrections: try --camera unknown'
    if _hides_mirrored_axes(calibration):
        yield 'all points move along one line: mirrored axes of the camera would not show'
    if calibration.late:
        late = f'{1e3 * calibration.late:.3g} ms'
        yield f'the residuals follow the speed of the crank: try --delay unknown (about {late})'
    yield ''
    yield verdict(calibration)
    for text in combinations(calibration):
        yield f'  unobservable: {text}'
    yield from suggestion_lines(calibration, further)


def _hides_mirrored_axes(calibration: Calibration) -> bool:
    """Return whether mirrored measurements would fit as well: of points on one line."""
    if any(fit.series.kind != 'point' for fit in calibration.series):
        return False
    points = np.concatenate([fit.series.values for fit in calibration.series])
    offsets = points[:, 1]
    if CAMERA[0] in calibration.model.names:
        centred = points - np.median(points, axis=0)
        offsets = centred @ np.linalg.svd(centred, full_matrices=False)[2][1]
    return float(np.median(np.abs(offsets))) < MAX_MISFIT / 2.0 * calibration.drawn.size


class ParameterLine(NamedTuple):
    """A parameter as text: drawn and calibrated value, standard error and unit."""

    name: str
    drawn: str
    built: str
    error: str
    unit: str


def table(calibration: Calibration) -> list[ParameterLine]:
    """Return the parameters as text."""
    model = calibration.model
    lines = []
    for n, name in enumerate(model.names):
        factor, unit = SCALES[model.si_units[n]]
        drawn = decimal(factor * model.start[n], '.3f')
        built = 'unknown'
        error = ''
        if np.isfinite(calibration.standard_errors[n]):
            built = decimal(factor * calibration.values[n], '.3f')
            error = f'+-{factor * calibration.standard_errors[n]:.2g}'
        lines.append(ParameterLine(name, drawn, built, error, unit))
    return lines


def series_line(fit: SeriesFit) -> str:
    """Return the residuals of a series, before and after, in words."""
    factor, unit = SCALES['rad' if fit.series.kind == 'angle' else 'm']
    before = factor * float(np.sqrt(np.nanmean(fit.before[fit.inliers] ** 2)))
    rejected = int(np.count_nonzero(~fit.inliers))
    source = printable(fit.series.source)
    samples = counted(len(fit.inliers), 'sample')
    return (
        f'{fit.series.title} ({source}): {samples}, {rejected} rejected, {fit.series.skipped} '
        f'skipped; residuals {before:.3g} {unit} as drawn, {factor * fit.noise:.3g} {unit} '
        f'as built'
    )


def verdict(calibration: Calibration) -> str:
    """Return in a sentence what can be observed apart."""
    observed = calibration.observability
    count = len(calibration.model.names)
    if not observed.combinations:
        quality = 'good' if observed.condition < GOOD_CONDITION else 'fair: the errors say how far'
        return f'All {count} parameters can be told apart in these measurements ({quality}).'
    fixed = ' The prior fixes the rest.' if calibration.prior else ''
    return (
        f'{observed.rank} of {count} combinations of parameters can be told apart in these '
        f'measurements; {counted(len(observed.combinations), "combination")} cannot.{fixed}'
    )


def combinations(calibration: Calibration) -> list[str]:
    """Return the combinations that cannot be distinguished, in words."""
    model = calibration.model
    return [combination.text(model) for combination in calibration.observability.combinations]


def suggestion_lines(calibration: Calibration, further: Sequence[Suggestion]) -> Iterator[str]:
    """Yield the further measurements that help."""
    resolves = 'resolves all, ' * bool(calibration.observability.combinations)
    for name, condition in further[:3]:
        yield f'  with {printable(name)}: {resolves}condition {condition:.0f} (below 100 is good)'


def report(calibration: Calibration, further: Sequence[Suggestion]) -> dict[str, Any]:
    """Return the calibration as JSON data, in SI units; null for an unobservable number."""
    model = calibration.model
    observed = calibration.observability
    errors = calibration.standard_errors
    known_values = np.where(np.isfinite(errors), calibration.values, np.nan)
    deviations = errors / model.units
    parameters = {}
    for n, name in enumerate(model.names):
        parameters[name] = {
            'value': float(known_values[n]),
            'standard_error': float(errors[n]),
            'drawn': float(model.start[n]),
            'unit': model.si_units[n],
        }
    dimensions = {name: parameters.pop(name) for name in model.linkage.dimensions}
    unobservable = []
    for combination in observed.combinations:
        lost = {'parameters': dict(combination.parts), 'error': combination.error}
        unobservable.append(lost)
    noise = {}
    points = {}
    for fit in calibration.series:
        noise[fit.series.name] = fit.noise
        points[fit.series.name] = {
            'source': fit.series.source,
            'used': int(np.count_nonzero(fit.inliers)),
            'rejected': int(np.count_nonzero(~fit.inliers)),
            'skipped': fit.series.skipped,
            'rms_drawn': float(np.sqrt(np.nanmean(fit.before**2))),
            'rms_built': fit.noise,
        }
    content = {
        'dimensions': dimensions,
        **{name.replace(' ', '_'): parameter for name, parameter in parameters.items()},
        'condition': observed.condition,
        'rank': observed.rank,
        'unobservable': unobservable,
        'suggestions': [suggestion._asdict() for suggestion in further],
        'prior': calibration.prior,
        'noise': {**noise, 'crank': calibration.crank_noise},
        'crank_gap': calibration.crank_gap,
        'held_out': calibration.held_out,
        'chi2_dof': calibration.chi2_dof,
        'late': calibration.late,
        'points': points,
        'parameters': model.names,
        'correlation': (calibration.covariance / np.outer(deviations, deviations)).tolist(),
    }
    return dict(finite(content))
