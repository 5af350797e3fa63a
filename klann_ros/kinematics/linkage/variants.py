"""Many linkages of one structure as arrays of their numbers."""

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import BoolArray
from klann_ros.kinematics.errors import GeometryError
from klann_ros.kinematics.validation import MAX_MAGNITUDE, MIN_MAGNITUDE
from klann_ros.sanitize.text import refusal
import numpy as np
from numpy.typing import ArrayLike

from .equations import link_vectors
from .linkage import as_linkage, Linkage
from .structure import dimension_places


class Variants:
    """
    Linkages that differ in their dimensions alone: thousands a millisecond.

    All are checked at once, like a single linkage; whether they close at any crank angle is left
    to the solver.

    Parameters
    ----------
    base : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage with their structure, assembly and other numbers.
    changes : mapping of str to array-like of float
        The numbers that differ, by their names in `Linkage.dimensions`: arrays that broadcast to
        one axis [m, rad].
    assembly : array-like of int, shape (number of blocks, n), optional
        An assembly for each; the base's where left out.

    Attributes
    ----------
    numbers : numpy.ndarray, shape (number of dimensions, n)
        Their numbers [m, rad].
    refused : numpy.ndarray of bool, shape (n,)
        Whether each is no valid linkage: see `reason`.

    Raises
    ------
    GeometryError
        There is no such number, or the arrays do not fit together.
    TypeError
        `base` is none of these, or `changes` no mapping.

    Examples
    --------
    >>> from klann_ros.kinematics import KlannGeometry
    >>> variants = Variants(KlannGeometry.sem104().linkage, {'l_bc': [0.34, 0.35, -1.0]})
    >>> len(variants), variants.refused.tolist(), variants.reason(2)
    (3, [False, False, True], 'l_bc = -1 m is refused: a length must be > 0')

    """

    def __init__(
        self, base: Linkage, changes: Mapping[str, ArrayLike], *, assembly: ArrayLike | None = None
    ) -> None:
        self.base = base = as_linkage(base)
        if not isinstance(changes, Mapping):
            raise TypeError(refusal('changes', changes, 'a mapping of dimensions to arrays'))
        # The linkages that they were made of, if they were.
        self.linkages: list[Linkage] | None = None
        # Those with change points by their rows, once they are searched for.
        self.changing: dict[int, Linkage] | None = None
        places = dimension_places(base.structure.dimensions, changes)
        try:
            arrays = [np.asarray(numbers, dtype=np.float64) for numbers in changes.values()]
            arrays = [*np.broadcast_arrays(*arrays)]
        except (TypeError, ValueError) as error:
            msg = f'the dimensions {", ".join(changes)} are no arrays of one shape: {error}'
            raise GeometryError(msg) from None
        shape = np.broadcast_shapes((1,), *(array.shape for array in arrays))
        if len(shape) != 1:
            raise GeometryError(f'the dimensions have {len(shape)} axes, not one')
        self.numbers = np.repeat(np.array(base.numbers)[:, None], shape[0], axis=1)
        for name, numbers in zip(changes, arrays, strict=True):
            self.numbers[places[name]] = numbers
        signs = np.asarray(base.assembly if assembly is None else assembly, dtype=np.float64)
        self.signs = np.repeat(signs[:, None], shape[0], axis=1) if signs.ndim == 1 else signs
        self.refused = self._refused()

    @classmethod
    def of(cls, linkages: Iterable[Linkage]) -> 'Variants':
        """
        Return linkages of one structure as variants of the first.

        A GeometryError says that there are none, or that they have several structures.
        """
        checked = list(linkages)
        if not checked:
            raise GeometryError('there are no linkages')
        structure = checked[0].structure
        for linkage in checked:
            if linkage.structure is not structure and linkage.structure != structure:
                raise GeometryError('the linkages are of several structures: give them one by one')
        variants = cls.__new__(cls)
        variants.base = checked[0]
        variants.linkages = checked
        variants.changing = None
        variants.numbers = np.array([linkage.numbers for linkage in checked]).T
        variants.signs = np.array([linkage.assembly for linkage in checked], dtype=np.float64).T
        # Each was checked when it was made.
        variants.refused = np.zeros(len(checked), dtype=bool)
        return variants

    def __len__(self) -> int:
        """Return their number."""
        return int(self.numbers.shape[1])

    def __getitem__(self, i: int) -> Linkage:
        """Return one of them; a GeometryError if it is invalid."""
        if self.linkages is not None:
            return self.linkages[i]
        numbers = self.numbers[:, i].tolist()
        linkage = self.base
        # The base keeps its branch, and its change points.
        if tuple(numbers) != linkage.numbers:
            linkage = linkage.varied(dict(zip(linkage.dimensions, numbers, strict=True)))
        signs = tuple(self.signs[:, i].astype(int).tolist())
        return linkage if signs == linkage.assembly else linkage.in_assembly(signs)

    def reason(self, i: int) -> str:
        """Return the error message of one of them; empty for a valid linkage."""
        try:
            _ = self.refused[i] and self[i]
        except GeometryError as error:
            return str(error)
        return ''

    @cached_property
    def vectors(self) -> tuple[list[Any], list[Any]]:
        """Return their pivots and bars: see `link_vectors`; NaN for invalid ones."""
        numbers = self.numbers
        if self.refused.any():
            numbers = np.where(self.refused, np.nan, numbers)
        return link_vectors(self.base.structure, [*numbers])

    def _refused(self) -> BoolArray:
        """Return whether each is invalid, by the rules of a single linkage."""
        structure = self.base.structure
        refused = np.zeros(len(self), dtype=bool)
        with np.errstate(all='ignore'):
            _, bars = link_vectors(structure, [*self.numbers])
        for dimension, numbers in zip(structure.dimensions, self.numbers, strict=True):
            size = numbers if dimension.is_length else np.abs(numbers)
            if dimension.unit == 'rad':
                valid = size <= TURN
            else:
                # NaN fails every comparison.
                valid = (size >= MIN_MAGNITUDE) & (size <= MAX_MAGNITUDE)
                if not dimension.is_length:
                    valid |= size == 0.0
            refused |= ~valid
            if dimension.kind == 'brace':
                refused |= np.isnan(bars[dimension.place])
        return refused
