"""
How a body moves over the ground on feet that cannot all stand still.

Legs with cranks of their own, and legs whose feet are not equally fast all over their stance, pull
the body with them to where friction lets them: each standing foot resists with mu l_i against the
way it slides. Slow as walking is, the forces balance, and the motion (d, psi) of the body is that
which wastes the least,

    min  sum l_i |g_i' - g_i + d + psi J g_i|,

g_i being the feet seen from above, before and after, and J a quarter turn. Mu cancels. A foot that
carries more than half the weight holds; the others slide. (Quasi-static sliding with dry friction:
S. Goyal, A. Ruina, J. Papadopoulos, Wear 143 (1991).) The sum is that of a geometric median, and
so it is solved: by least squares whose weights are 1 / how far each foot slides (E. Weiszfeld,
1937).
"""

from collections.abc import Sequence
from math import cos, sin, sqrt
from typing import NamedTuple

from .support import gravity_aligned, Point, Support

Flat = tuple[float, float]
# How a point moves, by how much more for each rad, and its weight.
Entry = tuple[float, float, float, float, float]
NOTHING = (0.0,) * 7
# Relative round-off threshold.
ROUNDOFF = 1e-12
# Relative tolerance of the iteration, and its limit.
ITERATIONS, CHANGE = 12, 1e-5
# Feet that slide by less than this part of the longest step hold.
HOLDS = 1e-3


class BodyStep(NamedTuple):
    """
    How a body has moved over the ground, in base_link's directions before.

    Attributes
    ----------
    x, y : float
        [m].
    yaw : float
        [rad].
    slid : float
        How far its feet slid, each by the weight that it carries [m].

    """

    x: float
    y: float
    yaw: float
    slid: float


class Standing(NamedTuple):
    """
    A pose of a body on its feet.

    Attributes
    ----------
    rest : Support
        On which feet.
    flat : list of (float, float)
        All feet in the level frame of base_link, with what they have rolled, seen from above [m].
    centre : (float, float)
        The centre of mass, likewise.

    """

    rest: Support
    flat: list[Flat]
    centre: Flat = (0.0, 0.0)


class InertiaPrior(NamedTuple):
    """
    What a body does that nothing holds.

    Attributes
    ----------
    before, after : (float, float)
        Where its centre of mass is in the level frame of base_link [m].
    way : (float, float)
        How far its centre of mass goes [m].
    turn : float
        By how much it turns [rad].
    gyration : float
        Its radius of gyration about the vertical [m].
    weight : float
        How much it would rather do so, against friction: 1 / (mu g t^2) over a time t [1/m].
    creep : float
        A foot that slides less than this is held by less than its friction [m].

    """

    before: Flat
    after: Flat
    way: Flat
    turn: float
    gyration: float
    weight: float
    creep: float


def standing(
    feet: Sequence[Point],
    rolled: Sequence[Sequence[float]],
    rest: Support,
    attitude: tuple[float, float] | None = None,
    centre: Point = (0.0, 0.0, 0.0),
) -> Standing:
    """Return a pose; `attitude` is roll and pitch where they are measured [rad]."""
    *level, middle = gravity_aligned([*feet, centre], *(attitude or (rest.roll, rest.pitch)))
    flat = [(x + rx, y + ry) for (x, y), (rx, ry) in zip(level, rolled, strict=True)]
    return Standing(rest, flat, middle)


def moved(before: Standing, after: Standing) -> BodyStep:
    """Return how a body moves from pose to pose."""
    loads = dict.fromkeys((*before.rest.feet, *after.rest.feet), 0.0)
    for rest in (before.rest, after.rest):
        for foot, load in zip(rest.feet, rest.loads, strict=True):
            loads[foot] += load / 2.0
    return step([before.flat[i] for i in loads], [after.flat[i] for i in loads], [*loads.values()])


def step(
    before: Sequence[Flat],
    after: Sequence[Flat],
    loads: Sequence[float],
    yaw: float | None = None,
    inertia: InertiaPrior | None = None,
) -> BodyStep:
    """
    Return how a body moves while its feet move in it.

    Parameters
    ----------
    before, after : sequence of (float, float)
        The standing feet in the level frame of base_link, before and after [m].
    loads : sequence of float
        What each carries.
    yaw : float, optional
        By how much it turns, where that is known [rad].
    inertia : InertiaPrior, optional
        What it does where nothing holds it; without, it is so slow that friction is all.

    """
    feet = [_entry(p, q, load) for p, q, load in zip(before, after, loads, strict=True) if load]
    scale = max([abs(dx) + abs(dy) for dx, dy, *_ in feet], default=0.0)
    if inertia is None:
        if scale == 0.0:
            return BodyStep(0.0, 0.0, 0.0, 0.0)
        x, y, turn = _balance(feet, (0.0, 0.0, 0.0), None, NOTHING, yaw)
        least = (HOLDS * scale) ** 2
        free = NOTHING
    else:
        dx, dy, jx, jy, weight = _entry(inertia.before, inertia.after, inertia.weight)
        dx, dy = dx - inertia.way[0], dy - inertia.way[1]
        turn = inertia.turn if yaw is None else yaw
        x, y = -dx - turn * jx, -dy - turn * jy
        least = inertia.creep**2
        scale += abs(x) + abs(y)
        # What coasts is drawn to its way by a spring, whose weight is the same everywhere.
        spin = weight * inertia.gyration**2
        free = (
            weight,
            weight * dx,
            weight * dy,
            weight * jx,
            weight * jy,
            weight * (jx * jx + jy * jy) + spin,
            weight * (jx * dx + jy * dy) - spin * inertia.turn,
        )
    # A turn moves feet by about as much as they are metres away.
    change = CHANGE * scale
    for _ in range(ITERATIONS):
        last_x, last_y, last_turn = x, y, turn
        x, y, turn = _balance(feet, (x, y, turn), least, free, yaw)
        if (
            abs(x - last_x) < change
            and abs(y - last_y) < change
            and abs(turn - last_turn) < change
        ):
            break
    slid = sum(
        [
            load * sqrt((dx + x + turn * jx) ** 2 + (dy + y + turn * jy) ** 2)
            for dx, dy, jx, jy, load in feet
        ]
    )
    return BodyStep(x, y, turn, slid)


def turned(vector: Flat, angle: float) -> Flat:
    """Return a vector, turned counter-clockwise."""
    (x, y), c, s = vector, cos(angle), sin(angle)
    return c * x - s * y, s * x + c * y


def low_pass(old: Flat, new: Flat, share: float) -> Flat:
    """Return a vector by a share of the way nearer to another: a mean over time, step by step."""
    (x, y), (to_x, to_y) = old, new
    return x + share * (to_x - x), y + share * (to_y - y)


def _entry(before: Flat, after: Flat, weight: float) -> Entry:
    """Return what a point moves by, and by how much more for each rad, to first order."""
    (px, py), (qx, qy) = before, after
    return qx - px, qy - py, -(py + qy) / 2.0, (px + qx) / 2.0, weight


def _balance(
    feet: Sequence[Entry],
    at: tuple[float, float, float],
    least: float | None,
    free: tuple[float, ...],
    yaw: float | None,
) -> tuple[float, float, float]:
    """
    Return the weighted least squares of d + psi J g = -(g' - g).

    The weights are loads by how far the feet slide in the step `at`, and the loads alone without
    `least`. `free` are the sums over all else: of weights w, w d, w j, w j^2 and w j d.
    """
    x, y, turn = at
    whole, sx, sy, sjx, sjy, sjj, sjd = free
    for dx, dy, jx, jy, load in feet:
        if least is None:
            w = load
        else:
            ex, ey = dx + x + turn * jx, dy + y + turn * jy
            w = load / sqrt(ex * ex + ey * ey + least)
        whole += w
        sx += w * dx
        sy += w * dy
        sjx += w * jx
        sjy += w * jy
        if yaw is None:
            sjj += w * (jx * jx + jy * jy)
            sjd += w * (jx * dx + jy * dy)
    if yaw is None:
        below = sjj - (sjx * sjx + sjy * sjy) / whole
        # Coincident points define no rotation.
        is_wide = below > ROUNDOFF * sjj
        yaw = ((sjx * sx + sjy * sy) / whole - sjd) / below if is_wide else 0.0
    return -(sx + yaw * sjx) / whole, -(sy + yaw * sjy) / whole, yaw
