"""
On which feet a body rests, and how it lies on them.

A body that may tilt rests on a facet of its feet's convex hull, three feet a, b, c with no foot
below their plane, if its centre of mass is above them: the point of the plane below it, along the
plane's normal, is

    sum l_i f_i,   sum l_i = 1,   l_i >= 0,

and the l_i are the parts of the weight that these feet carry. There may be more than one such
facet, as there is for a chair that can be tilted back: the body stays on the one that it is on
while that holds, and then tips to the one on which its centre of mass is the lowest; but it does
not lie down on its side, which may be lower still. Where more feet touch the plane, all are taken
as equally stiff springs (`spring_loads`).

One pose after the other is computed, in plain numbers: at six feet arrays would cost a hundred
times what they hold.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import combinations
from math import acos, asin, atan2, cos, hypot, inf, sin, sqrt
from typing import NamedTuple

from .feet import Placed

Point = Sequence[float]
Triple = tuple[int, int, int]
# Triangles smaller than this part of their size squared are lines.
FLAT = 1e-9
# A centre that is so little outside, as a part of the whole, is on an edge; and a foot that is so
# little below a plane is not [m].
ROUNDING, BELOW = 1e-12, 1e-12
# A body that is tilted further lies on its side: the cosine of 30 deg.
STANDING = 0.866
# Feet up to this height above the plane carry load as well [m].
TOUCHING = 1e-6
# A foot sinks by this under the whole weight: its leg and the floor give way [m].
SINK = 5e-4
SPRING_ITERATIONS = 8


class Support(NamedTuple):
    """
    How a body rests on its feet.

    Attributes
    ----------
    feet : tuple of int
        On which, three or more.
    loads : tuple of float
        The part of the weight that each of them carries.
    triple : (int, int, int)
        Three of them that are around its centre of mass.
    normal : (float, float, float)
        Upwards, in base_link.
    height : float
        Of base_link's origin above the ground [m].
    margin : float
        The static margin: the distance of the centre of mass, seen from above, from the nearest
        edge of the feet that it rests on [m].

    """

    feet: tuple[int, ...]
    loads: tuple[float, ...]
    triple: Triple
    normal: tuple[float, float, float]
    height: float
    margin: float

    @property
    def pitch(self) -> float:
        """Return the pitch, positive with the nose down, as in REP 103 [rad]."""
        return asin(-self.normal[0])

    @property
    def roll(self) -> float:
        """Return the roll, positive with the left side up [rad]."""
        return atan2(self.normal[1], self.normal[2])

    @property
    def tilt(self) -> float:
        """Return the angle between base_link's z axis and the vertical [rad]."""
        return acos(min(1.0, self.normal[2]))


def gravity_aligned(
    points: Iterable[Point], roll: float, pitch: float
) -> list[tuple[float, float]]:
    """Return points or vectors of base_link, turned by roll and pitch, seen from above."""
    b, a, d, c = sin(roll), cos(roll), sin(pitch), cos(pitch)
    return [(c * x + d * (b * y + a * z), a * y - b * z) for x, y, z in points]


def supports(placed: Placed) -> Iterator[Support | None]:
    """Yield how a body rests in poses one after the other; `placed` has one leading axis."""
    last = None
    for feet, centre in zip(placed.feet.tolist(), placed.centre.tolist(), strict=True):
        found = support(feet, centre, last and last.triple)
        last = found or last
        yield found


def support(feet: Sequence[Point], centre: Point, guess: Triple | None = None) -> Support | None:
    """
    Return how a body rests; None where its centre is not above the polygon of its feet.

    Parameters
    ----------
    feet : sequence of (float, float, float)
        Where its feet are in base_link [m].
    centre : (float, float, float)
        Its centre of mass [m].
    guess : (int, int, int), optional
        The feet that it rested on before; it does so still where it can.

    """
    if guess is not None:
        found = _on(feet, centre, guess)
        if found and _is_lowest(feet, found):
            return _shared(feet, centre, found)
    rests = [_on(feet, centre, triple) for triple in _triples(len(feet))]
    stable = [found for found in rests if found and _is_lowest(feet, found)]
    found = min(
        stable,
        key=lambda each: (-min(each.normal[2], STANDING), each.height + _dot(each.normal, centre)),
        default=None,
    )
    return found and _shared(feet, centre, found)


@cache
def _triples(count: int) -> tuple[Triple, ...]:
    return tuple((a, b, c) for a, b, c in combinations(range(count), 3))


def _loads(
    feet: Sequence[Point], centre: Point, triple: Triple
) -> tuple[float, float, float] | None:
    """Return the barycentric coordinates of a centre in a triangle; None where it is outside."""
    x, y = centre[0], centre[1]
    (ax, ay, _), (bx, by, _), (cx, cy, _) = (feet[i] for i in triple)
    ax, ay, bx, by, cx, cy = ax - x, ay - y, bx - x, by - y, cx - x, cy - y
    a, b, c = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    whole = a + b + c
    size = (bx - ax) ** 2 + (by - ay) ** 2 + (cx - ax) ** 2 + (cy - ay) ** 2
    if abs(whole) <= FLAT * size:
        return None
    a, b, c = a / whole, b / whole, c / whole
    return (a, b, c) if min(a, b, c) >= -ROUNDING else None


def _on(feet: Sequence[Point], centre: Point, triple: Triple) -> Support | None:
    """Return how it rests on three feet; None where its centre is not above them."""
    corners = [feet[i] for i in triple]
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    size = sqrt(nx * nx + ny * ny + nz * nz)
    if abs(nz) <= FLAT * (ux * ux + uy * uy + vx * vx + vy * vy):
        return None
    if nz < 0.0:
        size = -size
    normal = (nx / size, ny / size, nz / size)
    height = -_dot(normal, corners[0])
    loads = _loads(feet, _below(centre, normal, height), triple)
    if loads is None:
        return None
    a, b, c = corners
    margin = min(
        _from_edge(a, b, centre, normal),
        _from_edge(b, c, centre, normal),
        _from_edge(c, a, centre, normal),
    )
    return Support(triple, loads, triple, normal, height, margin)


def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _below(centre: Point, normal: Point, height: float) -> Point:
    """Return the point of the ground below a centre, which is where its weight acts."""
    above = height + _dot(normal, centre)
    return (
        centre[0] - above * normal[0],
        centre[1] - above * normal[1],
        centre[2] - above * normal[2],
    )


def _shared(feet: Sequence[Point], centre: Point, found: Support) -> Support:
    """Return a support on all feet that touch its plane."""
    x, y, z = found.normal
    top = TOUCHING - found.height
    touch = [i for i, f in enumerate(feet) if f[0] * x + f[1] * y + f[2] * z <= top]
    if len(touch) == 3:
        return found
    margin = max(found.margin, _from_hull([feet[i] for i in touch], centre, found.normal))
    ground = _below(centre, found.normal, found.height)
    flat = [(feet[i][0], feet[i][1]) for i in touch]
    loads = spring_loads(flat, [0.0] * len(touch), (ground[0], ground[1]))
    carrying = [(i, load) for i, load in zip(touch, loads, strict=True) if load > 0.0]
    if len(carrying) > 3:
        feet_on, loads_on = zip(*carrying, strict=True)
        return found._replace(feet=feet_on, loads=loads_on, margin=margin)
    return found._replace(margin=margin)


def spring_loads(
    flat: Sequence[tuple[float, float]], heights: Sequence[float], over: tuple[float, float]
) -> list[float]:
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
    for _ in range(SPRING_ITERATIONS):
        xx = xy = yy = sx = sy = sh = hx = hy = 0.0
        for i in active:
            x, y, h = at[i]
            xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
            sx, sy, sh, hx, hy = sx + x, sy + y, sh + h, hx + h * x, hy + h * y
        n = len(active)
        p, q, r = xx * yy - xy * xy, xy * sy - sx * yy, sx * xy - xx * sy
        whole = n * p + sx * q + sy * r
        if abs(whole) <= FLAT * (xx + yy) ** 2:
            break
        s, t, u = n * yy - sy * sy, sx * sy - n * xy, n * xx - sx * sx
        sh += SINK
        d = (p * sh + q * hx + r * hy) / whole
        a = (q * sh + s * hx + t * hy) / whole
        b = (r * sh + t * hx + u * hy) / whole
        loads = [max(0.0, (d + a * x + b * y - h) / SINK) for x, y, h in at]
        carrying = [i for i, load in enumerate(loads) if load > 0.0]
        if carrying == active:
            break
        active = carrying
    total = sum(loads)
    return [load / total for load in loads] if total else loads


def _from_hull(feet: Sequence[Point], centre: Point, normal: Point) -> float:
    """Return the distance of a centre, which is inside, from the edges around feet [m]."""
    nearest = inf
    for a, b in combinations(feet, 2):
        sides = [(b[0] - a[0]) * (f[1] - a[1]) - (b[1] - a[1]) * (f[0] - a[0]) for f in feet]
        if min(sides) >= -ROUNDING or max(sides) <= ROUNDING:
            nearest = min(nearest, _from_edge(a, b, centre, normal))
    return nearest


def _from_edge(a: Point, b: Point, centre: Point, normal: Point) -> float:
    """Return the distance of a centre from the upright plane through two feet [m]."""
    ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    ox = ey * normal[2] - ez * normal[1]
    oy = ez * normal[0] - ex * normal[2]
    oz = ex * normal[1] - ey * normal[0]
    away = ox * (centre[0] - a[0]) + oy * (centre[1] - a[1]) + oz * (centre[2] - a[2])
    return abs(away) / (sqrt(ox * ox + oy * oy + oz * oz) or 1.0)


def _is_lowest(feet: Sequence[Point], found: Support) -> bool:
    x, y, z = found.normal
    return min([fx * x + fy * y + fz * z for fx, fy, fz in feet]) >= -found.height - BELOW


def to_polygon(feet: Sequence[Point], centre: Point) -> float:
    """Return how far a centre is outside of the polygon of all feet, seen from above [m]."""
    return min(_to_segment(a, b, centre) for a, b in combinations(feet, 2))


def _to_segment(a: Point, b: Point, centre: Point) -> float:
    ex, ey = b[0] - a[0], b[1] - a[1]
    x, y = centre[0] - a[0], centre[1] - a[1]
    t = max(0.0, min(1.0, (x * ex + y * ey) / ((ex * ex + ey * ey) or 1.0)))
    return hypot(x - t * ex, y - t * ey)
