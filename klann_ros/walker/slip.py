"""
Motion of a body over the ground on feet that cannot all stand still.

Legs on separate cranks, and legs whose feet vary in speed over their stance, drag feet over the
ground. Each standing foot i resists with friction mu l_i, l_i being its share of the weight,
against the direction of its slip. At walking speed these forces balance, and the motion
(d, psi) of the body minimises the frictional dissipation

    sum l_i |g_i' - g_i + d + psi J g_i|,

with the feet g_i seen from above before and after, and J a quarter turn; mu cancels. A foot that
carries more than half of the weight sticks; the others slip (quasi-static sliding with dry
friction: S. Goyal, A. Ruina, J. Papadopoulos, Wear 143 (1991)). Where friction leaves the motion
undetermined a prior decides: the momentum of the body, or its measured acceleration. One step is
then an implicit step of Newton's law with dry friction (J. J. Moreau, Unilateral contact and dry
friction in finite freedom dynamics, 1988).

The sum is that of a geometric median, and is minimised in the same way: by least squares with
weights 1 / slip, repeated (E. Weiszfeld, 1937).
"""

from collections.abc import Sequence
from math import cos, sin, sqrt
from typing import NamedTuple

from .support import gravity_aligned, Point, Support

Vec2 = tuple[float, float]
Triple = tuple[float, float, float]
# A symmetric 3 x 3 matrix, row by row: xx, xy, xz, yy, yz, zz.
Symmetric = tuple[float, float, float, float, float, float]
# Relative tolerance of the iteration, and its limit.
ITERATIONS, CHANGE = 12, 1e-5
# Feet that slip by less than this part of the longest step stick.
HOLDS = 1e-3
# Yaw information of no foot, as a part of the feet's: coincident feet define no rotation.
NO_YAW = 1e-9


class FootMotion(NamedTuple):
    """
    Motion of a standing foot in the level frame of base_link, as a step or as a velocity.

    Attributes
    ----------
    x, y : float
        Its motion.
    arm_x, arm_y : float
        Motion over the ground for each rad that the body turns [m].
    load : float
        Its weight in the sum.

    """

    x: float
    y: float
    arm_x: float
    arm_y: float
    load: float


class MotionPrior(NamedTuple):
    """
    Motion of the body without friction, and a force that friction balances.

    Attributes
    ----------
    mean : (float, float, float)
        x, y and yaw.
    information : 6 floats
        Its inverse covariance.
    force : (float, float)
        Force on the body in units of mu times its weight, weighted as the loads are.

    """

    mean: tuple[float, float, float]
    information: Symmetric
    force: Vec2


class BodyStep(NamedTuple):
    """
    Motion of a body over the ground, in base_link's directions before.

    Attributes
    ----------
    x, y : float
        [m], or [m/s].
    yaw : float
        [rad], or [rad/s].
    slid : float
        Load-weighted slip of its feet [m], or [m/s].
    covariance : 6 floats
        Inverse of the information of prior and feet.

    """

    x: float
    y: float
    yaw: float
    slid: float
    covariance: Symmetric = (0.0,) * 6


class StancePose(NamedTuple):
    """
    A pose of a body on its feet.

    Attributes
    ----------
    support : Support
        The feet that carry it.
    flat : list of (float, float)
        All feet in the level frame of base_link with their rolling, seen from above [m].
    centre : (float, float)
        The centre of mass, likewise.

    """

    support: Support
    flat: list[Vec2]
    centre: Vec2 = (0.0, 0.0)


def stance_pose(
    feet: Sequence[Point],
    rolled: Sequence[Sequence[float]],
    support: Support,
    attitude: Vec2 | None = None,
    centre: Point = (0.0, 0.0, 0.0),
) -> StancePose:
    """Return a pose; `attitude` is roll and pitch where they are measured [rad]."""
    *level, middle = gravity_aligned([*feet, centre], *(attitude or (support.roll, support.pitch)))
    flat = [(x + rx, y + ry) for (x, y), (rx, ry) in zip(level, rolled, strict=True)]
    return StancePose(support, flat, middle)


def body_displacement(before: StancePose, after: StancePose) -> BodyStep:
    """Return how a body moves from pose to pose by friction alone."""
    loads = dict.fromkeys((*before.support.feet, *after.support.feet), 0.0)
    for support in (before.support, after.support):
        for foot, load in zip(support.feet, support.loads, strict=True):
            loads[foot] += load / 2.0
    feet = [foot_motion(before.flat[i], after.flat[i], load) for i, load in loads.items()]
    return minimize_slip(feet, HOLDS * max(abs(foot.x) + abs(foot.y) for foot in feet))


def foot_motion(before: Vec2, after: Vec2, load: float, seconds: float = 1.0) -> FootMotion:
    """Return the motion of a foot between two places, divided by a time."""
    (px, py), (qx, qy) = before, after
    return FootMotion(
        (qx - px) / seconds, (qy - py) / seconds, -(py + qy) / 2.0, (px + qx) / 2.0, load
    )


def minimize_slip(
    feet: Sequence[FootMotion],
    creep: float,
    prior: MotionPrior | None = None,
    yaw: float | None = None,
) -> BodyStep:
    """
    Return the motion of a body whose feet move.

    Parameters
    ----------
    feet : sequence of FootMotion
        The standing feet.
    creep : float
        Slip below which friction is regularised, in the unit of the motions.
    prior : MotionPrior, optional
        Motion without friction; without it, friction is all.
    yaw : float, optional
        Rotation of the body, where it is measured.

    """
    x, y, turn = prior.mean if prior else (0.0, 0.0, 0.0)
    scale = sum([abs(foot.x) + abs(foot.y) for foot in feet]) + abs(x) + abs(y)
    if scale == 0.0:
        return BodyStep(0.0, 0.0, yaw or 0.0, 0.0)
    turn = turn if yaw is None else yaw
    pxx = pxy = pxt = pyy = pyt = ptt = bx = by = bt = 0.0
    if prior is not None:
        pxx, pxy, pxt, pyy, pyt, ptt = prior.information
        bx = pxx * x + pxy * y + pxt * turn + prior.force[0]
        by = pxy * x + pyy * y + pyt * turn + prior.force[1]
        bt = pxt * x + pyt * y + ptt * turn
    floor, change = creep * creep, CHANGE * scale
    # Without a prior the first step weights by the loads alone.
    is_first = prior is None
    for _ in range(ITERATIONS):
        xx, xy, xt, yy, yt, tt, rx, ry, rt = pxx, pxy, pxt, pyy, pyt, ptt, bx, by, bt
        for dx, dy, jx, jy, load in feet:
            if is_first:
                w = load / scale
            else:
                ex, ey = dx + x + turn * jx, dy + y + turn * jy
                w = load / sqrt(ex * ex + ey * ey + floor)
            xx += w
            yy += w
            xt += w * jx
            yt += w * jy
            tt += w * (jx * jx + jy * jy)
            rx -= w * dx
            ry -= w * dy
            rt -= w * (jx * dx + jy * dy)
        is_first = False
        last_x, last_y, last_turn = x, y, turn
        if yaw is None:
            covariance = inverse((xx, xy, xt, yy, yt, tt * (1.0 + NO_YAW)))
            cxx, cxy, cxt, cyy, cyt, ctt = covariance
            turn = cxt * rx + cyt * ry + ctt * rt
            x, y = cxx * rx + cxy * ry + cxt * rt, cxy * rx + cyy * ry + cyt * rt
        else:
            whole = xx * yy - xy * xy
            cxx, cxy, cyy = yy / whole, -xy / whole, xx / whole
            covariance = (cxx, cxy, 0.0, cyy, 0.0, 0.0)
            rx, ry = rx - xt * yaw, ry - yt * yaw
            x, y = cxx * rx + cxy * ry, cxy * rx + cyy * ry
        # A rotation moves feet by about their distance in metres.
        if abs(x - last_x) + abs(y - last_y) + abs(turn - last_turn) < change:
            break
    slid = sum(
        [
            load * sqrt((dx + x + turn * jx) ** 2 + (dy + y + turn * jy) ** 2)
            for dx, dy, jx, jy, load in feet
        ]
    )
    return BodyStep(x, y, turn, slid, covariance)


def least_squares(feet: Sequence[FootMotion], yaw: float | None = None) -> Triple:
    """Return x, y and yaw of the body by load-weighted least squares of the slip."""
    n = sum([load for *_, load in feet])
    sx = sum([load * dx for dx, _, _, _, load in feet]) / n
    sy = sum([load * dy for _, dy, _, _, load in feet]) / n
    sjx = sum([load * jx for _, _, jx, _, load in feet]) / n
    sjy = sum([load * jy for _, _, _, jy, load in feet]) / n
    if yaw is None:
        jj = sum([load * (jx * jx + jy * jy) for _, _, jx, jy, load in feet]) / n
        jd = sum([load * (jx * dx + jy * dy) for dx, dy, jx, jy, load in feet]) / n
        below = jj * (1.0 + NO_YAW) - sjx * sjx - sjy * sjy
        yaw = (sjx * sx + sjy * sy - jd) / below
    return -(sx + yaw * sjx), -(sy + yaw * sjy), yaw


def inverse(matrix: Symmetric) -> Symmetric:
    """Return the inverse of a symmetric matrix."""
    a, b, c, d, e, f = matrix
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    whole = a * p + b * q + c * r
    s, t, u = a * f - c * c, b * c - a * e, a * d - b * b
    return p / whole, q / whole, r / whole, s / whole, t / whole, u / whole


def rotate(vector: Vec2, angle: float) -> Vec2:
    """Return a vector rotated counter-clockwise."""
    (x, y), c, s = vector, cos(angle), sin(angle)
    return c * x - s * y, s * x + c * y


def low_pass(old: Vec2, new: Vec2, share: float) -> Vec2:
    """Return a vector moved by a share of its distance towards another."""
    (x, y), (to_x, to_y) = old, new
    return x + share * (to_x - x), y + share * (to_y - y)
