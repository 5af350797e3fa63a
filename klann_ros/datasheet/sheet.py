"""A data sheet: the figures of a robot's legs and cranks before they are built, in SI units."""

from dataclasses import dataclass
from typing import NamedTuple

from klann_ros.dynamics import TurnOfForces
from klann_ros.kinematics import FootPath, Linkage, Margin, Stance
from klann_ros.kinematics.angles import Arc
from klann_ros.walker import GaitFigures
import numpy as np
from numpy.typing import NDArray

from .motor import Motor, MotorVerdict

Array = NDArray[np.float64]


class SheetError(ValueError):
    """A question that a robot does not answer; the text says why."""


class Extreme(NamedTuple):
    """A value, and its crank angle [rad]."""

    value: float
    at: float


@dataclass(frozen=True, eq=False)
class BarFigures:
    """
    A number of a linkage.

    Attributes
    ----------
    name, unit : str
        Such as 'l_bc', in 'm' or 'rad'.
    value : float
        [m or rad].
    margin : Margin, optional
        Within which the crank turns fully, all others unchanged; None where it is not known.

    """

    name: str
    unit: str
    value: float
    margin: Margin | None


@dataclass(frozen=True, eq=False)
class Transmission:
    """
    The transmission angle of a dyad over all crank angles.

    Attributes
    ----------
    name : str
        Of the two links, or of coupled loops.
    angles : numpy.ndarray, shape (k,)
        At the leg's crank angles, in [0, pi] [rad].
    least, greatest : Extreme
        Of the angles [rad].
    worst : Extreme
        The least min(mu, pi - mu): how near to in line the links come [rad].

    """

    name: str
    angles: Array
    least: Extreme
    greatest: Extreme
    worst: Extreme


@dataclass(frozen=True, eq=False)
class JointForce:
    """
    What a joint carries over the turn.

    Attributes
    ----------
    name : str
        A pin's point, or the body that slides.
    force : numpy.ndarray, shape (k,)
        Its magnitude at the leg's crank angles, on the body with the largest one [N].
    greatest : Extreme
        Of the force [N].
    moment : Extreme, optional
        The largest magnitude of the moment on what slides [N m].

    """

    name: str
    force: Array
    greatest: Extreme
    moment: Extreme | None = None


@dataclass(frozen=True, eq=False)
class LegForces:
    """
    What a leg takes at the speed of the sheet, without or with the load on its foot.

    Attributes
    ----------
    torque : numpy.ndarray, shape (k,)
        At its crank, at the leg's crank angles [N m].
    joints : tuple of JointForce
        The joints, in the order of the linkage's points.

    """

    torque: Array
    joints: tuple[JointForce, ...]


@dataclass(frozen=True)
class BodyMassFigures:
    """The mass of a body [kg], its centre in the body [m], its inertia about it [kg m^2]."""

    name: str
    mass: float
    centre: tuple[float, float]
    inertia: float


@dataclass(frozen=True, eq=False)
class LegSheet:
    """
    A leg, or several that are alike.

    Attributes
    ----------
    names : tuple of str
        What they are called in the robot; '' for the only, unnamed one.
    linkage : Linkage
        Its bars.
    bars : tuple of BarFigures
        Its numbers.
    no_margins : str
        Why there are no margins; '' where there are.
    turns_fully : bool
        Whether its crank does.
    arcs : tuple of (float, float)
        Where the crank can be [rad].
    path : FootPath, optional
        Of its foot.
    stance : Stance, optional
        While the foot is on the ground.
    no_stance : str
        Why there is none; '' where there is one.
    alphas : numpy.ndarray, shape (k,)
        Crank angles of all samples over the turn [rad].
    points : numpy.ndarray, shape (k, p, 2)
        The linkage's points there [m].
    transmission : tuple of Transmission
        One for every dyad.
    masses : tuple of BodyMassFigures
        Empty where the file tells none.
    empty, loaded : LegForces, optional
        Without and with the load on the standing foot. Without masses there is no `empty`, and
        `loaded` is what the load alone takes.

    """

    names: tuple[str, ...]
    linkage: Linkage
    bars: tuple[BarFigures, ...]
    no_margins: str
    turns_fully: bool
    arcs: tuple[Arc, ...]
    path: FootPath | None
    stance: Stance | None
    no_stance: str
    alphas: Array
    points: Array
    transmission: tuple[Transmission, ...]
    masses: tuple[BodyMassFigures, ...]
    empty: LegForces | None
    loaded: LegForces | None

    @property
    def mass(self) -> float:
        """Return the mass of one of them [kg]."""
        return sum(body.mass for body in self.masses)

    @property
    def cases(self) -> tuple[LegForces, ...]:
        """Return the figures without and with the load."""
        return tuple(of for of in (self.empty, self.loaded) if of is not None)

    @property
    def title(self) -> str:
        """Return the figure of a name."""
        return ', '.join(self.names)


@dataclass(frozen=True, eq=False)
class CrankSheet:
    """
    What turns legs: the joint of a crank.

    Attributes
    ----------
    joint : str
        Its name.
    legs : tuple of str
        The legs that it turns.
    is_own : bool
        Whether its angle is the crank angle of the only leg that it turns: no phase, no other
        direction.
    empty, loaded : TurnOfForces, optional
        Over the angles of the joint, without and with the load on each standing foot.
    motor : MotorVerdict, optional
        Whether the motor can turn it; loaded, if there is a load.

    """

    joint: str
    legs: tuple[str, ...]
    is_own: bool
    empty: TurnOfForces | None
    loaded: TurnOfForces | None
    motor: MotorVerdict | None

    @property
    def hardest(self) -> TurnOfForces | None:
        """Return what the motor is judged by."""
        return self.loaded or self.empty


@dataclass(frozen=True, eq=False)
class DataSheet:
    """
    The data sheet of a robot; made by `data_sheet`.

    Attributes
    ----------
    name, source : str
        Of the robot.
    speed : float
        Of its cranks, negative for clockwise [rad/s].
    load : float
        On each foot that stands [N].
    legs : tuple of LegSheet
        Each leg that is different once.
    cranks : tuple of CrankSheet
        The joints that turn them.
    motor : Motor, optional
        The motor of each of them.
    no_forces : str
        Why there are no forces, or why not all; '' where there are.
    walk : GaitFigures, optional
        What a walker does over a turn.
    no_walk : str
        Why it does not walk; '' where it does, and for a single leg.

    """

    name: str
    source: str
    speed: float
    load: float
    legs: tuple[LegSheet, ...]
    cranks: tuple[CrankSheet, ...]
    motor: Motor | None
    no_forces: str
    walk: GaitFigures | None
    no_walk: str

    @property
    def is_single(self) -> bool:
        """Return whether there is but one leg, whose crank angle is that of its joint."""
        return len(self.cranks) == 1 and self.cranks[0].is_own

    @property
    def motor_turns(self) -> bool:
        """Return whether the motor can turn every crank; True where no motor is asked about."""
        verdicts = [crank.motor for crank in self.cranks]
        return self.motor is None or all(each is not None and each.turns for each in verdicts)
