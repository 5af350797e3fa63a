"""
How a dyad is placed without iteration: the geometric method for each pair of joints.

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

from .joints import column, frame, Vectors
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
    d is small.

    Parameters
    ----------
    p, q : tuple of float
        The two ends P and Q, (x, y) [m].
    r_p, r_q : float
        Lengths of the links from P and from Q [m].
    sign : int
        The sign of the cross product PJ x QJ: which of the two joints.

    Returns
    -------
    tuple of float or None
        J = (x, y) [m]; None where the circles do not meet (see `dyad_clearance`), and where P
        and Q coincide, so that they meet nowhere or everywhere.

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


def dyad_clearance(p: Point, q: Point, r_p: float, r_q: float) -> float:
    """
    Return how far the ends P and Q are inside the dyad's reach [m]; negative when outside.

    The reach is |r_p - r_q| <= |PQ| <= r_p + r_q. Parameters as in `dyad_joint`.
    """
    d = dist(p, q)
    return min(r_p + r_q - d, d - abs(r_p - r_q))


# Of the longest of a loop.
ROUNDING = 8.0 * float_info.epsilon
# What misses by less than this part of a loop's rounding touches.
TOUCHES = 0.75


class Pair(NamedTuple):
    """Two bodies that close a loop."""

    # Whose bodies they are.
    structure: Structure
    # a and b.
    bodies: tuple[int, int]
    # What they, and others, add to the loop: the W_j [m].
    terms: Mapping[int, complex]
    # What does not move adds to it [m].
    constant: complex

    @property
    def length(self) -> Any:
        """Return the longest vector of the loop [m]."""
        return longest(self.structure, [(self.terms, self.constant)])

    @property
    def rounding(self) -> Any:
        """Return what the loop can lose to rounding [m]."""
        return ROUNDING * self.length

    @property
    def slides(self) -> tuple[bool, bool]:
        """Return which of the two slide."""
        a, b = (self.structure.bodies[j].slides for j in self.bodies)
        return a, b

    def turning_first(self, sign: Any) -> tuple[int, int, Any]:
        """Return the body that turns, the one that slides, and the sign for this order."""
        a, b = self.bodies
        return (b, a, -sign) if self.slides[0] else (a, b, sign)

    def columns(self, u: Vectors) -> tuple[Any, Any]:
        """Return by what the loop opens with the coordinate of a, and of b."""
        a, b = (column(self.structure, self.terms, u, i) for i in self.bodies)
        return a, b


class TwoCircles:
    """Two bodies that turn: a joint at the distance r_a from one end and r_b from the other."""

    # Whether there are two ways to put it together.
    two_branches = True

    def __init__(self, pair: Pair) -> None:
        self.pair = pair
        self.radii = abs(pair.terms[pair.bodies[0]]), abs(pair.terms[pair.bodies[1]])

    @property
    def scale(self) -> float:
        """Return the product of the lengths [m^2]."""
        return self.radii[0] * self.radii[1]

    @property
    def least_length(self) -> float:
        """Return the shorter one [m]."""
        return min(self.radii)

    def place(self, _: Vectors, way: Any, sign: Any) -> tuple[Any, Any]:
        """Return u_a and u_b; NaN where it does not close."""
        (a, b), terms, (r_a, r_b) = self.pair.bodies, self.pair.terms, self.radii
        if isinstance(way, np.ndarray):
            d = way.real**2 + way.imag**2
            heron = ((r_a + r_b) ** 2 - d) * (d - (r_a - r_b) ** 2)
            excess = (r_a - r_b) * (r_a + r_b) + 1j * sign * np.sqrt(heron)
            joint = way * (0.5 + excess / (2.0 * d))
            return joint / terms[a], (way - joint) / terms[b]
        meet = dyad_joint((0.0, 0.0), (way.real, way.imag), r_a, r_b, sign)
        if meet is not None:
            at = complex(*meet)
        elif -self.clearance(way) <= TOUCHES * self.pair.rounding < abs(way):
            # In line: a change-point linkage, such as a parallelogram, passes such poses.
            folded_back = abs(way) < max(r_a, r_b) and r_a < r_b
            at = (-r_a if folded_back else r_a) * way / abs(way)
        else:
            return complex(np.nan), complex(np.nan)
        return at / terms[a], (way - at) / terms[b]

    def clearance(self, way: Any, _: Vectors = ()) -> Any:
        """Return how far the ends are inside its reach [m]; negative outside."""
        if isinstance(way, np.ndarray):
            r_a, r_b = self.radii
            return np.minimum(r_a + r_b - abs(way), abs(way) - abs(r_a - r_b))
        return dyad_clearance((0.0, 0.0), (way.real, way.imag), *self.radii)

    def is_far(self, way: Any) -> Any:
        """Return whether it is too far, rather than too near, for it to close."""
        return abs(way) > sum(self.radii)

    def lengths(self, _: Any) -> float:
        """Return the product of its columns' lengths [m^2]."""
        return self.scale

    def transmission_angle(self, u: Vectors, *, outside: bool) -> Any:
        """Return the angle between the links at their joint, or outside of it [rad]."""
        (a, b), terms = self.pair.bodies, self.pair.terms
        along = np.abs(np.angle(terms[b] * u[b] * np.conj(terms[a] * u[a])))
        return along if outside else np.pi - along


class _Sliding:
    """What dyads have in common in which a body slides."""

    two_branches = True

    def __init__(self, pair: Pair) -> None:
        self.pair = pair

    def is_far(self, way: Any) -> Any:
        """Return whether it is too far, rather than too near, for it to close."""
        return np.zeros(np.shape(way), dtype=bool)

    def transmission_angle(self, u: Vectors, **_: bool) -> Any:
        """Return the angle between the ways in which its bodies can move their joint [rad]."""
        p, q = self.pair.columns(u)
        return np.abs(np.angle(q * np.conj(p)))


class CircleAndLine(_Sliding):
    """
    A link that turns, and a body that slides along a known line: the slider-crank's.

    With e = W_b u_f, the unit vector along the line, M = (p + i q) e: the link's end is q off the
    line, so x_b = p +- sqrt(r^2 - q^2).
    """

    def __init__(self, pair: Pair) -> None:
        super().__init__(pair)
        self._link, self._slider, self._order = pair.turning_first(1)
        self.scale = self.least_length = abs(pair.terms[self._link])

    def place(self, u: Vectors, way: Any, sign: Any) -> tuple[Any, Any]:
        """Return u_a and u_b; NaN where it does not close."""
        pair, r = self.pair, self.scale
        f = frame(pair.structure, u, self._slider)
        line = pair.terms[self._slider] * f
        m = way * np.conj(line)
        on = -self._order * sign * _root(pair, r, abs(m.imag))
        link = (on + 1j * m.imag) * line / pair.terms[self._link]
        return _ordered(pair, link, (m.real - on) * f)

    def clearance(self, way: Any, u: Vectors = ()) -> Any:
        """Return how much longer the link is than it must be to reach the line [m]."""
        line = self.pair.terms[self._slider] * frame(self.pair.structure, u, self._slider)
        return self.scale - abs((way * np.conj(line)).imag)

    def is_far(self, way: Any) -> Any:
        """Return whether it is too far, rather than too near, for it to close."""
        return np.ones(np.shape(way), dtype=bool)

    def lengths(self, _: Any) -> float:
        """Return the product of its columns' lengths [m]."""
        return self.scale


class LineOnLink(_Sliding):
    """
    A body that slides along a link that turns: the inverted slider-crank's.

    M = (c + x_b) W_b u_a with c = W_a / W_b: the line passes the link's pivot at the distance q,
    the imaginary part of c, so p + x_b = +- sqrt(|M|^2 - q^2).
    """

    def __init__(self, pair: Pair) -> None:
        super().__init__(pair)
        self._link, self._slider, self._order = pair.turning_first(1)
        self._c = pair.terms.get(self._link, 0.0) * np.conj(pair.terms[self._slider])
        self.scale = self.least_length = pair.length

    def place(self, _: Vectors, way: Any, sign: Any) -> tuple[Any, Any]:
        """Return u_a and u_b; NaN where it does not close, or everywhere."""
        pair = self.pair
        on = -self._order * sign * _root(pair, abs(way), abs(self._c.imag))
        with np.errstate(invalid='ignore', divide='ignore'):
            turned = way / ((on + 1j * self._c.imag) * pair.terms[self._slider])
            turned = turned / abs(turned)
        return _ordered(pair, turned, (on - self._c.real) * turned)

    def clearance(self, way: Any, _: Vectors = ()) -> Any:
        """Return how much further off than the line the end is from the link's pivot [m]."""
        return abs(way) - abs(self._c.imag)

    def lengths(self, way: Any) -> Any:
        """Return the product of its columns' lengths [m]."""
        return abs(way)


class TwoLines(_Sliding):
    """Two bodies that slide along known lines, which meet once: the Scotch yoke's."""

    two_branches = False
    scale = 1.0

    def __init__(self, pair: Pair) -> None:
        super().__init__(pair)
        self.least_length = pair.length

    def place(self, u: Vectors, way: Any, _: Any) -> tuple[Any, Any]:
        """Return u_a and u_b; NaN where the lines are parallel."""
        pair = self.pair
        frames = [frame(pair.structure, u, j) for j in pair.bodies]
        a, b = (pair.terms[j] * f for j, f in zip(pair.bodies, frames, strict=True))
        sine = cross(a, b)
        sine = np.where(abs(sine) <= 1e-12, np.nan, sine)
        return cross(way, b) / sine * frames[0], cross(a, way) / sine * frames[1]

    def clearance(self, way: Any, _: Vectors = ()) -> Any:
        """Return infinity: two lines meet however far off."""
        return np.full(np.shape(way), np.inf)[()]

    def lengths(self, _: Any) -> float:
        """Return the product of its columns' lengths."""
        return 1.0


Closing = TwoCircles | CircleAndLine | LineOnLink | TwoLines


def closing(pair: Pair) -> Closing:
    """Return how a pair of bodies is placed."""
    if not pair.structure.slides or pair.slides == (False, False):
        return TwoCircles(pair)
    if pair.slides == (True, True):
        return TwoLines(pair)
    link, slider, _ = pair.turning_first(1)
    if pair.structure.frames[slider] == link:
        return LineOnLink(pair)
    return CircleAndLine(pair)


def _ordered(pair: Pair, link: Any, slider: Any) -> tuple[Any, Any]:
    return (slider, link) if pair.slides[0] else (link, slider)


def _root(pair: Pair, p: Any, q: Any) -> Any:
    """Return the root of p^2 - q^2; NaN where q is longer by more than rounding."""
    beyond = p - q
    beyond = np.where((-TOUCHES * pair.rounding <= beyond) & (beyond < 0.0), 0.0, beyond)
    return np.sqrt(np.where(beyond < 0.0, np.nan, beyond * (p + q)))


def cross(p: Any, q: Any) -> Any:
    """Return the cross product of vectors that are complex numbers."""
    return np.imag(np.conj(p) * q)


def longest(structure: Structure, rows: Sequence[tuple[Mapping[int, complex], complex]]) -> Any:
    """Return the longest vector of loops [m]; those along lines have no length of their own."""
    if structure.slides:
        bodies = structure.bodies
        rows = [({j: w for j, w in t.items() if not bodies[j].slides}, c) for t, c in rows]
        # Of many linkages there are arrays.
        return reduce(np.maximum, [abs(v) for terms, c in rows for v in (c, *terms.values())])
    return max(abs(value) for terms, c in rows for value in (c, *terms.values()))
