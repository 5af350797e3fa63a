"""
The kernel compiled by numba: a program's operations in the same order, pose by pose.

Only `poses` imports this module, and only when it is needed: numba takes half a second.
"""

from collections.abc import Callable, Sequence
from functools import cache
from hashlib import sha256
from math import cos as cosine, isnan, nan, prod, sin as sine, sqrt
import os
from pathlib import Path
import tempfile
from typing import Any

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
from klann_ros.kinematics.arrays import FloatArray
import numba
import numpy as np

from .program import Program

# Division by zero gives NaN or an infinity, as in NumPy.
OPTIONS = {'error_model': 'numpy', 'nogil': True}
PLACE = 'int64(float64[:, ::1], int64, float64[::1], float64[::1], float64[:, :, ::1])'
TURN = '(float64[::1], float64[::1], float64[::1])'


def compiled(function: Callable[..., Any], signature: str, *, keep: bool = True) -> Any:
    """Compile at once, and for later runs where there is a place to keep it."""
    try:
        return numba.njit(signature, cache=keep, **OPTIONS)(function)
    except Exception:  # noqa: BLE001, RUF100 - the cache has no place, no room, or is broken
        return numba.njit(signature, **OPTIONS)(function)


def turn(alphas: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return cosines and sines of crank angles, shape (k,) each; NaN for those refused."""
    cos, sin = np.empty((2, alphas.size))
    _turn_function()(alphas, cos, sin)
    return cos, sin


@cache
def _turn_function() -> Any:
    return compiled(_turn, TURN)


def _turn(alphas: FloatArray, cos: FloatArray, sin: FloatArray) -> None:
    for j in range(alphas.size):
        alpha = alphas[j] if abs(alphas[j]) <= MAX_CRANK_ANGLE else nan
        cos[j] = cosine(alpha)
        sin[j] = sine(alpha)


class NumbaKernel:
    """Runs a program on blocks of at most `size` poses; see `numpy_kernel.NumpyKernel`."""

    def __init__(self, program: Program, results: Sequence[str], size: int) -> None:
        self._place = _function(_text(program, tuple(results)))
        self._memory = np.empty(len(results) * size)
        self._results = len(results)

    def run(
        self, constants: FloatArray, legs: slice, crank: tuple[FloatArray, FloatArray]
    ) -> tuple[list[FloatArray], bool]:
        """Return the results of a block, and whether some are missing; see `NumpyKernel.run`."""
        shape = self._results, legs.stop - legs.start, crank[0].size
        rows = self._memory[: prod(shape)].reshape(shape)
        missing = self._place(constants, legs.start, *crank, rows)
        return [*rows], bool(missing)


def _text(program: Program, results: Sequence[str]) -> str:
    """Return the text of the function; there are indices and operators in it, and nothing else."""
    lines = ['def place(constants, start, cosines, sines, rows):', '    missing = 0']
    lines += ['    for i in range(rows.shape[1]):']
    lines += [f'        k{k} = constants[{k}, start + i]' for k in range(len(program.constants))]
    # Rows of their own let the compiler see that the loop can be vectorised.
    lines += [f'        row{n} = rows[{n}, i]' for n in range(len(results))]
    lines += ['        for j in range(cosines.shape[0]):']
    lines += ['            cos = cosines[j]', '            sin = sines[j]']
    for name, operator, one, other in program.operations:
        value = f'{one} {operator} {other}' if other else f'{operator}({one})'
        lines.append(f'            {name} = {value}')
    lines += [f'            row{n}[j] = {name}' for n, name in enumerate(results)]
    lines += [f'            missing += isnan({results[0]})', '    return missing']
    return '\n'.join(lines) + '\n'


@cache
def _function(text: str) -> Any:
    path = _source_file(text)
    names: dict[str, Any] = {'sqrt': sqrt, 'isnan': isnan, '__name__': __name__}
    exec(compile(text, path or '<klann_ros kernel>', 'exec'), names)  # noqa: S102 - our own text
    return compiled(names['place'], PLACE, keep=bool(path))


def _source_file(text: str) -> str:
    """
    Return a file with the text, beside which numba keeps what it compiles; '' for none.

    The file is never read: its name, made from the text, is what numba knows the text by.
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


Kernel = NumbaKernel
