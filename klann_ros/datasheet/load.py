"""The torque of a crank over its turn at any constant speed, for one leg or several."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from klann_ros.dynamics import Dynamics, TurnOfForces
from klann_ros.kinematics import Stance
from klann_ros.kinematics.angles import enclosing_turns, TURN
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import RobotLeg
import numpy as np

# From a step of the load to the samples on both sides of it [rad].
EDGE_OFFSET = 1e-9
# An extreme within this part of a curve's range from its greatest or least value is refined, by
# this number of samples between its neighbours.
EXTREME_PART = 0.02
EXTREME_SAMPLES = 15
# Digits of a sampled angle: finer than EDGE_OFFSET [rad].
ANGLE_DIGITS = 12
FootForces = dict[str, tuple[float, float]]


class LoadedLeg(NamedTuple):
    """A leg on a joint; the load acts on its foot in stance."""

    leg: RobotLeg
    dynamics: Dynamics
    stance: Stance | None


class CrankLoad(NamedTuple):
    """The torque T = G + S w^2 at the joint of a crank at a constant speed w, shapes (k,)."""

    angles: FloatArray  #: of the joint over a turn, or several, from 0, ascending [rad]
    static_torque: FloatArray  #: G: of weight, springs and the load on the foot [N m]
    per_speed_squared: FloatArray  #: S: of inertia [N m s^2]

    def torque(self, speed: float) -> FloatArray:
        """Return the torque at a speed [rad/s], shape (k,) [N m]."""
        return np.asarray(self.static_torque + self.per_speed_squared * speed**2)

    def turn(self, speed: float) -> TurnOfForces:
        """Return the forces of a turn at a speed [rad/s]."""
        return TurnOfForces(self.angles, float(speed), self.torque(speed))


def foot_load(
    foot: str, stance: Stance | None, alphas: FloatArray, load: float
) -> FootForces | None:
    """Return the ground reaction of a foot in stance, up along y of the leg's plane [N]."""
    if not load or stance is None:
        return None
    reaction = np.where(stance.holds(alphas), load, 0.0)
    # Annotated as one number, but an array is accepted as well.
    return {foot: (0.0, reaction)}  # type: ignore[dict-item]


def turn_angles(samples: int, edges: Iterable[float] = (), turns: int = 1) -> FloatArray:
    """
    Return sampled angles of turns, ascending [rad]: uniform from 0, and both sides of edges.

    The load steps at an edge, so a curve may have its peak there.
    """
    span = TURN * turns
    uniform = TURN * np.arange(samples * turns) / samples
    edges = np.array([*edges])
    return np.unique(
        np.concatenate([uniform, (edges - EDGE_OFFSET) % span, (edges + EDGE_OFFSET) % span])
    )


def with_extremes(angles: FloatArray, curves: Iterable[FloatArray]) -> FloatArray:
    """Return angles of whole turns [rad] with more of them beside the extremes of curves."""
    turn = TURN * enclosing_turns(angles)
    padded = np.concatenate([[angles[-1] - turn], angles, [angles[0] + turn]])
    peaks = set()
    for curve in curves:
        curve_range = np.ptp(curve)
        for upright in (curve, -curve):
            is_peak = (upright >= np.roll(upright, 1)) & (upright >= np.roll(upright, -1))
            is_near_top = upright > upright.max() - EXTREME_PART * curve_range
            peaks.update(np.flatnonzero(is_peak & is_near_top).tolist())
    refined = [np.linspace(padded[k], padded[k + 2], EXTREME_SAMPLES + 2)[1:-1] for k in peaks]
    # Samples of neighbouring peaks coincide but for rounding.
    return np.unique(np.round(np.concatenate([angles, *refined]), ANGLE_DIGITS) % turn)


def crank_load(legs: Sequence[LoadedLeg], load: float, angles: FloatArray) -> CrankLoad:
    """
    Return the load of a joint at some of its angles [rad], its legs all turning fully.

    By virtual work a leg with alpha = direction * angle + phase adds direction times its torque.
    `load` is the ground reaction of each foot in stance [N].
    """
    static_torque = np.zeros(angles.size)
    per_speed_squared = np.zeros(angles.size)
    for leg, dynamics, stance in legs:
        alphas = leg.crank_angles(angles)
        forces = foot_load(leg.linkage.structure.foot, stance, alphas, load)
        at_rest = dynamics.crank_torque(alphas, 0.0, 0.0, forces)
        at_unit_rate = dynamics.crank_torque(alphas, 1.0, 0.0, forces)
        static_torque += leg.direction * at_rest
        per_speed_squared += leg.direction * (at_unit_rate - at_rest)
    return CrankLoad(angles, static_torque, per_speed_squared)
