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
from textwrap import indent
from typing import Any, NamedTuple, TypeAlias

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .operations import needed_operations
from .program import Program

# Loading numba and its machine code takes as long as NumPy takes for millions of poses; a batch of
# this size is unlikely to be the only one [poses].
MIN_NUMBA_SIZE = 100_000
# Outputs that numba stores row by row; more are stored in strips of STRIP_SIZE poses first.
MAX_ROWS = 4
STRIP_SIZE = 128
# Cosines and sines of crank angles; the names of outputs, and the array that they are stored in.
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
    """Operations by the slots of their operands and of what they compute."""

    steps: tuple[tuple[Any, int, int, int], ...]
    buffers: int
    output_slots: tuple[int, ...]


class NumpyKernel:
    """
    Runs the operations that the outputs need, on blocks of at most `size` poses.

    Outputs in `tables` are stored there: names, and an array of shape (number of names, legs,
    angles), contiguous.
    """

    def __init__(
        self, program: Program, outputs: Sequence[str], size: int, tables: Tables = ()
    ) -> None:
        names = [outputs]
        self._planes: list[FloatArray] = []
        for table_names, table in tables:
            names.append(table_names)
            self._planes += [*table]
        self._schedule = _schedule(program, tuple(chain(*names)))
        self._memory = np.empty((self._schedule.buffers, size))

    @staticmethod
    def crank(alphas: FloatArray) -> Crank:
        """Return cosines and sines of crank angles, shape (k,); NaN for refused angles."""
        cos = np.cos(alphas)
        sin = np.sin(alphas)
        # NaN fails every comparison.
        cos[~(np.abs(alphas) <= MAX_CRANK_ANGLE)] = np.nan
        return cos, sin

    def run(
        self, constants: FloatArray, legs: slice, crank: Crank, first_angle: int = 0
    ) -> tuple[list[FloatArray], bool]:
        """
        Return the outputs of a block, and whether some are missing; the next run overwrites them.

        `constants` belong to all linkages, of which `legs` are in the block; `crank` has the
        cosines and sines of its k crank angles, shape (k,), or of each leg's, shape (number of
        legs, k); in tables the first of them has the index `first_angle`. Outputs have the shape
        (number of legs, k), NaN where there is no pose. Missing are NaN in the first.
        """
        cos, sin = crank
        leg_constants = constants[:, legs]
        leg_count = leg_constants.shape[1]
        angle_count = cos.shape[-1]
        # The longer axis is contiguous.
        is_transposed = leg_count > angle_count and cos.ndim == 1
        shape = (angle_count, leg_count) if is_transposed else (leg_count, angle_count)
        if is_transposed:
            cos = cos[:, None]
            sin = sin[:, None]
        columns = np.expand_dims(leg_constants, 1 if is_transposed else 2)
        memory = self._memory[:, : leg_count * angle_count].reshape(-1, *shape)
        slots = [cos, sin, *columns, *memory]
        for function, left, right, out in self._schedule.steps:
            if right < 0:
                function(slots[left], out=slots[out])
            else:
                function(slots[left], slots[right], out=slots[out])
        outputs = []
        for slot in self._schedule.output_slots:
            outputs.append(slots[slot].T if is_transposed else slots[slot])
        is_incomplete = bool(np.isnan(outputs[0]).any())
        count = len(outputs) - len(self._planes)
        for plane, output in zip(self._planes, outputs[count:], strict=True):
            plane[legs, slice(first_angle, first_angle + angle_count)] = output
        return outputs[:count], is_incomplete


@cache
def _schedule(program: Program, outputs: tuple[str, ...]) -> _Schedule:
    """Assign a buffer to every number; one that is not read any more is reused."""
    slots = {'cos': 0, 'sin': 1}
    for k in range(len(program.constants)):
        slots[f'k{k}'] = 2 + k
    first = len(slots)
    operations = needed_operations(program.operations, outputs)
    last_use = {}
    for n, operation in enumerate(operations):
        last_use[operation.left] = n
        last_use[operation.right] = n
    last_use |= dict.fromkeys(outputs, len(operations))
    free: list[int] = []
    count = 0
    steps = []
    for n, operation in enumerate(operations):
        left = slots[operation.left]
        right = slots[operation.right] if operation.right else -1
        # An operand in its last use may be overwritten at once.
        for name in dict.fromkeys(operation[2:]):
            if name and last_use[name] == n and slots[name] >= first:
                free.append(slots[name])
        if not free:
            free.append(first + count)
            count += 1
        out = free.pop()
        slots[operation.name] = out
        steps.append((_UFUNCS[operation.operator], left, right, out))
    return _Schedule(tuple(steps), count, tuple(slots[name] for name in outputs))


class NumbaKernel:
    """Runs a compiled program, pose by pose; see `NumpyKernel`."""

    def __init__(
        self, program: Program, outputs: Sequence[str], size: int, tables: Tables = ()
    ) -> None:
        groups = [outputs]
        self._tables: list[FloatArray] = []
        for names, table in tables:
            groups.append(names)
            self._tables.append(table)
        self._place = _compiled_program(_source(program, groups), len(tables))
        self._memory = np.empty(len(outputs) * size)
        self._output_count = len(outputs)

    @staticmethod
    def crank(alphas: FloatArray) -> Crank:
        """Return cosines and sines as `NumpyKernel.crank` does."""
        cos, sin = np.empty((2, alphas.size))
        _compiled_crank()(alphas, cos, sin)
        return cos, sin

    def run(
        self, constants: FloatArray, legs: slice, crank: Crank, first_angle: int = 0
    ) -> tuple[list[FloatArray], bool]:
        """
        Return the outputs of a block, and whether some are missing; the next run overwrites them.

        Parameters and outputs are those of `NumpyKernel.run`, with one crank for all legs.
        """
        cosines, sines = crank
        shape = self._output_count, legs.stop - legs.start, cosines.size
        outputs = self._memory[: prod(shape)].reshape(shape)
        missing_count = self._place(
            constants, legs.start, cosines, sines, first_angle, outputs, *self._tables
        )
        return list(outputs), missing_count > 0


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
    outputs = [*chain(*groups)]
    # Separate rows let the compiler vectorise the loop. It cannot tell many of them apart, but the
    # parts of a strip, whose distances it knows.
    in_strips = len(outputs) > MAX_ROWS
    statements = ['cos = crank_cosines[j]', 'sin = crank_sines[j]', *map(str, program.operations)]
    for n, name in enumerate(outputs):
        target = f'strip[{n * STRIP_SIZE} + j]' if in_strips else f'row{n}[j]'
        statements.append(f'{target} = {name}')
    statements.append(f'missing += isnan({outputs[0]})')
    tables = ', '.join(f'table{n}' for n in range(len(groups)))
    lines = [f'def place(constants, start, cosines, sines, column, {tables}):', '    missing = 0']
    if in_strips:
        lines.append(f'    strip = empty({len(outputs) * STRIP_SIZE})')
    lines.append('    for i in range(table0.shape[1]):')
    lines += [f'        k{k} = constants[{k}, start + i]' for k in range(len(program.constants))]
    if in_strips:
        lines.append(f'        for first in range(0, cosines.shape[0], {STRIP_SIZE}):')
        angles = f'[first : first + {STRIP_SIZE}]'
    else:
        lines += [f'        row{n} = table0[{n}, i]' for n in range(len(outputs))]
        lines.append('        for first in (0,):')
        angles = ''
    lines.append(f'            crank_cosines = cosines{angles}')
    lines.append(f'            crank_sines = sines{angles}')
    lines.append('            for j in range(crank_cosines.shape[0]):')
    lines.append(indent('\n'.join(statements), 16 * ' '))
    if in_strips:
        lines.append(indent('\n'.join(_strip_source(groups)), 12 * ' '))
    return '\n'.join([*lines, '    return missing']) + '\n'


def _strip_source(groups: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines that store a strip in the tables, one for each group of outputs."""
    lines = []
    done = 0
    for n, names in enumerate(groups):
        leg = 'start + i' if n else 'i'
        begin = 'column + first' if n else 'first'
        lines += [
            f'for n in range({len(names)}):',
            f'    row = table{n}[n, {leg}, {begin} : {begin} + {STRIP_SIZE}]',
            f'    strip_row = strip[{STRIP_SIZE} * ({done} + n) :]',
            '    for j in range(crank_cosines.shape[0]):',
            '        row[j] = strip_row[j]',
        ]
        done += len(names)
    return lines


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
