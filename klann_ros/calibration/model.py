"""
The measurement model: predicted measurements, and their derivatives by all parameters.

Parameters are the dimensions of the linkage, the zero of its encoder (`phase`), and on request the
camera's pose in the leg's plane, the delay of the measurements and the backlash of the crank:

    alpha = s (crank + rate delay + sign(rate) backlash / 2) + phase,    s = +-1 (direction)
    point = R(rotation) p(alpha; dimensions) + (x, y).

Every parameter has a unit, the error that a workshop makes: 1/1000 of the longest bar, or 1 deg.
"""

from collections.abc import Sequence
from math import cos, radians, sin
from typing import Any, NamedTuple

from klann_ros.kinematics import Linkage, linkage_poses
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.batch.poses import wrapped
from klann_ros.kinematics.linkage.dimension_derivatives import pivot_derivatives
import numpy as np

from .measurements import MeasuredSeries

PHASE, DELAY, BACKLASH = 'phase', 'delay', 'backlash'
CAMERA = ('camera x', 'camera y', 'camera rotation')
# Units of parameters: of lengths relative to the linkage's size.
LENGTH_UNIT, ANGLE_UNIT, DELAY_UNIT = 1e-3, radians(1.0), 0.01


class Prediction(NamedTuple):
    """Predicted numbers of a series, and their derivatives."""

    # Shape (n, k), with k numbers a sample.
    values: FloatArray
    # By the crank angle, shape (n, k).
    slope: FloatArray
    # By the parameters, or by the dimensions alone, shape (n, k, number of these).
    jacobian: FloatArray


class MeasurementModel:
    """
    Predicts the measurements of a leg.

    Parameters
    ----------
    linkage : Linkage
        The leg as drawn.
    direction : int
        +1, or -1 for a crank that turns opposite to its joint.
    phase : float
        Its crank angle at joint position 0 [rad].
    camera, delay, backlash : bool
        Which optional parameters there are.

    """

    def __init__(
        self,
        linkage: Linkage,
        *,
        direction: int = 1,
        phase: float = 0.0,
        camera: bool = False,
        delay: bool = False,
        backlash: bool = False,
    ) -> None:
        self.linkage, self.direction, self.has_camera = linkage, direction, camera
        dimensions = linkage.structure.dimensions
        length = LENGTH_UNIT * linkage.size
        optional = [*(CAMERA if camera else ()), *[DELAY] * delay, *[BACKLASH] * backlash]
        units = {DELAY: DELAY_UNIT, 'camera x': length, 'camera y': length}
        self.names = (*linkage.dimensions, PHASE, *optional)
        self.units: FloatArray = np.array(
            [
                *(length if d.unit == 'm' else ANGLE_UNIT for d in dimensions),
                *(units.get(name, ANGLE_UNIT) for name in (PHASE, *optional)),
            ]
        )
        self.start: FloatArray = np.array([*linkage.numbers, phase, *[0.0] * len(optional)])
        self.count = len(dimensions)
        # The linkage with each measured point as its foot; structures are compiled once.
        self._feet: dict[str, Linkage] = {linkage.structure.foot: linkage}

    def unit_name(self, place: int) -> str:
        """Return the SI unit of a parameter: 'm', 'rad' or 's'."""
        if place < self.count:
            return self.linkage.structure.dimensions[place].unit
        name = self.names[place]
        return 's' if name == DELAY else 'm' if name in CAMERA[:2] else 'rad'

    def value(self, parameters: FloatArray, name: str) -> float:
        """Return a parameter by its name; 0 for one that there is not."""
        return float(parameters[self.names.index(name)]) if name in self.names else 0.0

    def varied(self, parameters: FloatArray, foot: str = '') -> Linkage:
        """Return the linkage with the dimensions of parameters; a GeometryError if it is none."""
        foot = foot or self.linkage.structure.foot
        if foot not in self._feet:
            self._feet[foot] = self.linkage.with_foot(foot)
        numbers = parameters[: self.count].tolist()
        return self._feet[foot].varied(dict(zip(self.linkage.dimensions, numbers, strict=True)))

    def crank_angles(self, series: MeasuredSeries, parameters: FloatArray) -> FloatArray:
        """Return the crank angles of a series, shape (n,) [rad]."""
        delay, backlash = (self.value(parameters, name) for name in (DELAY, BACKLASH))
        joint = series.crank + series.rate * delay + np.sign(series.rate) * backlash / 2.0
        found: FloatArray = self.direction * joint + self.value(parameters, PHASE)
        return found

    def predict(self, series: MeasuredSeries, parameters: FloatArray) -> Prediction:
        """Return the prediction of a series; NaN at crank angles out of reach."""
        values, slope, dimensions = self._motion(series, parameters)
        jacobian = np.zeros((*values.shape, len(self.names)))
        jacobian[..., : self.count] = dimensions
        if series.kind == 'point' and self.has_camera:
            values, slope = self._seen(values, slope, jacobian, parameters)
        by_alpha = {
            PHASE: np.ones(len(values)),
            DELAY: self.direction * series.rate,
            BACKLASH: self.direction * np.sign(series.rate) / 2.0,
        }
        for name, factor in by_alpha.items():
            if name in self.names:
                jacobian[..., self.names.index(name)] = slope * factor[:, None]
        return Prediction(values, slope, jacobian)

    def values(self, series: MeasuredSeries, parameters: FloatArray) -> FloatArray:
        """Return the predicted numbers of a series as a known camera sees them, shape (n, k)."""
        return self._motion(series, parameters).values

    def _motion(self, series: MeasuredSeries, parameters: FloatArray) -> Prediction:
        """Return the prediction for a known camera, with derivatives by the dimensions."""
        alphas = self.crank_angles(series, parameters)
        if series.kind == 'point':
            return self._point(series.name, alphas, parameters)
        if series.kind == 'angle':
            j = self.linkage.structure.angles.index(series.name)
            poses: Any = linkage_poses(
                self.varied(parameters), alphas, angles=True, velocities=True, gradients=True
            )
            found = poses.angles, poses.angles_1, poses.angles_gradient
            return Prediction(*(each[:, slice(j - 1, j)] for each in found))
        ends = (self._point(name, alphas, parameters) for name in series.name.split('-'))
        apart, slope, gradient = (q - p for p, q in zip(*ends, strict=True))
        distance = np.linalg.norm(apart, axis=1, keepdims=True)
        unit = apart / distance
        along = np.einsum('ni,nip->np', unit, gradient)[:, None]
        return Prediction(distance, (unit * slope).sum(axis=1, keepdims=True), along)

    def _point(self, name: str, alphas: FloatArray, parameters: FloatArray) -> Prediction:
        structure, count = self.linkage.structure, len(alphas)
        if name not in structure.pivots:
            own = self.varied(parameters, name)
            poses: Any = linkage_poses(own, alphas, velocities=True, gradients=True)
            return Prediction(poses.h, poses.h_1, poses.h_gradient)
        place = structure.pivots.index(name)
        moved = [pivot_derivatives(structure, d)[place] for d in structure.dimensions]
        fixed = np.array([self.varied(parameters).pivots[place], *moved])
        plane = np.broadcast_to([fixed.real, fixed.imag], (count, 2, len(fixed)))
        return Prediction(plane[..., 0], np.zeros((count, 2)), plane[..., 1:])

    def _seen(
        self, values: FloatArray, slope: FloatArray, jacobian: FloatArray, parameters: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return points and slopes as the camera sees them; complete the Jacobian."""
        places = [self.names.index(name) for name in CAMERA]
        x, y, angle = parameters[places]
        c, s = cos(angle), sin(angle)
        rotation = np.array([[c, -s], [s, c]])
        jacobian[...] = np.einsum('ij,njp->nip', rotation, jacobian)
        jacobian[:, 0, places[0]] = jacobian[:, 1, places[1]] = 1.0
        jacobian[..., places[2]] = values @ np.array([[-s, -c], [c, -s]]).T
        return values @ rotation.T + (x, y), slope @ rotation.T

    def residuals(self, series: MeasuredSeries, predicted: FloatArray) -> FloatArray:
        """Return predicted less measured numbers, shape (..., n, k); angles modulo a turn."""
        difference: FloatArray = predicted - series.values
        return wrapped(difference) if series.kind == 'angle' else difference

    def variant(self, linkage: Linkage, direction: int) -> 'MeasurementModel':
        """Return the model of another linkage or direction, with the same parameters."""
        optional = (name in self.names for name in (CAMERA[0], DELAY, BACKLASH))
        phase = self.value(self.start, PHASE)
        options = dict(zip(('camera', 'delay', 'backlash'), optional, strict=True))
        return MeasurementModel(linkage, direction=direction, phase=phase, **options)

    def with_camera(
        self, measured: Sequence[MeasuredSeries], values: Sequence[FloatArray]
    ) -> tuple[FloatArray, list[FloatArray]]:
        """Return the drawing's parameters with the camera that fits best, and what it sees."""
        start, seen = self.start.copy(), list(values)
        points = [n for n, series in enumerate(measured) if series.kind == 'point']
        if not (self.has_camera and points):
            return start, seen
        p, q = (
            np.concatenate([each[n] for n in points]) @ (1.0, 1j)
            for each in (values, [series.values for series in measured])
        )
        good = np.isfinite(p)
        p, q = p[good], q[good]
        turn = np.vdot(p - p.mean(), q - q.mean())
        turn = turn / (abs(turn) or 1.0)
        shift = q.mean() - turn * p.mean()
        places = [self.names.index(name) for name in CAMERA]
        start[places] = shift.real, shift.imag, np.angle(turn)
        for n in points:
            at = values[n] @ (1.0, 1j) * turn + shift
            seen[n] = np.stack([at.real, at.imag], axis=-1)
        return start, seen
