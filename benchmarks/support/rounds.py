"""Ways to do the same work, timed in turn; what counts is the ratio within a round."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import median
from time import perf_counter

import numpy as np

from .aims import is_met


@dataclass
class Way:
    """A name, how many poses one call makes, and the call, which returns H if it makes it."""

    name: str
    poses: int
    call: Callable[[], Sequence[tuple[float, float]] | np.ndarray | None]
    times: list[float] = field(default_factory=list)
    error: float | None = None

    @property
    def time(self) -> float:
        """Return the median time a pose [s]."""
        return median(self.times)

    def ratio(self, other: 'Way') -> float:
        """Return how much longer it takes a pose than another: the median over the rounds."""
        return median(own / its for own, its in zip(self.times, other.times, strict=True))


@dataclass(frozen=True)
class Aim:
    """Maximum ratio of the times per pose of two solvers; None: only reported."""

    way: str
    other: str
    most: float | None = None


def run(ways: Sequence[Way], expected: np.ndarray, rounds: int) -> None:
    """Time all ways in turn, several times; take the errors of the first round."""
    for way in ways:
        feet = way.call()
        if feet is not None:
            way.error = float(np.abs(np.asarray(feet) - expected[: way.poses]).max())
    for _ in range(rounds):
        for way in ways:
            begin = perf_counter()
            way.call()
            way.times.append((perf_counter() - begin) / way.poses)


def report(ways: Sequence[Way], aims: Sequence[Aim]) -> bool:
    """Print the results; return whether the aims are met."""
    print(f'{"":36} {"poses":>9} {"us a pose":>10} {"best":>9} {"error/m":>9}')
    for way in ways:
        error = '' if way.error is None else f'{way.error:.1e}'
        best = min(way.times) * 1e6
        print(f'{way.name:36} {way.poses:9} {way.time * 1e6:10.4f} {best:9.4f} {error:>9}')
    named = {way.name: way for way in ways}
    met = True
    for aim in aims:
        ratio = named[aim.way].ratio(named[aim.other])
        name = f'{aim.way} / {aim.other}'
        if aim.most is None:
            print(f'{name}: {ratio:.4f}')
        else:
            met &= is_met(name, ratio, aim.most)
    return met
