"""The kernel in NumPy: a program's operations on blocks of poses, in few buffers."""

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .program import Program

_FUNCTIONS: dict[str, Any] = {
    '+': np.add,
    '-': np.subtract,
    '*': np.multiply,
    '/': np.divide,
    'sqrt': np.sqrt,
}


class _Schedule(NamedTuple):
    """Operations by the places of what they read and write; the results stay where they are."""

    steps: tuple[tuple[Any, int, int, int], ...]
    buffers: int
    results: tuple[int, ...]


def turn(alphas: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return cosines and sines of crank angles, shape (k,) each; NaN for those refused."""
    cos, sin = np.cos(alphas), np.sin(alphas)
    # NaN fails every comparison.
    cos[~(np.abs(alphas) <= MAX_CRANK_ANGLE)] = np.nan
    return cos, sin


class NumpyKernel:
    """Runs a program, as far as its results are wanted, on blocks of at most `size` poses."""

    def __init__(self, program: Program, results: Sequence[str], size: int) -> None:
        self._schedule = _schedule(program, tuple(results))
        self._memory = np.empty((self._schedule.buffers, size))

    def run(
        self, constants: FloatArray, legs: slice, crank: tuple[FloatArray, FloatArray]
    ) -> tuple[list[FloatArray], bool]:
        """
        Return the results of a block, and whether some are missing; the next one overwrites them.

        `constants` are those of all linkages, of which `legs` are in the block; `crank` the
        cosines and sines of its k crank angles, shape (k,), or of those of each leg, (number of
        legs, k). Results have the shape (number of legs, k), NaN where there is no pose; missing
        is what is so in the first.
        """
        cos, sin = crank
        own = constants[:, legs]
        count, angles = own.shape[1], cos.shape[-1]
        # The longer side along the rows.
        across = count > angles and cos.ndim == 1
        shape = (angles, count) if across else (count, angles)
        given = np.expand_dims(own, 1 if across else 2)
        turned = (each[:, None] if across else each for each in (cos, sin))
        memory = self._memory[:, : count * angles].reshape(-1, *shape)
        slots = [*turned, *given, *memory]
        for function, one, other, out in self._schedule.steps:
            if other < 0:
                function(slots[one], out=slots[out])
            else:
                function(slots[one], slots[other], out=slots[out])
        found = [slots[place] for place in self._schedule.results]
        missing = bool(np.isnan(found[0]).any())
        return [array.T for array in found] if across else found, missing


@cache
def _schedule(program: Program, results: tuple[str, ...]) -> _Schedule:
    """Give every number a place; that of one which is not read any more goes to the next."""
    places = {'cos': 0, 'sin': 1}
    places |= {f'k{k}': 2 + k for k in range(len(program.constants))}
    first = len(places)
    needed = _needed(program, results)
    last_use = {name: at for at, step in enumerate(needed) for name in (step.one, step.other)}
    last_use |= dict.fromkeys(results, len(needed))
    free: list[int] = []
    count = 0
    steps = []
    for at, step in enumerate(needed):
        read = [places[name] for name in (step.one, step.other) if name]
        last = [n for n in dict.fromkeys((step.one, step.other)) if n and last_use[n] == at]
        # What is not read any more may be written over at once.
        free += [places[name] for name in last if places[name] >= first]
        if not free:
            free.append(first + count)
            count += 1
        places[step.name] = free.pop()
        other = read[1] if len(read) > 1 else -1
        steps.append((_FUNCTIONS[step.operator], read[0], other, places[step.name]))
    return _Schedule(tuple(steps), count, tuple(places[name] for name in results))


def _needed(program: Program, results: Sequence[str]) -> list[Any]:
    """Return the operations that lead to the results."""
    wanted, found = {*results}, []
    for step in reversed(program.operations):
        if step.name in wanted:
            wanted |= {step.one, step.other}
            found.append(step)
    return found[::-1]


Kernel = NumpyKernel
