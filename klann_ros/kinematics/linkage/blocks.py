"""
What of a linkage is solved one after the other: dyads, and coupled loops.

Position, velocity and acceleration all come down to one linear step: by which turns d of its
bodies does a block open its loops by a given -r,

    sum over its bodies of i s_j W_j u_j d_j = -r.

The determinant of that step over the product of the columns' lengths is the sine of the angle
between the links of a dyad, and stands for it where loops are coupled.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import hypot, pi
from sys import float_info
from typing import Any

from klann_ros.kinematics import dyad
from klann_ros.kinematics.errors import UnreachableError
import numpy as np

Terms = Mapping[int, complex]
# Circles that miss each other by less than this part of a loop's rounding touch.
TOUCHES = 0.75


@dataclass(frozen=True, eq=False)
class Block:
    """
    Loops that are solved together: one of a dyad, several where they are coupled.

    Attributes
    ----------
    number : int
        Which block of the linkage, from 1.
    rows : tuple of (mapping of int to complex, complex)
        Of each loop what the bodies add to it, and what the pivots do [m].
    unknowns : tuple of int
        The bodies that it places.
    senses : tuple of int
        +1 or -1 for each body of the linkage.
    names : tuple of str
        What the two ends and the two links of a dyad are called.
    outside : bool
        Whether a dyad's transmission angle is measured outside of its joint.

    """

    number: int
    rows: tuple[tuple[Terms, complex], ...]
    unknowns: tuple[int, ...]
    senses: tuple[int, ...]
    names: tuple[str, str, str, str]
    outside: bool = False

    @property
    def is_dyad(self) -> bool:
        """Return whether it is one loop of two bodies, which circles place."""
        return len(self.rows) == 1

    @cached_property
    def rounding(self) -> float:
        """Return what its loops can lose to rounding [m]."""
        return 8.0 * float_info.epsilon * max(
            abs(value) for terms, constant in self.rows for value in (constant, *terms.values())
        )  # fmt: skip

    @cached_property
    def scale(self) -> float:
        """Return what its determinant is divided by to be a sine; of a dyad r_a r_b."""
        own = np.array([[abs(terms.get(j, 0.0)) for j in self.unknowns] for terms, _ in self.rows])
        # Rows first: a small loop would make all of it look singular.
        longest = own.max(axis=1)
        columns = np.linalg.norm(own / longest[:, None], axis=0)
        return float(np.prod(longest**2) * np.prod(columns))

    @cached_property
    def rounding_of_sine(self) -> float:
        """Return the sine that rounding alone can make of 0, near the middle of the reach."""
        links = [abs(terms[j]) for terms, _ in self.rows for j in self.unknowns if j in terms]
        return self.rounding / (min(links) if self.is_dyad else max(links))

    @property
    def singular_sine(self) -> float:
        """
        Return the sine that rounding alone can make.

        Near the reach of a dyad the sine's square is proportional to the distance from it. Below
        this sine Phi is known to be small and nothing else, and no velocity follows from it.
        """
        return float(self.rounding_of_sine**0.5)

    # Of a dyad.

    @property
    def radii(self) -> tuple[float, float]:
        """Return the lengths of a dyad's links [m]."""
        (terms, _), (a, b) = self.rows[0], self.unknowns
        return abs(terms[a]), abs(terms[b])

    def way(self, u: Sequence[complex]) -> complex:
        """Return the vector from end to end of a dyad, W_a u_a + W_b u_b, by all others [m]."""
        terms, constant = self.rows[0]
        return -sum((w * u[j] for j, w in terms.items() if j not in self.unknowns), constant)

    def place(self, u: Sequence[complex], alpha: float, sign: int) -> tuple[complex, complex]:
        """
        Return the unit vectors of a dyad's two bodies by the geometric method: two circles.

        Where they miss each other by no more than rounding the links are in line: a change-point
        linkage, such as a parallelogram, passes such poses.

        Raises
        ------
        UnreachableError
            The circles do not meet, or everywhere.

        """
        way, (r_a, r_b) = self.way(u), self.radii
        meet = dyad.joint((0.0, 0.0), (way.real, way.imag), r_a, r_b, sign)
        if meet is None and self.misses(way) <= TOUCHES * self.rounding < abs(way):
            folded_back = abs(way) < max(r_a, r_b) and r_a < r_b
            at = (-r_a if folded_back else r_a) * way / abs(way)
            meet = at.real, at.imag
        if meet is None:
            short, stretched = max(0.0, self.misses(way)), abs(way) > r_a + r_b
            raise UnreachableError(alpha, self.number, short, stretched, self.names)
        (terms, _), (a, b), joint = self.rows[0], self.unknowns, complex(*meet)
        return joint / terms[a], (way - joint) / terms[b]

    def misses(self, way: complex) -> float:
        """Return how far the ends of a dyad are out of its reach [m]; negative inside."""
        return -dyad.clearance((0.0, 0.0), (way.real, way.imag), *self.radii)

    # Figures of a pose, given the unit vectors of all bodies; or of many, given arrays of them.

    def jacobian(self, u: Any) -> Any:
        """Return its part of Phi, shape (..., 2 k, 2 k) [m/rad]: of each loop x, then y."""
        rows = [
            [1j * self.senses[j] * terms.get(j, 0.0) * u[j] for j in self.unknowns]
            for terms, _ in self.rows
        ]
        table = np.array([part for r in rows for part in (np.real(r), np.imag(r))])
        return np.moveaxis(table, (0, 1), (-2, -1))

    def sine(self, u: Any) -> Any:
        """Return the determinant over `scale`, in [-1, 1]; its sign is the assembly."""
        if not self.is_dyad:
            return np.linalg.det(self.jacobian(u)) / self.scale
        p, q = self.links(u)
        return (p.imag * q.real - p.real * q.imag) / self.scale

    def links(self, u: Any) -> tuple[Any, Any]:
        """Return W_a u_a, from a dyad's near end to its joint, and W_b u_b, on to its far end."""
        (terms, _), (a, b) = self.rows[0], self.unknowns
        return terms[a] * u[a], terms[b] * u[b]

    def transmission_angle(self, u: Any) -> Any:
        """Return the angle between a dyad's links; of coupled loops asin(sine) [rad]."""
        if not self.is_dyad:
            return np.arcsin(np.minimum(1.0, np.abs(self.sine(u))))
        p, q = self.links(u)
        along = np.abs(np.angle(q * np.conj(p)))
        return along if self.outside else pi - along

    def clearance(self, u: Sequence[complex]) -> float:
        """
        Return how far a dyad's ends are inside its reach [m].

        Of coupled loops it is the least singular value of their part of Phi [m/rad].
        """
        if self.is_dyad:
            return -self.misses(self.way(u))
        jacobian = self.jacobian(u)
        return float(np.linalg.svd(jacobian, compute_uv=False)[-1])

    def gap(self, u: Sequence[complex]) -> float:
        """Return by how much its loops are open [m]."""
        gaps = [sum((w * u[j] for j, w in terms.items()), c) for terms, c in self.rows]
        return hypot(*(part for gap in gaps for part in (gap.real, gap.imag)))
