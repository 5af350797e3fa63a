"""The Newton-Raphson method as the courses teach it, for any system of equations."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from . import validation
from .errors import NotConvergedError

Array = NDArray[np.float64]


def newton_raphson(
    f: Callable[[Array], Array],
    phi: Callable[[Array], Array],
    guess: Array,
    *,
    alpha: float,
    tolerance: float,
    max_iterations: int,
) -> Array:
    """
    Return every iterate of x_{k+1} = x_k - Phi_k^-1 f(x_k), the guess first.

    It ends with the first iterate whose correction was at most `tolerance` in every angle.

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
    tolerance : float
        The largest correction at which it has converged [rad].
    max_iterations : int
        How many corrections it may make.

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
    for _ in range(validation.count('max_iterations', max_iterations, 0)):
        x = iterates[-1]
        try:
            correction = np.linalg.solve(phi(x), f(x))
        except np.linalg.LinAlgError:
            reason = 'Phi is singular at the last iterate'
            raise NotConvergedError(alpha, np.array(iterates), reason) from None
        iterates.append(x - correction)
        if not np.isfinite(iterates[-1]).all():
            reason = 'the last iterate is not finite'
            raise NotConvergedError(alpha, np.array(iterates), reason)
        if np.abs(correction).max() <= tolerance:
            return np.array(iterates)
    reason = f'corrections are above {tolerance:g} rad after {max_iterations} iterations'
    raise NotConvergedError(alpha, np.array(iterates), reason)
