"""
The parts of a linkage that are solved one after the other: dyads, and coupled loops.

Each is given the unit vectors u of all bodies, knows those of the bodies before it, and finds
those of its own. Position, velocity and acceleration all come down to one linear step: by which
turns d of its bodies do its loops open by a given r,

    sum over its bodies of i s_j w_j u_j d_j = -r.
"""

from cmath import phase
from collections.abc import Sequence
from math import nan, pi
from sys import float_info
from typing import Any

from klann_ros.kinematics.dyad import clearance, joint
from klann_ros.kinematics.errors import UnreachableError
import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]
Terms = tuple[tuple[int, complex], ...]
# By how much loops are open, or open per radian: a complex number for the one loop of a dyad, an
# array of shape (k,) for coupled loops.
Gap = Any


def terms(row: Complex) -> Terms:
    """Return the bodies of a loop, or of a point, with their constants, the others left out."""
    return tuple((j, complex(w)) for j, w in enumerate(row) if w != 0.0)


def cross(p: complex, q: complex) -> float:
    """Return the cross product of two vectors."""
    return p.real * q.imag - p.imag * q.real


class Dyad:
    """
    One loop with two unknown angles, those of the bodies a and b.

    Parameters
    ----------
    number : int
        Which dyad of the linkage, from 1.
    row : numpy.ndarray, shape (n,), complex
        The loop's row of W [m].
    constant : complex
        The pivots' part [m].
    unknowns : pair of int
        The bodies a and b.
    senses : sequence of int
        +1 or -1 for every body.
    names : tuple of str
        What its two ends and its two links are called.

    """

    def __init__(
        self,
        number: int,
        *,
        row: Complex,
        constant: complex,
        unknowns: tuple[int, int],
        senses: Sequence[int],
        names: tuple[str, str, str, str],
    ) -> None:
        """Keep the constants."""
        self.unknowns = unknowns
        self.number = number
        self.names = names
        self._terms = terms(row)
        self._constant = constant
        a, b = unknowns
        self._a, self._b, self._w_a, self._w_b = a, b, complex(row[a]), complex(row[b])
        self._i_a, self._i_b = 1j * senses[a] * self._w_a, 1j * senses[b] * self._w_b
        self._s_a, self._s_b = senses[a], senses[b]
        self._r_a, self._r_b = abs(self._w_a), abs(self._w_b)
        largest = max([abs(constant), *(abs(w) for _, w in self._terms)])
        self.rounding = 8.0 * float_info.epsilon * largest
        self.rounding_of_sine = self.rounding / min(self._r_a, self._r_b)
        # Near the reach the sine's square is proportional to the distance from it.
        self.singular_sine = self.rounding_of_sine**0.5

    def total(self, vectors: Sequence[complex]) -> Gap:
        """Return the sum of w_j times the vector of body j, over all bodies of the loop."""
        return sum([w * vectors[j] for j, w in self._terms], 0j)

    def gap(self, u: Sequence[complex]) -> Gap:
        """Return by how much the loop is open [m]."""
        return sum([w * u[j] for j, w in self._terms], self._constant)

    def is_closed(self, gap: Gap) -> bool:
        """Return whether a gap is rounding."""
        return bool(abs(gap) <= self.rounding)

    def turn(self, u: Sequence[complex], r: Gap) -> tuple[float, float] | None:
        """Return the turns of a and b that open the loop by -r; None where it is singular."""
        a, b = self._i_a * u[self._a], self._i_b * u[self._b]
        determinant = a.real * b.imag - a.imag * b.real
        if determinant == 0.0:
            return None
        return (
            (b.real * r.imag - b.imag * r.real) / determinant,
            (a.imag * r.real - a.real * r.imag) / determinant,
        )

    def sine(self, u: Sequence[complex]) -> float:
        """Return the sine of the angle between the links, signed as the assembly is."""
        determinant = cross(self._w_a * u[self._a], self._w_b * u[self._b])
        return -determinant / (self._r_a * self._r_b)

    def transmission_angle(self, u: Sequence[complex]) -> float:
        """Return the angle between the links, in [0, pi] [rad]."""
        # w_b u_b leads from the joint to the far end, w_a u_a from the near end to the joint.
        return pi - abs(phase(self._w_b * u[self._b] / (self._w_a * u[self._a])))

    def clearance(self, u: Sequence[complex]) -> float:
        """Return how far the ends are inside the dyad's reach [m]; its own bodies do not count."""
        return clearance(*self._circles(u))

    def assemble(self, u: Sequence[complex], alpha: float, sign: int) -> tuple[float, float]:
        """
        Return the angles of a and b by the geometric method: two circles.

        Raises
        ------
        UnreachableError
            The circles do not meet.

        """
        p, q, r_a, r_b = circles = self._circles(u)
        at = joint(p, q, r_a, r_b, sign)
        if at is None:
            shortfall = max(0.0, -clearance(*circles))
            stretched = abs(complex(*q)) > r_a + r_b
            raise UnreachableError(alpha, self.number, shortfall, stretched, self.names)
        meet = complex(*at)
        # A link's direction is the quotient of where it ends and its own vector.
        return (
            self._s_a * phase(meet / self._w_a),
            self._s_b * phase((complex(*q) - meet) / self._w_b),
        )

    def _circles(
        self, u: Sequence[complex]
    ) -> tuple[tuple[float, float], tuple[float, float], float, float]:
        known = self._constant
        for j, w in self._terms:
            if j not in (self._a, self._b):
                known += w * u[j]
        return (0.0, 0.0), (-known.real, -known.imag), self._r_a, self._r_b


class CoupledLoops:
    """
    Several loops that must be solved together; there is no closed form for them.

    Parameters
    ----------
    number : int
        Which block of the linkage, from 1.
    rows : numpy.ndarray, shape (k, n), complex
        The loops' rows of W [m].
    constants : numpy.ndarray, shape (k,), complex
        The pivots' part in each [m].
    unknowns : tuple of int, 2 k of them
        The bodies whose angles it gives.
    senses : sequence of int
        +1 or -1 for every body.

    """

    def __init__(
        self,
        number: int,
        *,
        rows: Complex,
        constants: Complex,
        unknowns: tuple[int, ...],
        senses: Sequence[int],
    ) -> None:
        """Keep the constants."""
        self.unknowns = unknowns
        self.number = number
        self._rows = rows
        self._constants = constants
        self._own = np.array(unknowns)
        self._i_w = 1j * rows[:, self._own] * np.array(senses)[self._own]
        largest = max(np.abs(rows).max(), np.abs(constants).max())
        self.rounding = 8.0 * float_info.epsilon * float(largest)
        self.rounding_of_sine = self.rounding / float(np.abs(rows[:, self._own]).max())
        self.singular_sine = self.rounding_of_sine**0.5

    def total(self, vectors: Sequence[complex]) -> Gap:
        """Return, for each loop, the sum of w_j times the vector of body j."""
        return self._rows @ np.array(vectors)

    def gap(self, u: Sequence[complex]) -> Gap:
        """Return by how much each loop is open, shape (k,), complex [m]."""
        return self._rows @ np.array(u) + self._constants

    def is_closed(self, gap: Gap) -> bool:
        """Return whether a gap is rounding."""
        return bool(np.abs(gap).max() <= self.rounding)

    def turn(self, u: Sequence[complex], r: Gap) -> tuple[float, ...] | None:
        """Return the turns of its bodies that open the loops by -r; None where singular."""
        try:
            turns = np.linalg.solve(self.jacobian(u), -np.concatenate([r.real, r.imag]))
        except np.linalg.LinAlgError:
            return None
        return tuple(turns.tolist())

    def jacobian(self, u: Sequence[complex]) -> NDArray[np.float64]:
        """Return the block of the Jacobian, shape (2 k, 2 k) [m/rad]."""
        columns = self._i_w * np.array(u)[self._own]
        return np.concatenate([columns.real, columns.imag])

    def sine(self, u: Sequence[complex]) -> float:
        """
        Return the determinant over the product of the columns' lengths, in [-1, 1].

        For one loop this is the sine of the angle between the links; here it stands for it.
        """
        jacobian = self.jacobian(u)
        # Rows as well: a small body would make all of it look singular.
        jacobian /= np.linalg.norm(jacobian, axis=1, keepdims=True)
        return float(np.linalg.det(jacobian / np.linalg.norm(jacobian, axis=0)))

    def transmission_angle(self, u: Sequence[complex]) -> float:
        """Return the angle whose sine is |sine(u)|, in [0, pi/2] [rad]."""
        return float(np.arcsin(min(1.0, abs(self.sine(u)))))

    def clearance(self, u: Sequence[complex]) -> float:
        """Return the least singular value of the block: how far singular matrices are [m/rad]."""
        values = np.linalg.svd(self.jacobian(u), compute_uv=False)
        return float(values[-1]) if np.isfinite(values).all() else nan
