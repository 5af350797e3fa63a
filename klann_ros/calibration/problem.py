"""
The least-squares problem of a calibration: residuals, their derivatives, noise and minimum.

Residuals are divided by their standard deviation and have exact derivatives. An error of the crank
angle moves all numbers of a sample along the slope v of its path. With the covariance K of the
crank's motion between the samples of its encoder (see `crank`) and noise at each stamp it is

    S = sigma^2 + v (K + sigma_crank^2) v^T.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from math import sqrt
from typing import Any, NamedTuple

from klann_ros.kinematics import GeometryError
from klann_ros.kinematics.arrays import BoolArray, FloatArray, IndexArray
import numpy as np

from .crank import CrankSpline, CrankWhitening
from .measurements import MeasuredSeries, MeasurementError, subset
from .model import DELAY, MeasurementModel

# Standard deviations beyond which a sample is an outlier; of a normal distribution by its MAD.
OUTLIER_GATE = 5.0
MAD_FACTOR = 1.4826
# Standard deviations of the weak prior of all parameters [units]: of dimensions about the drawing,
# of the others about the start.
WEAK_PRIOR = 100.0
WEAKEST_PRIOR = 1000.0
# Length over which a tolerance makes an error of a bend [m].
BEND_LENGTH = 0.03
# Share of the samples of a series that fit the leg, at least.
MIN_INLIERS = 0.5
# Standard deviation of the noise of a series, at least [m, rad].
MIN_NOISE = 1e-9
# Standard errors that show crank noise.
MIN_CRANK_NOISE = 4.0
# Standard deviation of the angle of a crank that is known by a tracked point alone [rad].
UNKNOWN_CRANK = 1e3
# Chi2 of the errors of the crank's motion up to which these are left out.
MAX_MOTION_CHI2 = 0.01
# Mean chi2 from which on errors between distant samples of the crank are worth a warning.
MIN_GAP_CHI2 = 0.1
# Iterations of the noise beside errors of the crank's motion.
NOISE_ITERATIONS = 4

Prior = float | Mapping[str, float] | None
"""Standard deviations of the dimensions [m, rad]: one of all, or by name."""


class Fit(NamedTuple):
    """Parameters in units, the rows that are used, and the noise of series and crank."""

    y: FloatArray
    is_used: BoolArray
    sigmas: FloatArray  # of each series [m, rad]
    crank_noise: float  # noise of the crank angle at each stamp [rad]
    motion: CrankSpline | None  # the crank's motion, where its errors count


class Rows(NamedTuple):
    """All numbers of all series: residuals, derivatives by y, and slopes by the crank."""

    residuals: FloatArray
    jacobian: FloatArray
    slopes: FloatArray


class Problem:
    """
    The least-squares problem in units: y = (parameters - drawing) / units.

    A known `crank_noise` is not estimated; `start` are the parameters of the first fit.
    """

    def __init__(
        self,
        model: MeasurementModel,
        measured: Sequence[MeasuredSeries],
        prior: Prior,
        crank_noise: float | None,
        start: FloatArray,
    ) -> None:
        self.model = model
        self.measured = tuple(measured)
        self.prior = prior
        self.start_y: FloatArray = (start - model.start) / model.units
        # Rows of the weak prior, and of the user's.
        self.weak_prior = np.diag(1.0 / _deviations(model, prior))
        self._crank_noise = crank_noise
        self._last_rows: tuple[bytes, Rows] | None = None
        # The series of each row, its sample among all, its stamp, and the index of that.
        sizes = [series.values.size for series in measured]
        self.owners = np.repeat(np.arange(len(measured)), sizes)
        times = np.concatenate([series.times for series in measured])
        widths: list[int] = []
        for series in measured:
            widths += [series.values.shape[1]] * len(series.times)
        self.samples = np.repeat(np.arange(len(times)), widths)
        self.times: FloatArray = times[self.samples]
        self.stamps = np.unique(times, return_inverse=True)[1][self.samples]

    @cached_property
    def motion(self) -> CrankSpline:
        """Return the motion of the crank, by the samples that all series are paired with."""
        encoder = self.measured[0].encoder
        if self._crank_noise is None:
            return encoder.motion
        return CrankSpline(encoder.times, encoder.positions, self._crank_noise)

    def delayed_times(self, y: FloatArray) -> FloatArray:
        """Return the times of all rows by the crank's clock [s]."""
        return self.times + self.model.value(self.parameters(y), DELAY)

    def with_samples(self, count: int) -> 'Problem':
        """Return the problem of at most `count` samples a series, without crank noise."""
        few = [subset(series, count) for series in self.measured]
        return Problem(self.model, few, self.prior, 0.0, self.parameters(self.start_y))

    def with_tracked_crank(self, fit: Fit) -> 'Problem':
        """Return the problem with the crank angles that fit all points of each frame best."""
        rows = self.rows(fit.y)
        weights = np.where(fit.is_used, rows.slopes / fit.sigmas[self.owners] ** 2, 0.0)
        errors = np.bincount(self.stamps, weights * np.nan_to_num(rows.residuals))
        squares = np.bincount(self.stamps, weights * np.nan_to_num(rows.slopes))
        corrections = -errors / np.maximum(squares, 1e-300)
        measured = []
        for n, series in enumerate(self.measured):
            frames = self.stamps[self.owners == n].reshape(series.values.shape)[:, 0]
            measured.append(replace(series, crank=series.crank + corrections[frames]))
        start = self.parameters(self.start_y)
        return Problem(self.model, measured, self.prior, self._crank_noise, start)

    def parameters(self, y: FloatArray) -> FloatArray:
        """Return parameters in SI units."""
        return np.asarray(self.model.start + self.model.units * y)

    def rows(self, y: FloatArray) -> Rows:
        """Return all rows; NaN where the leg does not reach a crank angle, or does not exist."""
        key = y.tobytes()
        if self._last_rows is None or self._last_rows[0] != key:
            try:
                self._last_rows = key, self._new_rows(y)
            except GeometryError:
                missing = np.full(len(self.owners), np.nan)
                return Rows(missing, np.full((len(missing), len(y)), np.nan), missing)
        return self._last_rows[1]

    def _new_rows(self, y: FloatArray) -> Rows:
        parameters = self.parameters(y)
        residuals = []
        jacobians = []
        slopes = []
        for series in self.measured:
            prediction = self.model.predict(series, parameters)
            residuals.append(self.model.residuals(series, prediction.values).ravel())
            jacobians.append(prediction.jacobian.reshape(-1, len(y)))
            slopes.append(prediction.slope.ravel())
        jacobian = np.concatenate(jacobians) * self.model.units
        return Rows(np.concatenate(residuals), jacobian, np.concatenate(slopes))

    def inliers(self, fit: Fit) -> BoolArray:
        """Return the rows of samples without a number beyond the gate."""
        rows = self.rows(fit.y)
        variance = fit.sigmas[self.owners] ** 2
        is_known: BoolArray = np.ones(len(self.owners), bool)
        if self.model.has_encoder:
            times = self.delayed_times(fit.y)
            variance = variance + rows.slopes**2 * self.motion.variances(times)
            is_known = self.motion.knows(times)
        is_outlier = ~(np.abs(rows.residuals) < OUTLIER_GATE * np.sqrt(variance)) | ~is_known
        is_inlier: BoolArray = ~np.isin(self.samples, self.samples[is_outlier])
        return is_inlier

    def minimized(self, fit: Fit, prior_rows: FloatArray, loss: str = 'linear') -> FloatArray:
        """Return the y of the smallest residuals, prior included, at the noise of a fit."""
        from scipy.optimize import least_squares  # noqa: PLC0415 - an extra, and slow to import

        whitening = Whitening(self, fit)

        def residuals(y: FloatArray) -> FloatArray:
            rows = self.rows(y)
            # Beyond the reach of the leg; the step is rejected.
            reached = np.nan_to_num(rows.residuals, nan=1e3)
            return np.concatenate([whitening.residuals(reached), prior_rows @ (y - self.start_y)])

        def jacobian(y: FloatArray) -> FloatArray:
            rows = self.rows(y)
            return np.vstack([whitening(np.nan_to_num(rows.jacobian)), prior_rows])

        # MINPACK is the fastest, and has no loss.
        method, tolerance = ('lm', 1e-9) if loss == 'linear' else ('trf', 1e-4)
        limits = dict.fromkeys(('xtol', 'ftol', 'gtol'), tolerance)
        options: dict[str, Any] = {'method': method, 'loss': loss, 'max_nfev': 60, **limits}
        return np.asarray(least_squares(residuals, fit.y, jacobian, **options).x)

    def with_robust_noise(self, y: FloatArray, is_used: BoolArray) -> Fit:
        """Return a fit with the noise by the median residuals, whatever a few outliers say."""
        residuals = self.rows(y).residuals
        is_used = is_used & np.isfinite(residuals)
        owners = self._checked_owners(is_used)
        sizes = np.abs(residuals[is_used])
        medians = np.empty(len(self.measured))
        for n in range(len(medians)):
            medians[n] = np.median(sizes[owners == n])
        return Fit(y, is_used, np.maximum(MAD_FACTOR * medians, MIN_NOISE), 0.0, None)

    def likeliest(self, fit: Fit) -> Fit:
        """Return a fit with the noise of its residuals and the likeliest motion of the crank."""
        if not self.model.has_encoder:
            return fit
        fits = []
        for motion in self.motion.likely:
            candidate = self.with_noise(fit.y, fit.is_used, motion)
            points_deviance = Whitening(self, candidate).deviance(self.rows(fit.y).residuals)
            fits.append((motion.deviance + points_deviance, candidate))
        return min(fits, key=lambda pair: pair[0])[1]

    def with_noise(
        self, y: FloatArray, is_used: BoolArray, motion: CrankSpline | None = None
    ) -> Fit:
        """Return a fit with the noise of its residuals: stated, or estimated."""
        fit = self.with_robust_noise(y, is_used)
        if not self.model.has_encoder:
            return self._with_refined_noise(fit._replace(crank_noise=UNKNOWN_CRANK))
        is_used = fit.is_used
        motion = motion or self.motion
        owners = self.owners[is_used]
        counts = np.bincount(owners)
        rows = self.rows(y)
        slopes = rows.slopes[is_used] ** 2
        motion_squares = slopes * motion.variances(self.delayed_times(y)[is_used])
        squares = rows.residuals[is_used] ** 2
        variances = np.maximum(np.bincount(owners, squares) / counts, 1e-18)
        squares = squares - motion_squares
        mean_slopes = np.bincount(owners, slopes) / counts
        if self._crank_noise is None:
            # The excess of residuals where the path is fast: a line over the squared slopes, by
            # weights of squared normal numbers, whose variance is 2 sigma^4.
            centred = slopes - mean_slopes[owners]
            weights = centred / (2.0 * variances[owners] ** 2)
            weight = float(weights @ centred)
            excess = float(weights @ squares)
            is_visible = weight > 0.0 and excess > MIN_CRANK_NOISE * sqrt(weight)
            fit = fit._replace(crank_noise=sqrt(excess / weight) if is_visible else 0.0)
        motion_chi2 = float((motion_squares / fit.sigmas[owners] ** 2).sum())
        if motion_chi2 > MAX_MOTION_CHI2:
            fit = fit._replace(motion=motion)
        return self._with_refined_noise(fit)

    def _with_refined_noise(self, fit: Fit) -> Fit:
        """Return a fit with the noise of its residuals, without what the crank takes of them."""
        owners = self.owners[fit.is_used]
        for _ in range(NOISE_ITERATIONS):
            whitening = Whitening(self, fit)
            residuals = whitening.residuals(self.rows(fit.y).residuals)[: len(owners)]
            factors = np.bincount(owners, residuals**2) / np.bincount(owners, whitening.freedom())
            sigmas = np.maximum(fit.sigmas * np.sqrt(np.maximum(factors, 0.0)), MIN_NOISE)
            for n, series in enumerate(self.measured):
                sigmas[n] = series.noise or sigmas[n]
            fit = fit._replace(sigmas=sigmas)
        return fit

    def crank_gap(self, fit: Fit) -> float:
        """Return the error of the crank angle between samples that miss its motion; else 0."""
        if fit.motion is None:
            return 0.0
        variances = fit.motion.variances(self.delayed_times(fit.y)[fit.is_used])
        slopes = self.rows(fit.y).slopes[fit.is_used] / fit.sigmas[self.owners][fit.is_used]
        deviation = float(np.mean(variances)) ** 0.5
        is_visible = float(variances @ slopes**2) > MIN_GAP_CHI2 * len(slopes)
        return deviation if is_visible and deviation > fit.motion.noise else 0.0

    def _checked_owners(self, is_used: BoolArray) -> IndexArray:
        """Return the series of the used rows; a MeasurementError if few of a series are used."""
        owners = self.owners[is_used]
        counts = np.bincount(owners, minlength=len(self.measured))
        for series, count in zip(self.measured, counts, strict=True):
            if count < MIN_INLIERS * series.values.size:
                share = 100.0 * count / series.values.size
                raise MeasurementError(
                    f'{series.title} ({series.source}) fits the leg at {share:.0f} % of its '
                    f'samples only: check the point, its topic, unit and axes'
                )
        return owners


class Whitening:
    """Whitens the used rows by the noise of a fit; the rows of the crank's motion follow them."""

    def __init__(self, problem: Problem, fit: Fit) -> None:
        is_used = fit.is_used
        self._is_used = is_used
        self._sigma = fit.sigmas[problem.owners][is_used]
        slopes = problem.rows(fit.y).slopes[is_used] / self._sigma
        # In units of sigma S is 1 + crank^2 v v^T at each stamp; with n = |v| its S^(-1/2) is
        # 1 - c v v^T / n^2, c = 1 - 1 / sqrt(1 + crank^2 n^2).
        self._stamps = problem.stamps[is_used]
        squares = np.maximum(np.bincount(self._stamps, slopes**2)[self._stamps], 1e-300)
        # Its determinant is 1 + crank^2 n^2; a stamp has a share of it for each of its rows.
        shares = slopes**2 / squares
        self._freedom = np.ones(len(slopes)) - (
            shares if fit.crank_noise == UNKNOWN_CRANK else 0.0
        )
        self.count = round(float(self._freedom.sum()))
        self._log_determinant = float(shares @ np.log1p(fit.crank_noise**2 * squares))
        shrinkage = 1.0 - 1.0 / np.sqrt(1.0 + fit.crank_noise**2 * squares)
        self._slopes = slopes
        self._factor = shrinkage / squares * slopes
        self.times = problem.times[is_used]
        self._motion = None
        # What the residuals change by from the usual motion to the fit's.
        self._offsets: FloatArray = np.zeros(len(slopes))
        if fit.motion is not None:
            delayed_times = problem.delayed_times(fit.y)[is_used]
            change = fit.motion.at(delayed_times)[0] - problem.motion.at(delayed_times)[0]
            self._offsets = problem.model.direction * slopes * self._sigma * change
            white_slopes = self._without_crank_noise(slopes[:, None])[:, 0]
            self._motion = CrankWhitening(fit.motion, delayed_times, white_slopes)
            self.times = np.concatenate([self.times, fit.motion.state_times])

    def __call__(self, columns: FloatArray) -> FloatArray:
        """Return columns, shape (rows, m), as whitened ones, shape (len(times), m)."""
        whitened = self._without_crank_noise(columns[self._is_used] / self._sigma[:, None])
        return whitened if self._motion is None else self._motion(whitened)

    def residuals(self, residuals: FloatArray) -> FloatArray:
        """Return whitened residuals of all rows, shape (len(times),)."""
        moved = residuals.copy()
        moved[self._is_used] += self._offsets
        whitened: FloatArray = self(moved[:, None])[:, 0]
        return whitened

    def freedom(self) -> FloatArray:
        """Return the mean squares of the whitened residuals of the used rows."""
        if self._motion is None:
            return self._freedom
        return self._freedom - self._motion.variances()

    def deviance(self, residuals: FloatArray) -> float:
        """Return -2 times the logarithm of the likelihood of the residuals."""
        determinant = self._log_determinant + 2.0 * np.log(self._sigma).sum()
        if self._motion is not None:
            determinant += self._motion.log_determinant
        return float(np.sum(self.residuals(residuals) ** 2) + determinant)

    def _without_crank_noise(self, columns: FloatArray) -> FloatArray:
        if not self._factor.any():
            return columns
        along = np.empty_like(columns)
        for n, column in enumerate((self._slopes[:, None] * columns).T):
            along[:, n] = np.bincount(self._stamps, column)[self._stamps]
        return columns - self._factor[:, None] * along


def _deviations(model: MeasurementModel, prior: Prior) -> FloatArray:
    """Return the prior's standard deviations in units; those of a weak one where there is none."""
    deviations: FloatArray = np.full(len(model.names), WEAKEST_PRIOR)
    deviations[: model.count] = WEAK_PRIOR
    if isinstance(prior, float | int):
        dimensions = model.linkage.structure.dimensions
        by_unit = {'m': prior, 'rad': prior / BEND_LENGTH}
        prior = {dimension.name: by_unit[dimension.unit] for dimension in dimensions}
    for name, deviation in (prior or {}).items():
        if name not in model.names:
            raise MeasurementError(f'the prior of {name}: there are {", ".join(model.names)}')
        n = model.names.index(name)
        deviations[n] = deviation / model.units[n]
    return deviations
