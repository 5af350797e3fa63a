"""
Dyads of three to five positions of a moving plane: Burmester theory.

A dyad is a bar from a fixed pivot M to a point W of the moving plane. In the standard form, with
W - M = w and the task point P - W = z in the first position,

    w (e^(i beta_j) - 1) + z (e^(i alpha_j) - 1) = delta_j,    j = 2 .. n,

alpha_j and delta_j are the rotation and the displacement of the moving plane from the first
position, beta_j is the rotation of the bar.

References
----------
Sandor, Erdman: Advanced Mechanism Design, vol. 2 (1984), chapter 3; McCarthy, Soh: Geometric
Design of Linkages, 2nd ed. (2011), chapter 5.

"""

import cmath
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from klann_ros.kinematics import GeometryError
from klann_ros.kinematics.arrays import ComplexArray, FloatArray
import numpy as np
from numpy.polynomial import polynomial

# Roots this far from the unit circle are not real rotations; nearer ones are refined.
CIRCLE_TOLERANCE = 1e-3
# A refined dyad fits all positions within this part of the task's size.
FIT_TOLERANCE = 1e-9
MAX_REFINEMENTS = 20
# Dyads closer than this part of the task's size are one.
DISTINCT = 1e-5


class PlanePose(NamedTuple):
    """
    A pose of the moving plane.

    Attributes
    ----------
    p : complex
        The task point P [m].
    angle : float
        The plane's angle [rad].

    """

    p: complex
    angle: float


class BurmesterPair(NamedTuple):
    """
    A dyad's bar: a fixed pivot, and a point of the moving plane on a circle about it.

    Attributes
    ----------
    pivot : complex
        The fixed pivot M, the centre point [m].
    pin : complex
        The moving pivot W in the first position, the circle point [m].

    """

    pivot: complex
    pin: complex


def pins(poses: Sequence[PlanePose], pin: complex) -> list[complex]:
    """Return where a point of the moving plane is in each pose; `pin` is it in the first [m]."""
    (p, angle), *_ = poses
    return [q + (pin - p) * cmath.rect(1.0, each - angle) for q, each in poses]


def dyad_of_rotations(
    poses: Sequence[PlanePose], rotations: Sequence[float], tolerance: float = 1e-12
) -> BurmesterPair:
    """
    Return the dyad of three positions whose bar turns by two given angles.

    Parameters
    ----------
    poses : sequence of PlanePose
        Three poses.
    rotations : sequence of float
        beta_2 and beta_3, the rotations of the bar from the first position [rad].
    tolerance : float
        Smallest determinant of the two equations, relative to their coefficients.

    Raises
    ------
    GeometryError
        The rotations determine no dyad: the two equations depend on each other.

    """
    rotors, shifts = _relative(poses)
    bars = np.exp(1j * np.asarray(rotations, dtype=float))
    system = np.column_stack([bars - 1.0, rotors - 1.0])
    if abs(np.linalg.det(system)) <= tolerance:
        raise GeometryError(f'the rotations {[*map(float, rotations)]} rad determine no dyad')
    w, z = np.linalg.solve(system, shifts)
    pin = poses[0].p - complex(z)
    return BurmesterPair(pin - complex(w), pin)


def dyad_of_pin(poses: Sequence[PlanePose], pin: complex) -> BurmesterPair:
    """
    Return the dyad of three positions with a given moving pivot.

    The fixed pivot is the centre of the circle through the three places of the pin. Raises a
    GeometryError where they are on one line or coincide.
    """
    first, second, third = pins(poses[:3], pin)
    return BurmesterPair(_circle_centre(first, second, third), pin)


def dyad_of_pivot(poses: Sequence[PlanePose], pivot: complex) -> BurmesterPair:
    """
    Return the dyad of three positions with a given fixed pivot; the inversion of `dyad_of_pin`.

    Raises a GeometryError where the pivot's three places in the moving plane are on one line.
    """
    (p, angle), *_ = poses
    inverted = [p + (pivot - q) * np.exp(1j * (angle - each)) for q, each in poses[:3]]
    return BurmesterPair(pivot, _circle_centre(*inverted))


def burmester_curve(poses: Sequence[PlanePose], count: int = 360) -> list[BurmesterPair]:
    """
    Return dyads of four positions: samples of the centre-point and circle-point curves.

    For each beta_2 the compatibility equation D1 + D2 e^(i b2) + D3 e^(i b3) + D4 e^(i b4) = 0
    is a triangle with at most two solutions.

    Parameters
    ----------
    poses : sequence of PlanePose
        Four poses.
    count : int
        Number of values of beta_2 over a turn.

    Returns
    -------
    list of BurmesterPair
        In the order of beta_2; empty where no bar fits.

    """
    rotors, shifts = _relative(poses)
    d_1, d_2, d_3, d_4 = _compatibility(rotors, shifts, (0, 1, 2))
    found = []
    for beta in np.arange(0.5, count) * 2.0 * np.pi / count:
        known = d_1 + d_2 * np.exp(1j * beta)
        for third in _triangle(known, d_3, d_4):
            bars = np.exp(1j * beta), third
            dyad = _solve(poses, bars)
            if dyad is not None and _fits(poses, dyad):
                found.append(dyad)
    return found


def burmester_points(poses: Sequence[PlanePose]) -> list[BurmesterPair]:
    """
    Return all dyads of five positions: none, two or four.

    Two compatibility equations in beta_2 and beta_3 are linear in e^(i b3) and its conjugate.
    Their elimination leaves a polynomial of degree 6 in e^(i b2). Its roots 1 and
    e^(i alpha_2) are a bar that does not turn and one that turns with the plane; four are left.

    Parameters
    ----------
    poses : sequence of PlanePose
        Five poses.

    Returns
    -------
    list of BurmesterPair
        Each fits all poses to rounding.

    """
    rotors, shifts = _relative(poses)
    rows = (0, 1, 2), (0, 1, 3)
    (a_1, b_1, c_1), (a_2, b_2, c_2) = (
        _in_third_bar(_compatibility(rotors, shifts, each)) for each in rows
    )
    over = polynomial.polysub(polynomial.polymul(a_2, c_1), polynomial.polymul(a_1, c_2))
    under = polynomial.polysub(polynomial.polymul(b_1, c_2), polynomial.polymul(b_2, c_1))
    other = polynomial.polysub(polynomial.polymul(a_1, b_2), polynomial.polymul(a_2, b_1))
    whole = polynomial.polysub(polynomial.polymul(over, other), polynomial.polymul(under, under))
    found: list[BurmesterPair] = []
    for root in polynomial.polyroots(polynomial.polytrim(whole, 1e-14 * np.abs(whole).max())):
        if abs(root) == 0.0 or abs(abs(root) - 1.0) > CIRCLE_TOLERANCE:
            continue
        x = root / abs(root)
        bottom = polynomial.polyval(x, under)
        if abs(bottom) <= 1e-12 * np.abs(under).sum():
            continue
        third = polynomial.polyval(x, over) / bottom
        start = _solve(poses, (complex(x), complex(third / abs(third))))
        dyad = start and _refine(poses, start)
        if dyad and _fits(poses, dyad) and not _is_among(dyad, found, _size(poses)):
            found.append(dyad)
    return found


def _relative(poses: Sequence[PlanePose]) -> tuple[ComplexArray, ComplexArray]:
    """Return e^(i alpha_j) and delta_j of the poses after the first one."""
    (p, angle), *others = poses
    rotors = np.array([np.exp(1j * (each - angle)) for _, each in others])
    return rotors, np.array([q - p for q, _ in others])


def _compatibility(
    rotors: ComplexArray, shifts: ComplexArray, rows: tuple[int, int, int]
) -> tuple[complex, complex, complex, complex]:
    """Return D1 to D4 of D1 + D2 e^(i b2) + D3 e^(i b3) + D4 e^(i b4) = 0."""
    (r_2, r_3, r_4), (s_2, s_3, s_4) = rotors[[*rows]] - 1.0, shifts[[*rows]]
    d_2, d_3, d_4 = r_3 * s_4 - r_4 * s_3, r_4 * s_2 - r_2 * s_4, r_2 * s_3 - r_3 * s_2
    return -d_2 - d_3 - d_4, d_2, d_3, d_4


def _in_third_bar(
    minors: tuple[complex, complex, complex, complex],
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """
    Return the polynomials a, b, c in x = e^(i b2) of a + b y + c / y = 0, y = e^(i b3).

    The equation is x (|D1 + D2 x + D3 y|^2 - |D4|^2) = 0 on the unit circle.
    """
    d_1, d_2, d_3, d_4 = minors
    middle = abs(d_1) ** 2 + abs(d_2) ** 2 + abs(d_3) ** 2 - abs(d_4) ** 2
    a = np.array([d_1 * d_2.conjugate(), middle, d_1.conjugate() * d_2])
    b = d_3 * np.array([d_2.conjugate(), d_1.conjugate()])
    c = d_3.conjugate() * np.array([0.0, d_1, d_2])
    return a, b, c


def _triangle(known: complex, side: complex, last: complex) -> Iterable[complex]:
    """Yield the unit numbers y with |known + side y| = |last|, at most two."""
    product = known.conjugate() * side
    along = (abs(last) ** 2 - abs(known) ** 2 - abs(side) ** 2) / 2.0
    square = abs(product) ** 2 - along**2
    if square < 0.0 or product == 0.0:
        return
    for sign in (1.0, -1.0):
        y = complex(along, sign * square**0.5) / product
        yield y / abs(y)


def _solve(poses: Sequence[PlanePose], bars: tuple[complex, complex]) -> BurmesterPair | None:
    """Return the dyad whose bar turns by e^(i b2), e^(i b3); None for a singular system."""
    try:
        return dyad_of_rotations(poses[:3], np.angle(bars).tolist())
    except GeometryError:
        return None


def _residuals(poses: Sequence[PlanePose], dyad: BurmesterPair) -> FloatArray:
    """Return |W_j - M|^2 - |W_1 - M|^2 of the poses after the first one [m^2]."""
    squares = np.abs(np.array(pins(poses, dyad.pin)) - dyad.pivot) ** 2
    residuals: FloatArray = squares[1:] - squares[0]
    return residuals


def _fits(poses: Sequence[PlanePose], dyad: BurmesterPair) -> bool:
    """Return whether a dyad fits all poses and is a bar of the task's size."""
    places = np.array(pins(poses, dyad.pin))
    lengths = np.abs(places - dyad.pivot)
    size = _size(poses)
    span = float(np.ptp(lengths))
    length = float(lengths[0])
    return span <= FIT_TOLERANCE * (size + length) and length > 1e-9 * size


def _size(poses: Sequence[PlanePose]) -> float:
    return float(max(abs(p - poses[0].p) for p, _ in poses))


def _refine(poses: Sequence[PlanePose], dyad: BurmesterPair) -> BurmesterPair:
    """Return a dyad of five positions after Newton's iteration on its four equations."""
    rotors, _ = _relative(poses)
    for _ in range(MAX_REFINEMENTS):
        arms = np.array(pins(poses, dyad.pin)) - dyad.pivot
        # Derivatives by pin (turned with the plane) and by pivot, real and imaginary.
        turned = arms[1:].conjugate() * rotors
        by_pin = turned - arms[0].conjugate()
        by_pivot = arms[0].conjugate() - arms[1:].conjugate()
        jacobian = 2.0 * np.column_stack(
            [by_pin.real, -by_pin.imag, by_pivot.real, -by_pivot.imag]
        )
        try:
            x = np.linalg.solve(jacobian, -_residuals(poses, dyad))
        except np.linalg.LinAlgError:
            break
        dyad = BurmesterPair(dyad.pivot + complex(x[2], x[3]), dyad.pin + complex(x[0], x[1]))
        if np.abs(x).max() <= 1e-15 * (abs(dyad.pin) + abs(dyad.pivot)):
            break
    return dyad


def _is_among(dyad: BurmesterPair, found: Iterable[BurmesterPair], size: float) -> bool:
    """Return whether a dyad was found already, up to the rounding of a close pair of roots."""
    return any(
        abs(dyad.pivot - other.pivot) + abs(dyad.pin - other.pin)
        <= DISTINCT * (size + abs(other.pin - other.pivot))
        for other in found
    )


def _circle_centre(a: complex, b: complex, c: complex) -> complex:
    """Return the centre of the circle through three points."""
    u, v = b - a, c - a
    cross = (u.conjugate() * v).imag
    if abs(cross) <= 1e-12 * abs(u) * abs(v):
        raise GeometryError('three places of a pivot are on one line: no bar fits them')
    return complex(a + 1j * (u * abs(v) ** 2 - v * abs(u) ** 2) / (2.0 * cross))
