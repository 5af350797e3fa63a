"""Four-bars by the limits of their rocker, and by toggles."""

from contextlib import suppress
from math import cos, hypot, isfinite, pi, sin, sqrt

from klann_ros.kinematics import FourBar, FourBarGeometry, GeometryError
import numpy as np

# Samples of the crank's length from which the best transmission angle is chosen.
CRANK_SAMPLES = 400


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
        Q >= 1: time of the slow stroke over the quick one's, the crank turning evenly.
    swing : float
        Angle between the rocker's limits, in (0, pi) [rad].
    rocker : float
        L4 [m].
    crank : float, optional
        L2 [m]; by default the crank with the best least transmission angle.

    Returns
    -------
    list of FourBarGeometry
        At most two, the best transmission angle first; empty where no crank-rocker has them.

    Raises
    ------
    ValueError
        A number is out of range. With Q = 1 the crank is C / 2 and the coupler is free:
        L1^2 = L3^2 + L4^2 - L2^2.

    References
    ----------
    Norton: Design of Machinery, section 3.4; Brodell, Soni: Design of the crank-rocker mechanism
    with unit time ratio, J. Mechanisms 5 (1970) 1-4.

    """
    if not (isfinite(time_ratio) and time_ratio > 1.0):
        raise ValueError(f'time_ratio = {time_ratio!r} is refused: it must be above 1')
    if not 0.0 < swing < pi:
        raise ValueError(f'swing = {swing!r} rad is refused: it must be between 0 and pi')
    alpha = pi * (time_ratio - 1.0) / (time_ratio + 1.0)
    chord = 2.0 * rocker * sin(swing / 2.0)
    max_crank = chord / sqrt(2.0 * (1.0 + cos(alpha)))
    lengths = [crank] if crank else np.arange(1, CRANK_SAMPLES) * max_crank / CRANK_SAMPLES
    crank_rockers = []
    for length in map(float, lengths):
        for geometry in _four_bars_with_crank(length, alpha, rocker, swing):
            bar = FourBar(*geometry.lengths)
            if bar.grashof.motion != 'crank-rocker':
                continue
            limits = bar.rocker_limits
            errors = abs(limits.time_ratio / time_ratio - 1.0), abs(limits.swing - swing)
            if max(errors) <= 1e-9:
                crank_rockers.append(bar)
    crank_rockers.sort(key=_min_transmission_sine, reverse=True)
    return [bar.geometry for bar in crank_rockers[: 2 if crank else 1]]


def _min_transmission_sine(bar: FourBar) -> float:
    extremes = bar.transmission_extremes
    return min(sin(extremes.least), sin(extremes.greatest))


def toggle_couplers(
    ground: float, crank: float, rocker: float, theta2: float
) -> list[tuple[float, str]]:
    """
    Return the couplers with which a crank angle is a dead point, and the kind of the dead point.

    With Z = `|A O4|` at theta2: L3 = Z - L4 (stretched), Z + L4 or L4 - Z (folded); those > 0 [m].
    """
    z = abs(crank * np.exp(1j * theta2) - ground)
    candidates = ((z - rocker, 'stretched'), (z + rocker, 'folded'), (rocker - z, 'folded'))
    return [(float(length), kind) for length, kind in candidates if length > 0.0]


def _four_bars_with_crank(
    crank: float, alpha: float, rocker: float, swing: float
) -> list[FourBarGeometry]:
    """
    Return the four-bars with a crank's length, for O2 on either side of the chord.

    Lengths in m, and the angles alpha > 0 and swing of `quick_returns` [rad].
    """
    chord = 2.0 * rocker * sin(swing / 2.0)
    # The equation of `quick_returns` by half of alpha, as 1 - cos alpha of a small one is 0.
    coupler_square = (chord**2 / 4.0 - (crank * cos(alpha / 2.0)) ** 2) / sin(alpha / 2.0) ** 2
    if coupler_square <= crank**2:
        return []
    coupler = sqrt(coupler_square)
    # O2 from the middle of the chord, y along it: L3 + L2 from one end, L3 - L2 from the other.
    y = 2.0 * coupler * crank / chord
    x = sqrt(max((coupler - crank) ** 2 - (chord / 2.0 - y) ** 2, 0.0))
    chord_from_o4 = rocker * cos(swing / 2.0)
    ground_lengths = hypot(chord_from_o4 + x, y), hypot(chord_from_o4 - x, y)
    four_bars = []
    for ground in ground_lengths:
        # The crank of a crank-rocker is its shortest link.
        if ground > crank:
            # A ground and a coupler that are long beyond rounding do not close.
            with suppress(GeometryError):
                four_bars.append(FourBarGeometry(ground, crank, coupler, rocker))
    return four_bars
