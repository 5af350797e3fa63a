"""A dyad: two links that meet at a joint; the geometric method for one of them."""

from math import dist, sqrt

Point = tuple[float, float]


def joint(p: Point, q: Point, r_p: float, r_q: float, sign: int) -> Point | None:
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
        J = (x, y) [m]; None where the circles do not meet (see `clearance`), and where P and Q
        coincide, so that they meet nowhere or everywhere.

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


def clearance(p: Point, q: Point, r_p: float, r_q: float) -> float:
    """
    Return how far the ends P and Q are inside the dyad's reach [m]; negative when outside.

    The reach is |r_p - r_q| <= |PQ| <= r_p + r_q. Parameters as in `joint`.
    """
    d = dist(p, q)
    return min(r_p + r_q - d, d - abs(r_p - r_q))
