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

from klann_ros.kinematics.arrays import BoolArray, FloatArray, with_short_repr
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
SUGGESTION_SAMPLES = 120
ENCODER_NOISE = radians(0.05)
# Standard deviation of an unobservable combination from the drawing's [units].
OPEN_ERROR = 2.0


class Combination(NamedTuple):
    """Parameters that turn together: their changes, the largest angle 1 deg or length 1 mm."""

    parts: tuple[tuple[str, float], ...]  # names and changes [m, rad, s]
    # Standard error of the combination as written, as a factor; infinite if it has none.
    error: float

    def text(self, model: MeasurementModel) -> str:
        """Return it for users, such as 'phase +1 deg, x_d -0.4 mm'."""
        changes = []
        for name, change in self.parts:
            factor, unit = SCALES[model.si_units[model.names.index(name)]]
            changes.append(f'{name} {factor * change:+.3g} {unit}')
        return ', '.join(changes)


@with_short_repr
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


def observability(
    jacobian: FloatArray, model: MeasurementModel, min_unobservable: int = 0
) -> Observability:
    """
    Return the verdict for the derivatives of whitened measurements by parameters in units.

    At least `min_unobservable` combinations are unobservable: those that are seen worst.
    """
    _, sizes, directions = np.linalg.svd(jacobian, full_matrices=False)
    sizes = np.where(sizes > ROUNDING * sizes[0], sizes, 0.0)
    is_observable = sizes > 1.0 / MAX_ERROR
    max_observable = len(sizes) - min_unobservable
    is_observable[max_observable:] = False
    lost = directions[~is_observable]
    unobservable: BoolArray = np.linalg.norm(lost, axis=0) > MIN_PART
    lost_sizes = sizes[~is_observable]
    combinations = []
    for direction, size in zip(lost, lost_sizes, strict=True):
        combinations.append(_combination(direction, size, model))
    condition = np.inf if len(lost) else condition_number(jacobian)
    rank = int(is_observable.sum())
    return Observability(condition, rank, tuple(combinations), unobservable, lost)


def condition_number(jacobian: FloatArray) -> float:
    """Return the condition number of the columns scaled to length 1; infinite for a zero one."""
    lengths = np.linalg.norm(jacobian, axis=0)
    if not (lengths > 0.0).all():
        return np.inf
    return float(np.linalg.cond(jacobian / lengths))


def _combination(direction: FloatArray, size: float, model: MeasurementModel) -> Combination:
    changes = direction * model.units
    order = np.argsort(-np.abs(direction))
    order = order[np.abs(direction[order]) > MIN_PART * np.abs(direction[order[0]])]
    largest = dict.fromkeys(SCALES, 0.0)
    for n in order:
        unit = model.si_units[n]
        largest[unit] = max(largest[unit], abs(changes[n]))
    scale = radians(1.0) / largest['rad'] if largest['rad'] else 1e-3 / (largest['m'] or 1.0)
    scale = np.sign(direction[order[0]]) * scale
    parts = tuple((model.names[n], float(changes[n] * scale)) for n in order)
    return Combination(parts, np.inf if size == 0.0 else float(1.0 / (size * abs(scale))))


def further_measurements(
    model: MeasurementModel,
    values: FloatArray,
    measured: Sequence[tuple[MeasuredSeries, float]],
    current: Observability,
) -> list[Suggestion]:
    """
    Return the further measurements that help, the best first: one more beside the measured.

    `measured` are the series with their noise [m, rad].
    """

    def derivatives(series: MeasuredSeries, noise: float) -> FloatArray:
        """Return the whitened derivatives by parameters in units."""
        few = subset(series, SUGGESTION_SAMPLES)
        jacobian = model.predict(few, values).jacobian.reshape(-1, len(values))
        share = len(few.times) / len(series.times)
        whitened = jacobian * model.units / (noise * share**0.5)
        finite: FloatArray = whitened[np.isfinite(whitened).all(axis=1)]
        return finite

    names = {*moving_points(model.linkage), *model.linkage.structure.angles[1:]}
    stretches = []
    for series, noise in measured:
        stretches.append(derivatives(series, noise))
        names.discard(series.name)
    jacobian = np.concatenate(stretches)
    pattern, noise = min(measured, key=lambda pair: (pair[0].kind != 'point', pair[1]))
    candidates = {}
    for name in names:
        kind = kind_of(model.linkage, name)
        further = replace(pattern, kind=kind, name=name)
        added_rows = derivatives(further, ENCODER_NOISE if kind == 'angle' else noise)
        candidates[f'{kind} {name}'] = np.concatenate([jacobian, added_rows])
    if CAMERA[0] in model.names:
        columns = [n for n, name in enumerate(model.names) if name not in CAMERA]
        candidates["the camera's pose"] = jacobian[:, columns]
    suggestions = []
    for name, extended in candidates.items():
        resolves = np.linalg.svd(extended, compute_uv=False)[-1] > 1.0 / MAX_ERROR
        condition = condition_number(extended)
        if resolves and (current.combinations or condition < 0.8 * current.condition):
            suggestions.append(Suggestion(name, condition))
    return sorted(suggestions, key=lambda suggestion: (suggestion.condition, suggestion.name))
