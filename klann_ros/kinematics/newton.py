"""Newton-Raphson: the courses' iteration for any system, and warm starts along a branch."""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, isnan, remainder
from typing import Any, NamedTuple

from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from . import validation
from .angles import TURN
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
        Convergence limit of the correction [rad]; None for any.
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
    reason = f'{last or "no iteration was made"} after {max_iterations} iterations'
    raise NotConvergedError(alpha, np.array(iterates), reason)


@dataclass(frozen=True, eq=False)
class Iterations:
    """
    A run of Newton-Raphson: iterates, residuals, Jacobians; all arrays are read-only.

    Attributes
    ----------
    alpha : float
        The driving angle [rad].
    names, units : tuple of str
        Names and units of the unknowns: 'rad', or 'm' for a sliding distance.
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
        """Return the correction of each iterate but the last, shape (k - 1, n) [rad, m]."""
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


# A warm start that needs more restarts from the closed form.
MAX_ITERATIONS = 10
# Limits of the intermediate poses of a split step, which only have to stay on the branch.
COARSE_TOLERANCE = 1e-3
COARSE_ITERATIONS = 6
# Half a turn is 9 parts of 0.35 rad; for a larger step the closed form is cheaper.
MAX_SUBSTEPS = 9


class FollowSettings(NamedTuple):
    """
    Tolerance and step limits of `follow_branch`.

    The largest correction of a converged pose [rad], the largest undivided step of the crank
    [rad], and the largest number of parts; a larger step restarts from the closed form.
    """

    tolerance: float
    max_crank_step: float
    max_parts: int = MAX_SUBSTEPS


def follow_branch(  # noqa: PLR0917 - as they are called
    correct: Callable[..., Any],
    predict: Callable[..., Any],
    initial_guess: Callable[[float], tuple[float, ...]],
    alpha: float,
    last: Any,
    settings: FollowSettings,
) -> Any:
    """
    Return the pose at a driving angle, on the assembly branch of the last pose.

    The step from the last pose, less whole turns, is split into parts of at most
    `max_crank_step`, each predicted along the tangent and corrected. Without a last pose, after a
    failed part, and from a singular pose, whose sign does not tell the branch, `initial_guess`
    gives the guess. `correct` and `predict` are those of `StepFunctions`.

    Raises
    ------
    NotConvergedError
        Newton-Raphson does not confirm the initial guess.

    """
    tolerance, max_crank_step, max_parts = settings
    if last is not None:
        step = alpha - last[0]
        if not -max_crank_step <= step <= max_crank_step:
            step = remainder(step, TURN)
        if abs(step) <= max_parts * max_crank_step:
            parts = max(1, ceil(abs(step) / max_crank_step))
            pose = _predict_and_correct(predict, alpha, last, tolerance, (step, parts))
            if pose is not None and not isnan(pose.coefficients[0]):
                return pose
    guess = initial_guess(alpha)
    pose = correct(alpha, guess, tolerance, MAX_ITERATIONS)
    if pose is None:
        reason = 'it does not confirm the closed form'
        raise NotConvergedError(alpha, np.array([guess]), reason)
    return pose


def _predict_and_correct(
    predict: Callable[..., Any],
    alpha: float,
    last: Any,
    tolerance: float,
    steps: tuple[float, int],
) -> Any:
    """Return the pose at a driving angle, (step, parts) from the last; None if a part fails."""
    step, parts = steps
    step /= parts
    spent = 0
    for remaining in range(parts - 1, -1, -1):
        between = alpha - remaining * step
        limits = (
            (COARSE_TOLERANCE, COARSE_ITERATIONS) if remaining else (tolerance, MAX_ITERATIONS)
        )
        pose = predict(between, step, last.x, last.coefficients, *limits)
        if pose is None:
            return None
        spent += pose.iterations
        last = pose
    return last if parts == 1 else last._replace(iterations=spent)
