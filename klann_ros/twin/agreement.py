"""The agreement of a leg in the physics engine with its kinematics and its forces."""

from collections.abc import Sequence
from math import pi
from typing import Any, NamedTuple

from klann_ros.dynamics import Dynamics, Reactions
from klann_ros.kinematics import linkage_poses, LinkageLeg
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.linkage.structure import FIXED, GROUND
from klann_ros.robot import Robot
import numpy as np

from .mjcf import robot_mjcf
from .tree import joint_rates, spanning_tree
from .twin import engine

# The part of a turn in which the servo settles; it is not compared.
SETTLING_TURNS = 0.03
# Scale of the relative error of a small force, as a part of the largest.
MIN_FORCE_SCALE = 1e-2
# The part of an arc at each end that is left out: there the leg comes to a stop.
ARC_MARGIN = 0.25


class Agreement(NamedTuple):
    """
    Differences between a leg in the engine and the computed one.

    Attributes
    ----------
    foot : float
        The greatest distance between the feet, at the engine's own crank angles [m].
    torque : float
        The rms difference of the crank's torque from that of an even turn, by the latter's rms.
    torque_as_moved : float
        The same, from the torque of the motion that the engine's crank made.
    reactions : float
        The greatest rms difference of a joint's force, in the same motion, by the rms of it.
    ripple : float
        Largest relative error of the crank's speed.

    """

    foot: float
    torque: float
    torque_as_moved: float
    reactions: float
    ripple: float


def agreement(
    robot: Robot, rate: float, *, time_step: float = 2e-4, samples: int = 400
) -> Agreement:
    """
    Turn a leg in the engine, and return its agreement with kinematics and forces.

    Parameters
    ----------
    robot : Robot
        One leg, with masses, mounted upright.
    rate : float
        Of its crank's joint [rad/s].
    time_step : float
        Of the engine [s].
    samples : int
        Number of compared poses over a turn, or over the arc.

    Raises
    ------
    NoMujocoError
        The engine is not installed.
    MassError
        The robot has no masses.

    """
    (leg,) = robot.legs
    (start, end), *_ = LinkageLeg(leg.linkage).reachable_arcs()
    is_full = end - start >= 2.0 * pi
    if not is_full:
        start, end = start + ARC_MARGIN * (end - start), end - ARC_MARGIN * (end - start)
    alpha = start if leg.direction * rate > 0.0 else end
    first = leg.direction * (alpha - leg.phase)
    turned = _Turned(robot, first, rate, time_step)
    turned.run((end - start) / abs(rate), samples)
    return turned.agreement(robot.dynamics(leg))


class _Turned:
    """A leg turned by the engine, with the recorded motion and forces."""

    def __init__(self, robot: Robot, crank: float, rate: float, time_step: float) -> None:
        self._mujoco, (leg,) = engine(), robot.legs
        self._leg, self._rate = leg, rate
        text = robot_mjcf(robot, time_step=time_step, crank=crank)
        self._model = self._mujoco.MjModel.from_xml_string(text)
        self._data = self._mujoco.MjData(self._model)
        self._bodies, self._closing = spanning_tree(leg.linkage)
        crank_dof = self._model.joint(leg.crank_joint).dofadr[0]
        rates = joint_rates(leg.linkage, self._bodies, float(leg.crank_angles(crank)))
        for j in range(1, len(self._bodies)):
            dof = self._model.joint(leg.linkage.joint_names[j]).dofadr[0]
            self._data.qvel[dof] = leg.direction * rate * rates[j]
        self._data.qvel[crank_dof] = self._data.ctrl[0] = rate
        self._rotor = float(self._model.dof_armature[crank_dof])
        self._rows: list[tuple[float, ...]] = []
        self._forces: list[dict[tuple[str, str], complex]] = []

    def run(self, duration: float, samples: int) -> None:
        """Turn it, and record."""
        model, data = self._model, self._data
        steps = int(duration / model.opt.timestep)
        every = max(1, steps // samples)
        foot = self._leg.linkage.structure.foot.lower()
        for step in range(1, steps + 1):
            self._mujoco.mj_step(model, data)
            if step % every == 0 and step > SETTLING_TURNS * steps:
                self._mujoco.mj_forward(model, data)
                self._mujoco.mj_rnePostConstraint(model, data)
                crank, place = data.joint(self._leg.crank_joint), data.site(foot).xpos
                self._rows.append(
                    (crank.qpos[0], crank.qvel[0], crank.qacc[0], data.actuator_force[0], *place)
                )
                self._forces.append(self._pins())

    def _pins(self) -> dict[tuple[str, str], complex]:
        """Return the force of each pin on each of its bodies, in the leg's plane [N]."""
        structure, data = self._leg.linkage.structure, self._data
        names = {FIXED: GROUND, **dict(enumerate(structure.angles))}
        pins: dict[tuple[str, str], complex] = {}

        def pull(point: str, on: int, by: int, force: FloatArray) -> None:
            flat = self._leg.mount.rotation.T @ force
            for body, sign in ((on, 1.0), (by, -1.0)):
                own = point, names[body]
                pins[own] = pins.get(own, 0j) + sign * complex(flat[0], flat[1])

        for j, parent, point in self._bodies:
            if not structure.bodies[j].slides:
                pull(point, j, parent, data.cfrc_int[self._model.body(names[j]).id][3:])
        equality = data.efc_type == self._mujoco.mjtConstraint.mjCNSTR_EQUALITY
        for number, (point, first, j) in enumerate(self._closing):
            pull(point, j, first, data.efc_force[equality & (data.efc_id == number)])
        return pins

    def agreement(self, dynamics: Dynamics) -> Agreement:
        """Return the differences from the computed leg."""
        joint, rates, changes, torques, *place = np.array(self._rows).T
        alphas, way = self._leg.crank_angles(joint), self._leg.direction
        feet = self._leg.mount.transform(linkage_poses(self._leg.linkage, alphas).h)
        even = way * dynamics.crank_torque(alphas, self._rate)
        moved = way * dynamics.crank_torque(alphas, rates, way * changes) + self._rotor * changes
        found = dynamics.reactions(alphas, rates, way * changes)
        return Agreement(
            foot=float(np.linalg.norm(np.array(place).T - feet, axis=1).max()),
            torque=_rms(torques - even) / _rms(even),
            torque_as_moved=_rms(torques - moved) / _rms(moved),
            reactions=_apart(self._forces, found),
            ripple=float(np.abs(rates / self._rate - 1.0).max()),
        )


def _apart(forces: Sequence[dict[tuple[str, str], complex]], computed: Reactions) -> float:
    """Return the greatest rms difference of a pin's force, by the rms of it."""
    sizes = {own: _rms(np.abs(force)) for own, force in computed.pins.items()}
    least = MIN_FORCE_SCALE * max(sizes.values())
    return max(
        _rms(np.abs(np.array([each[own] for each in forces]) - force)) / max(sizes[own], least)
        for own, force in computed.pins.items()
    )


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
