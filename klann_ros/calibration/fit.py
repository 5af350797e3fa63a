"""
Maximum likelihood of a leg's dimensions by its measurements: scipy's `least_squares`.

Residuals are divided by their standard deviation and have exact derivatives. A soft loss leads
from the drawing to the leg as built, whatever a few outliers say. Samples beyond OUTLIER_GATE
standard deviations are left out then, and the rest is fitted once more without the loss, which
gives the smallest errors. It holds combinations that the measurements leave open near the drawing,
as the leg is built: far along them the derivatives are those of another leg. Noise of the crank
angle moves all numbers of a sample along the slope v of its path: with it their covariance is
S = sigma^2 + sigma_crank^2 v v^T.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from math import sqrt
from typing import Any, NamedTuple

from klann_ros.kinematics import assemblies, GeometryError, Linkage
from klann_ros.kinematics.angles import wrap
from klann_ros.kinematics.arrays import BoolArray, FloatArray
import numpy as np

from .measurements import MeasuredSeries, MeasurementError, subset
from .model import BACKLASH, CAMERA, DELAY, MeasurementModel, PHASE
from .observability import (
    further_measurements,
    Observability,
    observability,
    OPEN_ERROR,
    ROUNDING,
    Suggestion,
)
from .search import check_measurements, median_misfit, SEARCH_SAMPLES, start_parameters

# Standard deviations beyond which a sample is an outlier; of a normal distribution by its MAD.
OUTLIER_GATE, MAD_FACTOR = 5.0, 1.4826
# Standard deviations of the weak prior of all parameters [units]: of dimensions about the drawing,
# of the others about the start.
WEAK_PRIOR, WEAKEST_PRIOR = 100.0, 1000.0
# Length over which a tolerance makes an error of a bend [m].
BEND_LENGTH = 0.03
# Samples of each series at most: derivatives of a million take gigabytes.
MAX_SAMPLES = 20_000
# Samples of each series in the robust fit; rounds until the outliers stay the same.
ROBUST_SAMPLES, MAX_ROUNDS = 200, 6
# A leg that fits worse than this part of the path's size is another one, as is one with larger
# corrections [units], and one that fits better by this factor far from the drawing.
MAX_MISFIT, MAX_CORRECTIONS, MAX_HELD_MISFIT = 0.03, {'m': 100.0, 'rad': 30.0}, 3.0
# Other legs and cameras that are fitted to explain a misfit, and how well they must fit.
MAX_EXPLANATIONS, MAX_EXPLAINED_MISFIT = 4, 0.006
# Relative standard deviation of the crank's rate up to which its speed is even.
EVEN_SPEED = 0.01
# Share of the samples of a series that fit the leg, at least.
MIN_INLIERS = 0.5
# Share of samples in the other direction from which on backlash is estimated.
MIN_REVERSE_SHARE = 0.05
# Stretches of a run whose scores are compared, and the largest ratio that is chance.
BLOCKS, MAX_CHANCE = 40, 1.4
# Gain of chi2 from which on residuals show a delay; standard errors that show crank noise.
MIN_DELAY_CHI2, MIN_CRANK_NOISE = 30.0, 4.0


class SeriesFit(NamedTuple):
    """The residuals of a series: predicted less measured numbers, shape (n, k) [m, rad]."""

    series: MeasuredSeries
    # Of the leg as drawn, and as calibrated.
    before: FloatArray
    after: FloatArray
    # The samples that were used, shape (n,).
    inliers: BoolArray

    @property
    def noise(self) -> float:
        """Return the standard deviation of the used residuals [m, rad]."""
        return float(np.sqrt(np.mean(self.after[self.inliers] ** 2)))


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
        Of the parameters, in their units; of unobservable combinations that of a workshop.
    observability : Observability
        The combinations that the measurements observe.
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
        return self.model.value(self.values, PHASE)

    @property
    def misfit(self) -> float:
        """Return the largest median residual of all samples, relative to the leg's size."""
        return median_misfit(
            self.model, [fit.series for fit in self.series], [fit.after for fit in self.series]
        )

    @property
    def is_complete(self) -> bool:
        """Return whether every parameter has a number."""
        return bool(np.isfinite(self.standard_errors).all())

    def further(self) -> list[Suggestion]:
        """Return the further measurements that would make all observable, the best first."""
        measured = [(fit.series, fit.noise) for fit in self.series]
        return further_measurements(self.model, self.values, measured, self.observability)

    def dimension(self, name: str) -> tuple[float, float]:
        """Return the value and the standard error of a parameter [m, rad, s]."""
        place = self.model.names.index(name)
        return float(self.values[place]), float(self.standard_errors[place])


def calibrate(
    linkage: Linkage,
    measured: Sequence[MeasuredSeries],
    *,
    direction: float = 1,
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
    measured : sequence of MeasuredSeries
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
    if not measured:
        raise MeasurementError('nothing was measured: name a point and its topic')
    rates = np.concatenate([series.rate for series in measured])
    reverse = min((rates > 0.0).sum(), (rates < 0.0).sum()) > MIN_REVERSE_SHARE * len(rates)
    optional = (*CAMERA * camera, *[DELAY] * delay, *[BACKLASH] * bool(reverse))
    model = MeasurementModel(linkage, direction, phase, optional)
    measured = [subset(series, MAX_SAMPLES) for series in measured]
    check_measurements(model, measured)
    start, _ = start_parameters(model, measured)
    problem = _Problem(model, measured, prior, crank_noise, start)
    try:
        return problem.calibration()
    except MeasurementError as error:
        raise MeasurementError(_explanation(model, measured) or str(error)) from None


def _deviations(model: MeasurementModel, prior: float | Mapping[str, float] | None) -> FloatArray:
    """Return the prior's standard deviations in units; those of a weak one where there is none."""
    found: FloatArray = np.full(len(model.names), WEAKEST_PRIOR)
    found[: model.count] = WEAK_PRIOR
    if isinstance(prior, float | int):
        dimensions = model.linkage.structure.dimensions
        prior = {d.name: prior if d.unit == 'm' else prior / BEND_LENGTH for d in dimensions}
    for name, value in (prior or {}).items():
        if name not in model.names:
            raise MeasurementError(f'the prior of {name}: there are {", ".join(model.names)}')
        place = model.names.index(name)
        found[place] = value / model.units[place]
    return found


def _explanation(model: MeasurementModel, measured: Sequence[MeasuredSeries]) -> str:
    """Return which other leg or camera the measurements fit; nothing if none of the likeliest."""
    few = [subset(series, SEARCH_SAMPLES) for series in measured]
    own = model.linkage.assembly
    modes = [own, *(m for m in assemblies(model.linkage) if m != own)] if own else [own]
    others = []
    for mode, direction in [*product(modes, (model.direction, -model.direction))][1:]:
        linkage = model.linkage if mode == own else model.linkage.in_assembly(mode)
        what = f'direction {direction}' if mode == own else f'assembly {list(mode)}'
        what = f'those of a leg with {what}: change it in the leg file'
        others.append((what, replace(model, linkage=linkage, direction=direction), few))
    seen = model
    if CAMERA[0] not in model.names:
        seen = replace(model, optional=(*CAMERA, *model.optional))
        others.append(('those of a camera in another pose: try --camera unknown', seen, few))
    mirrored = [replace(s, values=s.values * (1, -1)) if s.kind == 'point' else s for s in few]
    others.append(('mirrored: x must point right and y up, as on the drawing', seen, mirrored))
    rates = np.concatenate([series.rate for series in few])
    # At an even speed a delay is another encoder zero, and explains nothing.
    if DELAY not in model.names and np.std(rates) > EVEN_SPEED * abs(np.mean(rates)):
        late = replace(model, optional=(*model.optional, DELAY))
        others.append(('late, or early: try --delay unknown', late, few))
    starts = []
    for what, other, series in others:
        with suppress(MeasurementError):
            start, misfit = start_parameters(other, series)
            # A delay shows in the fit alone, so it is tried first.
            misfit *= DELAY not in other.names or DELAY in model.names
            if misfit < MAX_MISFIT:
                starts.append((misfit, what, _Problem(other, series, None, 0.0, start)))
    for _, what, problem in sorted(starts, key=lambda each: each[0])[:MAX_EXPLANATIONS]:
        with suppress(MeasurementError):
            problem.calibration(MAX_EXPLAINED_MISFIT)
            return f'the measurements are {what}'
    return ''


class _Fit(NamedTuple):
    """Parameters in units, the rows that are used, and the noise of series and crank."""

    y: FloatArray
    good: BoolArray
    sigmas: FloatArray
    crank: float


class _Rows(NamedTuple):
    """Of all numbers of all series: residuals, derivatives by y, and slopes by the crank."""

    residuals: FloatArray
    jacobian: FloatArray
    slopes: FloatArray


class _Evidence(NamedTuple):
    """Whitened residuals and derivatives, their chi2 per degree of freedom, and information."""

    residuals: FloatArray
    jacobian: FloatArray
    chi2: float
    # R of the information R^T R, less what the residuals say against the stated noise.
    root: FloatArray


class _Problem:
    """The least-squares problem in units: y = (parameters - drawing) / units."""

    def __init__(
        self,
        model: MeasurementModel,
        measured: Sequence[MeasuredSeries],
        prior: float | Mapping[str, float] | None,
        crank_noise: float | None,
        start: FloatArray,
    ) -> None:
        self._model, self._measured = model, tuple(measured)
        self._prior, self._crank_noise, self._start = prior, crank_noise, start
        self._weak = np.diag(1.0 / _deviations(model, prior))
        self._centre: FloatArray = (start - model.start) / model.units
        self._known: tuple[bytes, _Rows] | None = None
        # Of each row its series, its sample of all, and its stamp.
        self._owners = np.repeat(np.arange(len(measured)), [each.values.size for each in measured])
        times = np.concatenate([series.times for series in measured])
        widths = [[series.values.shape[1]] * len(series.times) for series in measured]
        self._samples = np.repeat(np.arange(len(times)), np.concatenate(widths))
        self._stamps = np.unique(times, return_inverse=True)[1][self._samples]

    def _parameters(self, y: FloatArray) -> FloatArray:
        return np.asarray(self._model.start + self._model.units * y)

    def _rows(self, y: FloatArray) -> _Rows:
        """Return all rows; NaN where the leg does not reach a crank angle, or does not exist."""
        key = y.tobytes()
        if self._known is None or self._known[0] != key:
            try:
                found = [self._model.predict(s, self._parameters(y)) for s in self._measured]
            except GeometryError:
                count = len(self._owners)
                nothing = np.full(count, np.nan)
                return _Rows(nothing, np.full((count, len(y)), np.nan), nothing)
            pairs = zip(self._measured, found, strict=True)
            rows = _Rows(
                np.concatenate([self._model.residuals(s, p.values).ravel() for s, p in pairs]),
                np.concatenate([p.jacobian.reshape(-1, len(y)) for p in found])
                * self._model.units,
                np.concatenate([p.slope.ravel() for p in found]),
            )
            self._known = key, rows
        return self._known[1]

    def _whitened(self, fit: _Fit, rows: _Rows, values: FloatArray) -> FloatArray:
        """Return columns of the used rows times S^(-1/2), shape (n, m)."""
        sigma = fit.sigmas[self._owners][fit.good]
        scaled: FloatArray = values[fit.good] / sigma[:, None]
        if fit.crank == 0.0:
            return scaled
        # In units of sigma S is 1 + crank^2 v v^T at each stamp; with n = |v| its S^(-1/2) is
        # 1 - c v v^T / n^2, c = 1 - 1 / sqrt(1 + crank^2 n^2).
        slopes, stamps = rows.slopes[fit.good] / sigma, self._stamps[fit.good]
        squares = np.maximum(np.bincount(stamps, slopes**2)[stamps], 1e-300)
        factor = (1.0 - 1.0 / np.sqrt(1.0 + fit.crank**2 * squares)) / squares * slopes
        summed = [np.bincount(stamps, along)[stamps] for along in (slopes[:, None] * scaled).T]
        return scaled - factor[:, None] * np.stack(summed, axis=1)

    def calibration(self, max_misfit: float = MAX_MISFIT) -> Calibration:
        """Return the calibration; a MeasurementError if the measurements are of another leg."""
        fit = self.solve()
        free = found = self.result(fit)
        if free.observability.combinations:
            found = self.held_result(fit)
        names = ', '.join(f'{series.title} ({series.source})' for series in self._measured)
        for n, d in enumerate(self._model.linkage.structure.dimensions):
            start, value = self._model.start[n], found.values[n]
            if abs(value - start) > MAX_CORRECTIONS[d.unit] * self._model.units[n]:
                raise MeasurementError(
                    f'the measurements fit only a leg with {d.name} = {value:.4g} {d.unit}, '
                    f'drawn {start:.4g}: check the points and their topics: {names}'
                )
        if found.misfit > min(max_misfit, MAX_HELD_MISFIT * free.misfit):
            raise MeasurementError(
                f'the measurements are not those of this leg: they miss it by '
                f'{100.0 * found.misfit:.3g} % of its size. Check the points, their topics, '
                f'units and axes: {names}'
            )
        return found

    def solve(self) -> _Fit:
        """Return the fit that the measurements choose."""
        some = [subset(series, ROBUST_SAMPLES) for series in self._measured]
        few, y = _Problem(self._model, some, self._prior, 0.0, self._start), self._centre
        good = np.isfinite(few._rows(y).residuals)
        for _ in range(2):
            fit = few._scaled(y, good, robust=True)
            y = few._minimized(fit, self._weak, loss='soft_l1')
        good = np.isfinite(self._rows(y).residuals)
        for _ in range(MAX_ROUNDS):
            before, good = good, self._inliers(self._scaled(y, good, robust=True))
            y = self._minimized(self._scaled(y, good, robust=False), self._weak)
            if np.array_equal(before, good):
                break
        return self._scaled(y, good, robust=False)

    def held_result(self, fit: _Fit) -> Calibration:
        """Return the calibration that holds unobservable combinations near the start."""
        held = 0
        for turn in range(MAX_ROUNDS):
            # A combination that is held stays held: nearer the drawing it may seem observable.
            least = held if turn > 1 else 0
            lost = observability(self._evidence(fit).root, self._model, least).lost
            fit = fit._replace(y=self._minimized(fit, self._held(lost)))
            if turn and held == len(lost):
                break
            held = len(lost)
        return self.result(fit, held)

    def _held(self, lost: FloatArray) -> FloatArray:
        """Return the rows of the prior; the user's own holds unobservable combinations as well."""
        fixed = lost[:0] if self._prior is not None else lost
        return np.vstack([self._weak, fixed / OPEN_ERROR])

    def _inliers(self, fit: _Fit) -> BoolArray:
        """Return the rows of samples without a number beyond the gate."""
        rows = self._rows(fit.y)
        variance = fit.sigmas[self._owners] ** 2 + fit.crank**2 * np.nanmax(rows.slopes**2)
        bad = ~(np.abs(rows.residuals) < OUTLIER_GATE * np.sqrt(variance))
        found: BoolArray = ~np.isin(self._samples, self._samples[bad])
        return found

    def _minimized(self, fit: _Fit, held: FloatArray, loss: str = 'linear') -> FloatArray:
        from scipy.optimize import least_squares  # noqa: PLC0415 - an extra, and slow to import

        def residuals(y: FloatArray) -> FloatArray:
            rows = self._rows(y)
            own = self._whitened(fit, rows, rows.residuals[:, None])[:, 0]
            # Beyond the reach of the leg; the step is rejected.
            return np.concatenate([np.nan_to_num(own, nan=1e6), held @ (y - self._centre)])

        def jacobian(y: FloatArray) -> FloatArray:
            rows = self._rows(y)
            return np.vstack([np.nan_to_num(self._whitened(fit, rows, rows.jacobian)), held])

        # MINPACK is the fastest, and has no loss.
        method, tolerance = ('lm', 1e-9) if loss == 'linear' else ('trf', 1e-4)
        limits = dict.fromkeys(('xtol', 'ftol', 'gtol'), tolerance)
        options: dict[str, Any] = {'method': method, 'loss': loss, 'max_nfev': 60, **limits}
        return np.asarray(least_squares(residuals, fit.y, jacobian, **options).x)

    def _scaled(self, y: FloatArray, good: BoolArray, *, robust: bool) -> _Fit:
        """Return a fit with the noise of its residuals: stated, or estimated."""
        rows, owners, count = self._rows(y), self._owners[good], len(self._measured)
        used = np.bincount(owners, minlength=count)
        for series, number in zip(self._measured, used, strict=True):
            if number < MIN_INLIERS * series.values.size:
                share = 100.0 * number / series.values.size
                raise MeasurementError(
                    f'{series.title} ({series.source}) fits the leg at {share:.0f} % of its '
                    f'samples only: check the point, its topic, unit and axes'
                )
        own, slopes = rows.residuals[good], rows.slopes[good] ** 2
        if robust:
            medians = [float(np.median(np.abs(own[owners == n]))) for n in range(count)]
            return _Fit(y, good, np.maximum(MAD_FACTOR * np.array(medians), 1e-9), 0.0)
        variances = np.maximum(np.bincount(owners, own**2) / used, 1e-18)
        crank = self._crank_noise
        if crank is None:
            # The excess of residuals where the path is fast: a line over the squared slopes, by
            # weights of squared normal numbers, whose variance is 2 sigma^4.
            centred = slopes - (np.bincount(owners, slopes) / used)[owners]
            weights = centred / (2.0 * variances[owners] ** 2)
            weight, total = float(weights @ centred), float(weights @ own**2)
            shows = weight > 0.0 and total > MIN_CRANK_NOISE * sqrt(weight)
            crank = sqrt(total / weight) if shows else 0.0
        without = variances - crank**2 * np.bincount(owners, slopes) / used
        sigmas = np.sqrt(np.maximum(without, 0.01 * variances))
        stated = [
            series.noise or sigma for series, sigma in zip(self._measured, sigmas, strict=True)
        ]
        return _Fit(y, good, np.array(stated), crank)

    def _evidence(self, fit: _Fit) -> _Evidence:
        rows = self._rows(fit.y)
        own = self._whitened(fit, rows, rows.residuals[:, None])[:, 0]
        jacobian = self._whitened(fit, rows, rows.jacobian)
        chi2 = float(own @ own) / max(1, len(own) - len(fit.y))
        triangle: Any = np.linalg.qr(jacobian, mode='r')
        # Residuals beyond the stated noise, and those that are alike from sample to sample, make
        # larger errors.
        scale = sqrt(max(1.0, chi2) * _inflation(own / sqrt(chi2), jacobian, triangle))
        return _Evidence(own, jacobian, chi2, triangle / scale)

    def result(self, fit: _Fit, held: int = 0) -> Calibration:
        """Return the calibration; `held` combinations are held near the drawing."""
        model, rows, evidence = self._model, self._rows(fit.y), self._evidence(fit)
        verdict = observability(evidence.root, model, held)
        stacked = np.vstack([evidence.root, self._held(verdict.lost)])
        spread = np.linalg.inv(np.linalg.qr(stacked, mode='r'))
        covariance: FloatArray = spread @ spread.T
        errors, has_prior = np.sqrt(np.diag(covariance)), self._prior is not None
        if not has_prior:
            errors[verdict.unobservable] = np.nan
        parameters = self._parameters(fit.y)
        parameters[model.count] = wrap(parameters[model.count])
        return Calibration(
            drawn=model.linkage,
            linkage=model.varied(parameters),
            model=model,
            values=parameters,
            standard_errors=errors * model.units,
            covariance=covariance,
            observability=verdict,
            series=self._series(rows, fit),
            crank_noise=fit.crank,
            chi2_dof=evidence.chi2 if all(series.noise for series in self._measured) else None,
            late=self._late(fit, rows, evidence),
            prior=has_prior,
        )

    def _series(self, rows: _Rows, fit: _Fit) -> tuple[SeriesFit, ...]:
        model, found = self._model, []
        drawn = [model.motion(series, model.start).values for series in self._measured]
        _, before = model.with_camera(self._measured, drawn)
        for n, (series, own) in enumerate(zip(self._measured, before, strict=True)):
            mine, shape = self._owners == n, series.values.shape
            after, good = (v[mine].reshape(shape) for v in (rows.residuals, fit.good))
            found.append(SeriesFit(series, model.residuals(series, own), after, good[:, 0]))
        return tuple(found)

    def _late(self, fit: _Fit, rows: _Rows, evidence: _Evidence) -> float:
        """Return the delay that explains the residuals, if none was asked for; 0 for none."""
        if DELAY in self._model.names:
            return 0.0
        rates = np.concatenate([series.rate for series in self._measured])[self._samples]
        moved = (self._model.direction * rows.slopes * rates)[:, None]
        column, jacobian = self._whitened(fit, rows, moved)[:, 0], evidence.jacobian
        # What the parameters do not explain of it.
        rest = column - jacobian @ np.linalg.lstsq(jacobian, column, rcond=None)[0]
        square = float(rest @ rest)
        is_apart = square > 1e-6 * float(column @ column)
        found = -float(rest @ evidence.residuals) / square if is_apart else 0.0
        return found if found**2 * square > MIN_DELAY_CHI2 else 0.0


def _inflation(rows: FloatArray, jacobian: FloatArray, triangle: FloatArray) -> float:
    """Return the factor by which residuals that are correlated in time enlarge the covariance."""
    # Scores of stretches have the covariance J^T J = R^T R if residuals are independent.
    parts = (np.array_split(each, BLOCKS) for each in (jacobian, rows))
    scores = np.transpose([j.T @ r for j, r in zip(*parts, strict=True)])
    _, sizes, axes = np.linalg.svd(triangle)
    seen = sizes > ROUNDING * sizes[0]
    whitened = (axes[seen] / sizes[seen][:, None]) @ scores
    factor = float((whitened**2).sum()) / int(seen.sum())
    return factor if factor > MAX_CHANCE else 1.0
