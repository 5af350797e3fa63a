"""Effect of manufacturing errors on the foot path: Monte Carlo statistics and sensitivities."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from numbers import Real
from typing import Any

from klann_ros.kinematics import validation
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray, IntArray, with_short_repr
from klann_ros.kinematics.linkage.linkage import as_linkage, Linkage
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np

from .poses import linkage_poses, Progress
from .turn_clearance import turn_clearances

DISTRIBUTIONS = ('uniform', 'normal')
# Poses in memory at once: the crank angles are processed in parts.
MAX_STUDY_POSES = 1_000_000


@with_short_repr
@dataclass(frozen=True, eq=False)
class ToleranceStudy:
    """
    Legs within tolerances compared with the nominal leg; all arrays are read-only.

    Statistics at a crank angle are of the legs with a pose there; NaN if there is none, or the
    nominal leg has none.

    Attributes
    ----------
    alphas : numpy.ndarray, shape (k,)
        The crank angles: a turn in equal steps [rad].
    nominal : numpy.ndarray, shape (k, 2)
        Foot path of the nominal leg [m].
    non_turning_fraction : float
        Fraction of the legs that do not turn fully: a loop does not close at one of `alphas`, or a
        dyad between them (with coupled loops only `alphas` count).
    mean : numpy.ndarray, shape (k, 2)
        Mean of H - H_nominal [m].
    rms, p95, p99, largest : numpy.ndarray, shape (k,)
        Statistics of `|H - H_nominal|`: root mean square, 95th and 99th percentile, maximum [m].
    box : numpy.ndarray, shape (k, 2, 2)
        Rows: least and greatest x, y of H at each crank angle [m].
    stride, lift : numpy.ndarray, shape (samples,)
        Extent of each leg's foot path in x and in y [m]; NaN for a leg that does not turn fully.
    names : tuple of str
        Dimensions, in the order of `tolerances` and `sensitivities`.
    tolerances : numpy.ndarray, shape (number of dimensions,)
        The half-widths [m, rad].
    sensitivities : numpy.ndarray, shape (k, number of dimensions, 2)
        Derivatives of the nominal H by each dimension [m/m, m/rad].

    """

    alphas: FloatArray
    nominal: FloatArray
    non_turning_fraction: float
    mean: FloatArray
    rms: FloatArray
    p95: FloatArray
    p99: FloatArray
    largest: FloatArray
    box: FloatArray
    stride: FloatArray
    lift: FloatArray
    names: tuple[str, ...]
    tolerances: FloatArray
    sensitivities: FloatArray

    @property
    def ranking(self) -> list[tuple[str, float]]:
        """
        Return the dimensions by decreasing influence.

        Each has the first-order shift of H by its whole tolerance: root mean square over the crank
        angles with a nominal pose [m].
        """
        shift = np.linalg.norm(self.sensitivities, axis=2) * self.tolerances
        shift = shift[np.isfinite(shift).all(axis=1)]
        rms = np.sqrt((shift**2).sum(axis=0) / max(1, len(shift))).tolist()
        return sorted(zip(self.names, rms, strict=True), key=lambda pair: -pair[1])


def tolerance_study(
    linkage: Any,
    tolerances: Mapping[str, float] | float,
    *,
    samples: int = 1000,
    crank_angles: int = 360,
    distribution: str = 'uniform',
    seed: int = 0,
    progress: Progress | None = None,
) -> ToleranceStudy:
    """
    Return the effect of manufacturing errors on a foot path.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        The nominal leg.
    tolerances : mapping of str to float, or float
        Half-width of each dimension's tolerance, by name [m, rad]; others are exact. A single
        number is the relative half-width of all lengths.
    samples : int
        Number of random legs.
    crank_angles : int
        Number of equal steps of the crank's turn.
    distribution : str
        Distribution of every dimension, independently: 'uniform', or 'normal' with a third of the
        half-width as standard deviation, truncated to the tolerance.
    seed : int
        >= 0; the same seed gives the same legs.
    progress : callable, optional
        Called with (done, total) poses after each part.

    Returns
    -------
    ToleranceStudy
        Statistics of the random legs, and sensitivities of the nominal leg.

    Raises
    ------
    TypeError
        `linkage` is none of these.
    ValueError
        A tolerance is not finite, negative, of no dimension, or not smaller than its length or
        2 pi rad; `samples` or `crank_angles` is no whole number >= 1, or `seed` none >= 0; the
        distribution is unknown.

    Examples
    --------
    >>> from klann_ros.kinematics import KlannGeometry
    >>> study = tolerance_study(KlannGeometry.sem104(), {'l_bc': 0.0005, 'angle_bcg': 0.002})
    >>> study.ranking[0][0]
    'l_bc'

    """
    base = as_linkage(linkage)
    samples = validation.whole_number('samples', samples, 1)
    crank_angles = validation.whole_number('crank_angles', crank_angles, 1)
    seed = validation.whole_number('seed', seed, 0)
    if distribution not in DISTRIBUTIONS:
        msg = f'distribution = {distribution!r} is refused: one of {", ".join(DISTRIBUTIONS)}'
        raise ValueError(msg)
    widths = _half_widths(base, tolerances)
    errors = _draw(distribution, (len(widths), samples), seed)
    numbers = np.array(base.numbers)[:, None] + widths[:, None] * errors
    legs = Variants(base, dict(zip(base.dimensions, numbers, strict=True)))

    alphas = np.arange(crank_angles, dtype=np.float64) * (TURN / crank_angles)
    nominal: Any = linkage_poses(base, alphas, gradients=True)
    turns = np.ones(samples, dtype=bool)
    if base.is_dyadic:
        # NaN fails every comparison.
        turns &= turn_clearances(legs).min(axis=1) >= 0.0
    lower = np.full((samples, 2), np.inf)
    upper = np.full((samples, 2), -np.inf)
    parts = []
    step = max(1, MAX_STUDY_POSES // samples)
    for start in range(0, crank_angles, step):
        end = min(start + step, crank_angles)
        feet = linkage_poses(legs, alphas[start:end]).h
        parts.append(_statistics(feet, nominal.h[start:end]))
        turns &= ~np.isnan(feet[..., 0]).any(axis=1)
        # fmin and fmax ignore a missing foot.
        np.fmin(lower, np.fmin.reduce(feet, axis=1), out=lower)
        np.fmax(upper, np.fmax.reduce(feet, axis=1), out=upper)
        if progress is not None:
            progress(end * samples, crank_angles * samples)
    extent = np.where(turns[:, None], upper - lower, np.nan)
    arrays = {
        'alphas': alphas,
        'nominal': nominal.h,
        'stride': extent[:, 0].copy(),
        'lift': extent[:, 1].copy(),
        'tolerances': widths,
        'sensitivities': nominal.h_gradient.swapaxes(1, 2),
    }
    for name in parts[0]:
        arrays[name] = np.concatenate([part[name] for part in parts])
    for array in arrays.values():
        array.setflags(write=False)
    fraction = float((~turns).mean())
    return ToleranceStudy(**arrays, non_turning_fraction=fraction, names=nominal.dimension_names)


def _half_widths(linkage: Linkage, tolerances: Mapping[str, float] | float) -> FloatArray:
    """Return the half-width of every dimension [m, rad]."""
    numbers = linkage.dimensions
    lengths = {}
    limits = {}
    for d in linkage.structure.dimensions:
        if d.is_length:
            lengths[d.name] = numbers[d.name]
        elif d.unit == 'rad':
            limits[d.name] = TURN
    if not isinstance(tolerances, Mapping):
        if not (isinstance(tolerances, Real) and -inf < tolerances < inf):
            raise ValueError(
                f'tolerances = {tolerances!r} is refused: '
                'it must be finite, or a mapping of names to half-widths'
            )
        tolerances = {name: float(length * tolerances) for name, length in lengths.items()}
    unknown = [str(name) for name in tolerances if name not in numbers]
    if unknown:
        msg = f'tolerances of {", ".join(unknown)} are refused: the names are {", ".join(numbers)}'
        raise ValueError(msg)
    for name, width in tolerances.items():
        # NaN fails every comparison.
        largest = lengths.get(name, limits.get(name, inf))
        if not (isinstance(width, Real) and 0.0 <= width < largest):
            limit = '2 pi rad (degrees?)' if name in limits else 'the length'
            raise ValueError(
                f'tolerance of {name} = {width!r} is refused: '
                f'it must be finite, not negative, and smaller than {limit}'
            )
    return np.array([float(tolerances.get(name, 0.0)) for name in numbers])


def _draw(distribution: str, shape: tuple[int, int], seed: int) -> FloatArray:
    """Return errors in [-1, 1], in half-widths."""
    random = np.random.default_rng(seed)
    if distribution == 'uniform':
        return random.uniform(-1.0, 1.0, shape)
    errors = random.normal(0.0, 1.0 / 3.0, shape)
    while (outside := np.abs(errors) > 1.0).any():
        errors[outside] = random.normal(0.0, 1.0 / 3.0, int(outside.sum()))
    return errors


def _statistics(feet: FloatArray, nominal: FloatArray) -> dict[str, FloatArray]:
    """
    Return the statistics of a ToleranceStudy at k crank angles.

    `feet` are the feet of the legs, shape (legs, k, 2), NaN where missing.
    """
    is_missing = np.isnan(feet)
    shift = feet - nominal
    count = (~is_missing[..., 0]).sum(axis=0)
    # NaN comes last in order.
    distance = np.sort(np.hypot(shift[..., 0], shift[..., 1]), axis=0)
    lower = np.where(is_missing, np.inf, feet).min(axis=0)
    upper = np.where(is_missing, -np.inf, feet).max(axis=0)
    statistics = {
        'mean': _total(shift) / np.maximum(1, count)[:, None],
        'rms': np.sqrt(_total(distance * distance) / np.maximum(1, count)),
        'p95': _percentile(distance, count, 0.95),
        'p99': _percentile(distance, count, 0.99),
        'largest': _percentile(distance, count, 1.0),
        'box': np.stack([lower, upper], axis=1),
    }
    is_undefined = (count == 0) | np.isnan(nominal[:, 0])
    for statistic in statistics.values():
        statistic[is_undefined] = np.nan
    return statistics


def _total(of_legs: FloatArray) -> FloatArray:
    """Return the sum over the legs, NaN omitted."""
    return np.asarray(np.where(np.isnan(of_legs), 0.0, of_legs).sum(axis=0), dtype=np.float64)


def _percentile(distance: FloatArray, count: IntArray, fraction: float) -> FloatArray:
    """Return the nearest-rank percentile of sorted distances, by a fraction of the legs."""
    rank = np.maximum(0, np.ceil(fraction * count).astype(int) - 1)
    percentile: FloatArray = distance[rank, np.arange(distance.shape[1])]
    return percentile
