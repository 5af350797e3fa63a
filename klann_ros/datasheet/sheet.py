"""A data sheet: the figures of a robot's legs and cranks before they are built, in SI units."""

from dataclasses import dataclass
from typing import Any, NamedTuple

from klann_ros.dynamics import GRAVITY, Masses, turn_mean, TurnOfForces
from klann_ros.gait import GaitFigures
from klann_ros.kinematics import FootPath, Linkage, Margin, Stance
from klann_ros.kinematics.angles import Arc
from klann_ros.kinematics.arrays import FloatArray, with_short_repr
import numpy as np

from .motor import Motor, MotorVerdict


class SheetError(ValueError):
    """A data sheet that cannot be computed for a robot; the text says why."""


class Extreme(NamedTuple):
    """A value, and its crank angle [rad]."""

    value: float
    at: float


class BarFigures(NamedTuple):
    """
    A dimension of a linkage: its name, such as 'l_bc', its value, and the unit 'm' or 'rad'.

    `margin` is the range in which the crank turns fully, all others unchanged; None if unknown.
    """

    name: str
    unit: str
    value: float
    margin: Margin | None


@with_short_repr
class Transmission(NamedTuple):
    """
    The transmission angle of a dyad over all crank angles.

    `name` has the two links, or is 'coupled loops'; `angle`, shape (k,), is in [0, pi], at the
    leg's crank angles; `from_in_line` is the least min(mu, pi - mu), the distance from links in
    line [rad].
    """

    name: str
    angle: FloatArray
    least: Extreme
    greatest: Extreme
    from_in_line: Extreme


@with_short_repr
class JointForce(NamedTuple):
    """
    The force of a joint, a pin's point or a sliding body, over the turn.

    `force`, shape (k,), is its magnitude at the leg's crank angles, on the body with the largest
    one, and `greatest` the largest [N], infinite if it grows without bound towards a change point;
    `moment` is the largest on a sliding body [N m].
    """

    name: str
    force: FloatArray
    greatest: Extreme
    moment: Extreme | None = None


@with_short_repr
class LegForces(NamedTuple):
    """
    The forces of a leg at the sheet's speed, without or with the load on its foot.

    `torque`, shape (k,), acts at its crank, at the leg's crank angles [N m]; `joints` are in the
    order of the linkage's points.
    """

    torque: FloatArray
    joints: tuple[JointForce, ...]


class CostsOfTransport(NamedTuple):
    """P / (m g v) by the mean positive, and by the mean absolute power of the cranks."""

    positive_power: float
    absolute_power: float


@with_short_repr
@dataclass(frozen=True, eq=False)
class LegSheet:
    """A leg, or several equal ones."""

    names: tuple[str, ...]  #: '' for the only, unnamed one
    linkage: Linkage
    has_foot: bool  #: whether its published point is a foot, whose stance is shown
    bars: tuple[BarFigures, ...]  #: its dimensions
    no_margins: str  #: the reason for missing margins, or ''
    turns_fully: bool
    arcs: tuple[Arc, ...]  #: the reachable crank angles [rad]
    path: FootPath | None  #: of its foot
    stance: Stance | None  #: of its foot
    no_stance: str  #: the reason for a missing stance, or ''
    alphas: FloatArray  #: crank angles of all samples over the turn, shape (k,) [rad]
    points: FloatArray  #: the linkage's points there, shape (k, p, 2) [m]
    transmission: tuple[Transmission, ...]  #: one for each dyad
    masses: Masses | None  #: of one of them; None without any in the file
    empty: LegForces | None  #: without the load on the foot; None without masses
    loaded: LegForces | None  #: with the load in stance, which is all without masses

    @property
    def shown_stance(self) -> Stance | None:
        """Return the stance of a foot; None for a point that is no foot."""
        return self.stance if self.has_foot else None

    @property
    def title(self) -> str:
        """Return the names of the legs in a line."""
        return ', '.join(self.names)


@dataclass(frozen=True, eq=False)
class CrankSheet:
    """
    The joint of a crank, which turns one leg or several.

    `is_own` tells whether its angle is the crank angle of its only leg: no phase, the same
    direction. `empty` and `loaded` are forces over the angles of the joint, without and with the
    load on each foot in stance; `motor` whether the motor can turn it, with the load if there is
    one.
    """

    joint: str
    legs: tuple[str, ...]
    is_own: bool
    empty: TurnOfForces | None
    loaded: TurnOfForces | None
    motor: MotorVerdict | None

    @property
    def hardest(self) -> TurnOfForces | None:
        """Return the case by which the motor is judged."""
        return self.loaded or self.empty


def cases(sheet: LegSheet | CrankSheet) -> list[tuple[str, Any]]:
    """Return the forces of a leg or a crank, without and with the load, as far as known."""
    named_forces = ('empty', sheet.empty), ('loaded', sheet.loaded)
    return [(name, forces) for name, forces in named_forces if forces]


@with_short_repr
@dataclass(frozen=True, eq=False)
class DataSheet:
    """The data sheet of a robot; made by `data_sheet`."""

    name: str
    source: str  #: the robot's file
    speed: float  #: rate of its cranks, negative for clockwise [rad/s]
    load: float  #: ground reaction of each foot in stance [N]
    legs: tuple[LegSheet, ...]  #: each distinct leg once
    cranks: tuple[CrankSheet, ...]  #: the joints that turn them
    motor: Motor | None  #: of each of these joints
    no_forces: str  #: the reason for missing forces, or ''
    walk: GaitFigures | None  #: the gait of a walker over a turn
    no_walk: str  #: the reason why a walker does not walk, or ''
    body_mass: float  #: of a walker [kg]

    @property
    def costs_of_transport(self) -> CostsOfTransport | None:
        """
        Return the costs of transport.

        Each crank is for itself: a motor does not give another one what it brakes. None for no
        walker, without masses or a load on the feet, and where it does not move.
        """
        turns = [crank.loaded for crank in self.cranks if crank.loaded]
        leg_masses = [leg.masses.total * len(leg.names) for leg in self.legs if leg.masses]
        is_weighed = len(leg_masses) == len(self.legs)
        mass = self.body_mass + sum(leg_masses)
        if self.walk is None or not (is_weighed and mass * self.walk.speed and turns):
            return None
        power = mass * GRAVITY * abs(self.walk.speed * self.speed)
        positive = sum(turn_mean(turn.alphas, np.maximum(turn.power, 0.0)) for turn in turns)
        absolute = sum(turn_mean(turn.alphas, np.abs(turn.power)) for turn in turns)
        return CostsOfTransport(positive / power, absolute / power)

    @property
    def is_single(self) -> bool:
        """Return whether there is a single leg, whose crank angle is its joint's angle."""
        return len(self.cranks) == 1 and self.cranks[0].is_own

    @property
    def motor_turns(self) -> bool:
        """Return whether the motor can turn every crank; True without a motor."""
        verdicts = [crank.motor for crank in self.cranks]
        return self.motor is None or all(verdict and verdict.turns for verdict in verdicts)
