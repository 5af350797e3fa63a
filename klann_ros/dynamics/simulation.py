"""The motion that a torque at the crank makes: the one degree of freedom, integrated in time."""

from collections.abc import Callable
from typing import NamedTuple

from klann_ros.kinematics import KinematicsError
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .forces import Dynamics

Array = NDArray[np.float64]
# Of time, crank angle and rate [s, rad, rad/s]: the torque at the crank [N m].
Torque = Callable[[float, float, float], float]


class Simulation(NamedTuple):
    """
    A motion in time.

    Attributes
    ----------
    times : numpy.ndarray, shape (k,)
        [s]
    alpha, alpha_rate : numpy.ndarray, shape (k,)
        Crank angle and rate [rad, rad/s].

    """

    times: Array
    alpha: Array
    alpha_rate: Array


class NoScipyError(ImportError):
    """scipy is not installed."""


def simulate(
    dynamics: Dynamics,
    torque: Torque | float,
    times: ArrayLike,
    *,
    alpha: float,
    alpha_rate: float = 0.0,
    tolerance: float = 1e-10,
) -> Simulation:
    """
    Return the motion that a torque at the crank makes: a.. = (T - V' - I'/2 a.^2) / I.

    Parameters
    ----------
    dynamics : Dynamics
        What moves.
    torque : callable or float
        At the crank, of time, crank angle and rate; or a constant [N m].
    times : array-like of float, shape (k,)
        When it is asked for, rising; it starts at the first [s].
    alpha, alpha_rate : float
        Crank angle and rate at the start [rad, rad/s].
    tolerance : float
        Of the integration, relative and absolute.

    Raises
    ------
    KinematicsError
        It runs into a pose at which it does not close, or a singular one.
    NoScipyError
        scipy is not installed: the extra "dynamics".

    """
    try:
        from scipy.integrate import solve_ivp  # noqa: PLC0415 - scipy is optional
    except ImportError as error:
        raise NoScipyError(
            "a simulation needs scipy: pip install 'klann_ros[dynamics]'"
        ) from error
    asked = np.asarray(times, dtype=np.float64)
    if asked.ndim != 1 or len(asked) < 2 or not (np.diff(asked) > 0.0).all():
        raise ValueError('times are refused: they must be two or more, and rise')

    def derivative(time: float, state: Array) -> tuple[float, float]:
        angle, rate = state.tolist()
        given = torque(time, angle, rate) if callable(torque) else torque
        inertia, needed = dynamics.inertia_and_torque(angle, rate)
        change = (given - needed) / inertia
        if not np.isfinite(change):
            msg = f'at {time:.6g} s the crank is at {angle:.6g} rad, where no motion follows'
            raise KinematicsError(msg)
        return rate, change

    found = solve_ivp(
        derivative,
        (asked[0], asked[-1]),
        (alpha, alpha_rate),
        method='DOP853',
        t_eval=asked,
        rtol=tolerance,
        atol=tolerance,
    )
    return Simulation(found.t, *found.y)
