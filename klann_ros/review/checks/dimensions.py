"""Check the lengths of a leg by measured points of it, if the run has any."""

from collections.abc import Iterator

from klann_ros.calibration import calibrate, Calibration, CrankSamples, MeasurementError, series_of
from klann_ros.calibration.load import point_topics
from klann_ros.calibration.report import SCALES
from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.review.model.times import Series
from klann_ros.sanitize.text import counted, printable
import numpy as np

# Standard errors beyond which a dimension differs from the file, and the least error [units].
MIN_DEVIATION, MIN_ERROR = 5.0, 0.05
# Dimensions that are named.
MAX_NAMED = 3


def check_dimensions(review: Review) -> Iterator[Finding]:
    """Yield the legs that were built with other dimensions than those of the run."""
    for leg in review.legs:
        points = measured_points(review, leg)
        if not points:
            continue
        try:
            found = _calibrated(leg, points, review.recording.start)
        except (MeasurementError, ModuleNotFoundError):
            # Other points, or no scipy; `calibrate` reports the reason.
            continue
        yield from _finding(leg, found)


def measured_points(review: Review, leg: ReviewedLeg) -> dict[str, Series]:
    """Return the measured points of a leg by their names: topics such as `/mocap/LEG/h`."""
    if leg.evaluated.solver.leg is None:
        return {}
    linkage, measured = leg.evaluated.solver.leg.linkage, review.recording.measured
    topics = point_topics(measured, linkage, leg.recording.name)
    return {point: measured[topic] for point, topic in topics.items()}


def _calibrated(leg: ReviewedLeg, points: dict[str, Series], start: int) -> Calibration:
    solver, cranks = leg.evaluated.solver, leg.evaluated.cranks
    if solver.leg is None:
        raise AssertionError('measured points are those of a known leg')
    crank = CrankSamples.of((cranks.stamps - start) / 1e9, cranks.values[:, 0])
    measured = [
        series_of('point', name, (series.stamps - start) / 1e9, series.values, crank)
        for name, series in points.items()
    ]
    return calibrate(
        solver.leg.linkage, measured, direction=int(solver.direction), phase=solver.phase
    )


def _finding(leg: ReviewedLeg, found: Calibration) -> Iterator[Finding]:
    model = found.model
    errors = np.maximum(found.standard_errors, MIN_ERROR * model.units)
    deviations = np.abs(found.values - model.start) / errors
    order = np.argsort(np.nan_to_num(-deviations))
    wrong = [n for n in order if n < model.count and deviations[n] > MIN_DEVIATION]
    if not wrong:
        return
    texts = []
    for n in wrong[:MAX_NAMED]:
        factor, unit = SCALES[model.unit_name(n)]
        value, error = factor * found.values[n], factor * found.standard_errors[n]
        drawn = f'the file says {factor * model.start[n]:.5g}'
        texts.append(f'{printable(model.names[n])} is {value:.5g} +- {error:.1g} {unit}, {drawn}')
    more = len(wrong) - len(texts)
    if more:
        texts.append(f'and {counted(more, "more dimension")}')
    title = leg.recording.title
    meaning = 'by measured points the leg was built otherwise: calibrate gives its leg file'
    yield Finding('dimensions', Severity.WARNING, '; '.join(texts), meaning, leg=title)
