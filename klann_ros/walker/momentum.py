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

A slope pulls as well, by g sin(slope), and v t is ahead by that. Where an accelerometer feels what
the velocity changes by, that is believed instead, and friction corrects it by a small part T:

    T mu g  for  mu g,  and  (1 - T) felt + T g sin(slope)  for  g sin(slope):

where both are true, it is the measured one.
"""

from collections.abc import Sequence
from math import exp, hypot
from typing import NamedTuple

from klann_ros.dynamics import GRAVITY

from .slip import BodyStep, Flat, InertiaPrior, low_pass, Standing, step, turned
from .support import Point

# Default friction coefficient, which is unknown: between wet tile and rubber on concrete.
FRICTION = 0.6
# Stiction speed: a foot that holds creeps by less than this [m/s].
STICTION_SPEED = 0.004
# Averaging time of the acceleration that tips the body [s].
ACCEL_FILTER_TIME = 0.05
# Where it is felt what the velocity changes by, friction corrects it by this part of itself: as
# little as brings it home from what an accelerometer is wrong by, a tenth of a m/s^2.
FRICTION_WEIGHT = 0.05
# After start-up the velocity comes from the feet alone for this time [s].
STARTUP_TIME = 0.2
# Averaging time of the innovation [s].
CORRECTING = 1.0
# After a longer step the velocity is unknown [s].
MAX_STEP_TIME = 0.1


class ImuIncrement(NamedTuple):
    """
    The IMU's measurement of a step.

    Attributes
    ----------
    yaw : float or None
        By how much it turns [rad].
    pull : (float, float)
        What a slope would accelerate it by [m/s^2].
    push : (float, float) or None
        What the velocity of base_link changes by [m/s].

    """

    yaw: float | None = None
    pull: Flat = (0.0, 0.0)
    push: Flat | None = None


class Momentum:
    """
    The speed of a body, and what friction does to it.

    Parameters
    ----------
    gyration : float
        Its radius of gyration about the vertical [m].

    Attributes
    ----------
    corrected : (float, float)
        Mean innovation of the accelerometer [m/s^2].

    """

    def __init__(self, gyration: float) -> None:
        self._gyration = gyration
        self.stop()

    @property
    def strain(self) -> float:
        """Return the normalised innovation, from 0 to 1."""
        return hypot(*self.corrected) / (FRICTION_WEIGHT * FRICTION * GRAVITY)

    def stop(self) -> None:
        """Let it stand."""
        # Of the centre of mass, in the level frame of base_link.
        self._velocity = self._acceleration = (0.0, 0.0)
        self._turning = 0.0
        # Of base_link, where it is felt what changes it.
        self._base: Flat = (0.0, 0.0)
        self._going = 0.0
        self.relax()

    def relax(self) -> None:
        """Forget what friction corrected."""
        self.corrected: Flat = (0.0, 0.0)

    def step(
        self,
        before: Standing,
        after: Standing,
        height: float,
        seconds: float,
        measured: ImuIncrement,
    ) -> BodyStep:
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
        measured : ImuIncrement
            The measurements.

        """
        if seconds > MAX_STEP_TIME:
            self.stop()
        seconds = min(seconds, MAX_STEP_TIME)
        self._going += seconds
        if self._going < STARTUP_TIME:
            measured = measured._replace(push=None)
        feet = after.rest.triple
        half = (self._turning * seconds if measured.yaw is None else measured.yaw) / 2.0
        velocity = turned(self._velocity, -half)
        tipping = turned(self._acceleration, -half)
        over = [c - height / GRAVITY * a for c, a in zip(after.centre, tipping, strict=True)]
        inertia = self._inertia_prior(before, after, seconds, measured, half)
        found = step(
            [before.flat[i] for i in feet],
            [after.flat[i] for i in feet],
            shares([after.flat[i] for i in feet], over),
            measured.yaw,
            inertia,
        )
        if measured.push is not None:
            (x, y), new = inertia.way, 1.0 - exp(-seconds / CORRECTING)
            by = (found.x - x) / seconds**2, (found.y - y) / seconds**2
            self.corrected = low_pass(self.corrected, by, new)
        (px, py), (qx, qy) = before.centre, after.centre
        gone = (
            (found.x + qx - px - found.yaw * (py + qy) / 2.0) / seconds,
            (found.y + qy - py + found.yaw * (px + qx) / 2.0) / seconds,
        )
        by = (gone[0] - velocity[0]) / seconds, (gone[1] - velocity[1]) / seconds
        mean = low_pass(tipping, by, 1.0 - exp(-seconds / ACCEL_FILTER_TIME))
        half = found.yaw / 2.0
        self._velocity = turned(gone, -half)
        self._acceleration = turned(mean, -half)
        self._base = turned((found.x / seconds, found.y / seconds), -half)
        self._turning = found.yaw / seconds
        return found

    def _inertia_prior(
        self,
        before: Standing,
        after: Standing,
        seconds: float,
        measured: ImuIncrement,
        half: float,
    ) -> InertiaPrior:
        """Return what it does that friction does not hold, of half a turn in the middle [rad]."""
        if measured.push is None:
            trust, points = 1.0, (before.centre, after.centre)
            x, y = turned(self._velocity, -half)
        else:
            # Where base_link is, that is where it is felt.
            trust, points = FRICTION_WEIGHT, ((0.0, 0.0), (0.0, 0.0))
            x, y = turned(self._base, -half)
            x, y = x + (1.0 - trust) * measured.push[0], y + (1.0 - trust) * measured.push[1]
        x, y = x + trust * measured.pull[0] * seconds, y + trust * measured.pull[1] * seconds
        return InertiaPrior(
            *points,
            (x * seconds, y * seconds),
            self._turning * seconds,
            self._gyration,
            1.0 / (trust * FRICTION * GRAVITY * seconds**2),
            STICTION_SPEED * seconds,
        )


def shares(feet: Sequence[Flat], over: Point) -> list[float]:
    """Return the load shares of three feet for a point; a foot in tension carries none."""
    (ax, ay), (bx, by), (cx, cy) = ((x - over[0], y - over[1]) for x, y in feet)
    loads = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    sense = 1.0 if sum(loads) > 0.0 else -1.0
    found = [max(sense * load, 0.0) for load in loads]
    return [load / sum(found) for load in found]
