"""A four-bar placed in the plane, the positions of its task, and their defects."""

import cmath
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import inf, pi
from typing import NamedTuple

from klann_ros.kinematics import crank_limits, FourBar, FourBarGeometry, GeometryError, Grashof
from klann_ros.kinematics.angles import TURN
import numpy as np

# A position belongs to a linkage if its bars fit within this part of their size.
FIT_TOLERANCE = 1e-7


class Position(NamedTuple):
    """A position of a placed four-bar: crank pin A, rocker pin B and coupler point P [m]."""

    a: complex
    b: complex
    p: complex


class Defects(NamedTuple):
    """
    The defects that keep a linkage, driven by its crank, from the positions of its task.

    Attributes
    ----------
    branch : bool
        Not all positions have the assembly mode of the first one.
    circuit : bool
        Some positions need the linkage to be taken apart: they are on another circuit.
    order : bool
        The crank does not meet the positions in their order, turning one way without a dead
        point between them.

    References
    ----------
    Erdman, Sandor: Mechanism Design, 4th ed., sections 3.10, 8.9; Chase, Mirth: Circuits and
    branches of single-degree-of-freedom planar linkages, J. Mech. Des. 115 (1993) 223-230.

    """

    branch: bool
    circuit: bool
    order: bool


@dataclass(frozen=True)
class PlacedFourBar:
    """
    A four-bar in the plane, and the positions of its task; points are complex numbers.

    Parameters
    ----------
    o2, o4 : complex
        Fixed pivots of crank and rocker [m].
    positions : tuple of Position
        One or more; the first one gives the lengths.

    Raises
    ------
    GeometryError
        The points are no four-bar: two of them coincide, or a position has other lengths.

    """

    o2: complex
    o4: complex
    positions: tuple[Position, ...]

    def __post_init__(self) -> None:
        size = sum(self.geometry.lengths)
        v = self.coupler_vector
        for k, (a, b, p) in enumerate(self.positions, 1):
            length_errors = np.abs([a - self.o2, b - a, b - self.o4]) - self.geometry.lengths[1:]
            max_error = np.abs([*length_errors, a + v * (b - a) - p]).max()
            # NaN does not fit either.
            if not max_error <= FIT_TOLERANCE * (size + abs(p - a)):
                raise GeometryError(f'position {k} does not fit the lengths of the four-bar')

    @cached_property
    def geometry(self) -> FourBarGeometry:
        """Return the lengths [m] and the assembly mode of the first position."""
        a, b, _ = self.positions[0]
        lengths = abs(self.o4 - self.o2), abs(a - self.o2), abs(b - a), abs(b - self.o4)
        return FourBarGeometry(*lengths, assembly=_turn_sense(b - a, b - self.o4))

    @property
    def coupler_vector(self) -> complex:
        """Return P from A in units of AB: (P - A) / (B - A)."""
        a, b, p = self.positions[0]
        return (p - a) / (b - a)

    @property
    def grashof(self) -> Grashof:
        """Return the class of the linkage."""
        return Grashof(self.geometry.lengths)

    @property
    def thetas(self) -> list[float]:
        """Return the crank angles of the positions, from the ground, in (-pi, pi] [rad]."""
        ground = self.o4 - self.o2
        return [cmath.phase((a - self.o2) / ground) for a, _, _ in self.positions]

    @cached_property
    def defects(self) -> Defects:
        """
        Return the defects of the positions.

        The assembly mode is the sign of sin(theta4 - theta3). A four-bar of class I has two
        circuits, distinguished by the sign at a joint that its shortest link does not touch: that
        angle never becomes 0 or pi. One of class II has a single circuit. Crank angles between
        two positions have to lie in one reachable arc, met in order by one sense of rotation.
        """
        lengths = self.geometry.lengths
        # A sine of that size squared is rounding of the lengths.
        rounding = FIT_TOLERANCE * max(lengths) ** 2
        # The shortest link is ground or crank, which touch O2, or else touches B.
        touches_o2 = np.argmin(lengths) in (0, 1)
        modes = set()
        circuits = set()
        for a, b, _ in self.positions:
            modes.add(_turn_sense(b - a, b - self.o4, rounding))
            if touches_o2:
                circuits.add(_turn_sense(b - a, b - self.o4))
            else:
                circuits.add(_turn_sense(self.o4 - self.o2, a - self.o2))
        has_circuit_defect = self.grashof.class_ == 'I' and len(circuits) > 1
        return Defects(len(modes) > 1, has_circuit_defect, not self._is_in_order())

    @property
    def is_sound(self) -> bool:
        """Return whether no position has a defect."""
        return not any(self.defects)

    def cognates(self) -> 'tuple[PlacedFourBar, PlacedFourBar]':
        """
        Return the other two four-bars whose coupler point has the same path.

        With v = (P - A) / (B - A), the third pivot is O2 + v (O4 - O2). The first cognate turns
        about O2 and the third pivot, the second about the third pivot and O4; the crank of the
        second has the speed of this linkage's crank.

        References
        ----------
        Roberts-Chebyshev theorem: Hartenberg, Denavit: Kinematic Synthesis of Linkages (1964),
        chapter 6.

        """
        v = self.coupler_vector
        pivot = self.o2 + v * (self.o4 - self.o2)
        at_o2 = []
        at_o4 = []
        for a, b, p in self.positions:
            crank_pin = self.o2 + p - a
            rocker_pin = self.o4 + p - b
            at_o2.append(Position(crank_pin, crank_pin + v * (a - self.o2), p))
            at_o4.append(Position(pivot + (1.0 - v) * (a - self.o2), rocker_pin, p))
        return (
            PlacedFourBar(self.o2, pivot, tuple(at_o2)),
            PlacedFourBar(pivot, self.o4, tuple(at_o4)),
        )

    def instant_centres(self, position: int = 0) -> dict[str, complex]:
        """
        Return the six instant centres 'I12' ... 'I34' of a position, by its number from 0 [m].

        Links are 1 ground, 2 crank, 3 coupler, 4 rocker. By Kennedy's theorem the centres of
        three links are on one line: I13 is on the lines of crank and rocker, I24 on those of
        ground and coupler. A centre at infinity is complex(inf, inf).
        """
        a, b, _ = self.positions[position]
        return {
            'I12': self.o2,
            'I14': self.o4,
            'I23': a,
            'I34': b,
            'I13': _intersection(self.o2, a, self.o4, b),
            'I24': _intersection(self.o2, self.o4, a, b),
        }

    def _is_in_order(self) -> bool:
        first, last = crank_limits(self.geometry.lengths)
        thetas = self.thetas
        if first > 0.0 and last < pi and min(thetas) <= 0.0 < max(thetas):
            return False
        # Angles are counted from one out of reach, or from the first of a crank that turns fully.
        start = 0.0 if first > 0.0 else pi if last < pi else thetas[0]

        def ascends(direction: float) -> bool:
            angles = [direction * (theta - start) % TURN for theta in thetas]
            is_within_turn = angles[-1] < TURN - FIT_TOLERANCE
            return is_within_turn and all(a < b for a, b in pairwise(angles))

        return ascends(1.0) or ascends(-1.0)


def _turn_sense(first: complex, second: complex, tolerance: float = 0.0) -> int:
    """Return the sign of the angle from one vector to another; +1 at a dead point."""
    return 1 if (first.conjugate() * second).imag >= -tolerance else -1


def _intersection(a: complex, b: complex, c: complex, d: complex) -> complex:
    """Return where the lines AB and CD meet; complex(inf, inf) where they are parallel."""
    u = b - a
    v = d - c
    cross = (u.conjugate() * v).imag
    if abs(cross) <= 1e-14 * abs(u) * abs(v):
        return complex(inf, inf)
    return a + u * ((c - a).conjugate() * v).imag / cross


def place(
    geometry: FourBarGeometry, theta2: float, u: float = 0.0, v: float = 0.0
) -> PlacedFourBar:
    """
    Return a four-bar with O2 at the origin and its ground along x, at a crank angle.

    Parameters
    ----------
    geometry : FourBarGeometry
        Its lengths and assembly mode.
    theta2 : float
        Crank angle [rad].
    u, v : float
        Coupler point: along AB from A, and to the left of it [m].

    Raises
    ------
    UnreachableError
        Coupler and rocker do not meet at this crank angle.

    """
    pose = FourBar(*geometry.lengths, geometry.assembly).closed_form(theta2)
    _, a, b, o4 = (complex(x, y) for x, y in pose.points.tolist())
    p = a + complex(u, v) * (b - a) / abs(b - a)
    return PlacedFourBar(0j, o4, (Position(a, b, p),))
