"""
The kernels, which run a program on blocks of poses: NumPy, and numba (the extra "fast").

NumPy runs the operations in few, reused buffers; numba compiles the same list. It is imported only
when it is chosen, since that takes half a second.
"""

from collections.abc import Callable, Sequence
from functools import cache
from hashlib import sha256
from itertools import chain
from math import cos as cosine, isnan, nan, prod, sin as sine, sqrt
import os
from pathlib import Path
import tempfile
from typing import Any, NamedTuple, TypeAlias

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .operations import Operation
from .program import Program

# Loading numba and its machine code takes as long as NumPy takes for millions of poses; a batch of
# this size is unlikely to be the only one [poses].
MIN_NUMBA_SIZE = 100_000
# Results that numba stores row by row; more are stored in strips of STRIP_SIZE poses first.
MAX_ROWS, STRIP_SIZE = 4, 128
# Cosines and sines of crank angles; results and the array of each group of them.
Crank: TypeAlias = tuple[FloatArray, FloatArray]
Tables: TypeAlias = Sequence[tuple[Sequence[str], FloatArray]]
_UFUNCS: dict[str, Any] = {
    '+': np.add,
    '-': np.subtract,
    '*': np.multiply,
    '/': np.divide,
    'sqrt': np.sqrt,
}
# Division by zero gives NaN or an infinity, as in NumPy.
NUMBA_OPTIONS = {'error_model': 'numpy', 'nogil': True}
TABLE = 'float64[:, :, ::1]'
PLACE_SIGNATURE = f'int64(float64[:, ::1], int64, float64[::1], float64[::1], int64, {TABLE}'
CRANK_SIGNATURE = '(float64[::1], float64[::1], float64[::1])'


def choose_kernel(name: str | None, poses: int) -> Any:
    """Return the class of a kernel: by name, or by the number of poses; a ValueError if none."""
    if name not in (None, 'numpy', 'numba'):
        raise ValueError(f"kernel = {name!r} is refused: it must be 'numpy', 'numba' or None")
    if name == 'numpy' or (name is None and poses < MIN_NUMBA_SIZE):
        return NumpyKernel
    problem = _numba_problem()
    if problem and name == 'numba':
        raise ValueError(f"kernel = 'numba' is refused: numba cannot be used here ({problem})")
    return NumpyKernel if problem else NumbaKernel


@cache
def _numba_problem() -> str:
    """Return why numba cannot be imported; '' if it can."""
    try:
        import numba  # noqa: F401, PLC0415 - it takes long to load
    except Exception as error:  # noqa: BLE001, RUF100 - an incompatible numba fails in any way
        return f'{type(error).__name__}: {error}'
    return ''


class _Schedule(NamedTuple):
    """Operations by the indices of their operands and results among the buffers."""

    steps: tuple[tuple[Any, int, int, int], ...]
    buffers: int
    results: tuple[int, ...]


class NumpyKernel:
    """
    Runs the operations that the results need, on blocks of at most `size` poses.

    Results in `tables` are stored there: names, and an array of shape (number of names, legs,
    angles), contiguous.
    """

    def __init__(
        self, program: Program, results: Sequence[str], size: int, tables: Tables = ()
    ) -> None:
        names = (*results, *chain(*(names for names, _ in tables)))
        self._schedule = _schedule(program, names)
        self._memory = np.empty((self._schedule.buffers, size))
        self._rows = [row for _, table in tables for row in table]

    @staticmethod
    def crank(alphas: FloatArray) -> Crank:
        """Return cosines and sines of crank angles, shape (k,); NaN for refused angles."""
        cos, sin = np.cos(alphas), np.sin(alphas)
        # NaN fails every comparison.
        cos[~(np.abs(alphas) <= MAX_CRANK_ANGLE)] = np.nan
        return cos, sin

    def run(
        self, constants: FloatArray, legs: slice, crank: Crank, first: int = 0
    ) -> tuple[list[FloatArray], bool]:
        """
        Return the results of a block, and whether some are missing; the next run overwrites them.

        `constants` are those of all linkages, of which `legs` are in the block; `crank` has the
        cosines and sines of its k crank angles, shape (k,), or of each leg's, shape (number of
        legs, k); in tables the first of them has the index `first`. Results have the shape (number
        of legs, k), NaN where there is no pose. Missing are NaN in the first.
        """
        cos, sin = crank
        own = constants[:, legs]
        count, angles = own.shape[1], cos.shape[-1]
        # The longer axis is contiguous.
        across = count > angles and cos.ndim == 1
        shape = (angles, count) if across else (count, angles)
        given = np.expand_dims(own, 1 if across else 2)
        expanded = (each[:, None] if across else each for each in (cos, sin))
        memory = self._memory[:, : count * angles].reshape(-1, *shape)
        slots = [*expanded, *given, *memory]
        for function, one, other, out in self._schedule.steps:
            if other < 0:
                function(slots[one], out=slots[out])
            else:
                function(slots[one], slots[other], out=slots[out])
        found = [slots[place] for place in self._schedule.results]
        missing = bool(np.isnan(found[0]).any())
        found = [array.T for array in found] if across else found
        count = len(found) - len(self._rows)
        for row, number in zip(self._rows, found[count:], strict=True):
            row[legs, slice(first, first + angles)] = number
        return found[:count], missing


@cache
def _schedule(program: Program, results: tuple[str, ...]) -> _Schedule:
    """Assign a buffer to every number; one that is not read any more is reused."""
    places = {'cos': 0, 'sin': 1}
    places |= {f'k{k}': 2 + k for k in range(len(program.constants))}
    first = len(places)
    needed = _needed(program, results)
    last_use = {name: at for at, step in enumerate(needed) for name in (step.left, step.right)}
    last_use |= dict.fromkeys(results, len(needed))
    free: list[int] = []
    count = 0
    steps = []
    for at, step in enumerate(needed):
        read = [places[name] for name in (step.left, step.right) if name]
        last = [n for n in dict.fromkeys((step.left, step.right)) if n and last_use[n] == at]
        # An operand in its last use may be overwritten at once.
        free += [places[name] for name in last if places[name] >= first]
        if not free:
            free.append(first + count)
            count += 1
        places[step.name] = free.pop()
        other = read[1] if len(read) > 1 else -1
        steps.append((_UFUNCS[step.operator], read[0], other, places[step.name]))
    return _Schedule(tuple(steps), count, tuple(places[name] for name in results))


def _needed(program: Program, results: Sequence[str]) -> list[Operation]:
    """Return the operations on which the results depend."""
    wanted, found = {*results}, list[Operation]()
    for step in reversed(program.operations):
        if step.name in wanted:
            wanted |= {step.left, step.right}
            found.append(step)
    return found[::-1]


class NumbaKernel:
    """Runs a compiled program, pose by pose; see `NumpyKernel`."""

    def __init__(
        self, program: Program, results: Sequence[str], size: int, tables: Tables = ()
    ) -> None:
        groups = [results, *(names for names, _ in tables)]
        self._place = _compiled_program(_source(program, groups), len(tables))
        self._memory, self._results = np.empty(len(results) * size), len(results)
        self._tables = [table for _, table in tables]

    @staticmethod
    def crank(alphas: FloatArray) -> Crank:
        """As `NumpyKernel.crank`."""
        cos, sin = np.empty((2, alphas.size))
        _compiled_crank()(alphas, cos, sin)
        return cos, sin

    def run(
        self, constants: FloatArray, legs: slice, crank: Crank, first: int = 0
    ) -> tuple[list[FloatArray], bool]:
        """As `NumpyKernel.run`, with one crank for all legs."""
        shape = self._results, legs.stop - legs.start, crank[0].size
        rows = self._memory[: prod(shape)].reshape(shape)
        missing = self._place(constants, legs.start, *crank, first, rows, *self._tables)
        return [*rows], bool(missing)


@cache
def _compiled_crank() -> Any:
    return _compile(_crank, CRANK_SIGNATURE)


def _crank(alphas: FloatArray, cos: FloatArray, sin: FloatArray) -> None:
    for j in range(alphas.size):
        alpha = alphas[j] if abs(alphas[j]) <= MAX_CRANK_ANGLE else nan
        cos[j] = cosine(alpha)
        sin[j] = sine(alpha)


def _source(program: Program, groups: Sequence[Sequence[str]]) -> str:
    """Return the source of the function; it contains only indices and operators."""
    constants = [f'k{k} = constants[{k}, start + i]' for k in range(len(program.constants))]
    steps = ['cos = own_cosines[j]', 'sin = own_sines[j]']
    steps += map(str, program.operations)
    results = [*chain(*groups)]
    # Separate rows let the compiler vectorise the loop. It cannot tell many of them apart, but the
    # parts of a strip, whose distances it knows.
    in_strips = len(results) > MAX_ROWS
    for n, name in enumerate(results):
        target = f'strip[{n * STRIP_SIZE} + j]' if in_strips else f'row{n}[j]'
        steps.append(f'{target} = {name}')
    steps.append(f'missing += isnan({results[0]})')
    tables = [f'table{n}' for n in range(len(groups))]
    lines = [f'def place(constants, start, cosines, sines, column, {", ".join(tables)}):']
    lines += ['    missing = 0', *[f'    strip = empty({len(results) * STRIP_SIZE})'] * in_strips]
    lines += ['    for i in range(table0.shape[1]):', *(f'        {line}' for line in constants)]
    if in_strips:
        lines.append(f'        for first in range(0, cosines.shape[0], {STRIP_SIZE}):')
    else:
        lines += [f'        row{n} = table0[{n}, i]' for n in range(len(results))]
        lines.append('        for first in (0,):')
    part = f'[first : first + {STRIP_SIZE}]' if in_strips else ''
    lines += [f'            own_{name} = {name}{part}' for name in ('cosines', 'sines')]
    lines += ['            for j in range(own_cosines.shape[0]):']
    lines += [f'                {line}' for line in steps]
    places = [('i', 'first'), *[('start + i', 'column + first')] * (len(groups) - 1)]
    done = 0
    for table, (leg, at), names in zip(tables, places, groups, strict=True) if in_strips else ():
        lines += [f'            for n in range({len(names)}):']
        lines += [f'                row = {table}[n, {leg}, {at} : {at} + {STRIP_SIZE}]']
        lines += [f'                own = strip[{STRIP_SIZE} * ({done} + n) :]']
        lines += ['                for j in range(own_cosines.shape[0]):']
        lines += ['                    row[j] = own[j]']
        done += len(names)
    return '\n'.join([*lines, '    return missing']) + '\n'


@cache
def _compiled_program(text: str, tables: int) -> Any:
    path = _source_file(text)
    names: dict[str, Any] = {'sqrt': sqrt, 'isnan': isnan, 'empty': np.empty, '__name__': __name__}
    exec(compile(text, path or '<klann_ros kernel>', 'exec'), names)  # noqa: S102 - our own source
    signature = PLACE_SIGNATURE + f', {TABLE}' * tables + ')'
    return _compile(names['place'], signature, cached=bool(path))


def _source_file(text: str) -> str:
    """
    Return a file with the source, next to which numba caches its machine code; '' if none.

    The file is never read: its name, a hash of the source, is the key of numba's cache.
    """
    folder = Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache') / 'klann_ros'
    path = folder / f'kernel_{sha256(text.encode()).hexdigest()[:24]}.py'
    try:
        if not path.is_file():
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile('w', dir=folder, delete=False) as file:
                file.write(text)
            Path(file.name).replace(path)
    except OSError:
        return ''
    return str(path)


def _compile(function: Callable[..., Any], signature: str, *, cached: bool = True) -> Any:
    """Compile at once; cache the machine code for later runs if there is a folder for it."""
    import numba  # noqa: PLC0415 - see `_numba_problem`

    try:
        return numba.njit(signature, cache=cached, **NUMBA_OPTIONS)(function)
    except Exception:  # noqa: BLE001, RUF100 - the cache has no place, no room, or is broken
        return numba.njit(signature, **NUMBA_OPTIONS)(function)
