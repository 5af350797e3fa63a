"""Check the built leg: crank efforts by its masses, and its dimensions by measured points."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from klann_ros.calibration import (
    calibrate,
    Calibration,
    CrankSamples,
    MeasurementError,
    point_topics,
    SCALES,
    series_of,
)
from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
from klann_ros.kinematics.arrays import FloatArray, IntArray
from klann_ros.review.model.recording import Drive, LegRecording
from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.review.model.times import Series
from klann_ros.sanitize.text import counted, printable
import numpy as np

# Rate and acceleration of a crank are those of a cubic through the samples around each moment, by
# least squares. The residuals of the fit give their standard errors, and that of the torque.
# Half width of the window: time [s], rotation of the crank [rad], number of samples.
MAX_HALF_WIDTH, MAX_ROTATION = 0.04, 0.2
MIN_SAMPLES, MAX_SAMPLES = 3, 40
# A window has no interval longer than this multiple of the median.
MAX_INTERVAL_RATIO = 5.0
# Evenly spaced moments of a run, and moments computed at once.
MAX_MOMENTS, CHUNK = 50_000, 2048


class Motion(NamedTuple):
    """Rate [rad/s] and acceleration [rad/s^2] of a crank at k samples, with standard errors."""

    rows: IntArray  # indices of the samples
    rate: FloatArray
    acceleration: FloatArray
    rate_error: FloatArray
    acceleration_error: FloatArray


class Torques(NamedTuple):
    """Recorded and expected efforts of a drive at k samples [N m]."""

    times: IntArray  # log times [ns]
    recorded: FloatArray
    expected: FloatArray
    accuracy: FloatArray  # standard error of the expected effort
    invalid: int  # number of efforts that are not finite
    total: int  # of all efforts


def torques(drive: Drive, legs: Sequence[LegRecording]) -> Torques | None:
    """
    Return recorded and expected efforts of a drive, where both are known.

    None if every effort is 0 or not finite.
    """
    series = drive.efforts
    own = [legs[k] for k in drive.legs]
    since = max(leg.solver.leg_time for leg in own)
    first = int(np.searchsorted(series.times, since))
    angles, efforts = series.values[first:].T
    known = np.isfinite(efforts)
    if not efforts[known].any():
        return None
    invalid, total = int((~known).sum()), len(efforts)
    known &= np.abs(angles) <= MAX_CRANK_ANGLE
    angles, efforts = angles[known], efforts[known]
    logged, stamps = series.times[first:][known], series.stamps[first:][known]
    moving = crank_motion(_seconds(stamps, logged), angles)
    rows = moving.rows
    expected, inertia, turning = (np.zeros(len(rows)) for _ in range(3))
    for leg in own:
        dynamics = leg.solver.dynamics
        if dynamics is None:
            return Torques(*(np.empty(0),) * 4, invalid, total)  # type: ignore[arg-type]
        sense = leg.solver.direction if drive.is_input else 1.0
        alphas = sense * angles[rows] + (leg.solver.phase if drive.is_input else 0.0)
        alphas[~(np.abs(alphas) <= MAX_CRANK_ANGLE)] = np.nan
        rates, changes = sense * moving.rate, sense * moving.acceleration
        expected += sense * dynamics.crank_torque(alphas, rates, changes)
        own_inertia, slope = dynamics.reduced_inertia(alphas)
        inertia += own_inertia
        turning += np.abs(slope * rates)
    accuracy = inertia * moving.acceleration_error + turning * moving.rate_error
    there = np.isfinite(expected) & np.isfinite(accuracy)
    rows, expected, accuracy = rows[there], expected[there], accuracy[there]
    return Torques(logged[rows], efforts[rows], expected, accuracy, invalid, total)


def crank_motion(times: FloatArray, angles: FloatArray) -> Motion:
    """Return rate and acceleration of a crank by times [s] and angles [rad], shape (n,)."""
    later = np.concatenate([[True], times[1:] > np.maximum.accumulate(times)[:-1]])
    increasing = np.flatnonzero(later)
    times, angles = times[increasing], angles[increasing]
    found = [_fit_cubics(times, angles, *window) for window in _windows(times, angles)]
    parts = zip(*found, strict=True) if found else ((np.empty(0),) * 5)
    rows, *others = (np.concatenate([np.empty(0), *part]) for part in parts)
    return Motion(increasing[rows.astype(np.int64)], *others)


def _windows(times: FloatArray, angles: FloatArray) -> Iterator[tuple[IntArray, int]]:
    """Yield moments whose windows have no gap, and the half width of these [samples]."""
    if len(times) < 2 * MIN_SAMPLES + 1:
        return
    steps = np.diff(times)
    period, median_step = float(np.median(steps)), float(np.median(np.abs(np.diff(angles))))
    most = min(MAX_HALF_WIDTH / period, MAX_ROTATION / median_step if median_step else MAX_SAMPLES)
    side = int(np.clip(most, MIN_SAMPLES, MAX_SAMPLES))
    broken = np.concatenate([[0], np.cumsum(steps > MAX_INTERVAL_RATIO * period)])
    moments = np.arange(side, len(times) - side)
    moments = moments[broken[moments + side] == broken[moments - side]]
    moments = moments[:: max(1, -(-len(moments) // MAX_MOMENTS))]
    for first in range(0, len(moments), CHUNK):
        yield moments[slice(first, first + CHUNK)], side


def _fit_cubics(
    times: FloatArray, angles: FloatArray, moments: IntArray, side: int
) -> tuple[FloatArray, ...]:
    """Return moments with rate, acceleration and their errors, by cubics around them."""
    around = moments[:, None] + np.arange(-side, side + 1)
    far = times[around] - times[moments][:, None]
    size = np.abs(far).max(axis=1)
    powers = (far / size[:, None])[..., None] ** np.arange(4)
    inverse = np.linalg.pinv(np.swapaxes(powers, 1, 2) @ powers, hermitian=True)
    moved = angles[around] - angles[moments][:, None]
    factors = (inverse @ (np.swapaxes(powers, 1, 2) @ moved[..., None]))[..., 0]
    off = moved - (powers @ factors[..., None])[..., 0]
    noise = np.sqrt((off**2).sum(axis=1) / (2 * side - 3))
    spread = noise[:, None] * np.sqrt(np.abs(np.diagonal(inverse, axis1=1, axis2=2)))
    return (
        moments.astype(np.float64),
        factors[:, 1] / size,
        2.0 * factors[:, 2] / size**2,
        spread[:, 1] / size,
        2.0 * spread[:, 2] / size**2,
    )


def _seconds(stamps: IntArray, logged: IntArray) -> FloatArray:
    """Return the times of samples [s]: their stamps if these increase, else the log times."""
    are_times = len(stamps) and (stamps > 0).all() and (np.diff(stamps) > 0).all()
    given = stamps if are_times else logged
    return (given - given[:1]) / 1e9


# Standard errors of the expected torque within which efforts agree.
_STANDARD_ERRORS = 3.0
# Moments above the limit that make a finding: their share, and their number.
_MIN_SHARE, _MIN_MOMENTS = 0.01, 3
# Cosine similarity above which the efforts are a multiple of the expected torque.
_MIN_SIMILARITY = 0.95


def check_torques(review: Review) -> Iterator[Finding]:
    """Yield efforts off the computed torque, and efforts that are not finite."""
    legs = review.recording.legs
    for drive in review.recording.drives:
        found = torques(drive, legs)
        if found is None:
            continue
        name = printable(drive.joint)
        title = legs[drive.legs[0]].title if len(drive.legs) == 1 else ''
        if found.invalid:
            text = f'{found.invalid} of {found.total} efforts of {name} are not finite'
            yield Finding('effort', Severity.NOTE, text, 'they are ignored', leg=title)
        if any(legs[k].solver.dynamics is None for k in drive.legs):
            text = f'the efforts of {name} cannot be judged: the masses are unknown'
            meaning = 'give a file with bar_density or masses: --geometry FILE'
            yield Finding('effort', Severity.NOTE, text, meaning, leg=title)
        elif len(found.times):
            yield from _differences(review, found, name, title)


def _differences(review: Review, found: Torques, name: str, title: str) -> Iterator[Finding]:
    off = np.abs(found.recorded - found.expected)
    peak = float(np.abs(found.expected).max())
    beyond = off - review.limits.torque * peak - _STANDARD_ERRORS * found.accuracy
    # Rounding, at rest without masses.
    wrong = beyond > 1e-9
    if np.count_nonzero(wrong) < max(_MIN_MOMENTS, _MIN_SHARE * len(off)):
        return
    worst = int(np.argmax(beyond))
    text = (
        f'the effort of {name} differs from the computed torque by up to '
        f'{off[worst]:.3g} N m: recorded {found.recorded[worst]:.3g}, expected '
        f'{found.expected[worst]:.3g} +- {found.accuracy[worst]:.1g} N m'
    )
    time = review.since_start(found.times[worst])
    yield Finding('effort', Severity.WARNING, text, _meaning(found), time, title)


def _meaning(found: Torques) -> str:
    """Return the likely cause of the difference."""
    both = float(found.recorded @ found.expected)
    sizes = float(np.linalg.norm(found.recorded) * np.linalg.norm(found.expected))
    similarity = both / sizes if sizes else 0.0
    factor = both / float(found.expected @ found.expected) if found.expected.any() else 0.0
    if similarity < -_MIN_SIMILARITY:
        return 'it has the opposite sign: the driver, or direction, is reversed'
    if similarity > _MIN_SIMILARITY and abs(factor - 1.0) > 0.02:
        return f'it is {factor:.2f} times as large: other masses, or a driver with another scale'
    return 'friction, a load on the foot, or other masses than given'


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
    return calibrate(solver.leg.linkage, measured, direction=solver.direction, phase=solver.phase)


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
        factor, unit = SCALES[model.si_units[n]]
        value, error = factor * found.values[n], factor * found.standard_errors[n]
        drawn = f'the file says {factor * model.start[n]:.5g}'
        texts.append(f'{printable(model.names[n])} is {value:.5g} +- {error:.1g} {unit}, {drawn}')
    more = len(wrong) - len(texts)
    if more:
        texts.append(f'and {counted(more, "more dimension")}')
    title = leg.recording.title
    meaning = 'by measured points the leg was built otherwise: calibrate gives its leg file'
    yield Finding('dimensions', Severity.WARNING, '; '.join(texts), meaning, leg=title)
