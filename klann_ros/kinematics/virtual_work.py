"""
The principle of virtual work between a crank and a foot: what one bears, the other must balance.

With the crank's torque T and the force F on the foot H, no friction and no weight, a leg is in
equilibrium where no small motion does work, T dalpha + F . dH = 0, so

    T = -F . dH/dalpha.

All that is needed of a linkage is dH/dalpha, its `velocity(pose, 1.0).h`.
"""

from collections.abc import Sequence
from math import hypot, isfinite
from sys import float_info

from .errors import KinematicsError

# Below this part of |dH/dalpha| the component along a direction is rounding.
ROUNDING = 8.0 * float_info.epsilon


class ImmobileDirectionError(KinematicsError):
    """
    A direction in which the foot does not move, so that any force along it is balanced.

    Attributes
    ----------
    h_1 : tuple of float
        dH/dalpha (x, y) [m/rad].
    direction : tuple of float
        The direction (x, y), of length 1.

    """

    def __init__(self, h_1: tuple[float, float], direction: tuple[float, float]) -> None:
        """Keep the numbers."""
        super().__init__(h_1, direction)
        self.h_1 = h_1
        self.direction = direction

    def __str__(self) -> str:
        (x_1, y_1), (u, v) = self.h_1, self.direction
        return (
            f'the foot does not move along ({u:.6g}, {v:.6g}), since '
            f'dH/dalpha = ({x_1:.6g}, {y_1:.6g}) m/rad: any force along it is balanced'
        )


def crank_torque(h_1: Sequence[float], force: Sequence[float]) -> float:
    """
    Return the torque at the crank that balances a force on the foot: T = -F . dH/dalpha [N m].

    Parameters
    ----------
    h_1 : sequence of float, shape (2,)
        dH/dalpha (x, y) [m/rad].
    force : sequence of float, shape (2,)
        The force that acts on the foot (x, y) [N].

    Returns
    -------
    float
        The torque that the crank must apply, counter-clockwise positive [N m].

    Raises
    ------
    ValueError
        A number is not finite, or there are not two of them.

    References
    ----------
    J. J. Uicker, G. R. Pennock, J. E. Shigley, Theory of Machines and Mechanisms, the chapter on
    static force analysis.

    """
    x_1, y_1 = _vector('h_1', h_1)
    f_x, f_y = _vector('force', force)
    # From 0.0, so that no force takes a torque of 0.0 and not of -0.0.
    return 0.0 - (f_x * x_1 + f_y * y_1)


def foot_force(h_1: Sequence[float], torque: float, direction: Sequence[float]) -> float:
    """
    Return the force on the foot along a direction that a torque at the crank balances [N].

    With the direction's unit vector u: F = -T / (u . dH/dalpha), the inverse of `crank_torque`.

    Parameters
    ----------
    h_1 : sequence of float, shape (2,)
        dH/dalpha (x, y) [m/rad].
    torque : float
        The crank's torque T, counter-clockwise positive [N m].
    direction : sequence of float, shape (2,)
        The force's direction (x, y), of any length but 0.

    Returns
    -------
    float
        The force that acts on the foot, as a multiple of u: negative when it acts against the
        direction [N].

    Raises
    ------
    ImmobileDirectionError
        The foot does not move along the direction, and any force is balanced.
    ValueError
        A number is not finite, there are not two of them, or the direction has no length.

    """
    x_1, y_1 = _vector('h_1', h_1)
    u, v = _unit(direction)
    if not isfinite(torque):
        msg = f'torque = {torque!r} is refused: it must be finite'
        raise ValueError(msg)
    along = u * x_1 + v * y_1
    if abs(along) <= ROUNDING * hypot(x_1, y_1):
        raise ImmobileDirectionError((x_1, y_1), (u, v))
    return -torque / along


def _vector(name: str, values: Sequence[float]) -> tuple[float, float]:
    try:
        x, y = (float(value) for value in values)
    except (TypeError, ValueError):
        x = y = float('nan')
    if not (isfinite(x) and isfinite(y)):
        msg = f'{name} = {values!r} is refused: it must be two finite numbers'
        raise ValueError(msg)
    return x, y


def _unit(direction: Sequence[float]) -> tuple[float, float]:
    x, y = _vector('direction', direction)
    largest = max(abs(x), abs(y))
    if largest == 0.0:
        msg = f'direction = {direction!r} is refused: it has no length'
        raise ValueError(msg)
    # Made about 1 long first, so that no square is too large or too small for a float.
    x, y = x / largest, y / largest
    return x / hypot(x, y), y / hypot(x, y)
