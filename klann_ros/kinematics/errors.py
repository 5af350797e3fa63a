"""
Errors of the kinematics: one class for each cause, with its numbers.

`__str__` formats the text from the attributes, so an error that is only counted costs little, and
it can be pickled.
"""

from dataclasses import dataclass
import math

from klann_ros.kinematics.arrays import FloatArray
import numpy as np


class KinematicsError(Exception):
    """Base of every error that the kinematics raises."""


class GeometryError(KinematicsError, ValueError):
    """An invalid linkage geometry; the text says which condition fails."""


class NotAssembledError(GeometryError):
    """A start that leads to no pose of a definite assembly mode."""


@dataclass(eq=False, repr=False)
class CrankAngleError(KinematicsError, ValueError):
    """An invalid crank angle `alpha` as received, not finite or beyond the `limit` [rad]."""

    alpha: object
    limit: float

    def __str__(self) -> str:
        if isinstance(self.alpha, np.ndarray | list | tuple | range):
            return (
                f'an array of crank angles is refused: it must be one number, finite and within '
                f'+-{self.limit:g} rad; linkage_poses(leg, alphas) and klann_poses(geometry, '
                f'alphas) solve many at once, FourBar.table(theta2) a four-bar'
            )
        return (
            f'crank angle {self.alpha} rad is refused: '
            f'it must be finite and within +-{self.limit:g} rad'
        )


@dataclass(eq=False, repr=False)
class UnreachableError(KinematicsError):
    """
    An unreachable crank angle: a dyad cannot close there.

    Attributes
    ----------
    alpha : float
        Crank angle [rad].
    dyad : int
        Number of the block in the linkage, from 1. Of the Klann leg, 1: coupler BC and rocker DC,
        from B and D; 2: rocker EF and leg FG, from E and G.
    shortfall : float
        Distance of the dyad's ends beyond its reach [m], >= 0; 0 where they coincide and the
        links are equally long, so that the dyad closes in every direction.
    stretched : bool
        True when they are too far apart for the links stretched out, False when they are too
        close together for the links folded.
    names : tuple of str
        Names of the dyad's two ends and two links. With a sliding joint: the end, the slider, the
        link and ''; or the link's pivot, the slider on it, the link and ''.
    unit : str
        Unit of the shortfall; empty where it may be any.

    """

    alpha: float
    dyad: int
    shortfall: float
    stretched: bool
    names: tuple[str, str, str, str]
    unit: str = 'm'

    def __str__(self) -> str:
        p, q, link_1, link_2 = self.names
        if not link_2:
            why = self._why_of_a_line()
        elif self.stretched:
            why = f'{p} and {q} are {self._length} further apart than {link_1} + {link_2}'
        elif self.shortfall:
            limit = f'closer together than |{link_1} - {link_2}|'
            why = f'{p} and {q} are {self._length} {limit}'
        else:
            why = f'{p} and {q} coincide, and the pose is not definite'
        angle = f'{self.alpha:.6f} rad ({math.degrees(self.alpha):.3f} deg)'
        return f'crank angle {angle} cannot be reached: dyad {self.dyad} does not close, {why}'

    @property
    def _length(self) -> str:
        return f'{self.shortfall:.6g} {self.unit}'.rstrip()

    def _why_of_a_line(self) -> str:
        p, q, link, _ = self.names
        if self.stretched:
            distance = f'{self._length} further from the line of {q}'
            return f'{p} is {distance} than {link} is long'
        if self.shortfall:
            return f'{q} is {self._length} nearer to {p} than the line along {link} is'
        return f'{p} and {q} leave the pose indefinite'


@dataclass(eq=False, repr=False)
class LoopsOpenError(KinematicsError):
    """
    A crank angle `alpha` beyond the assembly branch of coupled loops [rad].

    `block` is the number of the block in the linkage, from 1; `nearest` the nearest crank angle
    where its loops close [rad].
    """

    alpha: float
    block: int
    nearest: float

    def __str__(self) -> str:
        return (
            f'crank angle {self.alpha:.6f} rad ({math.degrees(self.alpha):.3f} deg) cannot be '
            f'reached: the coupled loops of block {self.block} do not close, the nearest angle at '
            f'which they do is {self.nearest:.6f} rad ({math.degrees(self.nearest):.3f} deg)'
        )


@dataclass(eq=False, repr=False)
class NotConvergedError(KinematicsError):
    """
    Newton-Raphson did not converge at a driving angle `alpha` [rad], for a `reason`.

    `iterates` are all of them, the guess first, shape (k, n) [rad].
    """

    alpha: float
    iterates: FloatArray
    reason: str

    def __str__(self) -> str:
        return (
            f'Newton-Raphson did not converge at {self.alpha:.6f} rad '
            f'({math.degrees(self.alpha):.3f} deg): {self.reason}'
        )


@dataclass(eq=False, repr=False)
class SingularPoseError(KinematicsError):
    """
    A singular pose: Phi has no inverse, so no velocity exists; a dyad is stretched or folded.

    `alpha` is the crank angle [rad].
    """

    alpha: float

    def __str__(self) -> str:
        return (
            f'the pose at {self.alpha:.6f} rad ({math.degrees(self.alpha):.3f} deg) is singular, '
            f'as where a dyad is stretched out or folded: no velocity follows from the crank rate'
        )


@dataclass(eq=False, repr=False)
class ImmobileDirectionError(KinematicsError):
    """
    A direction without foot motion: any force along it is balanced.

    `h_1` is dH/dalpha (x, y) [m/rad], `direction` the direction (x, y), of length 1.
    """

    h_1: tuple[float, float]
    direction: tuple[float, float]

    def __str__(self) -> str:
        x_1, y_1 = self.h_1
        u, v = self.direction
        return (
            f'the foot does not move along ({u:.6g}, {v:.6g}), since '
            f'dH/dalpha = ({x_1:.6g}, {y_1:.6g}) m/rad: any force along it is balanced'
        )
