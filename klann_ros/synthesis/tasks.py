"""Four-bars for poses, paths, limits and toggles: pairs of dyads, and the rocker's limits."""

from collections.abc import Sequence
from itertools import permutations
from math import cos, isfinite, pi, sin, sqrt

from klann_ros.kinematics import FourBar, FourBarGeometry, GeometryError, Grashof
import numpy as np

from .dyads import (
    burmester_curve,
    burmester_points,
    BurmesterPair,
    dyad_of_pin,
    dyad_of_pivot,
    dyad_of_rotations,
    pins,
    PlanePose,
)
from .placed import PlacedFourBar, Position

# Samples of the crank's length from which the best transmission angle is chosen.
CRANK_SAMPLES = 400


def motion_generators(
    poses: Sequence[PlanePose],
    *,
    pivots: tuple[complex, complex] | None = None,
    pins_at_start: tuple[complex, complex] | None = None,
    count: int = 36,
) -> list[PlacedFourBar]:
    """
    Return four-bars whose coupler takes three, four or five poses.

    Parameters
    ----------
    poses : sequence of PlanePose
        Poses of the coupler; P is the coupler point.
    pivots : (complex, complex), optional
        With three poses: the fixed pivots O2 and O4 [m].
    pins_at_start : (complex, complex), optional
        With three poses, instead of `pivots`: A and B in the first pose [m].
    count : int
        With four poses: number of crank rotations from which dyads of the Burmester curve are
        taken; all pairs of them are returned.

    Returns
    -------
    list of PlacedFourBar
        Each fits all poses; `defects` says what keeps it from moving through them.

    Raises
    ------
    ValueError
        Not three to five poses, or three without pivots or pins.
    GeometryError
        No bar fits the three poses with these pivots or pins.

    """
    if len(poses) == 3:
        if (pivots is None) == (pins_at_start is None):
            raise ValueError('three poses need either both fixed pivots or both pins')
        dyads = [dyad_of_pivot(poses, pivot) for pivot in pivots or ()]
        dyads += [dyad_of_pin(poses, pin) for pin in pins_at_start or ()]
    elif len(poses) == 4:
        dyads = burmester_curve(poses, count)
    elif len(poses) == 5:
        dyads = burmester_points(poses)
    else:
        raise ValueError(f'{len(poses)} poses: 3 to 5 are needed')
    pairs = permutations(dyads, 2) if len(poses) > 3 else [dyads]
    return [linkage for one, other in pairs if (linkage := _couple(poses, one, other))]


def path_generator(
    points: Sequence[complex],
    crank_rotations: Sequence[float],
    coupler_rotations: Sequence[float],
    rocker_rotations: Sequence[float],
) -> PlacedFourBar:
    """
    Return the four-bar whose coupler point passes three points with prescribed timing.

    Parameters
    ----------
    points : sequence of complex
        Three points of the path [m].
    crank_rotations : sequence of float
        Rotations of the crank from the first point to the two others: the timing [rad].
    coupler_rotations, rocker_rotations : sequence of float
        The same of coupler and rocker; free choices [rad].

    Raises
    ------
    ValueError
        Not three points.
    GeometryError
        The rotations determine no four-bar.

    """
    if len(points) != 3:
        raise ValueError(f'{len(points)} points: 3 are needed')
    angles = (0.0, *coupler_rotations)
    poses = [PlanePose(p, angle) for p, angle in zip(points, angles, strict=True)]
    crank, rocker = (dyad_of_rotations(poses, x) for x in (crank_rotations, rocker_rotations))
    linkage = _couple(poses, crank, rocker)
    if linkage is None:
        raise GeometryError('the two dyads make no four-bar: pivots or pins coincide')
    return linkage


def quick_returns(
    time_ratio: float, swing: float, rocker: float = 1.0, crank: float | None = None
) -> list[FourBarGeometry]:
    """
    Return crank-rockers with a time ratio and a swing of the rocker.

    With the imbalance angle alpha = pi (Q - 1) / (Q + 1) and the chord C = 2 L4 sin(swing / 2)
    between the limits of B, the triangle of L3 + L2 and L3 - L2 over the chord has the angle
    alpha at O2:

        L3^2 (1 - cos alpha) + L2^2 (1 + cos alpha) = C^2 / 2.

    Parameters
    ----------
    time_ratio : float
        Q >= 1: time of the slow stroke over that of the quick one, the crank turning evenly.
    swing : float
        Angle between the rocker's limits, in (0, pi) [rad].
    rocker : float
        L4 [m].
    crank : float, optional
        L2 [m]; else the one with the best least transmission angle.

    Returns
    -------
    list of FourBarGeometry
        At most two, the best transmission angle first; empty where no crank-rocker has them.

    Raises
    ------
    ValueError
        A number is out of range. With Q = 1 the crank is C / 2 and the coupler is free: see
        `central_crank_rocker`.

    References
    ----------
    Norton: Design of Machinery, section 3.4; Brodell, Soni: Design of the crank-rocker mechanism
    with unit time ratio, J. Mechanisms 5 (1970) 1-4.

    """
    if not (isfinite(time_ratio) and time_ratio > 1.0):
        raise ValueError(f'time_ratio = {time_ratio!r} is refused: it must be above 1')
    if not 0.0 < swing < pi:
        raise ValueError(f'swing = {swing!r} rad is refused: it must be between 0 and pi')
    alpha, chord = pi * (time_ratio - 1.0) / (time_ratio + 1.0), 2.0 * rocker * sin(swing / 2.0)
    most = chord / sqrt(2.0 * (1.0 + cos(alpha)))
    cranks = [crank] if crank else (np.arange(1, CRANK_SAMPLES) * most / CRANK_SAMPLES).tolist()
    found = []
    for geometry in (x for each in cranks for x in _of_crank(each, alpha, chord, rocker, swing)):
        bar = FourBar(*geometry.lengths)
        if bar.grashof.motion == 'crank-rocker':
            limits, extremes = bar.rocker_limits, bar.transmission_extremes
            away = abs(limits.time_ratio / time_ratio - 1.0), abs(limits.swing - swing)
            if max(away) <= 1e-9:
                found.append((min(sin(extremes.least), sin(extremes.greatest)), geometry))
    best = sorted(found, key=lambda each: -each[0])[: 2 if crank else 1]
    return [geometry for _, geometry in best]


def central_crank_rocker(swing: float, rocker: float, coupler: float) -> FourBarGeometry:
    """
    Return the crank-rocker with the time ratio 1: O2 and both limits of B are on one line.

    L2 = L4 sin(swing / 2), L1^2 = L3^2 + L4^2 - L2^2. Raises a GeometryError where it is none.
    """
    crank = rocker * sin(swing / 2.0)
    square = coupler**2 + rocker**2 - crank**2
    geometry = FourBarGeometry(sqrt(max(square, 0.0)), crank, coupler, rocker)
    if Grashof(geometry.lengths).motion != 'crank-rocker':
        raise GeometryError(f'coupler = {coupler:g} m makes no crank-rocker with this swing')
    return geometry


def toggle_couplers(
    ground: float, crank: float, rocker: float, theta2: float
) -> list[tuple[float, str]]:
    """
    Return the couplers with which a crank angle is a dead point, and how it is in line.

    With Z = `|A O4|` at theta2: L3 = Z - L4 (stretched), Z + L4 or L4 - Z (folded); those > 0 [m].
    """
    z = abs(crank * np.exp(1j * theta2) - ground)
    candidates = ((z - rocker, 'stretched'), (z + rocker, 'folded'), (rocker - z, 'folded'))
    return [(float(length), kind) for length, kind in candidates if length > 0.0]


def _couple(
    poses: Sequence[PlanePose], one: BurmesterPair, other: BurmesterPair
) -> PlacedFourBar | None:
    """Return the four-bar of a driving and a driven dyad; None if they make none."""
    places = tuple(
        Position(a, b, p)
        for a, b, (p, _) in zip(pins(poses, one.pin), pins(poses, other.pin), poses, strict=True)
    )
    try:
        return PlacedFourBar(one.pivot, other.pivot, *places[0], places)
    except (GeometryError, ZeroDivisionError):
        return None


def _of_crank(
    crank: float, alpha: float, chord: float, rocker: float, swing: float
) -> list[FourBarGeometry]:
    """Return the four-bars with a crank, for O2 on either side of the chord."""
    square = (chord**2 / 2.0 - crank**2 * (1.0 + cos(alpha))) / (1.0 - cos(alpha))
    if square <= crank**2:
        return []
    coupler = sqrt(square)
    # O4 at 0, the chord upright; O2 at distances L3 + L2 and L3 - L2 from its ends.
    half, across = chord / 2.0, rocker * cos(swing / 2.0)
    y = ((coupler + crank) ** 2 - (coupler - crank) ** 2) / (4.0 * half)
    x = sqrt(max((coupler - crank) ** 2 - (half - y) ** 2, 0.0))
    grounds = [abs(complex(across + side, y)) for side in (x, -x)]
    # A crank-rocker's crank is its shortest link, so that the others are positive.
    return [FourBarGeometry(g, crank, coupler, rocker) for g in grounds if g > crank]
