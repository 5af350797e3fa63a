"""Where a four-bar's driver stops: its dead points, and the limit positions of the rocker."""

from dataclasses import replace
from math import atan2, cos, nan, pi, sin
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN, wrap
from klann_ros.kinematics.linkage.reach import limits

from .geometry import FourBarGeometry

STRETCHED, FOLDED = 'stretched', 'folded'
DRIVERS = ('crank', 'rocker')


class DeadPoint(NamedTuple):
    """
    A pose in which the driver cannot go on: the two other moving links are in line.

    Attributes
    ----------
    driver : str
        'crank' (coupler and rocker are in line) or 'rocker' (crank and coupler are).
    angle : float
        The driver's angle: theta2 or theta4 [rad].
    kind : str
        'stretched' or 'folded': how the two are in line.
    theta2, theta3, theta4 : float
        The pose, each in (-pi, pi] [rad].

    """

    driver: str
    angle: float
    kind: str
    theta2: float
    theta3: float
    theta4: float


class RockerLimits(NamedTuple):
    """
    The limit positions of the rocker, where crank and coupler are in line.

    Attributes
    ----------
    stretched, folded : DeadPoint or None
        The two limit positions of this assembly; None where the rocker has no such limit.
    swing : float
        How far the rocker can turn between its limits, 2 pi for one that turns fully [rad]. Where
        it has only one kind of limit it swings through to the mirrored one, which the other
        assembly has.
    time_ratio : float
        Of a crank-rocker whose crank turns evenly: the time of the slow stroke over that of the
        quick one, >= 1; NaN for any other linkage.

    """

    stretched: DeadPoint | None
    folded: DeadPoint | None
    swing: float
    time_ratio: float


def dead_points(geometry: FourBarGeometry, driver: str = 'crank') -> list[DeadPoint]:
    """
    Return the dead points of a driver, by its angle; none where it turns fully.

    Those of the crank are the ends of what it can reach, where both assemblies meet: two for each
    kind, one on each side. Those of the rocker belong to one assembly: at most one for each kind,
    and the other assembly has it mirrored. So in class II crank and rocker have two each, but of
    the rocker's one is found of each assembly. A change point, where all links are in line and
    the driver passes, is no dead point. 'both' are the crank's and the rockers' of both
    assemblies.

    References
    ----------
    "Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples, "Posicoes de ponto morto".

    """
    if driver == 'both':
        other = replace(geometry, assembly=-geometry.assembly)
        of_rockers = [*_of_rocker(geometry), *_of_rocker(other)]
        return [*dead_points(geometry), *sorted(of_rockers, key=lambda point: point.angle)]
    if driver not in DRIVERS:
        msg = f"driver = {driver!r} is refused: it must be 'crank', 'rocker' or 'both'"
        raise ValueError(msg)
    found = _of_crank(geometry) if driver == 'crank' else _of_rocker(geometry)
    return sorted(found, key=lambda point: point.angle)


def rocker_limits(geometry: FourBarGeometry, motion: str) -> RockerLimits:
    """Return the limits of the rocker; only a motion of 'crank-rocker' has a time ratio."""
    points = {point.kind: point for point in _of_rocker(geometry)}
    stretched, folded = points.get(STRETCHED), points.get(FOLDED)
    near, far = limits(_reversed(geometry))
    # Within near .. far on one side of the ground, or through it where there is no limit.
    swing = (far - near) if near > 0.0 and far < pi else 2.0 * (far - near)
    ratio = nan
    if motion == 'crank-rocker' and stretched and folded:
        quick = abs(wrap(stretched.theta2 - folded.theta2))
        ratio = (TURN - quick) / quick
    return RockerLimits(stretched, folded, swing, ratio)


def _of_crank(geometry: FourBarGeometry) -> list[DeadPoint]:
    near, far = limits(geometry.lengths)
    found = []
    for angle, kind, exists in ((near, FOLDED, near > 0.0), (far, STRETCHED, far < pi)):
        for theta2 in (-angle, angle) if exists else ():
            x = _in_line(geometry, theta2, kind)
            found.append(DeadPoint('crank', theta2, kind, theta2, wrap(x[0]), wrap(x[1])))
    return found


def _of_rocker(geometry: FourBarGeometry) -> list[DeadPoint]:
    near, far = limits(_reversed(geometry))
    found = []
    if near > 0.0:
        # Crank and coupler point to B, or away from it; that decides on which side of the ground
        # sin(theta4 - theta3) has the assembly's sign.
        longer = geometry.crank > geometry.coupler
        side = -geometry.assembly if longer else geometry.assembly
        theta4 = side * (pi - near)
        out = _direction_of_b(geometry, theta4)
        back = wrap(out + pi)
        x = (out, back) if longer else (back, out)
        found.append(DeadPoint('rocker', theta4, FOLDED, *x, theta4))
    if far < pi:
        theta4 = geometry.assembly * (pi - far)
        out = _direction_of_b(geometry, theta4)
        found.append(DeadPoint('rocker', theta4, STRETCHED, out, out, theta4))
    return found


def _in_line(geometry: FourBarGeometry, theta2: float, kind: str) -> tuple[float, float]:
    """Return theta3 and theta4 where coupler and rocker are stretched out or folded [rad]."""
    x, y = geometry.crank_pin(theta2)
    toward, away = atan2(-y, geometry.ground - x), atan2(y, x - geometry.ground)
    if kind == STRETCHED:
        return toward, away
    return (toward, toward) if geometry.coupler > geometry.rocker else (away, away)


def _reversed(geometry: FourBarGeometry) -> tuple[float, float, float, float]:
    """Return the lengths seen from the rocker, which is the crank then, at pi - theta4."""
    return geometry.ground, geometry.rocker, geometry.coupler, geometry.crank


def _direction_of_b(geometry: FourBarGeometry, theta4: float) -> float:
    """Return the direction from O2 to B [rad]."""
    x, y = geometry.ground + geometry.rocker * cos(theta4), geometry.rocker * sin(theta4)
    return atan2(y, x)
