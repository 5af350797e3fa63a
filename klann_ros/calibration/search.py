"""Where a fit starts: checks of the measurements, the encoder's zero and the camera by search."""

from collections.abc import Sequence
from dataclasses import replace
from math import degrees
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .crank import MAX_CRANK_STEP
from .measurements import MeasuredSeries, MeasurementError, subset
from .model import CAMERA, CAMERA_SCALE, MeasurementModel, PHASE

# Samples that a fit needs at least, and rotation of the crank [rad].
MIN_SAMPLES, MIN_CRANK_RANGE = 20, 0.1
# Samples and start angles of the search for the encoder's zero.
SEARCH_SAMPLES, SEARCH_ANGLES = 120, 48
# Rounds until the rotations of camera and crank agree.
ROTATION_ROUNDS = 4
# Ratio of a path's measured and drawn size beyond which its unit is wrong.
MAX_SIZE_RATIO = 10.0
# Part of the misfit at the file's zero from which on another zero is clearly better.
BETTER = 0.7


def check_measurements(model: MeasurementModel, measured: Sequence[MeasuredSeries]) -> None:
    """Refuse change points, few samples, a crank that stands, and sizes in millimetres."""
    if model.linkage.change_points:
        raise MeasurementError(
            'it passes change points, which a leg of slightly different dimensions does only by '
            'its play: measured points do not tell its dimensions; measure its bars'
        )
    for series in measured:
        if len(series.times) < MIN_SAMPLES:
            raise MeasurementError(
                f'{series.title}: {len(series.times)} samples have a crank angle at their stamp, '
                f'{series.skipped} have none; at least {MIN_SAMPLES} are needed (are both stamped '
                f'by the same clock, and the crank at least every {MAX_CRANK_STEP:.0f} rad?)'
            )
    numbers = sum(series.values.size for series in measured)
    count = len(model.names)
    if numbers < 2 * count:
        raise MeasurementError(f'{numbers} measured numbers are too few for {count} parameters')
    rotation = float(np.ptp(np.concatenate([series.crank for series in measured])))
    if rotation < MIN_CRANK_RANGE:
        raise MeasurementError(
            f'the crank turns by {degrees(rotation):.2g} deg only: turn it fully'
        )
    for series in measured:
        predicted = model.motion(series, model.start).values
        is_scaled = series.kind == 'angle' or CAMERA_SCALE in model.names
        if is_scaled or not np.isfinite(predicted).any():
            continue
        drawn_size = max(_spread(predicted), 0.01 * model.linkage.size)
        size = _spread(series.values)
        if size > MAX_SIZE_RATIO * drawn_size or size < 0.01 * drawn_size:
            hint = ': is it in millimetres? Points must be in metres' if size > drawn_size else ''
            raise MeasurementError(
                f'{series.title} moves by {size:.3g} m, on the drawing by {drawn_size:.3g} m{hint}'
            )


def _spread(values: FloatArray) -> float:
    squares = (values - np.nanmedian(values, axis=0)) ** 2
    return float(np.sqrt(np.nanmedian(squares, axis=0).sum()))


class Start(NamedTuple):
    """The model and the parameters of the first fit, and its misfit."""

    model: MeasurementModel
    parameters: FloatArray
    misfit: float


def start_parameters(model: MeasurementModel, measured: Sequence[MeasuredSeries]) -> Start:
    """Return the drawing with the crank's zero and the camera that fit best."""
    rotations = np.linspace(0.0, TURN, SEARCH_ANGLES, endpoint=False)
    few = [subset(series, SEARCH_SAMPLES) for series in measured]
    starts, misfits = _starts(model, few, rotations)
    best = int(np.argmin(misfits))
    if misfits[best] == np.inf:
        raise MeasurementError('the leg as drawn reaches few of the measured crank angles')
    best = best if misfits[best] < BETTER * misfits[0] else 0
    start = starts[best]
    misfit = misfits[best]
    if not model.has_encoder:
        rotation = float(rotations[best])
        for _ in range(ROTATION_ROUNDS if CAMERA[2] in model.names else 0):
            rotation = -model.value(start, CAMERA[2])
            (start,), (misfit,) = _starts(model, few, np.array([rotation]))
        model = replace(model, phase=rotation + model.value(start, CAMERA[2]))
    return Start(model, start, misfit)


def _starts(
    model: MeasurementModel, few: Sequence[MeasuredSeries], rotations: FloatArray
) -> tuple[list[FloatArray], list[float]]:
    """Return the parameters of the best camera at each zero of the crank, and their misfits."""
    # Row by row the numbers at each zero.
    tables = []
    for series in few:
        crank = (series.crank + model.direction * rotations[:, None]).ravel()
        prediction = model.motion(replace(series, crank=crank, rate=0.0 * crank), model.start)
        tables.append(prediction.values.reshape(len(rotations), *series.values.shape))
    misfits = []
    starts = []
    for n, rotation in enumerate(rotations):
        start, seen = model.with_camera(few, [table[n] for table in tables])
        if model.has_encoder:
            start[model.names.index(PHASE)] += rotation
        residuals = list(map(model.residuals, few, seen))
        misfits.append(median_misfit(model, few, residuals))
        starts.append(start)
    return starts, misfits


def median_misfit(
    model: MeasurementModel, measured: Sequence[MeasuredSeries], residuals: Sequence[FloatArray]
) -> float:
    """
    Return the median residual of the worst series, infinite if most of its samples have no pose.

    Residuals [m] are relative to the linkage's size, those of angles to 1 rad.
    """
    medians = []
    for series, series_residuals in zip(measured, residuals, strict=True):
        size = 1.0 if series.kind == 'angle' else model.linkage.size
        errors = np.linalg.norm(series_residuals, axis=1) / size
        if np.isnan(errors).mean() > 0.5:
            return np.inf
        medians.append(float(np.nanmedian(errors)))
    return max(medians)
