"""
The geometric method for the Klann leg: two circles a dyad, no iteration.

It shares no equation with the Newton solver, so each is the other's oracle.
"""

from math import atan2, cos, dist, sin
from typing import NamedTuple, TYPE_CHECKING

from klann_ros.kinematics.dyad import clearance, joint, Point
from klann_ros.kinematics.errors import UnreachableError

if TYPE_CHECKING:
    from .geometry import KlannGeometry


class Joints(NamedTuple):
    """The moving joints of a leg, each (x, y) [m]."""

    b: Point
    c: Point
    f: Point
    g: Point
    h: Point


def joints(geometry: 'KlannGeometry', alpha: float) -> Joints:
    """
    Return B, C, F, G and H at a crank angle, in the geometry's assembly.

    C is where the circles about B and D meet, F where those about E and G meet; G and H follow
    from the bent bodies B-C-G and F-G-H.

    Parameters
    ----------
    geometry : KlannGeometry
        The leg.
    alpha : float
        Crank angle [rad].

    Raises
    ------
    UnreachableError
        The circles of a dyad do not meet.

    """
    s_1, s_2 = geometry.assembly
    b, d, e = crank_pin(geometry, alpha), (geometry.x_d, 0.0), (geometry.x_e, geometry.y_e)
    c = joint(b, d, geometry.l_bc, geometry.l_dc, s_1)
    if c is None:
        raise _unreachable(alpha, 1, (b, d, geometry.l_bc, geometry.l_dc))
    g = bent_body_end(b, c, geometry.l_cg / geometry.l_bc, geometry.angle_bcg)
    f = joint(e, g, geometry.l_ef, geometry.l_fg, s_2)
    if f is None:
        raise _unreachable(alpha, 2, (e, g, geometry.l_ef, geometry.l_fg))
    h = bent_body_end(f, g, geometry.l_gh / geometry.l_fg, -geometry.angle_fgh)
    return Joints(b, c, f, g, h)


def angles(geometry: 'KlannGeometry', joints: Joints) -> tuple[float, float, float, float]:
    """Return gamma, beta, delta, theta of placed joints, in [-pi, pi] [rad]."""
    b, c, f, g, _ = joints
    return (
        # gamma and theta are clockwise: the y component changes its sign.
        atan2(b[1] - c[1], c[0] - b[0]),
        atan2(c[1], c[0] - geometry.x_d),
        atan2(f[1] - geometry.y_e, f[0] - geometry.x_e),
        atan2(f[1] - g[1], g[0] - f[0]),
    )


def seed(geometry: 'KlannGeometry', alpha: float) -> tuple[float, float, float, float]:
    """Return gamma, beta, delta, theta at a crank angle [rad]; raises as `joints` does."""
    return angles(geometry, joints(geometry, alpha))


def crank_pin(geometry: 'KlannGeometry', alpha: float) -> Point:
    """Return B (x, y) [m]."""
    return geometry.l_ab * cos(alpha), geometry.y_a + geometry.l_ab * sin(alpha)


def bent_body_end(p: Point, q: Point, ratio: float, bend: float) -> Point:
    """
    Return the end R of the bent body P-Q-R [m].

    QR is PQ, turned by `bend` [rad, counter-clockwise] and longer by `ratio`.
    """
    ux, uy = q[0] - p[0], q[1] - p[1]
    c, s = ratio * cos(bend), ratio * sin(bend)
    return q[0] + c * ux - s * uy, q[1] + s * ux + c * uy


def clearances(geometry: 'KlannGeometry', alpha: float) -> tuple[float, float | None]:
    """
    Return how far each dyad is inside its reach at a crank angle [m]; negative when outside.

    The second is None where the first dyad does not close, since G is nowhere then.
    """
    b, d, e = crank_pin(geometry, alpha), (geometry.x_d, 0.0), (geometry.x_e, geometry.y_e)
    first = clearance(b, d, geometry.l_bc, geometry.l_dc)
    c = joint(b, d, geometry.l_bc, geometry.l_dc, geometry.assembly[0])
    if c is None:
        return first, None
    g = bent_body_end(b, c, geometry.l_cg / geometry.l_bc, geometry.angle_bcg)
    return first, clearance(e, g, geometry.l_ef, geometry.l_fg)


def _unreachable(
    alpha: float, dyad: int, ends: tuple[Point, Point, float, float]
) -> UnreachableError:
    p, q, r_p, r_q = ends
    shortfall = max(0.0, -clearance(*ends))
    return UnreachableError(alpha, dyad, shortfall, dist(p, q) > r_p + r_q)
