"""Dimensions rounded to what can be cut: the best of the neighbours on both sides."""

from collections.abc import Callable, Mapping
from itertools import combinations
from typing import Any, NamedTuple

from klann_ros.kinematics import Linkage, Variants
from klann_ros.kinematics.arrays import BoolArray, FloatArray
import numpy as np

from .space import Space, Units

KEYS = {'length': 'lengths', 'brace': 'lengths', 'x': 'pivots', 'y': 'pivots', 'bend': 'angles'}
# Roundings up and down that are tried at random, and steps of the search from the best of them.
RANDOM_ROUNDINGS, MAX_STEPS = 256, 50
# Rounding of the numbers of a file [m, rad].
FILE_ERROR = 1e-9


class Rounding(NamedTuple):
    """Steps, scalar, or a stock of lengths, by kind [m, rad]."""

    sizes: Mapping[str, FloatArray]

    @classmethod
    def of(cls, content: Any, units: Units) -> 'Rounding':
        """Return the rounding of the key `round`: by kind, or a step of lengths and pivots."""
        if not isinstance(content, Mapping):
            content = {'lengths': content, 'pivots': content}
        sizes = {}
        for key, size in content.items():
            sizes[key] = np.array(size) * units.size('rad' if key == 'angles' else 'm')
        return cls(sizes)

    def neighbours(self, kind: str, number: float) -> FloatArray | None:
        """Return the sizes below and above a dimension; None if it is not rounded."""
        key = KEYS[kind]
        if key not in self.sizes:
            return None
        # Of a dimension that is one of the sizes both are that one.
        bounds = number + FILE_ERROR * np.array([1.0, -1.0])
        sizes = np.sort(self.sizes[key], axis=None)
        if self.sizes[key].ndim:
            places = np.searchsorted(sizes, bounds) - [1, 0]
            return np.asarray(sizes[np.clip(places, 0, len(sizes) - 1)])
        steps = np.array([np.floor(bounds[0] / sizes[0]), np.ceil(bounds[1] / sizes[0])])
        # Not -0.0.
        steps = np.maximum(steps, 1.0 if key == 'lengths' else -np.inf) + 0.0
        return np.asarray(sizes[0] * steps)

    def error(self, space: Space, linkage: Linkage) -> float:
        """Return the greatest distance of a dimension from a size, or from its tie [m, rad]."""
        errors = []
        for dimension in linkage.structure.dimensions:
            number = linkage.dimensions[dimension.name]
            neighbours = self.neighbours(dimension.kind, number)
            if neighbours is not None:
                errors.append(float(np.abs(neighbours - number).min()))
            leader, sign = space.ties.get(dimension.name, (dimension.name, 1))
            errors.append(abs(number - sign * linkage.dimensions[leader]))
        return max(errors)


def rounded(
    rounding: Rounding, space: Space, linkage: Linkage, scores: Callable[[Variants], Any]
) -> Linkage:
    """Return a linkage of a space rounded, ties kept, by the limits, then by the losses."""
    choices = {}
    for dimension in linkage.structure.dimensions:
        neighbours = rounding.neighbours(dimension.kind, linkage.dimensions[dimension.name])
        if neighbours is not None and dimension.name not in space.ties:
            choices[dimension.name] = neighbours
    reference = np.abs(scores(Variants(linkage, {})).losses)
    reference[reference == 0.0] = 1.0

    def best(is_up: BoolArray) -> BoolArray:
        """Return the best row, of equal ones the first."""
        judged = scores(_variants(space, linkage, choices, is_up))
        loss = (judged.losses / reference).sum(axis=1)
        return np.asarray(is_up[np.lexsort([loss, judged.total])[0]])

    numbers = np.array([linkage.dimensions[name] for name in choices])
    low, high = np.array([*choices.values()]).T
    random = np.random.default_rng(0).uniform(size=(RANDOM_ROUNDINGS, len(choices))) < 0.5
    chosen = best(np.vstack([numbers - low > high - numbers, random]))
    flips = [*np.eye(len(choices), dtype=bool)]
    flips += [a | b for a, b in combinations(flips, 2)]
    for _ in range(MAX_STEPS):
        better = best(np.vstack([chosen, chosen ^ flips]))
        if (better == chosen).all():
            break
        chosen = better
    return _variants(space, linkage, choices, chosen[None])[0]


def _variants(
    space: Space, linkage: Linkage, choices: Mapping[str, FloatArray], is_up: BoolArray
) -> Variants:
    """Return a linkage with the lower or the upper size of each dimension, shape (n, d)."""
    columns = {}
    for (name, neighbours), column in zip(choices.items(), is_up.T, strict=True):
        columns[name] = neighbours[column.astype(int)]
    for name, (leader, sign) in space.ties.items():
        if leader in columns:
            columns[name] = sign * columns[leader]
    return Variants(linkage, columns)
