"""
Function generation with a four-bar: three to five precision points.

Freudenstein's equation relates crank angle theta2 and rocker angle theta4, both from the ground:

    K1 cos theta4 - K2 cos theta2 + K3 = cos(theta2 - theta4),
    K1 = L1 / L2,  K2 = L1 / L4,  K3 = (L1^2 + L2^2 - L3^2 + L4^2) / (2 L2 L4).

References
----------
Freudenstein: Approximate synthesis of four-bar linkages, Trans. ASME 77 (1955) 853-861;
Hartenberg, Denavit: Kinematic Synthesis of Linkages (1964), chapters 5 and 10.

"""

import cmath
from collections.abc import Callable, Sequence
from math import acos, atan2, hypot, pi
from typing import NamedTuple

from klann_ros.kinematics import GeometryError
from klann_ros.kinematics.arrays import FloatArray, with_short_repr
from klann_ros.sanitize.units import warn_of_degrees
import numpy as np

from .dyads import burmester_points, PlanePose
from .placed import PlacedFourBar, Position

# Start angles that each number of precision points needs.
STARTS = {3: 'input_start and output_start', 4: 'input_start alone', 5: 'no start angle'}


@with_short_repr
class FunctionTask(NamedTuple):
    """
    A function as rotations of crank and rocker.

    Precision points x, and the rotations from the start of the range there [rad], shape (n,).
    """

    x: FloatArray
    input_rotations: FloatArray
    output_rotations: FloatArray


def precision_points(start: float, end: float, count: int) -> FloatArray:
    """
    Return precision points with Chebyshev's spacing, shape (count,).

        x_k = (start + end) / 2 - (end - start) / 2 cos((2 k - 1) pi / (2 count))
    """
    angles = (2.0 * np.arange(1, count + 1) - 1.0) * pi / (2.0 * count)
    return np.asarray((start + end) / 2.0 - (end - start) / 2.0 * np.cos(angles))


def function_task(
    function: Callable[[float], float],
    domain: tuple[float, float],
    travels: tuple[float, float],
    count: int = 3,
) -> FunctionTask:
    """
    Return the rotations for a function at Chebyshev's precision points.

    Parameters
    ----------
    function : callable
        y of x, of different values at the ends of the domain.
    domain : (float, float)
        First and last x.
    travels : (float, float)
        Rotations of crank and rocker over the domain, with signs [rad].
    count : int
        Number of precision points, 3 to 5.

    Raises
    ------
    ValueError
        The function is not finite, or equal at both ends: its range cannot be scaled.

    """
    start, end = domain
    warn_of_degrees('travels', travels)
    x = precision_points(start, end, count)
    first_y = function(start)
    last_y = function(end)
    y = [function(precision_point) for precision_point in x.tolist()]
    if not np.isfinite([*y, first_y, last_y]).all() or first_y == last_y or start == end:
        raise ValueError(
            f'y({start:g}) = {first_y:g} and y({end:g}) = {last_y:g}: must be finite and different'
        )
    input_part = (x - start) / (end - start)
    output_part = (np.array(y) - first_y) / (last_y - first_y)
    return FunctionTask(x, travels[0] * input_part, travels[1] * output_part)


def function_generators(
    inputs: Sequence[float] | FloatArray,
    outputs: Sequence[float] | FloatArray,
    *,
    input_start: float | None = None,
    output_start: float | None = None,
    ground: float = 1.0,
) -> list[PlacedFourBar]:
    """
    Return all four-bars that fit three to five pairs of rotations.

    With three pairs both start angles are given; with four, the crank's; with five, none. Where
    Freudenstein's equation gives a negative length, the link points the other way.

    Parameters
    ----------
    inputs, outputs : sequence of float
        Rotations of crank and rocker, counter-clockwise [rad].
    input_start, output_start : float, optional
        Their angles from the ground where the rotation is 0 [rad].
    ground : float
        L1 [m].

    Raises
    ------
    ValueError
        Not 3 to 5 pairs, or not the start angles that this number of pairs needs.

    """
    phi = np.asarray(inputs, dtype=float)
    psi = np.asarray(outputs, dtype=float)
    if phi.shape != psi.shape or phi.ndim != 1 or len(phi) not in STARTS:
        raise ValueError(f'{phi.size} and {psi.size} rotations: 3 to 5 of each are needed')
    if (input_start is None, output_start is None) != (len(phi) == 5, len(phi) > 3):
        raise ValueError(f'{len(phi)} precision points need {STARTS[len(phi)]}')
    starts = [start for start in (input_start, output_start) if start is not None]
    warn_of_degrees('the angles of a function', [*phi, *psi, *starts])
    if len(phi) == 5:
        return _five_point_generators(phi - phi[0], psi - psi[0], ground)
    theta2 = phi + (input_start or 0.0)
    starts = [output_start] if output_start is not None else _output_starts(theta2, psi)
    generators = []
    for start in starts:
        theta4 = psi + start
        k_1, k_2, _ = freudenstein(theta2, theta4).tolist()
        if k_1 and k_2:
            generators += _four_bars(theta2, theta4, ground / k_1, ground / k_2, ground)
    return generators


def freudenstein(theta2: FloatArray, theta4: FloatArray) -> FloatArray:
    """Return K1, K2, K3 for angles from the ground, least squares, shape (3,)."""
    system = np.column_stack([np.cos(theta4), -np.cos(theta2), np.ones_like(theta2)])
    return np.asarray(np.linalg.lstsq(system, np.cos(theta2 - theta4), rcond=None)[0])


def _four_bars(
    theta2: FloatArray, theta4: FloatArray, crank: complex, rocker: complex, ground: float
) -> list[PlacedFourBar]:
    """Return the four-bar, if any, whose crank and rocker have these vectors at the angle 0."""
    a = crank * np.exp(1j * theta2)
    b = ground + rocker * np.exp(1j * theta4)
    positions = tuple(map(Position, a.tolist(), b.tolist(), a.tolist()))
    try:
        return [PlacedFourBar(0j, complex(ground), positions)]
    except GeometryError:
        return []


def _output_starts(theta2: FloatArray, psi: FloatArray) -> list[float]:
    """
    Return the start angles of the rocker for four precision points, modulo pi.

    The determinant of the four equations is a quadratic form in the start's cosine and sine.
    """

    def det(first: FloatArray, last: FloatArray) -> float:
        columns = [first, -np.cos(theta2), np.ones_like(theta2), last]
        return float(np.linalg.det(np.column_stack(columns)))

    cos_psi = np.cos(psi)
    sin_psi = np.sin(psi)
    cos_difference = np.cos(theta2 - psi)
    sin_difference = np.sin(theta2 - psi)
    # p cos^2 + q cos sin + r sin^2 = 0
    p = det(cos_psi, cos_difference)
    q = det(cos_psi, sin_difference) - det(sin_psi, cos_difference)
    r = -det(sin_psi, sin_difference)
    size = hypot(p - r, q)
    if abs(p + r) > size or size == 0.0:
        return []
    middle = atan2(q, p - r)
    offset = acos(-(p + r) / size)
    return [(middle + offset) / 2.0, (middle - offset) / 2.0]


def _five_point_generators(phi: FloatArray, psi: FloatArray, ground: float) -> list[PlacedFourBar]:
    """
    Return the four-bars of five pairs of rotations.

    Seen from the rocker, the crank is a plane in five poses. Its dyads are couplers; the dyad of
    the two fixed pivots is the ground itself.
    """
    poses = []
    for crank_rotation, rocker_rotation in zip(phi.tolist(), psi.tolist(), strict=True):
        pivot = ground * (1.0 - cmath.rect(1.0, -rocker_rotation))
        poses.append(PlanePose(pivot, crank_rotation - rocker_rotation))
    generators = []
    for dyad in burmester_points(poses):
        rocker = dyad.pivot - ground
        if max(abs(dyad.pin), abs(rocker)) > 1e-6 * ground:
            generators += _four_bars(phi, psi, dyad.pin, rocker, ground)
    return generators
