"""What a crank takes over its turn, at any constant speed: of one leg, or of several."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from klann_ros.dynamics import Dynamics, TurnOfForces
from klann_ros.kinematics import Stance
from klann_ros.kinematics.angles import TURN
from klann_ros.robot import RobotLeg
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# From a step of the load to the samples on both sides of it [rad].
EDGE_OFFSET = 1e-9
# An extreme within this part of a curve's range from its greatest or least value is refined, by
# this number of samples between its neighbours.
EXTREME_PART, EXTREME_SAMPLES = 0.02, 15
Forces = dict[str, tuple[float, float]]


class CrankLoad(NamedTuple):
    """
    The torque T = G + S w^2 at the joint of a crank that turns at a constant speed w.

    Attributes
    ----------
    angles : numpy.ndarray, shape (k,)
        Of the joint over a turn, ascending, in [0, 2 pi) [rad].
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
    """Return the crank angles with the foot on the ground, shape (k,) [rad]."""
    since: NDArray[np.bool_] = (alphas - stance.start) % TURN <= stance.end - stance.start
    return since


def foot_load(linkage_foot: str, stance: Stance, alphas: Array, load: float) -> Forces:
    """Return the force of the ground on a foot that stands: up, along y of the leg's plane [N]."""
    up = np.where(on_the_ground(stance, alphas), load, 0.0)
    # Annotated as one number, and taken as an array as well.
    return {linkage_foot: (0.0, up)}  # type: ignore[dict-item]


def turn_angles(samples: int, edges: Iterable[float] = ()) -> Array:
    """
    Return the sampled angles of a turn: even from 0 on, and both sides of edges, ascending [rad].

    Edges are where the load steps: a curve may have its peak there.
    """
    even = TURN * np.arange(samples) / samples
    sides = [(edge + side) % TURN for edge in edges for side in (-EDGE_OFFSET, EDGE_OFFSET)]
    return np.unique([*even, *sides])


def with_extremes(angles: Array, curves: Iterable[Array]) -> Array:
    """Return angles of a turn [rad] with more of them beside the extremes of curves."""
    padded = np.concatenate([[angles[-1] - TURN], angles, [angles[0] + TURN]])
    found = set()
    for curve in curves:
        span = np.ptp(curve)
        for values in (curve, -curve):
            is_peak = (values >= np.roll(values, 1)) & (values >= np.roll(values, -1))
            near_top = values > values.max() - EXTREME_PART * span
            found.update(np.flatnonzero(is_peak & near_top).tolist())
    added = [np.linspace(padded[k], padded[k + 2], EXTREME_SAMPLES + 2)[1:-1] for k in found]
    return np.unique(np.concatenate([angles, *added]) % TURN)


class Turned(NamedTuple):
    """A leg that a joint turns, with its masses, its stance, and whether it turns fully."""

    leg: RobotLeg
    dynamics: Dynamics
    stance: Stance | None
    is_full: bool

    @property
    def edges(self) -> tuple[float, ...]:
        """Return the joint angles of the start and the end of the stance [rad]."""
        if self.stance is None:
            return ()
        alphas = self.stance.start, self.stance.end
        return tuple(self.leg.direction * (alpha - self.leg.phase) for alpha in alphas)


def crank_load(turned: Sequence[Turned], load: float, angles: Array) -> CrankLoad:
    """
    Return what a joint takes that turns some legs, which all turn fully.

    By virtual work a leg with alpha = direction * angle + phase adds direction times its torque.

    Parameters
    ----------
    turned : sequence of Turned
        The legs.
    load : float
        On each foot that stands [N].
    angles : numpy.ndarray, shape (k,)
        Of the joint [rad].

    """
    still, squared = np.zeros(angles.size), np.zeros(angles.size)
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
