"""
A body on its feet: which of them carry it, and how it moves over the ground when they slip.

A body that may tilt rests on a facet of its feet's convex hull, three feet f_i with no foot below
their plane, if its centre of mass is above them: the point of the plane below it is

    sum l_i f_i,   sum l_i = 1,   l_i >= 0,

and the l_i are the load shares of these feet. There may be several such facets, as for a chair
that can be tilted back: the body stays on its facet while that holds, then tips to the one with
the lowest centre of mass. It does not lie down on its side, which may be lower still. Where more
feet touch the plane, all are taken as equally stiff springs (`spring_loads`).

Legs on separate cranks, and legs whose feet vary in speed over their stance, drag feet over the
ground. Each standing foot resists with friction mu l_i against the direction of its slip. At
walking speed these forces balance, and the motion (d, psi) of the body minimises the frictional
dissipation

    sum l_i |g_i' - g_i + d + psi J g_i|,

with the feet g_i seen from above before and after, and J a quarter turn; mu cancels. A foot that
carries more than half of the weight sticks; the others slip (quasi-static sliding with dry
friction: S. Goyal, A. Ruina, J. Papadopoulos, Wear 143 (1991)). Where friction leaves the motion
undetermined a prior decides: the momentum of the body, or its measured acceleration. One step is
then an implicit step of Newton's law with dry friction (J. J. Moreau, Unilateral contact and dry
friction in finite freedom dynamics, 1988). The sum is that of a geometric median, minimised by
least squares with weights 1 / slip, repeated (E. Weiszfeld, 1937).

Poses are computed one by one in plain numbers: arrays of six feet would be slower.
"""

from collections.abc import Iterable, Sequence
from functools import cache
from itertools import combinations
from math import asin, atan2, cos, hypot, inf, sin, sqrt
from typing import NamedTuple

Point = Sequence[float]
Vec2 = tuple[float, float]
Triple = tuple[float, float, float]
Facet = tuple[int, int, int]
# A symmetric 3 x 3 matrix, row by row: xx, xy, xz, yy, yz, zz.
Symmetric = tuple[float, float, float, float, float, float]
# Rounding: of areas by the squared size, of load shares, and of heights [m].
FLAT, ROUNDING, BELOW = 1e-9, 1e-12, 1e-12
# Cosine of the tilt beyond which a body lies on its side: 30 deg.
STANDING = 0.866
# Feet up to this height above the plane carry load as well, and a foot sinks by this under the
# whole weight, as its leg and the floor give way [m].
TOUCHING, SINK = 1e-6, 5e-4
# Iterations of the loads and of the slip, the relative tolerance of the latter, and the slip of
# sticking feet by the longest step.
ITERATIONS, CHANGE, HOLDS = 12, 1e-5, 1e-3
# Yaw information of no foot, as a part of the feet's: coincident feet define no rotation.
NO_YAW = 1e-9


class Support(NamedTuple):
    """
    How a body rests on its feet.

    Attributes
    ----------
    feet : tuple of int
        Those that carry it, three or more.
    loads : tuple of float
        Their shares of the weight.
    facet : (int, int, int)
        Three of them around the centre of mass.
    normal : (float, float, float)
        Upwards, in base_link.
    height : float
        Of base_link's origin above the ground [m].
    corners : sequence of (float, float, float)
        The feet that touch the ground [m].
    centre : (float, float, float)
        The centre of mass [m].

    """

    feet: tuple[int, ...]
    loads: tuple[float, ...]
    facet: Facet
    normal: Triple
    height: float
    corners: Sequence[Point]
    centre: Point

    @property
    def pitch(self) -> float:
        """Return the pitch, positive with the nose down, as in REP 103 [rad]."""
        return asin(-self.normal[0])

    @property
    def roll(self) -> float:
        """Return the roll, positive with the left side up [rad]."""
        return atan2(self.normal[1], self.normal[2])

    @property
    def margin(self) -> float:
        """
        Return the static margin [m].

        It is the horizontal distance of the centre of mass from the nearest edge of the polygon of
        the feet that touch the ground.
        """
        corners, (nx, ny, nz), nearest = self.corners, self.normal, inf
        for a, b in combinations(corners, 2):
            ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            sides = [ex * (f[1] - a[1]) - ey * (f[0] - a[0]) for f in corners]
            if min(sides) < -ROUNDING and max(sides) > ROUNDING:
                continue
            # From the upright plane through both.
            out = ey * nz - ez * ny, ez * nx - ex * nz, ex * ny - ey * nx
            away = sum(o * (c - p) for o, c, p in zip(out, self.centre, a, strict=True))
            nearest = min(nearest, abs(away) / (hypot(*out) or 1.0))
        return nearest


def outside(feet: Sequence[Point], centre: Point) -> float:
    """Return the distance of a centre of mass from the polygon of all feet, from above [m]."""
    nearest = inf
    for a, b in combinations(feet, 2):
        ex, ey, x, y = b[0] - a[0], b[1] - a[1], centre[0] - a[0], centre[1] - a[1]
        t = max(0.0, min(1.0, (x * ex + y * ey) / ((ex * ex + ey * ey) or 1.0)))
        nearest = min(nearest, hypot(x - t * ex, y - t * ey))
    return nearest


def gravity_aligned(points: Iterable[Point], roll: float, pitch: float) -> list[Vec2]:
    """Return points or vectors of base_link, turned by roll and pitch, seen from above."""
    b, a, d, c = sin(roll), cos(roll), sin(pitch), cos(pitch)
    return [(c * x + d * (b * y + a * z), a * y - b * z) for x, y, z in points]


def support(feet: Sequence[Point], centre: Point, guess: Facet | None = None) -> Support | None:
    """
    Return how a body rests; None where its centre is not above the polygon of its feet.

    Parameters
    ----------
    feet : sequence of (float, float, float)
        Positions in base_link [m].
    centre : (float, float, float)
        Its centre of mass [m].
    guess : (int, int, int), optional
        The facet before, on which it stays while that holds.

    """
    found = guess and _on(feet, centre, guess)
    if not found:
        stable = [each for facet in _facets(len(feet)) if (each := _on(feet, centre, facet))]
        if not stable:
            return None
        found = min(stable, key=lambda s: (-min(s.normal[2], STANDING), _above(s, centre)))
    return _shared(feet, found)


@cache
def _facets(count: int) -> tuple[Facet, ...]:
    return tuple(combinations(range(count), 3))


def _above(found: Support, point: Point) -> float:
    """Return the height of a point above the ground."""
    (x, y, z), (px, py, pz) = found.normal, point
    return found.height + x * px + y * py + z * pz


def _on(feet: Sequence[Point], centre: Point, facet: Facet) -> Support | None:
    """Return how it rests on three feet; None where its centre or a foot forbids it."""
    corners = [feet[i] for i in facet]
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    if abs(nz) <= FLAT * (ux * ux + uy * uy + vx * vx + vy * vy):
        return None
    size = sqrt(nx * nx + ny * ny + nz * nz) * (1.0 if nz > 0.0 else -1.0)
    x, y, z = nx / size, ny / size, nz / size
    height = -(x * ax + y * ay + z * az)
    above = height + x * centre[0] + y * centre[1] + z * centre[2]
    px, py = centre[0] - above * x - ax, centre[1] - above * y - ay
    b, c = (px * vy - py * vx) / nz, (ux * py - uy * px) / nz
    a = 1.0 - b - c
    if min(a, b, c) < -ROUNDING:
        return None
    if min([fx * x + fy * y + fz * z for fx, fy, fz in feet]) < -height - BELOW:
        return None
    return Support(facet, (a, b, c), facet, (x, y, z), height, corners, centre)


def _shared(feet: Sequence[Point], found: Support) -> Support:
    """Return a support on all feet that touch its plane."""
    (x, y, z), centre = found.normal, found.centre
    top = TOUCHING - found.height
    touch = [i for i, f in enumerate(feet) if f[0] * x + f[1] * y + f[2] * z <= top]
    if len(touch) == 3:
        return found
    above, corners = _above(found, centre), [feet[i] for i in touch]
    flat = [(corner[0], corner[1]) for corner in corners]
    ground = centre[0] - above * x, centre[1] - above * y
    loads = spring_loads(flat, [0.0] * len(touch), ground)
    carrying = [(i, load) for i, load in zip(touch, loads, strict=True) if load > 0.0]
    if len(carrying) > 3:
        on, shares = zip(*carrying, strict=True)
        return found._replace(feet=on, loads=shares, corners=corners)
    return found._replace(corners=corners)


def spring_loads(flat: Sequence[Vec2], heights: Sequence[float], over: Vec2) -> list[float]:
    """
    Return the load shares of feet that give way like springs.

    Each foot carries (d + a x + b y - h) / SINK where that is positive; d, a and b follow from the
    balance of the weight.

    Parameters
    ----------
    flat : sequence of (float, float)
        All feet, seen from above [m].
    heights : sequence of float
        Heights of the feet above the plane of their support [m].
    over : (float, float)
        The point in which the weight acts [m].

    """
    ox, oy = over
    at = [(x - ox, y - oy, h) for (x, y), h in zip(flat, heights, strict=True)]
    active = [i for i, h in enumerate(heights) if h < TOUCHING]
    loads = [0.0] * len(at)
    for _ in range(ITERATIONS):
        xx = xy = yy = sx = sy = sh = hx = hy = 0.0
        for i in active:
            x, y, h = at[i]
            xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
            sx, sy, sh, hx, hy = sx + x, sy + y, sh + h, hx + h * x, hy + h * y
        n = float(len(active))
        whole = n * (xx * yy - xy * xy) - sx * (sx * yy - sy * xy) + sy * (sx * xy - sy * xx)
        if abs(whole) <= FLAT * (xx + yy) ** 2:
            break
        p, q, r, s, t, u = inverse((n, sx, sy, xx, xy, yy))
        sh += SINK
        d, a, b = p * sh + q * hx + r * hy, q * sh + s * hx + t * hy, r * sh + t * hx + u * hy
        loads = [max(0.0, (d + a * x + b * y - h) / SINK) for x, y, h in at]
        carrying = [i for i, load in enumerate(loads) if load > 0.0]
        if carrying == active:
            break
        active = carrying
    total = sum(loads)
    return [load / total for load in loads] if total else loads


class FootMotion(NamedTuple):
    """Motion of a standing foot in the level frame of base_link: a step [m] or velocity [m/s]."""

    x: float
    y: float
    # Motion over the ground for each rad of the body's rotation [m].
    arm_x: float
    arm_y: float
    # Its weight in the sum.
    load: float


class MotionPrior(NamedTuple):
    """Motion of the body without friction, and a force that friction balances."""

    # x, y and yaw, and their inverse covariance.
    mean: Triple
    information: Symmetric
    # In units of mu times the weight of the body, weighted as the loads are.
    force: Vec2


class BodyStep(NamedTuple):
    """Motion of a body over the ground, in base_link's directions before: a step or velocity."""

    x: float
    y: float
    yaw: float
    # Load-weighted slip of its feet.
    slid: float
    # Inverse of the information of prior and feet.
    covariance: Symmetric = (0.0,) * 6


class StancePose(NamedTuple):
    """A pose of a body on its feet; positions in its level frame, seen from above [m]."""

    support: Support
    # All feet, with their rolling.
    flat: list[Vec2]
    # The centre of mass.
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
    pxx = pxy = pxt = pyy = pyt = ptt = bx = by = bt = 0.0
    if prior is None:
        x, y, turn = least_squares(feet, yaw)
    else:
        turn = turn if yaw is None else yaw
        pxx, pxy, pxt, pyy, pyt, ptt = prior.information
        bx = pxx * x + pxy * y + pxt * turn + prior.force[0]
        by = pxy * x + pyy * y + pyt * turn + prior.force[1]
        bt = pxt * x + pyt * y + ptt * turn
    floor, change = creep * creep, CHANGE * scale
    # Least squares without a prior is the first iteration.
    for _ in range(ITERATIONS if prior else ITERATIONS - 1):
        xx, xy, xt, yy, yt, tt, rx, ry, rt = pxx, pxy, pxt, pyy, pyt, ptt, bx, by, bt
        for dx, dy, jx, jy, load in feet:
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
    slips = [(f.load, f.x + x + turn * f.arm_x, f.y + y + turn * f.arm_y) for f in feet]
    slid = sum([load * hypot(ex, ey) for load, ex, ey in slips])
    return BodyStep(x, y, turn, slid, covariance)


def least_squares(feet: Sequence[FootMotion], yaw: float | None = None) -> Triple:
    """Return x, y and yaw of the body by load-weighted least squares of the slip."""
    n = sx = sy = sjx = sjy = jj = jd = 0.0
    for dx, dy, jx, jy, load in feet:
        n, sx, sy = n + load, sx + load * dx, sy + load * dy
        sjx, sjy = sjx + load * jx, sjy + load * jy
        jj, jd = jj + load * (jx * jx + jy * jy), jd + load * (jx * dx + jy * dy)
    if yaw is None:
        yaw = (sjx * sx + sjy * sy - n * jd) / (n * jj * (1.0 + NO_YAW) - sjx * sjx - sjy * sjy)
    return -(sx + yaw * sjx) / n, -(sy + yaw * sjy) / n, yaw


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
