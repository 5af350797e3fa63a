"""
Observability: singular values of the measurements' derivatives by the parameters.

In units of a workshop's errors (see `model`) a singular value s is the inverse standard error of a
combination of parameters. A combination beyond MAX_ERROR units is unobservable: the measurements
say less about it than the drawing. The condition number is that of the columns scaled to length 1
(Schroeer: below 100 is good).
"""

from collections.abc import Sequence
from dataclasses import replace
from math import radians
from typing import NamedTuple

from klann_ros.kinematics.arrays import BoolArray, FloatArray
import numpy as np

from .measurements import kind_of, MeasuredSeries, moving_points, subset
from .model import CAMERA, MeasurementModel, SCALES

# Standard error from which on a combination is unobservable [units].
MAX_ERROR = 10.0
# Singular values below this part of the largest are rounding.
ROUNDING = 1e-9
# Parts of a combination, or of a parameter's error, that are left out.
MIN_PART = 0.03
GOOD_CONDITION = 100.0
# Samples of a further measurement that is considered, and the noise of an encoder [rad].
SUGGESTION_SAMPLES, ENCODER_NOISE = 120, radians(0.05)
# Standard deviation of an unobservable combination from the drawing's [units].
OPEN_ERROR = 2.0


class Combination(NamedTuple):
    """Parameters that turn together: their changes, the largest angle 1 deg or length 1 mm."""

    # Names and changes [m, rad, s].
    parts: tuple[tuple[str, float], ...]
    # Standard error of the combination as written, as a factor; infinite if it has none.
    error: float

    def text(self, model: MeasurementModel) -> str:
        """Return it for users, such as 'phase +1 deg, x_d -0.4 mm'."""
        scales = (SCALES[model.si_units[model.names.index(name)]] for name, _ in self.parts)
        return ', '.join(
            f'{name} {factor * value:+.3g} {unit}'
            for (name, value), (factor, unit) in zip(self.parts, scales, strict=True)
        )


class Observability(NamedTuple):
    """The verdict on the observability of the parameters."""

    # Condition number of the normalised columns; infinite if a combination is not observable.
    condition: float
    # Number of observable combinations, and the others.
    rank: int
    combinations: tuple[Combination, ...]
    # The parameters that belong to one of these.
    unobservable: BoolArray
    # The unobservable combinations as orthonormal rows, in units.
    lost: FloatArray


class Suggestion(NamedTuple):
    """A further measurement that makes all observable, such as 'point G', and its condition."""

    name: str
    condition: float


def observability(jacobian: FloatArray, model: MeasurementModel, least: int = 0) -> Observability:
    """
    Return the verdict for the derivatives of whitened measurements by parameters in units.

    At least `least` combinations are unobservable: those that are seen worst.
    """
    _, sizes, rows = np.linalg.svd(jacobian, full_matrices=False)
    seen = (sizes > 1.0 / MAX_ERROR) & (sizes > ROUNDING * sizes[0])
    seen[slice(len(sizes) - least, None)] = False
    lost = rows[~seen]
    unobservable: BoolArray = np.linalg.norm(lost, axis=0) > MIN_PART
    combinations = tuple(
        _combination(row, size if size > ROUNDING * sizes[0] else 0.0, model)
        for row, size in zip(lost, sizes[~seen], strict=True)
    )
    condition = np.inf if len(lost) else condition_number(jacobian)
    return Observability(condition, int(seen.sum()), combinations, unobservable, lost)


def condition_number(jacobian: FloatArray) -> float:
    """Return the condition number of the columns scaled to length 1; infinite for a zero one."""
    lengths = np.linalg.norm(jacobian, axis=0)
    if not (lengths > 0.0).all():
        return np.inf
    return float(np.linalg.cond(jacobian / lengths))


def _combination(row: FloatArray, size: float, model: MeasurementModel) -> Combination:
    changes = row * model.units
    order = np.argsort(-np.abs(row))
    order = order[np.abs(row[order]) > MIN_PART * np.abs(row[order[0]])]
    angle, length = (
        max((abs(changes[n]) for n in order if model.si_units[n] == unit), default=0.0)
        for unit in ('rad', 'm')
    )
    scale = np.sign(row[order[0]]) * (radians(1.0) / angle if angle else 1e-3 / (length or 1.0))
    parts = tuple((model.names[n], float(changes[n] * scale)) for n in order)
    return Combination(parts, np.inf if size == 0.0 else float(1.0 / (size * abs(scale))))


def further_measurements(
    model: MeasurementModel,
    values: FloatArray,
    measured: Sequence[tuple[MeasuredSeries, float]],
    current: Observability,
) -> list[Suggestion]:
    """Return the further measurements that help, the best first: one more beside the measured."""

    def rows(series: MeasuredSeries, noise: float) -> FloatArray:
        few = subset(series, SUGGESTION_SAMPLES)
        own = model.predict(few, values)
        share = len(few.times) / len(series.times)
        found = own.jacobian.reshape(-1, len(values)) * model.units / (noise * share**0.5)
        finite: FloatArray = found[np.isfinite(found).all(axis=1)]
        return finite

    known = np.concatenate([rows(*each) for each in measured])
    base, noise = min(measured, key=lambda each: (each[0].kind != 'point', each[1]))
    names = {*moving_points(model.linkage), *model.linkage.structure.angles[1:]}
    candidates = {}
    for name in names - {series.name for series, _ in measured}:
        kind = kind_of(model.linkage, name)
        own = ENCODER_NOISE if kind == 'angle' else noise
        more = rows(replace(base, kind=kind, name=name), own)
        candidates[f'{kind} {name}'] = np.concatenate([known, more])
    if CAMERA[0] in model.names:
        columns = [n for n, name in enumerate(model.names) if name not in CAMERA]
        candidates["the camera's pose"] = known[:, columns]
    found = []
    for name, jacobian in candidates.items():
        resolves = np.linalg.svd(jacobian, compute_uv=False)[-1] > 1.0 / MAX_ERROR
        condition = condition_number(jacobian)
        if resolves and (current.combinations or condition < 0.8 * current.condition):
            found.append(Suggestion(name, condition))
    return sorted(found, key=lambda each: (each.condition, each.name))
