"""Check the built leg: crank efforts by its masses, and its dimensions by measured points."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
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
from klann_ros.review.model.recording import Drive, LegRecording, RunRecording
from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.sanitize.text import counted, printable
import numpy as np

# Rate and acceleration of a crank are those of a cubic through the samples around each moment, by
# least squares. The residuals of the fit give their standard errors, and that of the torque.
# Half width of the window: time [s], rotation of the crank [rad], number of samples.
MAX_HALF_WIDTH = 0.04
MAX_ROTATION = 0.2
MIN_SAMPLES = 3
MAX_SAMPLES = 40
# A window has no interval longer than this multiple of the median.
MAX_INTERVAL_RATIO = 5.0
# Evenly spaced moments of a run, and moments computed at once.
MAX_MOMENTS = 50_000
CHUNK = 2048


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
    invalid_count: int  # efforts that are not finite
    total_count: int  # all efforts


def drive_torques(drive: Drive, legs: Sequence[LegRecording]) -> Torques | None:
    """
    Return recorded and expected efforts of a drive, where both are known.

    None if no effort was recorded, every one being 0 or not finite; no sample if the masses of a
    leg are unknown.
    """
    series = drive.efforts
    drive_legs = [legs[index] for index in drive.legs]
    series = series.since(max(leg.solver.leg_time for leg in drive_legs))
    angles, efforts = series.values.T
    is_valid = np.isfinite(efforts)
    if not efforts[is_valid].any():
        return None
    invalid_count = int((~is_valid).sum())
    total_count = len(efforts)
    is_valid &= np.abs(angles) <= MAX_CRANK_ANGLE
    angles = angles[is_valid]
    efforts = efforts[is_valid]
    times = series.times[is_valid]
    motion = crank_motion(_seconds(series.stamps[is_valid], times), angles)
    rows = motion.rows
    expected = np.zeros(len(rows))
    # Sensitivities of the torque to acceleration and rate.
    inertia = np.zeros(len(rows))
    damping = np.zeros(len(rows))
    for leg in drive_legs:
        dynamics = leg.solver.dynamics
        if dynamics is None:
            no_samples = times[:0], efforts[:0], efforts[:0], efforts[:0]
            return Torques(*no_samples, invalid_count, total_count)
        direction = leg.solver.direction if drive.is_input else 1.0
        alphas = direction * angles[rows] + (leg.solver.phase if drive.is_input else 0.0)
        alphas[~(np.abs(alphas) <= MAX_CRANK_ANGLE)] = np.nan
        rates = direction * motion.rate
        accelerations = direction * motion.acceleration
        expected += direction * dynamics.crank_torque(alphas, rates, accelerations)
        leg_inertia, inertia_slope = dynamics.reduced_inertia(alphas)
        inertia += leg_inertia
        damping += np.abs(inertia_slope * rates)
    accuracy = inertia * motion.acceleration_error + damping * motion.rate_error
    is_known = np.isfinite(expected) & np.isfinite(accuracy)
    rows = rows[is_known]
    return Torques(
        times[rows],
        efforts[rows],
        expected[is_known],
        accuracy[is_known],
        invalid_count,
        total_count,
    )


def crank_motion(times: FloatArray, angles: FloatArray) -> Motion:
    """Return rate and acceleration of a crank by times [s] and angles [rad], shape (n,)."""
    is_later = np.concatenate([[True], times[1:] > np.maximum.accumulate(times)[:-1]])
    increasing = np.flatnonzero(is_later)
    times = times[increasing]
    angles = angles[increasing]
    moments, side = _windows(times, angles)
    chunks = np.split(moments, range(CHUNK, len(moments), CHUNK))
    fits = [_fit_cubics(times, angles, chunk, side) for chunk in chunks]
    return Motion(increasing[moments], *np.concatenate(fits, axis=1))


def _windows(times: FloatArray, angles: FloatArray) -> tuple[IntArray, int]:
    """Return moments whose windows have no gap, and the half width of these [samples]."""
    if len(times) < 2 * MIN_SAMPLES + 1:
        return np.empty(0, dtype=np.int64), MIN_SAMPLES
    steps = np.diff(times)
    period = float(np.median(steps))
    median_rotation = float(np.median(np.abs(np.diff(angles))))
    max_samples = MAX_ROTATION / median_rotation if median_rotation else MAX_SAMPLES
    max_samples = min(MAX_HALF_WIDTH / period, max_samples)
    side = int(np.clip(max_samples, MIN_SAMPLES, MAX_SAMPLES))
    gap_counts = np.concatenate([[0], np.cumsum(steps > MAX_INTERVAL_RATIO * period)])
    moments = np.arange(side, len(times) - side)
    moments = moments[gap_counts[moments + side] == gap_counts[moments - side]]
    return moments[:: max(1, -(-len(moments) // MAX_MOMENTS))], side


def _fit_cubics(times: FloatArray, angles: FloatArray, moments: IntArray, side: int) -> FloatArray:
    """Return rates, accelerations and their errors by cubics around moments, shape (4, k)."""
    samples = moments[:, None] + np.arange(-side, side + 1)
    offsets = times[samples] - times[moments][:, None]
    scale = np.abs(offsets).max(axis=1)
    powers = (offsets / scale[:, None])[..., None] ** np.arange(4)
    inverse = np.linalg.pinv(np.swapaxes(powers, 1, 2) @ powers, hermitian=True)
    rotations = angles[samples] - angles[moments][:, None]
    coefficients = (inverse @ (np.swapaxes(powers, 1, 2) @ rotations[..., None]))[..., 0]
    residuals = rotations - (powers @ coefficients[..., None])[..., 0]
    noise = np.sqrt((residuals**2).sum(axis=1) / (2 * side - 3))
    errors = noise[:, None] * np.sqrt(np.abs(np.diagonal(inverse, axis1=1, axis2=2)))
    rates = [coefficients[:, 1] / scale, 2.0 * coefficients[:, 2] / scale**2]
    return np.stack([*rates, errors[:, 1] / scale, 2.0 * errors[:, 2] / scale**2])


def _seconds(stamps: IntArray, log_times: IntArray) -> FloatArray:
    """Return the times of samples [s]: their stamps if these increase, else the log times."""
    are_times = len(stamps) and (stamps > 0).all() and (np.diff(stamps) > 0).all()
    times = stamps if are_times else log_times
    return (times - times[:1]) / 1e9


# Standard errors of the expected torque within which efforts agree.
_STANDARD_ERRORS = 3.0
# Moments above the limit that make a finding: their share, and their number.
_MIN_SHARE = 0.01
_MIN_MOMENTS = 3
# Cosine similarity above which the efforts are a multiple of the expected torque.
_MIN_SIMILARITY = 0.95


def check_torques(review: Review) -> Iterator[Finding]:
    """Yield efforts that differ from the computed torque, cannot be checked or are not finite."""
    legs = review.recording.legs
    for drive in review.recording.drives:
        torques = drive_torques(drive, legs)
        if torques is None:
            continue
        name = printable(drive.joint)
        title = legs[drive.legs[0]].title if len(drive.legs) == 1 else ''
        if torques.invalid_count:
            counts = f'{torques.invalid_count} of {torques.total_count}'
            text = f'{counts} efforts of {name} are not finite'
            yield Finding('effort', Severity.NOTE, text, 'they are ignored', leg=title)
        if any(legs[index].solver.dynamics is None for index in drive.legs):
            text = f'the efforts of {name} cannot be checked: the masses are unknown'
            advice = 'give a file with bar_density or masses: --geometry FILE'
            yield Finding('effort', Severity.NOTE, text, advice, leg=title)
        elif len(torques.times):
            yield from _torque_differences(review, torques, name, title)


def _torque_differences(
    review: Review, torques: Torques, name: str, title: str
) -> Iterator[Finding]:
    """Yield a finding if more efforts than a few differ from the computed torque."""
    differences = np.abs(torques.recorded - torques.expected)
    peak = float(np.abs(torques.expected).max())
    excesses = differences - review.limits.torque * peak - _STANDARD_ERRORS * torques.accuracy
    # At rest without masses there is rounding.
    wrong_count = np.count_nonzero(excesses > 1e-9)
    if wrong_count < max(_MIN_MOMENTS, _MIN_SHARE * len(differences)):
        return
    worst = int(np.argmax(excesses))
    text = (
        f'the effort of {name} differs from the computed torque by up to '
        f'{differences[worst]:.3g} N m: recorded {torques.recorded[worst]:.3g}, expected '
        f'{torques.expected[worst]:.3g} +- {torques.accuracy[worst]:.1g} N m'
    )
    time = review.since_start(torques.times[worst])
    yield Finding('effort', Severity.WARNING, text, _likely_cause(torques), time, title)


def _likely_cause(torques: Torques) -> str:
    """Return the likely cause of the difference."""
    recorded = torques.recorded
    expected = torques.expected
    product = float(recorded @ expected)
    norms = float(np.linalg.norm(recorded) * np.linalg.norm(expected))
    similarity = product / norms if norms else 0.0
    factor = product / float(expected @ expected) if expected.any() else 0.0
    if similarity < -_MIN_SIMILARITY:
        return 'it has the opposite sign: the driver, or direction, is reversed'
    if similarity > _MIN_SIMILARITY and abs(factor - 1.0) > 0.02:
        return f'it is {factor:.2f} times as large: other masses, or a driver with another scale'
    return 'friction, a load on the foot, or other masses than given'


# Standard errors beyond which a dimension differs from the file, and the least error [units].
MIN_DEVIATION = 5.0
MIN_ERROR = 0.05
# Dimensions that are named.
MAX_NAMED = 3


def check_dimensions(review: Review) -> Iterator[Finding]:
    """Yield the legs that were built with other dimensions than those of the run."""
    for leg in review.legs:
        calibration = None
        # Other points, or no scipy; `calibrate` reports the reason.
        with suppress(MeasurementError, ModuleNotFoundError):
            calibration = _calibrated(review.recording, leg)
        if calibration is not None:
            yield from _dimension_findings(leg, calibration)


def _calibrated(recording: RunRecording, leg: ReviewedLeg) -> Calibration | None:
    """Return the calibration of a leg by points on topics such as `/mocap/LEG/h`, if any."""
    solver = leg.evaluated.solver
    if solver.leg is None:
        return None
    topics = point_topics(recording.measured, solver.leg.linkage, leg.recording.name)
    if not topics:
        return None
    start = recording.start
    cranks = leg.evaluated.cranks
    crank = CrankSamples.of((cranks.stamps - start) / 1e9, cranks.values[:, 0])
    measured = []
    for name, topic in topics.items():
        series = recording.measured[topic]
        times = (series.stamps - start) / 1e9
        measured.append(series_of('point', name, times, series.values, crank))
    return calibrate(solver.leg.linkage, measured, direction=solver.direction, phase=solver.phase)


def _dimension_findings(leg: ReviewedLeg, calibration: Calibration) -> Iterator[Finding]:
    """Yield a finding if calibrated dimensions differ from the file's by several errors."""
    model = calibration.model
    errors = np.maximum(calibration.standard_errors, MIN_ERROR * model.units)
    deviations = np.abs(calibration.values - model.start) / errors
    order = np.argsort(np.nan_to_num(-deviations))
    wrong = [n for n in order if n < model.count and deviations[n] > MIN_DEVIATION]
    if not wrong:
        return
    texts = []
    for n in wrong[:MAX_NAMED]:
        factor, unit = SCALES[model.si_units[n]]
        built = f'{factor * calibration.values[n]:.5g}'
        error = f'{factor * calibration.standard_errors[n]:.1g}'
        drawn = f'{factor * model.start[n]:.5g}'
        name = printable(model.names[n])
        texts.append(f'{name} is {built} +- {error} {unit}, the file says {drawn}')
    unnamed_count = len(wrong) - len(texts)
    if unnamed_count:
        texts.append(f'and {counted(unnamed_count, "more dimension")}')
    title = leg.recording.title
    meaning = 'by measured points the leg was built otherwise: calibrate gives its leg file'
    yield Finding('dimensions', Severity.WARNING, '; '.join(texts), meaning, leg=title)
