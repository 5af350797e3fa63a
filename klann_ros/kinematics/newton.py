"""The Newton-Raphson method as the courses teach it, for any system of equations."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isnan

from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from . import validation
from .errors import NotConvergedError


def newton_raphson(
    f: Callable[[FloatArray], FloatArray],
    phi: Callable[[FloatArray], FloatArray],
    guess: FloatArray,
    *,
    alpha: float,
    tolerance: float | None,
    max_iterations: int,
    residual: float | None = None,
) -> FloatArray:
    """
    Return every iterate of x_{k+1} = x_k - Phi_k^-1 f(x_k), the guess first.

    It ends with the first iterate whose correction was at most `tolerance` in every angle, and
    whose equations are all open by less than `residual`.

    Parameters
    ----------
    f : callable
        The equations' left-hand sides, shape (n,) to shape (n,).
    phi : callable
        Their Jacobian, shape (n,) to shape (n, n).
    guess : numpy.ndarray, shape (n,)
        The first iterate x_1 [rad].
    alpha : float
        The driving angle, for the error's text [rad].
    tolerance : float or None
        The largest correction at which it has converged [rad]; None for any.
    max_iterations : int
        How many corrections it may make.
    residual : float, optional
        What every `|f|` must be below [m]; then the guess may be the root already, if there is no
        tolerance.

    Returns
    -------
    numpy.ndarray, shape (k, n)
        The iterates [rad], not rounded and not wrapped.

    Raises
    ------
    NotConvergedError
        Phi is singular at an iterate, an iterate is not finite, or `max_iterations` are used up.
        It carries the iterates.
    ValueError
        `max_iterations` is no whole number, or negative.

    References
    ----------
    R. Nicoletti, SEM 104 Mecanismos, lecture 7.

    """
    iterates = [np.array(guess, dtype=np.float64)]
    last = f'corrections are above {tolerance:g} rad' if tolerance is not None else ''
    for _ in range(validation.count('max_iterations', max_iterations, 0)):
        x = iterates[-1]
        if tolerance is None and residual is not None and np.abs(f(x)).max() < residual:
            return np.array(iterates)
        try:
            correction = np.linalg.solve(phi(x), f(x))
        except np.linalg.LinAlgError:
            reason = 'Phi is singular at the last iterate'
            raise NotConvergedError(alpha, np.array(iterates), reason) from None
        iterates.append(x - correction)
        if not np.isfinite(iterates[-1]).all():
            reason = 'the last iterate is not finite'
            raise NotConvergedError(alpha, np.array(iterates), reason)
        if tolerance is None or np.abs(correction).max() <= tolerance:
            if residual is None or np.abs(f(iterates[-1])).max() < residual:
                return np.array(iterates)
            last = f'|f| is not below {residual:g} m'
    reason = f'{last or "nothing was done"} after {max_iterations} iterations'
    raise NotConvergedError(alpha, np.array(iterates), reason)


@dataclass(frozen=True, eq=False)
class Iterations:
    """
    A run of Newton-Raphson, as one writes it down; all arrays are read-only.

    Attributes
    ----------
    alpha : float
        The driving angle [rad].
    names, units : tuple of str
        What the unknowns are called, and their units: 'rad', or 'm' of what slides.
    x : numpy.ndarray, shape (k, n)
        The iterates, the guess first.
    f : numpy.ndarray, shape (k, n)
        The equations' left-hand sides at each [m].
    phi : numpy.ndarray, shape (k, n, n)
        Their Jacobian at each [m/rad].

    """

    alpha: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    x: FloatArray
    f: FloatArray
    phi: FloatArray

    @property
    def corrections(self) -> FloatArray:
        """Return what was added to each iterate but the last, shape (k - 1, n) [rad, m]."""
        return np.diff(self.x, axis=0)

    @property
    def residuals(self) -> FloatArray:
        """Return the largest `|f|` at each iterate, shape (k,) [m]."""
        largest: FloatArray = np.abs(self.f).max(axis=1)
        return largest

    def __str__(self) -> str:
        """Return a table: angles in deg, f in the unit of the lengths, corrections in rad."""
        count = len(self.names)
        heads = [
            *self.names,
            *(f'f{k + 1}' for k in range(count)),
            *(f'd {n}' for n in self.names),
        ]
        slides = 'm' in self.units
        unit = ('deg, m', 'rad, m') if slides else ('deg', 'rad')
        lines = [f'{", ".join(self.names)} [{unit[0]}], f, corrections d [{unit[1]}]']
        lines += [' k' + ''.join(f'{head:>11}' for head in heads)]
        shown = np.where([each == 'rad' for each in self.units], np.degrees(self.x), self.x)
        blank = np.full((1, count), np.nan)
        rows = np.hstack([shown, self.f, np.vstack([self.corrections, blank])])
        for k, row in enumerate(rows.tolist(), 1):
            cells = [f'{value:11.5f}' for value in row[:count]]
            cells += [' ' * 11 if isnan(value) else f'{value:11.3e}' for value in row[count:]]
            lines.append(f'{k:2}' + ''.join(cells).rstrip())
        return '\n'.join(lines)
