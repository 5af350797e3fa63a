"""What manufacturing errors do to the foot path: many legs drawn at random, and derivatives."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import inf
from numbers import Real
from typing import Any

from klann_ros.kinematics import validation
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import AnyArray, FloatArray
from klann_ros.kinematics.linkage.linkage import as_linkage, Linkage
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np

from .batch import Progress
from .deviations import Deviations, deviations
from .poses import linkage_poses
from .turn_clearance import driven_clearances

DISTRIBUTIONS = ('uniform', 'normal')
# Crank angles are taken in turns, so that no more poses than this are held at once.
POSES_HELD = 1_000_000
# The step of the central differences, relative: their two errors are least together.
STEP = 6e-6


@dataclass(frozen=True, eq=False)
class ToleranceStudy:
    """
    Legs made within tolerances, held against the leg as drawn; all arrays are read-only.

    Statistics at a crank angle are of the legs that have a pose there; NaN where none has, or
    the leg as drawn has none.

    Attributes
    ----------
    alphas : numpy.ndarray, shape (k,)
        The crank angles: a turn in equal steps [rad].
    nominal : numpy.ndarray, shape (k, 2)
        Foot path of the leg as drawn [m].
    stuck : float
        Share of the legs that do not turn fully: a loop does not close at one of `alphas`, or a
        dyad that the crank alone drives between them.
    mean : numpy.ndarray, shape (k, 2)
        Mean of H - H_nominal [m].
    rms, p95, p99, largest : numpy.ndarray, shape (k,)
        Of `|H - H_nominal|`: root mean square, what 95 and 99 % of the legs keep to, maximum [m].
    box : numpy.ndarray, shape (k, 2, 2)
        Rows: least and greatest x, y of H at each crank angle [m].
    stride, lift : numpy.ndarray, shape (samples,)
        Extent of each leg's foot path in x and in y [m]; NaN for a leg that does not turn fully.
    names : tuple of str
        Dimensions, in the order of `tolerances` and `sensitivities`.
    tolerances : numpy.ndarray, shape (number of dimensions,)
        The half-widths [m, rad].
    sensitivities : numpy.ndarray, shape (k, number of dimensions, 2)
        Derivatives of H by each dimension, of the leg as drawn [m/m, m/rad].

    """

    alphas: FloatArray
    nominal: FloatArray
    stuck: float
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
        Return the dimensions, the one that matters most first.

        Each has the shift of H that its whole tolerance makes, to first order: root mean square
        over the crank angles at which the leg as drawn has a pose [m].
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
    Return what manufacturing errors do to a foot's path.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        The leg as drawn.
    tolerances : mapping of str to float, or float
        Half-width of each dimension's tolerance, by its name [m, rad]; those left out are exact. A
        number is the relative half-width of all lengths.
    samples : int
        How many legs are drawn.
    crank_angles : int
        In how many equal steps the crank turns.
    distribution : str
        Of every dimension within its tolerance, each by itself: 'uniform', or 'normal' with a
        third of the half-width as standard deviation, parts out of tolerance being replaced.
    seed : int
        >= 0; the same seed draws the same legs.
    progress : callable, optional
        Called with (done, total) poses now and then.

    Returns
    -------
    ToleranceStudy
        Statistics of the legs drawn, and the derivatives of the leg as drawn.

    Raises
    ------
    TypeError
        `linkage` is none of these.
    ValueError
        A tolerance is no finite number, negative, of no dimension, or not smaller than its length
        or 2 pi rad; `samples` or `crank_angles` is no whole number, at least 1, or `seed` none at
        least 0; there is no such distribution.

    Examples
    --------
    >>> from klann_ros.kinematics import KlannGeometry
    >>> study = tolerance_study(KlannGeometry.sem104(), {'l_bc': 0.0005, 'angle_bcg': 0.002})
    >>> study.ranking[0][0]
    'l_bc'

    """
    draw = tolerance_draw(
        linkage,
        tolerances,
        samples=samples,
        crank_angles=crank_angles,
        distribution=distribution,
        seed=seed,
    )

    def found() -> Iterator[dict[str, Any]]:
        for part in draw.parts:
            yield draw.deviations(part)
            if progress is not None:
                progress(part.stop * draw.samples, len(draw.alphas) * draw.samples)

    return draw.study(found())


@dataclass(frozen=True, eq=False)
class ToleranceDraw:
    """
    Legs drawn within tolerances, to be looked at some crank angles at a time.

    Attributes
    ----------
    linkage : Linkage
        The leg as drawn.
    widths : numpy.ndarray, shape (number of dimensions,)
        Half-widths of the tolerances [m, rad].
    samples, distribution, seed
        As of `tolerance_study`.
    alphas : numpy.ndarray, shape (k,)
        The crank angles [rad].

    """

    linkage: Linkage
    widths: FloatArray
    samples: int
    distribution: str
    seed: int
    alphas: FloatArray

    @property
    def parts(self) -> list[slice]:
        """Return which crank angles are looked at together."""
        step = max(1, POSES_HELD // self.samples)
        count = len(self.alphas)
        return [slice(first, min(first + step, count)) for first in range(0, count, step)]

    @cached_property
    def drawn(self) -> Variants:
        """Return the legs."""
        values = np.array(self.linkage.numbers)
        errors = _draw(self.distribution, (len(values), self.samples), self.seed)
        return _variants(self.linkage, values[:, None] + self.widths[:, None] * errors)

    def deviations(self, part: slice) -> dict[str, AnyArray]:
        """Return what is to be known of the feet at some of the crank angles."""
        alphas = self.alphas[part]
        nominal = linkage_poses(self.linkage, alphas).h
        return deviations(linkage_poses(self.drawn, alphas).h, nominal)

    def study(self, found: Iterable[Mapping[str, Any]]) -> ToleranceStudy:
        """Return the study, given the deviations of all parts in their order."""
        all_found = Deviations(self.samples, len(self.alphas))
        for part, each in zip(self.parts, found, strict=True):
            all_found.add(part, each)
        all_found.exclude(driven_clearances(self.drawn) < 0.0)
        return ToleranceStudy(
            **_read_only(
                alphas=self.alphas,
                nominal=linkage_poses(self.linkage, self.alphas).h,
                **all_found.statistics(),
                tolerances=self.widths,
                sensitivities=_sensitivities(self.linkage, self.alphas),
            ),
            stuck=all_found.stuck,
            names=tuple(self.linkage.dimensions),
        )


def tolerance_draw(
    linkage: Any,
    tolerances: Mapping[str, float] | float,
    *,
    samples: int,
    crank_angles: int,
    distribution: str,
    seed: int,
) -> ToleranceDraw:
    """Return the legs of a `tolerance_study`; parameters and errors as there."""
    drawn_as = as_linkage(linkage)
    samples = validation.count('samples', samples, 1)
    crank_angles = validation.count('crank_angles', crank_angles, 1)
    seed = validation.count('seed', seed, 0)
    if distribution not in DISTRIBUTIONS:
        msg = f'distribution = {distribution!r} is refused: one of {", ".join(DISTRIBUTIONS)}'
        raise ValueError(msg)
    alphas = np.arange(crank_angles, dtype=np.float64) * (TURN / crank_angles)
    widths = _half_widths(drawn_as, tolerances)
    return ToleranceDraw(drawn_as, widths, samples, distribution, seed, alphas)


def _variants(linkage: Linkage, numbers: FloatArray) -> Variants:
    return Variants(linkage, dict(zip(linkage.dimensions, numbers, strict=True)))


def _half_widths(linkage: Linkage, tolerances: Mapping[str, float] | float) -> FloatArray:
    """Return the half-width of every dimension [m, rad]."""
    numbers, dimensions = linkage.dimensions, linkage.structure.dimensions
    lengths = {d.name: numbers[d.name] for d in dimensions if d.is_length}
    turns = {d.name: TURN for d in dimensions if d.unit == 'rad'}
    if not isinstance(tolerances, Mapping):
        if not (isinstance(tolerances, Real) and -inf < tolerances < inf):
            msg = (
                f'tolerances = {tolerances!r} is refused: '
                'it must be finite, or a mapping of names to half-widths'
            )
            raise ValueError(msg)
        tolerances = {name: float(value * tolerances) for name, value in lengths.items()}
    unknown = [str(name) for name in tolerances if name not in numbers]
    if unknown:
        msg = f'tolerances of {", ".join(unknown)} are refused: the names are {", ".join(numbers)}'
        raise ValueError(msg)
    for name, width in tolerances.items():
        # NaN fails every comparison.
        if not (
            isinstance(width, Real) and 0.0 <= width < lengths.get(name, turns.get(name, inf))
        ):
            least = '2 pi rad (degrees?)' if name in turns else 'the length'
            msg = (
                f'tolerance of {name} = {width!r} is refused: '
                f'it must be finite, not negative, and smaller than {least}'
            )
            raise ValueError(msg)
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


def _sensitivities(linkage: Linkage, alphas: FloatArray) -> FloatArray:
    """Return dH/d(dimension) by central differences, shape (k, number of dimensions, 2)."""
    values, dimensions = np.array(linkage.numbers), linkage.structure.dimensions
    largest = max(v for v, d in zip(linkage.numbers, dimensions, strict=True) if d.is_length)
    # A pivot coordinate may be 0, and a bend has its own measure.
    scale = [
        value if d.is_length else largest if d.unit == 'm' else 1.0
        for value, d in zip(linkage.numbers, dimensions, strict=True)
    ]
    steps = np.diag(STEP * np.array(scale))
    shifted = values[:, None] + np.hstack([steps, -steps])
    feet = linkage_poses(_variants(linkage, shifted), alphas).h
    up, down = feet.reshape(2, len(values), -1, 2)
    # The steps as they were rounded.
    made = np.subtract(*(half.diagonal() for half in np.hsplit(shifted, 2)))
    slopes: FloatArray = (up - down) / made[:, None, None]
    return slopes.swapaxes(0, 1)


def _read_only(**arrays: FloatArray) -> dict[str, FloatArray]:
    for array in arrays.values():
        array.setflags(write=False)
    return arrays
