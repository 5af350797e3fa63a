"""
Maximum likelihood of a leg's dimensions by its measurements: scipy's `least_squares`.

Residuals are divided by their standard deviation and have exact derivatives. A soft loss leads
from the drawing to the leg as built, whatever a few outliers say. Samples beyond OUTLIER_GATE
standard deviations are left out then, and the rest is fitted once more without the loss, which
gives the smallest errors. Noise of the crank angle moves all numbers of a sample along the slope v
of its path: with it their covariance is S = sigma^2 + sigma_crank^2 v v^T.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import degrees, radians, sqrt
from typing import Any

from klann_ros.kinematics import assemblies, GeometryError, Linkage
from klann_ros.kinematics.angles import TURN, wrap
from klann_ros.kinematics.arrays import BoolArray, FloatArray
import numpy as np

from .measurements import Kind, MeasurementError, Series, subset
from .model import CAMERA, DELAY, MeasurementModel, PHASE, Prediction, seen_from
from .observability import (
    condition_number,
    MAX_ERROR,
    Observability,
    observability,
    ROUNDING,
    Suggestion,
    suggestions,
)

# Standard deviations beyond which a sample is an outlier; samples that a fit needs at least.
OUTLIER_GATE, MIN_SAMPLES = 5.0, 20
# Stretches of a run whose scores are compared, and the largest ratio that is chance.
BLOCKS, MAX_CHANCE = 40, 1.4
# Samples of each series in the robust fit.
ROBUST_SAMPLES = 200
# Standard deviation of the weak prior that holds what the measurements leave open [units].
WEAK_PRIOR = 100.0
MAX_ROUNDS = 6
# Samples and start angles of the search for the encoder's zero.
SEARCH_SAMPLES, SEARCH_ANGLES = 120, 48
# The crank must turn by this at least [rad].
MIN_CRANK_RANGE = 0.1
# Ratio of a path's measured and drawn size beyond which its unit is wrong.
MAX_SIZE_RATIO = 10.0
# A leg that fits worse than this part of the path's size is another one.
MAX_MISFIT = 0.03
# Corrections beyond which it is another one as well [units].
MAX_CORRECTIONS = {'m': 100.0, 'rad': 30.0}
# A median residual from the MAD of a normal distribution.
MAD_FACTOR = 1.4826
# Noise of an encoder that would be added [rad].
SUGGESTED_ANGLE_NOISE = radians(0.05)
# Gain of chi2 from which on residuals show a delay.
MIN_DELAY_CHI2 = 30.0
# Share of samples in the other direction from which on backlash is estimated.
MIN_REVERSE_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class SeriesFit:
    """
    The residuals of a series.

    Attributes
    ----------
    series : Series
        The measurements.
    before, after : numpy.ndarray, shape (n, k)
        Predicted less measured numbers of the leg as drawn, and as calibrated [m, rad].
    inliers : numpy.ndarray of bool, shape (n,)
        The samples that were used.
    noise : float
        Standard deviation of their residuals [m, rad].

    """

    series: Series
    before: FloatArray
    after: FloatArray
    inliers: BoolArray
    noise: float


@dataclass(frozen=True, eq=False)
class Calibration:
    """
    The leg as it was built.

    Attributes
    ----------
    drawn, linkage : Linkage
        The leg as drawn, and with the calibrated dimensions.
    model : MeasurementModel
        The parameters: dimensions, encoder zero, and optional ones.
    values, standard_errors : numpy.ndarray, shape (number of parameters,)
        Their values and standard errors [m, rad, s]; NaN errors of parameters that belong to an
        unobservable combination.
    covariance : numpy.ndarray
        Of the parameters, in their units.
    observability : Observability
        What the measurements tell apart.
    series : tuple of SeriesFit
        The residuals.
    crank_noise : float
        Standard deviation of the crank angle [rad]; 0 if it does not show.
    chi2_dof : float or None
        Sum of squared residuals over the stated noise, per degree of freedom; None if the noise
        of a series is unknown and estimated from its residuals.
    late : float
        Delay of the measurements that the residuals show, if it was taken to be 0 [s]; 0 for none.
    prior : bool
        Whether a prior fixed what the measurements leave open.

    """

    drawn: Linkage
    linkage: Linkage
    model: MeasurementModel
    values: FloatArray
    standard_errors: FloatArray
    covariance: FloatArray
    observability: Observability
    series: tuple[SeriesFit, ...]
    crank_noise: float
    chi2_dof: float | None
    late: float
    prior: bool

    @property
    def phase(self) -> float:
        """Return the crank angle at joint position 0, in (-pi, pi] [rad]."""
        return wrap(self.model.value(self.values, PHASE))

    @cached_property
    def correlation(self) -> FloatArray:
        """Return the correlation of the parameters; NaN for unobservable ones."""
        deviation = self.standard_errors / self.model.units
        with np.errstate(invalid='ignore', divide='ignore'):
            found: FloatArray = self.covariance / np.outer(deviation, deviation)
        return found

    @property
    def is_complete(self) -> bool:
        """Return whether every parameter has a number."""
        return bool(np.isfinite(self.standard_errors).all())

    def dimension(self, name: str) -> tuple[float, float]:
        """Return the value and the standard error of a parameter [m, rad, s]."""
        place = self.model.names.index(name)
        return float(self.values[place]), float(self.standard_errors[place])


def calibrate(
    linkage: Linkage,
    measured: Sequence[Series],
    *,
    direction: int = 1,
    phase: float = 0.0,
    camera: bool = False,
    delay: bool = False,
    prior: float | Mapping[str, float] | None = None,
    crank_noise: float | None = None,
) -> Calibration:
    """
    Return the dimensions of a leg by measured points, angles and distances.

    Parameters
    ----------
    linkage : Linkage
        The leg as drawn.
    measured : sequence of Series
        The measurements.
    direction : int
        +1, or -1 for a crank that turns opposite to its joint.
    phase : float
        Its crank angle at joint position 0, a guess of any quality [rad].
    camera : bool
        Whether the pose of the camera in the leg's plane is unknown.
    delay : bool
        Whether the clock of the measurements is offset from the crank's by an unknown time.
    prior : float or mapping of str to float, optional
        Standard deviations of the dimensions about the drawing [m, rad]: one of all lengths and
        coordinates (a workshop's tolerance; bends get the angle of it over 30 mm), or by name.
    crank_noise : float, optional
        Standard deviation of the crank angle [rad]; estimated if left out.

    Raises
    ------
    MeasurementError
        The measurements are too few, or are not those of this leg; the text says why.

    References
    ----------
    A. Nahvi, J. M. Hollerbach, The noise amplification index for optimal pose selection in robot
    calibration, ICRA 1996.

    """
    _check_samples(measured)
    signs = np.concatenate([np.sign(s.rate) for s in measured])
    reverse = min(np.mean(signs > 0.0), np.mean(signs < 0.0)) > MIN_REVERSE_SHARE
    options = {'camera': camera, 'delay': delay, 'backlash': bool(reverse)}
    model = MeasurementModel(linkage, direction=direction, phase=phase, **options)
    _check_sizes(model, measured)
    start = _start(model, measured)
    problem = _Problem(model, measured, _deviations(model, prior), crank_noise)
    fit = problem.solve(start)
    if problem.misfit(fit) > MAX_MISFIT:
        _explain_misfit(model, measured, problem.misfit(fit), options)
    found = problem.result(fit, prior=prior is not None)
    _check_corrections(found)
    return found


def _check_samples(measured: Sequence[Series]) -> None:
    if not measured:
        raise MeasurementError('nothing was measured: name a point and its topic')
    for series in measured:
        if len(series.times) < MIN_SAMPLES:
            raise MeasurementError(
                f'{series.title}: {len(series.times)} samples have a crank angle at their stamp, '
                f'{series.skipped} have none; at least {MIN_SAMPLES} are needed (are both stamped '
                f'by the same clock?)'
            )
    crank = np.concatenate([series.crank for series in measured])
    if np.ptp(crank) < MIN_CRANK_RANGE:
        turned = degrees(float(np.ptp(crank)))
        raise MeasurementError(f'the crank turns by {turned:.2g} deg only: turn it fully')


def _check_sizes(model: MeasurementModel, measured: Sequence[Series]) -> None:
    """Refuse measurements of a size that is no error: millimetres, or another thing."""
    for series in measured:
        own = model.values(series, model.start)
        if series.kind == 'angle' or not np.isfinite(own).any():
            continue
        drawn, seen = (
            float(np.sqrt(np.nanmedian((v - np.nanmedian(v, axis=0)) ** 2, axis=0).sum()))
            for v in (own, series.values)
        )
        drawn = max(drawn, 0.01 * model.linkage.size)
        if seen > MAX_SIZE_RATIO * drawn or seen < 0.01 * drawn:
            hint = ': is it in millimetres? Points must be in metres' if seen > drawn else ''
            raise MeasurementError(
                f'{series.title} moves by {seen:.3g} m, on the drawing by {drawn:.3g} m{hint}'
            )


def _check_corrections(found: Calibration) -> None:
    """Refuse dimensions that nobody builds: another point was measured."""
    model = found.model
    for n, d in enumerate(model.linkage.structure.dimensions):
        change, limit = found.values[n] - model.start[n], MAX_CORRECTIONS[d.unit] * model.units[n]
        if abs(change) > limit and np.isfinite(found.standard_errors[n]):
            names = ', '.join(f'{s.series.title} ({s.series.source})' for s in found.series)
            raise MeasurementError(
                f'the measurements fit only a leg with {d.name} = {found.values[n]:.4g} {d.unit}, '
                f'drawn {model.start[n]:.4g}: check the points and their topics: {names}'
            )


def _deviations(model: MeasurementModel, prior: float | Mapping[str, float] | None) -> FloatArray:
    """Return the prior's standard deviations in units; WEAK_PRIOR where there is none."""
    found: FloatArray = np.full(len(model.names), WEAK_PRIOR)
    if prior is None:
        return found
    dimensions = model.linkage.structure.dimensions
    if isinstance(prior, Mapping):
        for name, value in prior.items():
            if name not in model.names:
                known = ', '.join(model.names)
                raise MeasurementError(f'the prior of {name}: there are {known}')
            found[model.names.index(name)] = value
    else:
        for n, d in enumerate(dimensions):
            found[n] = prior if d.unit == 'm' else prior / BEND_LENGTH
    stated = found != WEAK_PRIOR
    return np.where(stated, found / model.units, found)


# Length over which a tolerance makes an error of a bend [m].
BEND_LENGTH = 0.03


def _start(model: MeasurementModel, measured: Sequence[Series]) -> FloatArray:
    """Return the drawing's parameters with the encoder's zero, and the camera, that fit best."""
    turned = np.linspace(0.0, TURN, SEARCH_ANGLES, endpoint=False)
    few = [subset(series, SEARCH_SAMPLES) for series in measured]
    # Row by row the values at each zero; the first is the file's.
    tables = []
    for series in few:
        crank = (series.crank + model.direction * turned[:, None]).ravel()
        values = model.values(replace(series, crank=crank, rate=0.0 * crank), model.start)
        tables.append(values.reshape(len(turned), *series.values.shape))
    misfits, starts = [], []
    for n, turn in enumerate(turned):
        start = with_camera(model, few, [table[n] for table in tables])
        start[model.names.index(PHASE)] += turn
        rows = [
            _seen(model, series, table[n], start)
            for series, table in zip(few, tables, strict=True)
        ]
        misfits.append(_median_misfit(model, few, rows))
        starts.append(start)
    best = int(np.argmin(misfits))
    if misfits[best] == np.inf:
        raise MeasurementError('the leg as drawn reaches few of the measured crank angles')
    # The file's own zero, unless another one is clearly better.
    return starts[best if misfits[best] < 0.7 * misfits[0] else 0]


def with_camera(
    model: MeasurementModel, measured: Sequence[Series], values: Sequence[FloatArray]
) -> FloatArray:
    """Return the drawing's parameters with the camera's pose, given points in the plane."""
    found = model.start.copy()
    own = [v for s, v in zip(measured, values, strict=True) if s.kind == 'point']
    if model.has_camera and own:
        seen = [series.values for series in measured if series.kind == 'point']
        found[[model.names.index(name) for name in CAMERA]] = model.camera_pose(own, seen)
    return found


def _seen(
    model: MeasurementModel, series: Series, values: FloatArray, parameters: FloatArray
) -> FloatArray:
    if series.kind != 'point' or not model.has_camera:
        return values
    return seen_from(values, parameters[[model.names.index(name) for name in CAMERA]])


def _median_misfit(
    model: MeasurementModel, many: Sequence[Series], values: Sequence[FloatArray]
) -> float:
    """Return the median residual relative to the linkage's size; infinite if it does not move."""
    found = []
    for series, own in zip(many, values, strict=True):
        size = 1.0 if series.kind == 'angle' else model.linkage.size
        error = np.linalg.norm(model.residuals(series, own), axis=1) / size
        if np.isnan(error).mean() > 0.5:
            return np.inf
        found.append(float(np.nanmedian(error)))
    return max(found)


def _explain_misfit(
    model: MeasurementModel, measured: Sequence[Series], misfit: float, options: Mapping[str, bool]
) -> None:
    """Raise a MeasurementError that says which other leg fits, or that none does."""
    few = [subset(series, SEARCH_SAMPLES) for series in measured]
    modes = [model.linkage.assembly]
    if model.linkage.is_dyadic:
        modes += [mode for mode in assemblies(model.linkage) if mode != model.linkage.assembly]
    for mode, direction in product(modes, (model.direction, -model.direction)):
        if (mode, direction) == (modes[0], model.direction):
            continue
        linkage = model.linkage if mode == modes[0] else model.linkage.in_assembly(mode)
        phase = model.value(model.start, PHASE)
        other = MeasurementModel(linkage, direction=direction, phase=phase, **options)
        try:
            problem = _Problem(other, few, _deviations(other, None), 0.0)
            found = problem.misfit(problem.solve(_start(other, few)))
        except MeasurementError:
            continue
        if found < 0.2 * misfit:
            own, direct = f'assembly {list(mode)}', f'direction {direction}'
            what = direct if mode == modes[0] else own
            raise MeasurementError(
                f'the measurements are those of a leg with {what}: change it in the leg file'
            )
    worst = f"{100.0 * misfit:.2g} % of the leg's size"
    names = ', '.join(f'{series.title} ({series.source})' for series in measured)
    raise MeasurementError(
        f'the measurements are not those of this leg: they miss it by {worst} however its '
        f'dimensions are chosen. Check the points and their topics: {names}'
    )


@dataclass(frozen=True, eq=False)
class _Fit:
    """Parameters, predictions of each series, and the noise model they were found with."""

    y: FloatArray
    inliers: tuple[BoolArray, ...]
    sigmas: tuple[float, ...]
    crank: float


class _Problem:
    """The least-squares problem in units: y = (parameters - drawing) / units."""

    def __init__(
        self,
        model: MeasurementModel,
        measured: Sequence[Series],
        deviations: FloatArray,
        crank_noise: float | None,
    ) -> None:
        self._model, self._measured = model, tuple(measured)
        self._deviations, self._crank_noise = deviations, crank_noise
        self._known: tuple[bytes, list[Prediction]] | None = None
        times = np.concatenate([series.times for series in measured])
        self._samples = np.unique(times, return_inverse=True)[1]

    # Evaluation.

    def _parameters(self, y: FloatArray) -> FloatArray:
        found: FloatArray = self._model.start + self._model.units * y
        return found

    def _predictions(self, y: FloatArray) -> list[Prediction]:
        """Return the predictions; NaN where the leg does not exist."""
        key = y.tobytes()
        if self._known is None or self._known[0] != key:
            try:
                found = self._model.predict(self._measured, self._parameters(y))
            except GeometryError:
                found = [
                    Prediction(
                        *(np.full_like(each, np.nan) for each in (p.values, p.jacobian, p.slope))
                    )
                    for p in (self._known[1] if self._known else [])
                ]
            self._known = key, found
        return self._known[1]

    def _errors(self, y: FloatArray) -> list[FloatArray]:
        pairs = zip(self._measured, self._predictions(y), strict=True)
        return [self._model.residuals(series, own.values) for series, own in pairs]

    def _rows(self, fit: _Fit, y: FloatArray, *, jacobian: bool) -> FloatArray:
        """Return the whitened residuals of the inliers, or their derivatives by y."""
        if jacobian:
            return self._whitened(
                fit, y, [p.jacobian * self._model.units for p in self._predictions(y)]
            )
        return self._whitened(fit, y, [error[..., None] for error in self._errors(y)])

    def _whitened(self, fit: _Fit, y: FloatArray, values: Sequence[FloatArray]) -> FloatArray:
        """Return arrays of shapes (n, k, m), one a series, as rows divided by their noise."""
        rows, slopes, samples, at = [], [], [], 0
        parts = zip(values, self._predictions(y), fit.inliers, fit.sigmas, strict=True)
        for value, p, inliers, sigma in parts:
            rows.append((value[inliers] / sigma).reshape(-1, value.shape[-1]))
            slopes.append((p.slope[inliers] / sigma).ravel())
            ids = self._samples[slice(at, at + len(inliers))][inliers]
            samples.append(np.repeat(ids, value.shape[1]))
            at += len(inliers)
        whole = np.concatenate(rows)
        if fit.crank == 0.0:
            return whole
        return _decorrelated(whole, np.concatenate(slopes), np.concatenate(samples), fit.crank)

    def solve(self, start: FloatArray) -> _Fit:
        """Return the fit from start parameters [m, rad, s]."""
        y: FloatArray = (start - self._model.start) / self._model.units
        every = tuple(np.ones(len(series.times), dtype=np.bool_) for series in self._measured)
        fit = _Fit(y, every, (1.0,) * len(every), 0.0)
        few = [subset(series, ROBUST_SAMPLES) for series in self._measured]
        coarse = _Problem(self._model, few, self._deviations, 0.0)
        fit = replace(fit, y=coarse.robust(y))
        for _ in range(MAX_ROUNDS):
            fit = self._scaled(fit, robust=True)
            inliers = tuple(
                np.abs(e).max(axis=1) < OUTLIER_GATE * sqrt(s * s + self._drift(fit, n))
                for n, (e, s) in enumerate(zip(self._errors(fit.y), fit.sigmas, strict=True))
            )
            same = all(map(np.array_equal, inliers, fit.inliers))
            fit = self._scaled(replace(fit, inliers=inliers), robust=False)
            fit = self._minimized(fit, loss='linear')
            if same:
                break
        return self._scaled(fit, robust=False)

    def robust(self, y: FloatArray) -> FloatArray:
        """Return the parameters of a fit with a soft loss."""
        inliers = tuple(_finite_rows(error) for error in self._errors(y))
        fit = _Fit(y, inliers, (1.0,) * len(inliers), 0.0)
        for _ in range(2):
            fit = self._minimized(self._scaled(fit, robust=True), loss='soft_l1')
        return fit.y

    def _drift(self, fit: _Fit, n: int) -> float:
        """Return the variance that the crank's noise adds to a series, at most."""
        slope = self._predictions(fit.y)[n].slope
        return float(fit.crank**2 * np.nanmax(slope**2, initial=0.0))

    def _minimized(self, fit: _Fit, *, loss: str) -> _Fit:
        from scipy.optimize import least_squares  # noqa: PLC0415 - an extra, and slow to import

        def residuals(y: FloatArray) -> FloatArray:
            rows = self._rows(fit, y, jacobian=False)[:, 0]
            # Beyond the reach of the leg; the step is rejected.
            return np.concatenate([np.nan_to_num(rows, nan=1e6), y / self._deviations])

        def jacobian(y: FloatArray) -> FloatArray:
            rows = np.nan_to_num(self._rows(fit, y, jacobian=True))
            return np.vstack([rows, np.diag(1.0 / self._deviations)])

        # MINPACK is the fastest, and has no loss.
        method, tolerance = ('lm', 1e-9) if loss == 'linear' else ('trf', 1e-4)
        found = least_squares(
            residuals,
            fit.y,
            jacobian,
            method=method,
            loss=loss,
            xtol=tolerance,
            ftol=tolerance,
            gtol=tolerance,
            max_nfev=60,
        )
        return replace(fit, y=found.x)

    def _scaled(self, fit: _Fit, *, robust: bool) -> _Fit:
        """Return the fit with the noise of its residuals: stated, or estimated."""
        sigmas, squares, slopes = [], [], []
        for series, error, p, inliers in zip(
            self._measured, self._errors(fit.y), self._predictions(fit.y), fit.inliers, strict=True
        ):
            own, slope = error[inliers], p.slope[inliers]
            if not own.size:
                raise MeasurementError(f'{series.title} does not fit the leg at any sample')
            rms = (
                MAD_FACTOR * float(np.median(np.abs(own)))
                if robust
                else float(np.sqrt(np.mean(own**2)))
            )
            sigmas.append(max(rms, 1e-9))
            squares.append((own**2).ravel())
            slopes.append((slope**2).ravel())
        crank = self._crank_noise or 0.0
        if not robust:
            if self._crank_noise is None:
                crank = _crank_noise(squares, slopes, sigmas)
            for n, series in enumerate(self._measured):
                without = squares[n] - crank**2 * slopes[n]
                sigmas[n] = series.noise or sqrt(
                    max(float(without.mean()), 1e-18, 0.01 * sigmas[n] ** 2)
                )
        return replace(fit, sigmas=tuple(sigmas), crank=crank)

    # Results.

    def misfit(self, fit: _Fit) -> float:
        """Return the largest median residual of all samples, relative to the leg's size."""
        values = [own.values for own in self._predictions(fit.y)]
        return _median_misfit(self._model, self._measured, values)

    def _late(self, fit: _Fit, rows: FloatArray, jacobian: FloatArray) -> float:
        """Return the delay that explains the residuals, if none was asked for; 0 for none."""
        if DELAY in self._model.names:
            return 0.0
        parts = zip(self._measured, self._predictions(fit.y), strict=True)
        moved = [self._model.direction * p.slope * s.rate[:, None] for s, p in parts]
        column = self._whitened(fit, fit.y, [each[..., None] for each in moved])[:, 0]
        # What the parameters do not explain of it.
        own = column - jacobian @ np.linalg.lstsq(jacobian, column, rcond=None)[0]
        square = float(own @ own)
        found = -float(own @ rows) / square if square > 1e-6 * float(column @ column) else 0.0
        return found if found**2 * square > MIN_DELAY_CHI2 else 0.0

    def result(self, fit: _Fit, *, prior: bool) -> Calibration:
        """Return the calibration."""
        model = self._model
        rows, jacobian = (
            self._rows(fit, fit.y, jacobian=False),
            self._rows(fit, fit.y, jacobian=True),
        )
        free = max(1, len(rows) - len(model.names))
        chi2 = float((rows**2).sum()) / free
        triangle: Any = np.linalg.qr(jacobian, mode='r')
        # Residuals beyond the stated noise, and those that are alike from sample to sample, make
        # larger errors.
        whole, jacobian = (
            jacobian,
            triangle / sqrt(max(1.0, chi2) * _inflation(rows[:, 0] / sqrt(chi2), jacobian)),
        )
        told = observability(jacobian, model)
        if prior:
            information = jacobian.T @ jacobian + np.diag(self._deviations**-2)
            covariance: FloatArray = np.linalg.inv(information).astype(np.float64)
            errors = np.sqrt(np.diag(covariance))
        else:
            covariance = told.covariance
            errors = np.where(told.unobservable, np.nan, np.sqrt(np.diag(covariance)))
        parameters = self._parameters(fit.y)
        stated = all(series.noise for series in self._measured)
        drawn = [model.values(series, model.start) for series in self._measured]
        start = with_camera(model, self._measured, drawn)
        before = [_seen(model, s, v, start) for s, v in zip(self._measured, drawn, strict=True)]
        parts = zip(self._measured, before, self._errors(fit.y), fit.inliers, strict=True)
        series = tuple(
            SeriesFit(
                s, model.residuals(s, b), a, inliers, float(np.sqrt(np.mean(a[inliers] ** 2)))
            )
            for s, b, a, inliers in parts
        )
        return Calibration(
            drawn=model.linkage,
            linkage=model.varied(parameters),
            model=model,
            values=parameters,
            standard_errors=errors * model.units,
            covariance=covariance,
            observability=told,
            series=series,
            crank_noise=fit.crank,
            chi2_dof=chi2 if stated else None,
            late=self._late(fit, rows[:, 0], whole),
            prior=prior,
        )


def further_measurements(calibration: Calibration) -> list[Suggestion]:
    """Return the further measurements that would help, the best first: one more each."""
    model, values = calibration.model, calibration.values
    measured = [fit.series for fit in calibration.series]
    noise = min(
        (fit.noise for fit in calibration.series if fit.series.kind == 'point'), default=1e-4
    )
    scales = {'point': noise, 'distance': noise, 'angle': SUGGESTED_ANGLE_NOISE}

    def rows(series: Series, sigma: float) -> FloatArray:
        few = subset(series, SEARCH_SAMPLES)
        (own,) = model.predict([few], values)
        found = own.jacobian.reshape(-1, len(model.names)) * model.units / sigma
        more: FloatArray = found[np.isfinite(found).all(axis=1)] * sqrt(
            len(series.times) / len(few.times)
        )
        return more

    known = np.concatenate([rows(fit.series, fit.noise) for fit in calibration.series])
    structure, names = model.linkage.structure, {series.name for series in measured}
    moving = [point for point in structure.points if point not in structure.pivots]
    base = max(measured, key=lambda series: len(series.times))
    kinds: tuple[tuple[Kind, Sequence[str]], ...]
    kinds = (('point', moving), ('angle', structure.angles[1:]))
    candidates: list[tuple[str, FloatArray]] = [
        (
            f'{kind} {name}',
            np.concatenate([known, rows(replace(base, kind=kind, name=name), scales[kind])]),
        )
        for kind, every in kinds
        for name in every
        if name not in names
    ]
    if model.has_camera:
        columns = [n for n, name in enumerate(model.names) if name not in CAMERA]
        candidates.append(("the camera's pose", known[:, columns]))
    found = []
    for name, jacobian in candidates:
        sizes = np.linalg.svd(jacobian, compute_uv=False)
        resolves = bool(sizes[-1] > 1.0 / MAX_ERROR)
        found.append(
            Suggestion(name, condition_number(jacobian) if resolves else np.inf, resolves)
        )
    return suggestions(found, calibration.observability)


def _inflation(rows: FloatArray, jacobian: FloatArray) -> float:
    """
    Return the factor by which residuals that are correlated in time enlarge the covariance.

    The scores of BLOCKS stretches of the run have the covariance J^T J if residuals are
    independent, and a larger one if they are not; 1 within what chance does.
    """
    scores = [
        j.T @ r
        for j, r in zip(*(np.array_split(each, BLOCKS) for each in (jacobian, rows)), strict=True)
    ]
    _, sizes, axes = np.linalg.svd(np.linalg.qr(jacobian, mode='r'))
    seen = sizes > ROUNDING * sizes[0]
    whitened = (axes[seen] / sizes[seen][:, None]) @ np.transpose(scores)
    factor = float((whitened**2).sum()) / int(seen.sum())
    return factor if factor > MAX_CHANCE else 1.0


def _finite_rows(values: FloatArray) -> BoolArray:
    found: BoolArray = np.asarray(np.isfinite(values).all(axis=1))
    return found


def _decorrelated(rows: FloatArray, slopes: FloatArray, samples: Any, crank: float) -> FloatArray:
    """
    Return rows times S^(-1/2) with S = 1 + crank^2 v v^T of each sample.

    With n = |v| that is 1 - c v v^T / n^2, c = 1 - 1 / sqrt(1 + crank^2 n^2).
    """
    squares = np.bincount(samples, slopes**2)[samples]
    factor = 1.0 - 1.0 / np.sqrt(1.0 + crank**2 * squares)
    along = slopes[:, None] * rows
    summed = np.stack([np.bincount(samples, column) for column in along.T], axis=1)[samples]
    with np.errstate(invalid='ignore'):
        share = np.where(squares > 0.0, factor / squares, 0.0) * slopes
    found: FloatArray = rows - share[:, None] * summed
    return found


def _crank_noise(
    squares: Sequence[FloatArray], slopes: Sequence[FloatArray], sigmas: Sequence[float]
) -> float:
    """
    Return the crank's standard deviation by the excess of residuals where the path is fast.

    A line through squared residuals over squared slopes: significant only if its slope is 4 times
    its standard error.
    """
    total = weight = 0.0
    for square, slope, sigma in zip(squares, slopes, sigmas, strict=True):
        centred = slope - slope.mean()
        # The variance of a squared normal number is 2 sigma^4.
        total += float(centred @ square) / (2.0 * sigma**4)
        weight += float(centred @ centred) / (2.0 * sigma**4)
    if weight <= 0.0 or total < 4.0 * sqrt(weight):
        return 0.0
    return sqrt(total / weight)
