"""What a crank takes over its turn, at any constant speed: of one leg, or of several."""

from collections.abc import Sequence
from typing import NamedTuple

from klann_ros.dynamics import Dynamics, TurnOfForces
from klann_ros.kinematics import Stance
from klann_ros.kinematics.angles import TURN
from klann_ros.robot import RobotLeg
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Forces = dict[str, tuple[float, float]]


class CrankLoad(NamedTuple):
    """
    The torque T = G + S w^2 at the joint of a crank that turns at a constant speed w.

    Attributes
    ----------
    angles : numpy.ndarray, shape (k,)
        Of the joint, evenly over a turn from 0 on [rad].
    still : numpy.ndarray, shape (k,)
        G: by weight, springs and the load on the foot [N m].
    per_speed_squared : numpy.ndarray, shape (k,)
        S: by inertia [N m s^2].

    """

    angles: Array
    still: Array
    per_speed_squared: Array

    def torque(self, speed: float) -> Array:
        """Return the torque at a speed [rad/s], shape (k,) [N m]."""
        return np.asarray(self.still + self.per_speed_squared * speed**2)

    def turn(self, speed: float) -> TurnOfForces:
        """Return what a turn at a speed [rad/s] takes."""
        return TurnOfForces(self.angles, float(speed), self.torque(speed))


def on_the_ground(stance: Stance, alphas: Array) -> NDArray[np.bool_]:
    """Return at which crank angles [rad] the foot is on the ground, shape (k,)."""
    since: NDArray[np.bool_] = (alphas - stance.start) % TURN <= stance.end - stance.start
    return since


def foot_load(linkage_foot: str, stance: Stance, alphas: Array, load: float) -> Forces:
    """Return the force of the ground on a foot that stands: up, along y of the leg's plane [N]."""
    up = np.where(on_the_ground(stance, alphas), load, 0.0)
    # Annotated as one number, and taken as an array as well.
    return {linkage_foot: (0.0, up)}  # type: ignore[dict-item]


class Turned(NamedTuple):
    """A leg that a joint turns, with its masses, its stance, and whether it turns fully."""

    leg: RobotLeg
    dynamics: Dynamics
    stance: Stance | None
    is_full: bool


def crank_load(turned: Sequence[Turned], load: float, samples: int) -> CrankLoad:
    """
    Return what a joint takes that turns some legs, which all turn fully.

    By virtual work a leg with alpha = direction * angle + phase adds direction times its torque.

    Parameters
    ----------
    turned : sequence of Turned
        The legs.
    load : float
        On each foot that stands [N].
    samples : int
        Of the turn.

    """
    angles = TURN * np.arange(samples) / samples
    still, squared = np.zeros(samples), np.zeros(samples)
    for leg, dynamics, stance, _ in turned:
        alphas = leg.crank_angles(angles)
        forces = (
            foot_load(leg.linkage.structure.foot, stance, alphas, load)
            if load and stance
            else None
        )
        at_rest = dynamics.crank_torque(alphas, 0.0, 0.0, forces)
        still += leg.direction * at_rest
        squared += leg.direction * (dynamics.crank_torque(alphas, 1.0, 0.0, forces) - at_rest)
    return CrankLoad(angles, still, squared)
