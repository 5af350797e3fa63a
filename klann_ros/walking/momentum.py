"""
How a body with inertia moves over the ground on feet that slide.

A walker with a crank on each side often stands on two feet that carry the same and are dragged
against each other: left and right each have half of the weight. Friction alone then leaves open
which of them holds, and the body keeps the speed that it has. Over a time t its centre of mass c
moves by that step d which minimises

    sum l_i |s_i(d)| + |d + c' - c - v t|^2 / (2 mu g t^2),

s_i being what foot i slides: an implicit step of Newton's law with dry friction (J. J. Moreau,
Unilateral contact and dry friction in finite freedom dynamics, 1988). What friction accelerates
tips it as well, for it acts on the ground, and the centre of mass is at a height h: the feet carry
it as if that were above c - h a / g. In MuJoCo this takes most of what odometry was wrong by.
"""

from collections.abc import Sequence
from math import cos, exp, sin

from .slip import Coasting, Flat, Standing, Step, step
from .support import Point

GRAVITY = 9.80665
# Of feet on the floor, which nobody knows: between a wet tile and rubber on concrete.
FRICTION = 0.6
# Where a foot is said to hold it trembles, and creeps by less than this [m/s].
CREEP = 0.004
# The acceleration that tips it is the mean over so long [s].
TIPPING = 0.05
# Over a longer step nobody knows what became of a speed [s].
LONGEST = 0.1


class Momentum:
    """
    The speed of a body, and what friction does to it.

    Parameters
    ----------
    gyration : float
        Its radius of gyration about the vertical [m].

    """

    def __init__(self, gyration: float) -> None:
        self._gyration = gyration
        self.stop()

    def stop(self) -> None:
        """Let it stand."""
        # Of the centre of mass, in the level frame of base_link.
        self._velocity = self._acceleration = (0.0, 0.0)
        self._turning = 0.0

    def step(
        self, before: Standing, after: Standing, height: float, seconds: float, yaw: float | None
    ) -> Step:
        """
        Return how the body moves from pose to pose.

        Parameters
        ----------
        before, after : Standing
            The poses, with their centres of mass.
        height : float
            Of the centre of mass above the ground [m].
        seconds : float
            The time between them.
        yaw : float, optional
            By how much it turns, where that is known [rad].

        """
        if seconds > LONGEST:
            self.stop()
        seconds = min(seconds, LONGEST)
        feet = after.rest.triple
        half = (self._turning * seconds if yaw is None else yaw) / 2.0
        velocity = turned(self._velocity, -half)
        tipping = turned(self._acceleration, -half)
        over = [c - height / GRAVITY * a for c, a in zip(after.centre, tipping, strict=True)]
        coasting = Coasting(
            before.centre,
            after.centre,
            (velocity[0] * seconds, velocity[1] * seconds),
            self._turning * seconds,
            self._gyration,
            1.0 / (FRICTION * GRAVITY * seconds**2),
            CREEP * seconds,
        )
        found = step(
            [before.flat[i] for i in feet],
            [after.flat[i] for i in feet],
            shares([after.flat[i] for i in feet], over),
            yaw,
            coasting,
        )
        (px, py), (qx, qy) = before.centre, after.centre
        gone = (
            (found.x + qx - px - found.yaw * (py + qy) / 2.0) / seconds,
            (found.y + qy - py + found.yaw * (px + qx) / 2.0) / seconds,
        )
        new = 1.0 - exp(-seconds / TIPPING)
        mean = [
            old + new * ((one - other) / seconds - old)
            for old, one, other in zip(tipping, gone, velocity, strict=True)
        ]
        half = found.yaw / 2.0
        self._velocity = turned(gone, -half)
        self._acceleration = turned((mean[0], mean[1]), -half)
        self._turning = found.yaw / seconds
        return found


def turned(vector: Flat, angle: float) -> Flat:
    """Return a vector, turned counter-clockwise."""
    (x, y), c, s = vector, cos(angle), sin(angle)
    return c * x - s * y, s * x + c * y


def shares(feet: Sequence[Flat], over: Point) -> list[float]:
    """Return what three feet carry of what is above a point; one that would pull carries none."""
    (ax, ay), (bx, by), (cx, cy) = ((x - over[0], y - over[1]) for x, y in feet)
    loads = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    sense = 1.0 if sum(loads) > 0.0 else -1.0
    found = [max(sense * load, 0.0) for load in loads]
    return [load / sum(found) for load in found]
