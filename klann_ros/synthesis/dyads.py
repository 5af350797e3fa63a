"""
Dyads of three to five positions of a moving plane, and four-bars of two: Burmester theory.

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
from contextlib import suppress
from itertools import permutations
from typing import NamedTuple

from klann_ros.kinematics import GeometryError
from klann_ros.kinematics.arrays import ComplexArray, FloatArray
from klann_ros.sanitize.units import warn_of_degrees
import numpy as np
from numpy.polynomial import Polynomial

from .placed import PlacedFourBar, Position

# A refined dyad fits all positions within this part of the task's size.
FIT_TOLERANCE = 1e-9
# Dyads closer than this part of the bar are one.
MIN_DISTANCE = 1e-5
MAX_REFINEMENTS = 20
# Smallest determinant of a dyad's two equations.
SINGULAR = 1e-12


class PlanePose(NamedTuple):
    """A pose of the moving plane: its task point P [m], and its angle [rad]."""

    p: complex
    angle: float


class BurmesterPair(NamedTuple):
    """
    A dyad's bar: the fixed pivot M, and the pin W in the first position, on a circle about it [m].

    They are a centre point and its circle point.
    """

    pivot: complex
    pin: complex


def pins(poses: Sequence[PlanePose], pin: complex) -> list[complex]:
    """Return the places of a point of the moving plane in each pose, `pin` in the first [m]."""
    first = poses[0]
    return [pose.p + (pin - first.p) * cmath.rect(1.0, pose.angle - first.angle) for pose in poses]


def motion_generators(
    poses: Sequence[PlanePose], dyads: Iterable[BurmesterPair]
) -> list[PlacedFourBar]:
    """
    Return the four-bars of all pairs of dyads: the coupler takes the poses, P is its point.

    Parameters
    ----------
    poses : sequence of PlanePose
        Three to five poses.
    dyads : iterable of BurmesterPair
        Dyads of these poses, from any of the functions below. Rotations of three points of a path
        are the timing of its crank.

    Returns
    -------
    list of PlacedFourBar
        The first dyad of a pair drives; `defects` says what keeps it from moving through them.

    """
    generators = []
    coupler_points = [pose.p for pose in poses]
    for driver, follower in permutations(dyads, 2):
        crank_pins = pins(poses, driver.pin)
        rocker_pins = pins(poses, follower.pin)
        positions = tuple(map(Position, crank_pins, rocker_pins, coupler_points))
        with suppress(GeometryError, ZeroDivisionError):
            generators.append(PlacedFourBar(driver.pivot, follower.pivot, positions))
    return generators


def dyad_of_rotations(poses: Sequence[PlanePose], rotations: Sequence[float]) -> BurmesterPair:
    """
    Return the dyad of three positions whose bar turns by two given angles.

    Parameters
    ----------
    poses : sequence of PlanePose
        Three poses.
    rotations : sequence of float
        beta_2 and beta_3, the rotations of the bar from the first position [rad].

    Raises
    ------
    GeometryError
        The rotations determine no dyad: the two equations depend on each other.

    """
    warn_of_degrees('rotations', rotations)
    rotors, shifts = _relative(poses, 3)
    bars = np.exp(1j * np.asarray(rotations, dtype=float))
    system = np.column_stack([bars - 1.0, rotors - 1.0])
    if abs(np.linalg.det(system)) <= SINGULAR:
        raise GeometryError(f'the rotations {[*map(float, rotations)]} rad determine no dyad')
    w, z = map(complex, np.linalg.solve(system, shifts))
    return BurmesterPair(poses[0].p - z - w, poses[0].p - z)


def dyad_of_pin(poses: Sequence[PlanePose], pin: complex) -> BurmesterPair:
    """
    Return the dyad of three positions with a given moving pivot.

    The fixed pivot is the centre of the circle through the three places of the pin. Raises a
    GeometryError where they are on one line or coincide.
    """
    return BurmesterPair(_circle_centre(*pins(poses[:3], pin)), pin)


def dyad_of_pivot(poses: Sequence[PlanePose], pivot: complex) -> BurmesterPair:
    """
    Return the dyad of three positions with a given fixed pivot; the inversion of `dyad_of_pin`.

    Raises a GeometryError where the pivot's three places in the moving plane are on one line.
    """
    first = poses[0]
    places = [
        first.p + (pivot - pose.p) * cmath.rect(1.0, first.angle - pose.angle)
        for pose in poses[:3]
    ]
    return BurmesterPair(pivot, _circle_centre(*places))


def dyads_of_rotation(poses: Sequence[PlanePose], rotation: float) -> list[BurmesterPair]:
    """
    Return the dyads of four poses whose bar turns by beta_2 = `rotation` to the second one [rad].

    The compatibility equation D1 + D2 e^(i b2) + D3 e^(i b3) + D4 e^(i b4) = 0 is a triangle with
    at most two solutions: D3 e^(i b3) is to the left of D1 + D2 e^(i b2), then to its right.
    """
    rotors, shifts = _relative(poses, 4)
    d_2, d_3, d_4 = np.cross(rotors - 1.0, shifts).tolist()
    d_1 = -d_2 - d_3 - d_4
    x = cmath.rect(1.0, rotation)
    dyads = []
    for y in _triangle(d_1 + d_2 * x, d_3, abs(d_4)):
        with suppress(GeometryError):
            dyad = dyad_of_rotations(poses[:3], (rotation, cmath.phase(y)))
            if _fits(poses, dyad):
                dyads.append(dyad)
    return dyads


def burmester_curve(poses: Sequence[PlanePose], count: int = 360) -> list[BurmesterPair]:
    """
    Return dyads of four poses: samples of the centre-point and circle-point curves.

    They are in the order of beta_2, of which `count` values over a turn are tried; no bar may fit.
    """
    curve: list[BurmesterPair] = []
    for rotation in (np.arange(0.5, count) * 2.0 * np.pi / count).tolist():
        curve += dyads_of_rotation(poses, rotation)
    return curve


def burmester_points(poses: Sequence[PlanePose]) -> list[BurmesterPair]:
    """
    Return all dyads of five poses: none, two or four, each of which fits all poses to rounding.

    With W and M from the first task point and r_j = e^(i alpha_j), one length of the bars is

        delta_j conj(delta_j) / 2 + Re(conj(delta_j) (r_j W - M)) = Re((r_j - 1) W conj(M)), j > 1,

    linear in W, M and W conj(M): two numbers s and t are free. That the last one is the product
    of the others are two conics of s and t, which meet in four points.
    """
    size = _size(poses)
    rotors, shifts = _relative(poses, 5)
    shifts = shifts / size
    factors = np.column_stack([shifts.conj() * rotors, -shifts.conj(), 1.0 - rotors])
    system = np.stack([factors.real, -factors.imag], axis=-1).reshape(4, 6)
    start = np.linalg.lstsq(system, np.abs(shifts) ** 2 / -2.0, rcond=None)[0]
    basis = np.vstack([start, np.linalg.svd(system)[2][-2:]])
    w_basis = basis[:, 0] + 1j * basis[:, 1]
    m_basis = basis[:, 2] + 1j * basis[:, 3]
    product_basis = basis[:, 4] + 1j * basis[:, 5]
    conics = np.outer(w_basis, m_basis.conj())
    conics[0] -= product_basis
    dyads: list[BurmesterPair] = []
    for v in _meeting_points(conics + conics.T):
        pivot = poses[0].p + size * complex(v @ m_basis)
        pin = poses[0].p + size * complex(v @ w_basis)
        dyad = BurmesterPair(pivot, pin)
        if _fits(poses, dyad) and not any(_is_same(dyad, known_dyad) for known_dyad in dyads):
            dyads.append(dyad)
    return dyads


def _meeting_points(conics: ComplexArray) -> Iterable[FloatArray]:
    """Yield the v = (1, s, t) of v Q v = 0, the conics of the real and the imaginary part of Q."""
    a_1, b_1, c_1 = _quadratic(conics.real)
    a_2, b_2, c_2 = _quadratic(conics.imag)
    # The resultant of both by t, a polynomial of s; a common root has t = numerator / denominator.
    numerator = a_2 * c_1 - a_1 * c_2
    denominator = a_1 * b_2 - a_2 * b_1
    resultant = numerator * numerator - denominator * (b_1 * c_2 - b_2 * c_1)
    for s in resultant.roots():
        v = np.array([1.0, s.real, (numerator(s) / denominator(s)).real])
        for _ in range(MAX_REFINEMENTS):
            slopes = 2.0 * (conics @ v)[1:]
            error = v @ conics @ v
            try:
                step = np.linalg.solve([slopes.real, slopes.imag], [error.real, error.imag])
            except np.linalg.LinAlgError:
                break
            v[1:] -= step
            if np.abs(step).max() <= 1e-15 * np.abs(v).max():
                break
        yield v


def _quadratic(conic: FloatArray) -> tuple[float, Polynomial, Polynomial]:
    """Return a, b(s) and c(s) of the conic a t^2 + b t + c = 0."""
    b = Polynomial(2.0 * conic[:2, 2])
    c = Polynomial([conic[0, 0], 2.0 * conic[0, 1], conic[1, 1]])
    return conic[2, 2], b, c


def _relative(poses: Sequence[PlanePose], count: int) -> tuple[ComplexArray, ComplexArray]:
    """Return e^(i alpha_j) and delta_j of the poses after the first one; there must be `count`."""
    if len(poses) != count:
        raise ValueError(f'{len(poses)} poses: {count} are needed')
    first, *later = poses
    rotors = np.array([cmath.rect(1.0, pose.angle - first.angle) for pose in later])
    return rotors, np.array([pose.p - first.p for pose in later])


def _triangle(base: complex, side: complex, last_length: float) -> Iterable[complex]:
    """Yield the unit numbers y with |base + side y| = last_length, at most two."""
    product = base.conjugate() * side
    along = (last_length**2 - abs(base) ** 2 - abs(side) ** 2) / 2.0
    square = abs(product) ** 2 - along**2
    if square >= 0.0 and product != 0.0:
        yield complex(along, square**0.5) / product
        yield complex(along, -(square**0.5)) / product


def _fits(poses: Sequence[PlanePose], dyad: BurmesterPair) -> bool:
    """Return whether a dyad fits all poses and is a bar of the task's size."""
    size = _size(poses)
    lengths = np.abs(np.array(pins(poses, dyad.pin)) - dyad.pivot)
    tolerance = FIT_TOLERANCE * (size + lengths[0])
    return bool(np.ptp(lengths) <= tolerance and lengths[0] > 1e-9 * size)


def _size(poses: Sequence[PlanePose]) -> float:
    return max(abs(p - poses[0].p) for p, _ in poses)


def _is_same(dyad: BurmesterPair, dyad_2: BurmesterPair) -> bool:
    """Return whether two dyads are one, up to the rounding of a close pair of roots."""
    bar = abs(dyad_2.pin - dyad_2.pivot)
    return abs(dyad.pivot - dyad_2.pivot) + abs(dyad.pin - dyad_2.pin) <= MIN_DISTANCE * bar


def _circle_centre(a: complex, b: complex, c: complex) -> complex:
    """Return the centre of the circle through three points."""
    u = b - a
    v = c - a
    cross = (u.conjugate() * v).imag
    if abs(cross) <= 1e-12 * abs(u) * abs(v):
        raise GeometryError('three places of a pivot are on one line: no bar fits them')
    return complex(a + 1j * (u * abs(v) ** 2 - v * abs(u) ** 2) / (2.0 * cross))
