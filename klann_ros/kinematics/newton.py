"""Newton-Raphson: the courses' iteration for any system, and its table of iterates."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan
from typing import Protocol

from klann_ros.kinematics.arrays import FloatArray, with_short_repr
import numpy as np

from . import validation
from .errors import NotConvergedError


class System(Protocol):
    """Equations f, shape (n,), of n unknowns x at a driving angle, and their Jacobian Phi."""

    def f(self, alpha: float, x: FloatArray) -> FloatArray:
        """Return the left-hand sides."""

    def phi(self, alpha: float, x: FloatArray) -> FloatArray:
        """Return df/dx, shape (n, n)."""


def newton_raphson(
    system: System,
    alpha: float,
    guess: Sequence[float] | FloatArray,
    *,
    tolerance: float | None,
    max_iterations: int,
    residual: float | None = None,
) -> FloatArray:
    """
    Return every iterate of x_{k+1} = x_k - Phi_k^-1 f(x_k), shape (k, n), the guess first.

    It ends with the first iterate whose correction was at most `tolerance` in every angle [rad],
    None for any, and whose equations are all open by less than `residual` [m]. Without a tolerance
    the guess may be the root already. A NotConvergedError carries the iterates: Phi is singular at
    the last, it is not finite, or `max_iterations` are used up. (SEM 104, lecture 7.)
    """
    iterates = [np.array(guess, dtype=np.float64)]
    open_reason = f'corrections are above {tolerance:g} rad' if tolerance is not None else ''

    def closes() -> bool:
        return residual is None or np.abs(system.f(alpha, iterates[-1])).max() < residual

    for _ in range(validation.whole_number('max_iterations', max_iterations, 0)):
        x = iterates[-1]
        if tolerance is None and residual is not None and closes():
            return np.array(iterates)
        try:
            correction = np.linalg.solve(system.phi(alpha, x), system.f(alpha, x))
        except np.linalg.LinAlgError:
            reason = 'Phi is singular at the last iterate'
            raise NotConvergedError(alpha, np.array(iterates), reason) from None
        iterates.append(x - correction)
        if not np.isfinite(iterates[-1]).all():
            raise NotConvergedError(alpha, np.array(iterates), 'the last iterate is not finite')
        if tolerance is None or np.abs(correction).max() <= tolerance:
            if closes():
                return np.array(iterates)
            open_reason = f'|f| is not below {residual:g}'
    reason = f'{open_reason or "no iteration was made"} after {max_iterations} iterations'
    raise NotConvergedError(alpha, np.array(iterates), reason)


@with_short_repr
@dataclass(frozen=True, eq=False)
class Iterations:
    """
    A run of Newton-Raphson: iterates, residuals, Jacobians; all arrays are read-only.

    `alpha` is the driving angle [rad]; `names` and `units` describe the unknowns: 'rad', or 'm'
    for a sliding distance. `x`, shape (k, n), are the iterates, the guess first; `f`, shape (k,
    n), the equations' left-hand sides at each [m], and `phi`, shape (k, n, n), their Jacobians
    [m/rad].
    """

    alpha: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    x: FloatArray
    f: FloatArray
    phi: FloatArray

    @property
    def corrections(self) -> FloatArray:
        """Return the correction of each iterate but the last, shape (k - 1, n) [rad, m]."""
        return np.diff(self.x, axis=0)

    @property
    def residuals(self) -> FloatArray:
        """Return the largest `|f|` at each iterate, shape (k,) [m]."""
        largest: FloatArray = np.abs(self.f).max(axis=1)
        return largest

    def __str__(self) -> str:
        """Return a table: angles in deg, f in the unit of the lengths, corrections in rad."""
        names = self.names
        residual_names = [f'f{k}' for k in range(1, len(names) + 1)]
        heads = [*names, *residual_names, *(f'd {name}' for name in names)]
        unit = ', m' if 'm' in self.units else ''
        lines = [
            f'{", ".join(names)} [deg{unit}], f, corrections d [rad{unit}]',
            ' k' + ''.join(f'{head:>11}' for head in heads),
        ]
        is_angle = [unknown_unit == 'rad' for unknown_unit in self.units]
        unknowns = np.where(is_angle, np.degrees(self.x), self.x)
        no_correction = np.full((1, len(names)), np.nan)
        corrections = np.vstack([self.corrections, no_correction])
        for k in range(len(self.x)):
            line = f'{k + 1:2}'
            for number in unknowns[k].tolist():
                line += f'{number:11.5f}'
            for number in (*self.f[k].tolist(), *corrections[k].tolist()):
                line += ' ' * 11 if isnan(number) else f'{number:11.3e}'
            lines.append(line.rstrip())
        return '\n'.join(lines)
