"""
The measurement model: predicted measurements, and their derivatives by all parameters.

Parameters are the dimensions of the linkage, the zero of its encoder (`phase`), and on request the
camera, the delay of the measurements and the backlash of the crank:

    alpha = s (crank(t + delay) + sign(rate) backlash / 2) + phase,    s = +-1 (direction)
    point = (x, y) + scale R(rotation) S p(alpha; dimensions) / (1 + k p),

with the symmetric S = [[1 + stretch, shear], [shear, 1 - stretch]] and the keystone k of a camera
that is tilted: these are all maps of a plane by a pinhole. Without an encoder alpha is the angle
of a tracked point of the crank, and there is no phase. Every parameter has a unit, the error that
a workshop makes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import cos, degrees, radians, sin
from typing import Any, NamedTuple

from klann_ros.kinematics import Linkage, linkage_poses, wrapped
from klann_ros.kinematics.arrays import FloatArray, plane_vectors
import numpy as np

from .measurements import MeasuredSeries

PHASE, DELAY, BACKLASH = 'phase', 'delay', 'backlash'
CAMERA = ('camera x', 'camera y', 'camera rotation')
CAMERA_SCALE = 'camera scale'
TILT = ('camera stretch', 'camera shear', 'camera keystone x', 'camera keystone y')
# The unknown parameters of each sort of camera.
CAMERAS = {
    'known': (),
    'unknown': CAMERA,
    'scale': (*CAMERA, CAMERA_SCALE),
    'tilt': (*CAMERA, CAMERA_SCALE, *TILT),
}
# Factors and units of numbers for people.
SCALES = {
    'm': (1e3, 'mm'),
    'rad': (degrees(1.0), 'deg'),
    's': (1e3, 'ms'),
    '1': (1e2, '%'),
    '1/m': (1e2, '%/m'),
}
SI_UNITS = {
    'camera x': 'm',
    'camera y': 'm',
    DELAY: 's',
    CAMERA_SCALE: '1',
    **dict(zip(TILT, ('1', '1', '1/m', '1/m'), strict=True)),
}
# A workshop's errors: of lengths and keystones relative to the linkage's size, of angles [rad], of
# clocks [s].
TYPICAL_ERRORS = {'m': 1e-3, 'rad': radians(1.0), 's': 0.01, '1': 0.01, '1/m': 0.01}


class Prediction(NamedTuple):
    """Predicted numbers of a series, and their derivatives."""

    values: FloatArray  # shape (n, k), with k numbers a sample
    slope: FloatArray  # derivatives by the crank angle, shape (n, k)
    # Derivatives by the parameters, or by the dimensions alone, shape (n, k, number of these).
    jacobian: FloatArray


@dataclass(frozen=True, eq=False)
class MeasurementModel:
    """
    Predicts the measurements of a leg as drawn.

    `direction` is -1 for a crank that turns opposite to its joint, `phase` its crank angle at
    joint position 0 [rad], a parameter if it has an encoder; optional parameters are those of the
    camera, the delay, the backlash.
    """

    linkage: Linkage
    direction: float = 1
    phase: float = 0.0
    optional: tuple[str, ...] = ()
    has_encoder: bool = True
    # The last poses: points are often measured at the same moments.
    _last: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def count(self) -> int:
        """Return the number of dimensions, which are the first parameters."""
        return len(self.linkage.numbers)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Return the names of all parameters."""
        return (*self.linkage.dimensions, *self._other_names)

    @property
    def _other_names(self) -> tuple[str, ...]:
        return (*[PHASE] * self.has_encoder, *self.optional)

    @cached_property
    def si_units(self) -> tuple[str, ...]:
        """Return the SI units of all parameters: 'm', 'rad' or 's'."""
        units = [dimension.unit for dimension in self.linkage.structure.dimensions]
        for name in self._other_names:
            units.append(SI_UNITS.get(name, 'rad'))
        return tuple(units)

    @cached_property
    def units(self) -> FloatArray:
        """Return the units of all parameters [m, rad, s]."""
        scales = {'m': self.linkage.size, '1/m': 1.0 / self.linkage.size}
        return np.array([TYPICAL_ERRORS[unit] * scales.get(unit, 1.0) for unit in self.si_units])

    @cached_property
    def start(self) -> FloatArray:
        """Return the parameters of the drawing [m, rad, s]."""
        others = map(self._usual_value, self._other_names)
        return np.array([*self.linkage.numbers, *others])

    def _usual_value(self, name: str) -> float:
        return {PHASE: self.phase, CAMERA_SCALE: 1.0}.get(name, 0.0)

    def value(self, parameters: FloatArray, name: str) -> float:
        """Return a parameter by its name; the usual value of one that there is not."""
        if name in self.names:
            return float(parameters[self.names.index(name)])
        return self._usual_value(name)

    def varied(self, parameters: FloatArray) -> Linkage:
        """Return the linkage with the dimensions of parameters; a GeometryError if it is none."""
        numbers = zip(self.linkage.dimensions, parameters[: self.count].tolist(), strict=True)
        return self.linkage.varied(dict(numbers))

    def crank_angles(self, series: MeasuredSeries, parameters: FloatArray) -> FloatArray:
        """Return the crank angles of a series, shape (n,) [rad]."""
        crank, rate = self.crank_motion(series, parameters)
        backlash = self.value(parameters, BACKLASH)
        joint = crank + np.sign(rate) * backlash / 2.0
        alphas: FloatArray = self.direction * joint + self.value(parameters, PHASE)
        # A camera that is turned sees the crank turned by the same.
        return alphas if self.has_encoder else alphas - self.value(parameters, CAMERA[2])

    def crank_motion(
        self, series: MeasuredSeries, parameters: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the crank joint's angles [rad] and rates [rad/s] at the delayed stamps."""
        delay = self.value(parameters, DELAY)
        if not delay:
            return series.crank, series.rate
        return series.encoder.motion.at(series.times + delay)

    def predict(self, series: MeasuredSeries, parameters: FloatArray) -> Prediction:
        """Return the prediction of a series; NaN at crank angles out of reach."""
        values, slope, dimensions = self.motion(series, parameters)
        jacobian = np.zeros((*values.shape, len(self.names)))
        jacobian[..., : self.count] = dimensions
        if series.kind == 'point' and CAMERA[0] in self.names:
            values, slope = self._seen(values, slope, jacobian, parameters)
        _, rate = self.crank_motion(series, parameters)
        by_alpha = {
            PHASE: np.ones(len(values)),
            DELAY: self.direction * rate,
            BACKLASH: self.direction * np.sign(rate) / 2.0,
        }
        for name in by_alpha.keys() & {*self.names}:
            jacobian[..., self.names.index(name)] = slope * by_alpha[name][:, None]
        if not self.has_encoder and CAMERA[2] in self.names:
            jacobian[..., self.names.index(CAMERA[2])] -= slope
        return Prediction(values, slope, jacobian)

    def motion(self, series: MeasuredSeries, parameters: FloatArray) -> Prediction:
        """Return the prediction in the leg's plane, with derivatives by the dimensions alone."""
        structure = self.linkage.structure
        has_angle = series.name in self.linkage.joint_names
        alphas = self.crank_angles(series, parameters)
        key = has_angle, parameters.tobytes(), alphas.tobytes()
        if key not in self._last:
            self._last.clear()
            self._last[key] = linkage_poses(
                self.varied(parameters),
                alphas,
                angles=has_angle,
                points=not has_angle,
                velocities=True,
                gradients=True,
            )
        poses = self._last[key]
        if has_angle:
            j = structure.angles.index(series.name)
            column = slice(j - 1, j)
            return Prediction(
                poses.angles[:, column],
                poses.angles_1[:, column],
                poses.angles_gradient[:, column],
            )
        first, *second = [structure.points.index(name) for name in series.name.split('-')]
        points = poses.points
        slopes = poses.points_1
        gradients = poses.points_gradient
        if not second:
            return Prediction(points[:, first], slopes[:, first], gradients[:, first])
        offset = points[:, second[0]] - points[:, first]
        slope = slopes[:, second[0]] - slopes[:, first]
        gradient = gradients[:, second[0]] - gradients[:, first]
        distance = np.linalg.norm(offset, axis=1, keepdims=True)
        unit = offset / distance
        along = np.einsum('ni,nip->np', unit, gradient)[:, None]
        return Prediction(distance, (unit * slope).sum(axis=1, keepdims=True), along)

    def _seen(
        self, points: FloatArray, slope: FloatArray, jacobian: FloatArray, parameters: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return points and slopes as the camera sees them; complete the Jacobian."""
        x, y, angle, scale, a, b, *k = [self.value(parameters, name) for name in CAMERAS['tilt']]
        c = scale * cos(angle)
        s = scale * sin(angle)
        rotation = np.array([[c, -s], [s, c]])
        affine = rotation @ [[1.0 + a, b], [b, 1.0 - a]]
        depth = 1.0 + points @ k
        seen = points @ affine.T / depth[:, None]
        by_point = (affine - seen[:, :, None] * np.array(k)) / depth[:, None, None]
        jacobian[...] = np.einsum('nij,njp->nip', by_point, jacobian)
        by_depth = -seen / depth[:, None]
        by_stretch = points * (1.0, -1.0) @ rotation.T / depth[:, None]
        by_shear = points[:, ::-1] @ rotation.T / depth[:, None]
        derivatives = {
            'camera x': np.array([1.0, 0.0]),
            'camera y': np.array([0.0, 1.0]),
            'camera rotation': seen[:, ::-1] * (-1.0, 1.0),
            CAMERA_SCALE: seen / scale,
        }
        by_tilt = (by_stretch, by_shear, by_depth * points[:, :1], by_depth * points[:, 1:])
        derivatives |= zip(TILT, by_tilt, strict=True)
        for name in derivatives.keys() & {*self.names}:
            jacobian[..., self.names.index(name)] = derivatives[name]
        return seen + np.array([x, y]), np.einsum('nij,nj->ni', by_point, slope)

    def residuals(self, series: MeasuredSeries, predicted: FloatArray) -> FloatArray:
        """Return predicted less measured numbers, shape (..., n, k); angles modulo a turn."""
        difference: FloatArray = predicted - series.values
        return wrapped(difference) if series.kind == 'angle' else difference

    def with_camera(
        self, measured: Sequence[MeasuredSeries], values: Sequence[FloatArray]
    ) -> tuple[FloatArray, list[FloatArray]]:
        """Return the drawing's parameters with the camera that fits best, and what it sees."""
        start = self.start.copy()
        seen = list(values)
        filmed = [n for n, series in enumerate(measured) if series.kind == 'point']
        if not filmed or CAMERA[0] not in self.names:
            return start, seen
        predicted = np.concatenate([values[n] for n in filmed]) @ (1.0, 1j)
        observed = np.concatenate([measured[n].values for n in filmed]) @ (1.0, 1j)
        is_reached = np.isfinite(predicted)
        predicted = predicted[is_reached]
        observed = observed[is_reached]
        rotation = np.vdot(predicted - predicted.mean(), observed - observed.mean())
        rotation = rotation / (abs(rotation) or 1.0)
        if CAMERA_SCALE in self.names:
            deviations = np.linalg.norm(predicted - predicted.mean())
            scale = float(np.linalg.norm(observed - observed.mean()) / (deviations or 1.0))
            start[self.names.index(CAMERA_SCALE)] = scale
            rotation = scale * rotation
        shift = observed.mean() - rotation * predicted.mean()
        camera_indices = list(map(self.names.index, CAMERA))
        start[camera_indices] = shift.real, shift.imag, np.angle(rotation)
        for n in filmed:
            points = values[n] @ (1.0, 1j) * rotation + shift
            seen[n] = plane_vectors(points)
        return start, seen
