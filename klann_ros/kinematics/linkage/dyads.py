"""
Dyads, and the geometric method that places their two bodies without iteration.

A dyad closes one loop by two bodies a and b, W_a u_a + W_b u_b = M, where M is known. Two that
turn are where two circles meet. Where one or both slide it is a circle and a line, a circle around
the line's own pivot, or two lines.

The functions take one pose, or many at once: M and u_j are numbers, or arrays.
"""

from collections.abc import Mapping, Sequence
from functools import reduce
from math import dist, sqrt
from sys import float_info
from typing import Any, NamedTuple

import numpy as np

from .joints import carrier_rotation, jacobian_column, Vectors
from .structure import Structure

Point = tuple[float, float]


def dyad_joint(p: Point, q: Point, r_p: float, r_q: float, sign: int) -> Point | None:
    """
    Return the joint J with |PJ| = r_p and |QJ| = r_q: where two circles meet.

    With d = |PQ|, u the unit vector from P to Q and n = u turned by +90 deg,

        J = P + a u + sign h n,    a = (d^2 + r_p^2 - r_q^2) / (2 d),
        h = sqrt((r_p + r_q - d) (d - (r_p - r_q)) (d + (r_p - r_q)) (d + r_p + r_q)) / (2 d).

    The product form of h (Heron's) keeps its digits where the links are nearly in line, and there
    the square root of r_p^2 - a^2 loses half of them. r_p - r_q is formed first: it is exact where
    d is small. `sign`, the assembly mode, is the sign of the cross product PJ x QJ. None where the
    circles do not meet, and where P and Q coincide, so that they meet nowhere or everywhere.
    """
    (px, py), (qx, qy) = p, q
    d = dist(p, q)
    heron = (r_p + r_q - d) * (d - (r_p - r_q)) * (d + (r_p - r_q)) * (d + r_p + r_q)
    if d == 0.0 or heron < 0.0:
        return None
    a = (d * d + (r_p - r_q) * (r_p + r_q)) / (2.0 * d)
    h = sign * sqrt(heron) / (2.0 * d)
    ux, uy = (qx - px) / d, (qy - py) / d
    return px + a * ux - h * uy, py + a * uy + h * ux


# Rounding of a loop, as a part of its longest vector.
RELATIVE_ROUNDING = 8.0 * float_info.epsilon
# What misses by less, as a part of a loop's longest vector, touches: the one tolerance of placing,
# arcs, change points and Grashof's law.
CONTACT_ROUNDING = 16.0 * float_info.epsilon


class Dyad(NamedTuple):
    """Two bodies that close a loop."""

    # The structure of the linkage.
    structure: Structure
    # The indices a and b of the bodies.
    bodies: tuple[int, int]
    # The loop's coefficients W_j [m].
    terms: Mapping[int, complex]
    # The loop's constant [m].
    constant: complex

    @property
    def length(self) -> Any:
        """Return the longest vector of the loop [m]."""
        return max_vector_length(self.structure, [(self.terms, self.constant)])

    @property
    def contact_rounding(self) -> Any:
        """Return the tolerance of a contact [m]."""
        return CONTACT_ROUNDING * self.length

    @property
    def slides(self) -> tuple[bool, bool]:
        """Return which of the two slide."""
        a, b = self.bodies
        return self.structure.bodies[a].slides, self.structure.bodies[b].slides

    def order_turning_first(self, sign: Any) -> tuple[int, int, Any]:
        """Return the body that turns, the one that slides, and the sign for this order."""
        a, b = self.bodies
        return (b, a, -sign) if self.slides[0] else (a, b, sign)

    def jacobian_columns(self, u: Vectors) -> tuple[Any, Any]:
        """Return the Jacobian's columns of the loop for a and b."""
        a, b = self.bodies
        column_a = jacobian_column(self.structure, self.terms, u, a)
        return column_a, jacobian_column(self.structure, self.terms, u, b)


class _DyadSolver:
    """The common part of all dyads."""

    # Whether it has two assembly modes.
    two_branches = True
    # The product of the lengths of its links [m^2], or the length of its link [m].
    scale: Any

    def __init__(self, dyad: Dyad) -> None:
        self.dyad = dyad

    def span(self, _: Vectors, closure: Any) -> Any:
        """Return m, whose length decides whether it closes: see `change_points`."""
        return closure

    def is_too_far(self, closure: Any) -> Any:
        """Return whether it is too far, rather than too near, for it to close."""
        return np.zeros(np.shape(closure), dtype=bool)

    def column_lengths(self, _: Any) -> Any:
        """Return the product of its columns' lengths, in the unit of `scale`."""
        return self.scale

    def transmission_angle(self, u: Vectors, *_: Any, **__: Any) -> Any:
        """Return the angle between the motions of the joint that its bodies allow [rad]."""
        p, q = self.dyad.jacobian_columns(u)
        return np.abs(np.angle(q * np.conj(p)))


class TwoCircles(_DyadSolver):
    """Two bodies that turn: a joint at the distance r_a from one end and r_b from the other."""

    def __init__(self, dyad: Dyad) -> None:
        super().__init__(dyad)
        self.radii = abs(dyad.terms[dyad.bodies[0]]), abs(dyad.terms[dyad.bodies[1]])
        self.scale = self.radii[0] * self.radii[1]

    @property
    def min_length(self) -> Any:
        """Return the shorter one [m]."""
        return np.minimum(*self.radii)

    def place(self, _: Vectors, closure: Any, sign: Any) -> tuple[Any, Any]:
        """Return u_a and u_b; NaN where it does not close."""
        a, b = self.dyad.bodies
        terms = self.dyad.terms
        r_a, r_b = self.radii
        if isinstance(closure, np.ndarray):
            d = closure.real**2 + closure.imag**2
            heron = self.discriminant(closure)
            excess = (r_a - r_b) * (r_a + r_b) + 1j * sign * np.sqrt(heron)
            joint = closure * (0.5 + excess / (2.0 * d))
            return joint / terms[a], (closure - joint) / terms[b]
        meet = dyad_joint((0.0, 0.0), (closure.real, closure.imag), r_a, r_b, sign)
        if meet is not None:
            joint = complex(*meet)
        elif -self.clearance(closure) <= self.dyad.contact_rounding < abs(closure):
            # In line: a change-point linkage, such as a parallelogram, passes such poses.
            folded_back = abs(closure) < max(r_a, r_b) and r_a < r_b
            joint = (-r_a if folded_back else r_a) * closure / abs(closure)
        else:
            return complex(np.nan), complex(np.nan)
        return joint / terms[a], (closure - joint) / terms[b]

    def clearance(self, closure: Any, _: Vectors = ()) -> Any:
        """Return the clearance of the ends within its reach [m]; negative outside."""
        r_a, r_b = self.radii
        d = abs(closure)
        return np.minimum(r_a + r_b - d, d - abs(r_a - r_b))

    def discriminant(self, span: Any) -> Any:
        """Return p by m, whose root places the joint [m^4]."""
        r_a, r_b = self.radii
        d = span.real**2 + span.imag**2
        return ((r_a + r_b) ** 2 - d) * (d - (r_a - r_b) ** 2)

    def is_too_far(self, closure: Any) -> Any:
        """Return whether it is too far, rather than too near, for it to close."""
        return abs(closure) > sum(self.radii)

    def transmission_angle(self, u: Vectors, *, outside: bool) -> Any:
        """Return the angle between the links at their joint, or outside of it [rad]."""
        a, b = self.dyad.bodies
        terms = self.dyad.terms
        deviation = np.abs(np.angle(terms[b] * u[b] * np.conj(terms[a] * u[a])))
        return deviation if outside else np.pi - deviation


class CircleAndLine(_DyadSolver):
    """
    A link that turns, and a body that slides along a known line: the slider-crank's.

    With e = W_b u_f, the unit vector along the line, M = (p + i q) e: the link's end is q off the
    line, so x_b = p +- sqrt(r^2 - q^2).
    """

    def __init__(self, dyad: Dyad) -> None:
        super().__init__(dyad)
        self._link, self._slider, self._order = dyad.order_turning_first(1)
        self.scale = self.min_length = abs(dyad.terms[self._link])

    def place(self, u: Vectors, closure: Any, sign: Any) -> tuple[Any, Any]:
        """Return u_a and u_b; NaN where it does not close."""
        dyad = self.dyad
        rotation = carrier_rotation(dyad.structure, u, self._slider)
        line = dyad.terms[self._slider] * rotation
        m = closure * np.conj(line)
        along_line = -self._order * sign * _clamped_root(dyad, self.scale, abs(m.imag))
        link = (along_line + 1j * m.imag) * line / dyad.terms[self._link]
        return _ordered(dyad, link, (m.real - along_line) * rotation)

    def clearance(self, closure: Any, u: Vectors = ()) -> Any:
        """Return the excess of the link's length over its distance to the line [m]."""
        return self.scale - abs(self.span(u, closure))

    def span(self, u: Vectors, closure: Any) -> Any:
        """Return q, the distance of the link's end from the line [m]."""
        rotation = carrier_rotation(self.dyad.structure, u, self._slider)
        return (closure * np.conj(self.dyad.terms[self._slider] * rotation)).imag

    def discriminant(self, span: Any) -> Any:
        """Return p by q, whose root places the slider [m^2]."""
        return self.scale**2 - span**2

    def is_too_far(self, closure: Any) -> Any:
        """Return whether it is too far, rather than too near, for it to close."""
        return np.ones(np.shape(closure), dtype=bool)


class LineOnLink(_DyadSolver):
    """
    A body that slides along a link that turns: the inverted slider-crank's.

    M = (c + x_b) W_b u_a with c = W_a / W_b: the line passes the link's pivot at the distance q,
    the imaginary part of c, so p + x_b = +- sqrt(|M|^2 - q^2).
    """

    def __init__(self, dyad: Dyad) -> None:
        super().__init__(dyad)
        self._link, self._slider, self._order = dyad.order_turning_first(1)
        self._c = dyad.terms.get(self._link, 0.0) * np.conj(dyad.terms[self._slider])
        self.scale = self.min_length = dyad.length

    def place(self, _: Vectors, closure: Any, sign: Any) -> tuple[Any, Any]:
        """Return u_a and u_b; NaN where it does not close, or everywhere."""
        dyad = self.dyad
        along_line = -self._order * sign * _clamped_root(dyad, abs(closure), abs(self._c.imag))
        with np.errstate(invalid='ignore', divide='ignore'):
            link = closure / ((along_line + 1j * self._c.imag) * dyad.terms[self._slider])
            link = link / abs(link)
        return _ordered(dyad, link, (along_line - self._c.real) * link)

    def clearance(self, closure: Any, _: Vectors = ()) -> Any:
        """Return the excess of the end's distance from the link's pivot over the line's [m]."""
        return abs(closure) - abs(self._c.imag)

    def discriminant(self, span: Any) -> Any:
        """Return p by M, whose root places the slider [m^2]."""
        return abs(span) ** 2 - self._c.imag**2

    def column_lengths(self, closure: Any) -> Any:
        """Return the product of its columns' lengths [m]."""
        return abs(closure)


class TwoLines(_DyadSolver):
    """Two bodies that slide along known lines, which meet once: the Scotch yoke's."""

    two_branches = False
    scale = 1.0

    def __init__(self, dyad: Dyad) -> None:
        super().__init__(dyad)
        self.min_length = dyad.length

    def place(self, u: Vectors, closure: Any, _: Any) -> tuple[Any, Any]:
        """Return u_a and u_b; NaN where the lines are parallel."""
        dyad = self.dyad
        a, b = dyad.bodies
        rotation_a = carrier_rotation(dyad.structure, u, a)
        rotation_b = carrier_rotation(dyad.structure, u, b)
        line_a = dyad.terms[a] * rotation_a
        line_b = dyad.terms[b] * rotation_b
        sine = cross(line_a, line_b)
        sine = np.where(abs(sine) <= 1e-12, np.nan, sine)
        u_a = cross(closure, line_b) / sine * rotation_a
        return u_a, cross(line_a, closure) / sine * rotation_b

    def clearance(self, closure: Any, _: Vectors = ()) -> Any:
        """Return infinity: two lines always meet."""
        return np.full(np.shape(closure), np.inf)[()]

    def discriminant(self, span: Any) -> Any:
        """Return p: two lines meet in one way."""
        return np.ones(np.shape(span))


DyadSolver = TwoCircles | CircleAndLine | LineOnLink | TwoLines


def dyad_solver(dyad: Dyad) -> DyadSolver:
    """Return the solver of a dyad by its joints."""
    if not dyad.structure.slides or dyad.slides == (False, False):
        return TwoCircles(dyad)
    if dyad.slides == (True, True):
        return TwoLines(dyad)
    link, slider, _ = dyad.order_turning_first(1)
    if dyad.structure.frames[slider] == link:
        return LineOnLink(dyad)
    return CircleAndLine(dyad)


def _ordered(dyad: Dyad, link: Any, slider: Any) -> tuple[Any, Any]:
    return (slider, link) if dyad.slides[0] else (link, slider)


def _clamped_root(dyad: Dyad, p: Any, q: Any) -> Any:
    """Return the root of p^2 - q^2; NaN where q is longer by more than rounding."""
    excess = p - q
    is_tangent = (-dyad.contact_rounding <= excess) & (excess < 0.0)
    excess = np.where(is_tangent, 0.0, excess)
    return np.sqrt(np.where(excess < 0.0, np.nan, excess * (p + q)))


def cross(p: Any, q: Any) -> Any:
    """Return the cross product of vectors that are complex numbers."""
    return np.imag(np.conj(p) * q)


def max_vector_length(
    structure: Structure, rows: Sequence[tuple[Mapping[int, complex], complex]]
) -> Any:
    """Return the longest vector of loops [m]; those along lines have no length of their own."""
    lengths = []
    for terms, constant in rows:
        lengths.append(abs(constant))
        for j, w in terms.items():
            if not structure.bodies[j].slides:
                lengths.append(abs(w))
    # Many linkages have arrays of lengths.
    return reduce(np.maximum, lengths) if structure.slides else max(lengths)
