"""
The least-squares problem of a calibration: residuals, their derivatives, noise and minimum.

Residuals are divided by their standard deviation and have exact derivatives. Noise of the crank
angle moves all numbers of a sample along the slope v of its path: with it their covariance is
S = sigma^2 + sigma_crank^2 v v^T.
"""

from collections.abc import Mapping, Sequence
from math import sqrt
from typing import Any, NamedTuple

from klann_ros.kinematics import GeometryError
from klann_ros.kinematics.arrays import BoolArray, FloatArray, IndexArray
import numpy as np

from .measurements import MeasuredSeries, MeasurementError, subset
from .model import MeasurementModel

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
# Standard errors that show crank noise.
MIN_CRANK_NOISE = 4.0

Prior = float | Mapping[str, float] | None
"""Standard deviations of the dimensions [m, rad]: one of all, or by name."""


class Fit(NamedTuple):
    """Parameters in units, the rows that are used, and the noise of series and crank."""

    y: FloatArray
    is_used: BoolArray
    sigmas: FloatArray  # of each series [m, rad]
    crank_noise: float  # [rad]


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
        # The series of each row, its sample among all, and its stamp.
        sizes = [series.values.size for series in measured]
        self.owners = np.repeat(np.arange(len(measured)), sizes)
        times = np.concatenate([series.times for series in measured])
        widths: list[int] = []
        for series in measured:
            widths += [series.values.shape[1]] * len(series.times)
        self.samples = np.repeat(np.arange(len(times)), widths)
        self._stamps = np.unique(times, return_inverse=True)[1][self.samples]

    def with_samples(self, count: int) -> 'Problem':
        """Return the problem of at most `count` samples a series, without crank noise."""
        few = [subset(series, count) for series in self.measured]
        return Problem(self.model, few, self.prior, 0.0, self.parameters(self.start_y))

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

    def whitened(self, fit: Fit, rows: Rows, columns: FloatArray) -> FloatArray:
        """Return columns of the used rows times S^(-1/2), shape (n, m)."""
        sigma = fit.sigmas[self.owners][fit.is_used]
        scaled: FloatArray = columns[fit.is_used] / sigma[:, None]
        if fit.crank_noise == 0.0:
            return scaled
        # In units of sigma S is 1 + crank^2 v v^T at each stamp; with n = |v| its S^(-1/2) is
        # 1 - c v v^T / n^2, c = 1 - 1 / sqrt(1 + crank^2 n^2).
        slopes = rows.slopes[fit.is_used] / sigma
        stamps = self._stamps[fit.is_used]
        squares = np.maximum(np.bincount(stamps, slopes**2)[stamps], 1e-300)
        factor = (1.0 - 1.0 / np.sqrt(1.0 + fit.crank_noise**2 * squares)) / squares * slopes
        along = np.empty_like(scaled)
        for n, column in enumerate((slopes[:, None] * scaled).T):
            along[:, n] = np.bincount(stamps, column)[stamps]
        return scaled - factor[:, None] * along

    def inliers(self, fit: Fit) -> BoolArray:
        """Return the rows of samples without a number beyond the gate."""
        rows = self.rows(fit.y)
        variance = fit.sigmas[self.owners] ** 2
        variance = variance + fit.crank_noise**2 * np.nanmax(rows.slopes**2)
        is_outlier = ~(np.abs(rows.residuals) < OUTLIER_GATE * np.sqrt(variance))
        is_inlier: BoolArray = ~np.isin(self.samples, self.samples[is_outlier])
        return is_inlier

    def minimized(self, fit: Fit, prior_rows: FloatArray, loss: str = 'linear') -> FloatArray:
        """Return the y of the smallest residuals, prior included, at the noise of a fit."""
        from scipy.optimize import least_squares  # noqa: PLC0415 - an extra, and slow to import

        def residuals(y: FloatArray) -> FloatArray:
            rows = self.rows(y)
            measured = self.whitened(fit, rows, rows.residuals[:, None])[:, 0]
            # Beyond the reach of the leg; the step is rejected.
            measured = np.nan_to_num(measured, nan=1e6)
            return np.concatenate([measured, prior_rows @ (y - self.start_y)])

        def jacobian(y: FloatArray) -> FloatArray:
            rows = self.rows(y)
            return np.vstack([np.nan_to_num(self.whitened(fit, rows, rows.jacobian)), prior_rows])

        # MINPACK is the fastest, and has no loss.
        method, tolerance = ('lm', 1e-9) if loss == 'linear' else ('trf', 1e-4)
        limits = dict.fromkeys(('xtol', 'ftol', 'gtol'), tolerance)
        options: dict[str, Any] = {'method': method, 'loss': loss, 'max_nfev': 60, **limits}
        return np.asarray(least_squares(residuals, fit.y, jacobian, **options).x)

    def with_robust_noise(self, y: FloatArray, is_used: BoolArray) -> Fit:
        """Return a fit with the noise by the median residuals, whatever a few outliers say."""
        owners = self._checked_owners(is_used)
        sizes = np.abs(self.rows(y).residuals[is_used])
        medians = np.empty(len(self.measured))
        for n in range(len(medians)):
            medians[n] = np.median(sizes[owners == n])
        return Fit(y, is_used, np.maximum(MAD_FACTOR * medians, 1e-9), 0.0)

    def with_noise(self, y: FloatArray, is_used: BoolArray) -> Fit:
        """Return a fit with the noise of its residuals: stated, or estimated."""
        owners = self._checked_owners(is_used)
        counts = np.bincount(owners, minlength=len(self.measured))
        rows = self.rows(y)
        residuals = rows.residuals[is_used]
        slopes = rows.slopes[is_used] ** 2
        mean_slopes = np.bincount(owners, slopes) / counts
        variances = np.maximum(np.bincount(owners, residuals**2) / counts, 1e-18)
        crank_noise = self._crank_noise
        if crank_noise is None:
            # The excess of residuals where the path is fast: a line over the squared slopes, by
            # weights of squared normal numbers, whose variance is 2 sigma^4.
            centred = slopes - mean_slopes[owners]
            weights = centred / (2.0 * variances[owners] ** 2)
            weight = float(weights @ centred)
            excess = float(weights @ residuals**2)
            is_visible = weight > 0.0 and excess > MIN_CRANK_NOISE * sqrt(weight)
            crank_noise = sqrt(excess / weight) if is_visible else 0.0
        without_crank = variances - crank_noise**2 * np.bincount(owners, slopes) / counts
        sigmas = np.sqrt(np.maximum(without_crank, 0.01 * variances))
        for n, series in enumerate(self.measured):
            sigmas[n] = series.noise or sigmas[n]
        return Fit(y, is_used, sigmas, crank_noise)

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
