"""
Maximum likelihood of a leg's dimensions by its measurements: scipy's `least_squares`.

A soft loss leads from the drawing to the leg as built, whatever a few outliers say. Samples beyond
OUTLIER_GATE standard deviations are left out then, and the rest is fitted once more without the
loss, which gives the smallest errors. It holds combinations that the measurements leave open near
the drawing, as the leg is built: far along them the derivatives are those of another leg.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from math import hypot, sqrt
from typing import Any, NamedTuple

from klann_ros.kinematics import assemblies, Linkage
from klann_ros.kinematics.angles import TURN, wrap
from klann_ros.kinematics.arrays import BoolArray, FloatArray, with_short_repr
import numpy as np

from .measurements import MeasuredSeries, MeasurementError, scaled, subset, TrackedCrank
from .model import BACKLASH, CAMERA, CAMERA_SCALE, CAMERAS, DELAY, MeasurementModel, PHASE
from .observability import (
    further_measurements,
    Observability,
    observability,
    OPEN_ERROR,
    ROUNDING,
    Suggestion,
)
from .problem import Fit, Prior, Problem, Whitening
from .search import check_measurements, median_misfit, SEARCH_SAMPLES, start_parameters

# Samples of each series at most: derivatives of a million take gigabytes.
MAX_SAMPLES = 20_000
# Samples of each series in the robust fit; rounds until the outliers stay the same.
ROBUST_SAMPLES = 200
MAX_ROUNDS = 6
# A leg that fits worse than this part of the path's size is another one, as is one with larger
# corrections [units], and one that fits better by this factor far from the drawing.
MAX_MISFIT = 0.03
MAX_CORRECTIONS = {'m': 100.0, 'rad': 30.0}
MAX_HELD_MISFIT = 3.0
# Other legs and cameras that are fitted to explain a misfit, and how well they must fit.
MAX_EXPLANATIONS = 4
MAX_EXPLAINED_MISFIT = 0.006
# Relative standard deviation of the crank's rate up to which its speed is even.
EVEN_SPEED = 0.01
# Share of samples in the other direction from which on backlash is estimated.
MIN_REVERSE_SHARE = 0.05
# Corrections from which on a camera in another pose may explain them [units], and the share that
# it leaves of them.
MIN_CAMERA_CORRECTION = 5.0
MAX_CAMERA_SHARE = 0.3
# Stretches of a run whose scores are compared, and the largest ratio that is chance.
BLOCKS, MAX_CHANCE = 20, 1.4
# Gain of chi2 from which on residuals show a delay.
MIN_DELAY_CHI2 = 30.0


@with_short_repr
class SeriesFit(NamedTuple):
    """The residuals of a series: predicted less measured numbers, shape (n, k) [m, rad]."""

    series: MeasuredSeries
    before: FloatArray  # the residuals of the leg as drawn
    after: FloatArray  # the residuals of the leg as calibrated
    inliers: BoolArray  # the samples that were used, shape (n,)

    @property
    def noise(self) -> float:
        """Return the standard deviation of the used residuals [m, rad]."""
        return float(np.sqrt(np.mean(self.after[self.inliers] ** 2)))


@with_short_repr
@dataclass(frozen=True, eq=False)
class Calibration:
    """The leg as it was built."""

    drawn: Linkage
    linkage: Linkage  #: with the calibrated dimensions
    model: MeasurementModel  #: the parameters: dimensions, encoder zero, and optional ones
    values: FloatArray  #: of the parameters [m, rad, s]
    #: Of the values; NaN of parameters that belong to an unobservable combination.
    standard_errors: FloatArray
    #: Of the parameters, in their units; of unobservable combinations that of a workshop.
    covariance: FloatArray
    observability: Observability  #: the combinations that the measurements observe
    series: tuple[SeriesFit, ...]  #: the residuals
    #: Standard deviation of the encoder's samples [rad]; 0 if it does not show, or beside a gap.
    crank_noise: float
    #: Standard deviation of the crank angle between samples that are too far apart [rad], or 0.
    crank_gap: float
    #: Sum of squared residuals over the stated noise, per degree of freedom; None if the noise of
    #: a series is unknown and estimated from its residuals.
    chi2_dof: float | None
    #: Delay of the measurements that the residuals show, if it was taken to be 0 [s], or 0.
    late: float
    prior: bool  #: whether a prior fixed what the measurements leave open
    #: Residuals of the last turn over their noise, predicted by a fit of the turns before it; None
    #: for less than two turns.
    held_out: float | None = None
    #: Rotation of the camera that would explain large corrections, if its pose was taken to be
    #: known [rad], or 0.
    camera_rotation: float = 0.0

    @property
    def phase(self) -> float:
        """Return the crank angle at joint position 0, in (-pi, pi] [rad]."""
        return self.model.value(self.values, PHASE)

    @property
    def misfit(self) -> float:
        """Return the median residual of the worst series, relative to the leg's size or 1 rad."""
        measured = [fit.series for fit in self.series]
        residuals = [fit.after for fit in self.series]
        return median_misfit(self.model, measured, residuals)

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
        n = self.model.names.index(name)
        return float(self.values[n]), float(self.standard_errors[n])


def calibrate(
    linkage: Linkage,
    measured: Sequence[MeasuredSeries],
    *,
    direction: float = 1,
    phase: float = 0.0,
    camera: bool | str = False,
    delay: bool = False,
    prior: Prior = None,
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
    camera : bool or str
        Whether the pose of the camera in the leg's plane is unknown; 'scale' if its scale is as
        well, and 'tilt' if it may look at an angle (see `CAMERAS`).
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
    has_encoder = not any(isinstance(series.encoder, TrackedCrank) for series in measured)
    if delay and not has_encoder:
        raise MeasurementError('a crank that the camera tracks has no delay')
    rates = np.concatenate([series.rate for series in measured])
    reverse_samples = min((rates > 0.0).sum(), (rates < 0.0).sum())
    has_backlash = bool(reverse_samples > MIN_REVERSE_SHARE * len(rates))
    camera_names = CAMERAS[camera] if isinstance(camera, str) else CAMERA * camera
    optional = (*camera_names, *[DELAY] * delay, *[BACKLASH] * has_backlash)
    model = MeasurementModel(linkage, direction, phase, optional)
    if not has_encoder:
        model = MeasurementModel(linkage, optional=optional, has_encoder=False)
    measured = [subset(series, MAX_SAMPLES) for series in measured]
    check_measurements(model, measured)
    start = start_parameters(model, measured)
    if CAMERA_SCALE in model.names:
        # In metres of the leg.
        scale = start.parameters[model.names.index(CAMERA_SCALE)]
        measured = [scaled(series, scale) for series in measured]
        start = start_parameters(model, measured)
    problem = Problem(start.model, measured, prior, crank_noise, start.parameters)
    try:
        calibration = _calibration(problem)
        return replace(calibration, camera_rotation=_camera_rotation(calibration))
    except MeasurementError as error:
        raise MeasurementError(_explanation(model, measured) or str(error)) from None


def _camera_rotation(calibration: Calibration) -> float:
    """Return the rotation of a camera that explains large corrections; 0 for none [rad]."""
    model = calibration.model
    if CAMERA[0] in model.names or _correction(calibration) < MIN_CAMERA_CORRECTION:
        return 0.0
    few = [subset(fit.series, SEARCH_SAMPLES) for fit in calibration.series]
    camera_model = replace(model, optional=(*CAMERA, *model.optional))
    with suppress(MeasurementError):
        start = start_parameters(camera_model, few)
        moved = _calibration(Problem(start.model, few, None, 0.0, start.parameters))
        if _correction(moved) < MAX_CAMERA_SHARE * _correction(calibration):
            return moved.model.value(moved.values, CAMERA[2])
    return 0.0


def _correction(calibration: Calibration) -> float:
    """Return the root mean square of the corrections of the dimensions [units]."""
    model = calibration.model
    corrections = ((calibration.values - model.start) / model.units)[: model.count]
    return float(np.sqrt(np.mean(corrections**2)))


def _explanation(model: MeasurementModel, measured: Sequence[MeasuredSeries]) -> str:
    """Return which other leg or camera the measurements fit; nothing if none of the likeliest."""
    few = [subset(series, SEARCH_SAMPLES) for series in measured]
    candidates = []
    for text, possible_model, seen in _hypotheses(model, few):
        with suppress(MeasurementError):
            start = start_parameters(possible_model, seen)
            # A delay shows in the fit alone, so it is tried first.
            is_delay = DELAY in possible_model.names and DELAY not in model.names
            misfit = 0.0 if is_delay else start.misfit
            if misfit < MAX_MISFIT:
                problem = Problem(start.model, seen, None, 0.0, start.parameters)
                candidates.append((misfit, text, problem))
    candidates.sort(key=lambda candidate: candidate[0])
    for _, text, problem in candidates[:MAX_EXPLANATIONS]:
        with suppress(MeasurementError):
            _calibration(problem, MAX_EXPLAINED_MISFIT)
            return f'the measurements are {text}'
    return ''


def _hypotheses(
    model: MeasurementModel, few: list[MeasuredSeries]
) -> Iterator[tuple[str, MeasurementModel, list[MeasuredSeries]]]:
    """Yield what may explain a misfit: in words, as a model, and measurements as it sees them."""
    drawn_mode = model.linkage.assembly
    modes = [drawn_mode]
    if drawn_mode:
        modes = list(dict.fromkeys([drawn_mode, *assemblies(model.linkage)]))
    for mode, direction in [*product(modes, (model.direction, -model.direction))][1:]:
        is_drawn = mode == drawn_mode
        linkage = model.linkage if is_drawn else model.linkage.in_assembly(mode)
        change = f'direction {direction}' if is_drawn else f'assembly {list(mode)}'
        text = f'those of a leg with {change}: change it in the leg file'
        yield text, replace(model, linkage=linkage, direction=direction), few
    camera_model = model
    if CAMERA[0] not in model.names:
        camera_model = replace(model, optional=(*CAMERA, *model.optional))
        text = 'those of a camera in another pose: try --camera unknown'
        yield text, camera_model, few
    mirrored = []
    for series in few:
        sign = (1, -1) if series.kind == 'point' else 1
        # A tracked crank is mirrored as well.
        crank = series.crank if model.has_encoder else -series.crank
        mirrored.append(replace(series, values=series.values * sign, crank=crank))
    text = 'mirrored: x must point right and y up, as on the drawing'
    yield text, camera_model, mirrored
    rates = np.concatenate([series.rate for series in few])
    # At an even speed a delay is another encoder zero, and explains nothing.
    if DELAY not in model.names and np.std(rates) > EVEN_SPEED * abs(np.mean(rates)):
        delay_model = replace(model, optional=(*model.optional, DELAY))
        yield 'late, or early: try --delay unknown', delay_model, few


def _calibration(problem: Problem, max_misfit: float = MAX_MISFIT) -> Calibration:
    """Return the calibration; a MeasurementError if the measurements are of another leg."""
    model = problem.model
    problem, fit = _outlier_free_fit(problem)
    free = _result(problem, fit)
    calibration = _held_result(problem, fit) if free.observability.combinations else free
    names = ', '.join(f'{series.title} ({series.source})' for series in problem.measured)
    for n, dimension in enumerate(model.linkage.structure.dimensions):
        drawn = model.start[n]
        built = calibration.values[n]
        if abs(built - drawn) > MAX_CORRECTIONS[dimension.unit] * model.units[n]:
            raise MeasurementError(
                f'the measurements fit only a leg with {dimension.name} = {built:.4g} '
                f'{dimension.unit}, drawn {drawn:.4g}: check the points and their topics: {names}'
            )
    if calibration.misfit > min(max_misfit, MAX_HELD_MISFIT * free.misfit):
        raise MeasurementError(
            f'the measurements are not those of this leg: they miss it by '
            f'{100.0 * calibration.misfit:.3g} % of its size. Check the points, their topics, '
            f'units and axes: {names}'
        )
    return calibration


def _outlier_free_fit(problem: Problem) -> tuple[Problem, Fit]:
    """Return the fit of the measurements without outliers, and the problem with its crank."""
    small_problem = problem.with_samples(ROBUST_SAMPLES)
    y = small_problem.start_y
    is_used = np.isfinite(small_problem.rows(y).residuals)
    for _ in range(2):
        fit = small_problem.with_robust_noise(y, is_used)
        y = small_problem.minimized(fit, problem.weak_prior, loss='soft_l1')
    is_used = np.isfinite(problem.rows(y).residuals)
    for _ in range(MAX_ROUNDS):
        was_used = is_used
        is_used = problem.inliers(problem.with_robust_noise(y, is_used))
        fit = problem.with_noise(y, is_used)
        y = problem.minimized(fit, problem.weak_prior)
        if not problem.model.has_encoder:
            problem = problem.with_tracked_crank(fit._replace(y=y))
        if np.array_equal(was_used, is_used):
            break
    fit = problem.likeliest(problem.with_noise(y, is_used))
    return problem, fit._replace(y=problem.minimized(fit, problem.weak_prior))


def _held_result(problem: Problem, fit: Fit) -> Calibration:
    """Return the calibration that holds unobservable combinations near the start."""
    held_count = 0
    for iteration in range(MAX_ROUNDS):
        # A combination that is held stays held: nearer the drawing it may seem observable.
        min_unobservable = held_count if iteration > 1 else 0
        root = _evidence(problem, fit).root
        lost = observability(root, problem.model, min_unobservable).lost
        fit = fit._replace(y=problem.minimized(fit, _prior_rows(problem, lost)))
        if not problem.model.has_encoder:
            problem = problem.with_tracked_crank(fit)
        if iteration and held_count == len(lost):
            break
        held_count = len(lost)
    return _result(problem, fit, held_count)


def _prior_rows(problem: Problem, lost: FloatArray) -> FloatArray:
    """Return the rows of the prior; the user's own holds unobservable combinations as well."""
    fixed = lost[:0] if problem.prior is not None else lost
    return np.vstack([problem.weak_prior, fixed / OPEN_ERROR])


class _Evidence(NamedTuple):
    """Whitened residuals and derivatives, their chi2 per degree of freedom, and information."""

    whitening: Whitening
    residuals: FloatArray
    jacobian: FloatArray
    chi2: float
    # R of the information R^T R, less what the residuals say against the stated noise.
    root: FloatArray


def _evidence(problem: Problem, fit: Fit) -> _Evidence:
    rows = problem.rows(fit.y)
    whitening = Whitening(problem, fit)
    residuals = whitening.residuals(rows.residuals)
    jacobian = whitening(rows.jacobian)
    chi2 = float(residuals @ residuals) / max(1, whitening.count - len(fit.y))
    triangle: Any = np.linalg.qr(jacobian, mode='r')
    # Residuals beyond the stated noise, and those that are alike from sample to sample, make
    # larger errors.
    in_time = np.argsort(whitening.times, kind='stable')
    inflation = _inflation(residuals[in_time] / sqrt(chi2), jacobian[in_time], triangle)
    root = triangle / sqrt(max(1.0, chi2) * inflation)
    return _Evidence(whitening, residuals, jacobian, chi2, root)


def _inflation(residuals: FloatArray, jacobian: FloatArray, triangle: FloatArray) -> float:
    """Return the factor by which residuals that are correlated in time enlarge the covariance."""
    # Scores of stretches have the covariance J^T J = R^T R if residuals are independent.
    stretches = zip(
        np.array_split(jacobian, BLOCKS), np.array_split(residuals, BLOCKS), strict=True
    )
    scores = np.transpose([derivatives.T @ errors for derivatives, errors in stretches])
    _, sizes, axes = np.linalg.svd(triangle)
    is_observable = sizes > ROUNDING * sizes[0]
    whitened = (axes[is_observable] / sizes[is_observable][:, None]) @ scores
    factor = float((whitened**2).sum()) / int(is_observable.sum())
    return factor if factor > MAX_CHANCE else 1.0


def _result(problem: Problem, fit: Fit, held_count: int = 0) -> Calibration:
    """Return the calibration by a fit; `held_count` combinations are held near the drawing."""
    model = problem.model
    evidence = _evidence(problem, fit)
    verdict = observability(evidence.root, model, held_count)
    stacked = np.vstack([evidence.root, _prior_rows(problem, verdict.lost)])
    spread = np.linalg.inv(np.linalg.qr(stacked, mode='r'))
    covariance: FloatArray = spread @ spread.T
    errors = np.sqrt(np.diag(covariance))
    if problem.prior is None:
        errors[verdict.unobservable] = np.nan
    parameters = problem.parameters(fit.y)
    # The phase follows the dimensions.
    if model.has_encoder:
        parameters[model.count] = wrap(parameters[model.count])
    has_stated_noise = all(series.noise for series in problem.measured)
    crank_gap = problem.crank_gap(fit)
    crank_noise = 0.0
    # What samples that are too far apart miss of the motion is no noise.
    if model.has_encoder and not crank_gap:
        crank_noise = hypot(fit.crank_noise, fit.motion.noise if fit.motion else 0.0)
    return Calibration(
        drawn=model.linkage,
        linkage=model.varied(parameters),
        model=model,
        values=parameters,
        standard_errors=errors * model.units,
        covariance=covariance,
        observability=verdict,
        series=tuple(_series_fits(problem, fit)),
        crank_noise=crank_noise,
        crank_gap=crank_gap,
        chi2_dof=evidence.chi2 if has_stated_noise else None,
        late=_unmodelled_delay(problem, fit, evidence),
        prior=problem.prior is not None,
        held_out=_held_out(problem, fit, _prior_rows(problem, verdict.lost)),
    )


def _series_fits(problem: Problem, fit: Fit) -> Iterator[SeriesFit]:
    model = problem.model
    start = problem.parameters(problem.start_y)
    residuals = problem.rows(fit.y).residuals
    for n, series in enumerate(problem.measured):
        is_own = problem.owners == n
        before = model.residuals(series, model.predict(series, start).values)
        after = residuals[is_own].reshape(series.values.shape)
        is_used = fit.is_used[is_own].reshape(series.values.shape)
        yield SeriesFit(series, before, after, is_used[:, 0])


def _held_out(problem: Problem, fit: Fit, prior_rows: FloatArray) -> float | None:
    """Return the residuals of the last turn over their noise, by a fit of the turns before."""
    cranks = np.concatenate([series.crank for series in problem.measured])[problem.samples]
    last = np.argmax(problem.times)
    is_before = np.abs(cranks - cranks[last]) > TURN
    if not is_before.any() or np.ptp(cranks[is_before]) < TURN:
        return None
    is_last = problem.times > problem.times[is_before].max()
    before = fit._replace(is_used=fit.is_used & ~is_last)
    after = fit._replace(is_used=fit.is_used & is_last, y=problem.minimized(before, prior_rows))
    whitening = Whitening(problem, after)
    residuals = whitening.residuals(problem.rows(after.y).residuals)
    return sqrt(float(residuals @ residuals) / max(1, whitening.count))


def _unmodelled_delay(problem: Problem, fit: Fit, evidence: _Evidence) -> float:
    """Return the delay that explains the residuals, if none was asked for; 0 for none [s]."""
    if DELAY in problem.model.names or not problem.model.has_encoder:
        return 0.0
    rows = problem.rows(fit.y)
    rates = np.concatenate([series.rate for series in problem.measured])[problem.samples]
    by_delay = (problem.model.direction * rows.slopes * rates)[:, None]
    column = evidence.whitening(by_delay)[:, 0]
    jacobian = evidence.jacobian
    # What the parameters do not explain of it.
    unexplained = column - jacobian @ np.linalg.lstsq(jacobian, column, rcond=None)[0]
    square = float(unexplained @ unexplained)
    if square <= 1e-6 * float(column @ column):
        return 0.0
    delay = -float(unexplained @ evidence.residuals) / square
    return delay if delay**2 * square > MIN_DELAY_CHI2 else 0.0
