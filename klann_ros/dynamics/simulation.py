"""Forward dynamics: the motion by a crank torque, one degree of freedom integrated in time."""

from collections.abc import Callable
from typing import NamedTuple

from klann_ros.kinematics import KinematicsError
from klann_ros.kinematics.arrays import FloatArray
import numpy as np
from numpy.typing import ArrayLike

from .forces import Dynamics

# The crank torque [N m], by time, crank angle and rate [s, rad, rad/s].
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

    times: FloatArray
    alpha: FloatArray
    alpha_rate: FloatArray


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
    Return the motion by a crank torque: a.. = (T - V' - I'/2 a.^2) / I.

    Parameters
    ----------
    dynamics : Dynamics
        The linkage with masses.
    torque : callable or float
        At the crank, of time, crank angle and rate; or a constant [N m].
    times : array-like of float, shape (k,)
        Times of the result, ascending from the start [s].
    alpha, alpha_rate : float
        Crank angle and rate at the start [rad, rad/s].
    tolerance : float
        Of the integration, relative and absolute.

    Raises
    ------
    KinematicsError
        The motion reaches a singular pose, or one that does not close.
    NoScipyError
        scipy is not installed: the extra "dynamics".

    """
    try:
        from scipy.integrate import solve_ivp  # noqa: PLC0415 - scipy is optional
    except ImportError as error:
        raise NoScipyError(
            "a simulation needs scipy: pip install 'klann_ros[dynamics]'"
        ) from error
    instants = np.asarray(times, dtype=np.float64)
    if instants.ndim != 1 or len(instants) < 2 or not (np.diff(instants) > 0.0).all():
        raise ValueError('times are refused: they must be two or more, and ascend')

    def derivative(time: float, state: FloatArray) -> tuple[float, float]:
        angle, rate = state.tolist()
        given = torque(time, angle, rate) if callable(torque) else torque
        inertia, needed = dynamics.inertia_and_torque(angle, rate)
        change = (given - needed) / inertia
        if not np.isfinite(change):
            msg = f'at {time:.6g} s the crank is at {angle:.6g} rad, where it cannot move on'
            raise KinematicsError(msg)
        return rate, change

    found = solve_ivp(
        derivative,
        (instants[0], instants[-1]),
        (alpha, alpha_rate),
        method='DOP853',
        t_eval=instants,
        rtol=tolerance,
        atol=tolerance,
    )
    return Simulation(found.t, *found.y)
