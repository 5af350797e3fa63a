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
from math import sqrt
from typing import NamedTuple

from .support import levelled, Point, Support

Flat = tuple[float, float]
# It is done where the step changes by less than this part of it, or after so many times.
ITERATIONS, CHANGE = 12, 1e-5
# Feet that slide by less than this part of the longest step hold.
HOLDS = 1e-3


class Step(NamedTuple):
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

    """

    rest: Support
    flat: list[Flat]


def standing(
    feet: Sequence[Point],
    rolled: Sequence[Sequence[float]],
    rest: Support,
    attitude: tuple[float, float] | None = None,
) -> Standing:
    """Return a pose; `attitude` is roll and pitch where they are measured [rad]."""
    level = levelled(feet, *(attitude or (rest.roll, rest.pitch)))
    flat = [(x + rx, y + ry) for (x, y), (rx, ry) in zip(level, rolled, strict=True)]
    return Standing(rest, flat)


def moved(
    before: Standing, after: Standing, yaw: float | None = None, *, hops: bool = False
) -> Step:
    """Return how a body moves from pose to pose; `yaw` and `hops` as for `step`."""
    loads = dict.fromkeys((*before.rest.feet, *after.rest.feet), 0.0)
    for rest in (before.rest, after.rest):
        for foot, load in zip(rest.feet, rest.loads, strict=True):
            loads[foot] += load / 2.0
    return step(
        [before.flat[i] for i in loads],
        [after.flat[i] for i in loads],
        [*loads.values()],
        yaw,
        hops=hops,
    )


def step(
    before: Sequence[Flat],
    after: Sequence[Flat],
    loads: Sequence[float],
    yaw: float | None = None,
    *,
    hops: bool = False,
) -> Step:
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
    hops : bool
        Whether the feet hop, so that now this one and now that one carries all: then the body goes
        with their mean.

    """
    # To first order in the yaw, about the middle of both.
    feet = [
        (qx - px, qy - py, -(py + qy) / 2.0, (px + qx) / 2.0, load)
        for (px, py), (qx, qy), load in zip(before, after, loads, strict=True)
        if load > 0.0
    ]
    scale = max((abs(dx) + abs(dy) for dx, dy, *_ in feet), default=0.0)
    if scale == 0.0 and not yaw:
        return Step(0.0, 0.0, 0.0, 0.0)
    least = (HOLDS * (scale + abs(yaw or 0.0))) ** 2
    x = y = turn = 0.0
    weights = [load for *_, load in feet]
    for _ in range(1 if hops else ITERATIONS):
        last = x, y, turn
        x, y, turn = _balanced(feet, weights, yaw)
        # A turn moves feet by about as much as they are metres away.
        if max(abs(x - last[0]), abs(y - last[1]), abs(turn - last[2])) < CHANGE * scale:
            break
        weights = [
            load / sqrt((dx + x + turn * jx) ** 2 + (dy + y + turn * jy) ** 2 + least)
            for dx, dy, jx, jy, load in feet
        ]
    slid = sum(
        load * sqrt((dx + x + turn * jx) ** 2 + (dy + y + turn * jy) ** 2)
        for dx, dy, jx, jy, load in feet
    )
    return Step(x, y, turn, slid)


def _balanced(
    feet: Sequence[tuple[float, ...]], weights: Sequence[float], yaw: float | None
) -> tuple[float, float, float]:
    """Return the weighted least squares of d + psi J g = -(g' - g)."""
    whole = sx = sy = sjx = sjy = 0.0
    for (dx, dy, jx, jy, _), w in zip(feet, weights, strict=True):
        whole += w
        sx -= w * dx
        sy -= w * dy
        sjx += w * jx
        sjy += w * jy
    sx, sy, sjx, sjy = sx / whole, sy / whole, sjx / whole, sjy / whole
    if yaw is None:
        above = below = 0.0
        for (dx, dy, jx, jy, _), w in zip(feet, weights, strict=True):
            cx, cy = jx - sjx, jy - sjy
            above -= w * (cx * (dx + sx) + cy * (dy + sy))
            below += w * (cx * cx + cy * cy)
        yaw = above / below if below else 0.0
    return sx - yaw * sjx, sy - yaw * sjy, yaw
