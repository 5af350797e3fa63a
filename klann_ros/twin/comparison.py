"""The agreement of a leg in the physics engine with its kinematics and its forces."""

from collections.abc import Sequence
from math import pi
from typing import Any, NamedTuple

from klann_ros.dynamics import Reactions
from klann_ros.kinematics import FIXED, GROUND, linkage_poses, LinkageLeg
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import Robot, RobotLeg
import numpy as np

from .mjcf import is_near_change, robot_mjcf, start_angle
from .tree import Closing, joint_rates, spanning_tree, TreeBody
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

    `foot` is the greatest distance between the feet, at the engine's own crank angles [m].
    `torque` is the rms difference of the crank's torque from that of an even turn, by the latter's
    rms, and `torque_as_moved` from that of the motion that the engine's crank made. `reactions` is
    the greatest rms difference of a joint's force in this motion, by its rms; `ripple` the largest
    relative error of the crank's speed.
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
    if end - start < 2.0 * pi:
        start, end = start + ARC_MARGIN * (end - start), end - ARC_MARGIN * (end - start)
    else:
        start = float(leg.crank_angles(start_angle(robot.legs)))
        end = start + 2.0 * pi
    way = leg.direction
    first = way * ((start if way * rate > 0.0 else end) - leg.phase)
    mujoco = engine()
    text = robot_mjcf(robot, time_step=time_step, crank=first)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    bodies, closing = spanning_tree(leg.linkage)
    rates = joint_rates(leg.linkage, bodies, float(leg.crank_angles(first)))
    for j, name in enumerate(leg.linkage.joint_names[1:], 1):
        data.joint(name).qvel = way * rate * rates[j]
    crank, foot = data.joint(leg.crank_joint), data.site(leg.linkage.structure.foot.lower())
    crank.qvel = data.ctrl[0] = rate
    steps = int((end - start) / abs(rate) / model.opt.timestep)
    interval = max(1, steps // samples)
    readings = []
    forces = []
    for step in range(1, steps + 1):
        mujoco.mj_step(model, data)
        is_settled = step > SETTLING_TURNS * steps
        if step % interval == 0 and is_settled and not is_near_change(leg, crank.qpos[0]):
            mujoco.mj_forward(model, data)
            mujoco.mj_rnePostConstraint(model, data)
            effort = float(data.actuator_force[0])
            readings.append((crank.qpos[0], crank.qvel[0], crank.qacc[0], effort, *foot.xpos))
            forces.append(_pins(leg, data, bodies, closing))
    joint, speeds, changes, torques, *place = np.array(readings).T
    alphas, dynamics = leg.crank_angles(joint), robot.dynamics(leg)
    feet = leg.mount.transform(linkage_poses(leg.linkage, alphas).h)
    even = way * dynamics.crank_torque(alphas, rate)
    rotor = float(model.joint(leg.crank_joint).armature[0])
    torque_as_moved = way * dynamics.crank_torque(alphas, speeds, way * changes) + rotor * changes
    return Agreement(
        foot=float(np.linalg.norm(np.array(place).T - feet, axis=1).max()),
        torque=_rms(torques - even) / _rms(even),
        torque_as_moved=_rms(torques - torque_as_moved) / _rms(torque_as_moved),
        reactions=_apart(forces, dynamics.reactions(alphas, speeds, way * changes)),
        ripple=float(np.abs(speeds / rate - 1.0).max()),
    )


def _pins(
    leg: RobotLeg, data: Any, bodies: Sequence[TreeBody], closing: Sequence[Closing]
) -> dict[tuple[str, str], complex]:
    """Return the force of each pin on each of its bodies, in the leg's plane [N]."""
    structure = leg.linkage.structure
    names = {FIXED: GROUND, **dict(enumerate(structure.angles))}
    pins: dict[tuple[str, str], complex] = {}

    def pull(point: str, body: int, partner: int, force: FloatArray) -> None:
        flat = leg.mount.rotation.T @ force
        for index, sign in ((body, 1.0), (partner, -1.0)):
            pin = point, names[index]
            pins[pin] = pins.get(pin, 0j) + sign * complex(flat[0], flat[1])

    for j, parent, point in bodies:
        if not structure.bodies[j].slides:
            pull(point, j, parent, data.cfrc_int[data.body(names[j]).id][3:])
    equality = data.efc_type == engine().mjtConstraint.mjCNSTR_EQUALITY
    for number, (point, first, j) in enumerate(closing):
        pull(point, j, first, data.efc_force[equality & (data.efc_id == number)])
    return pins


def _apart(forces: Sequence[dict[tuple[str, str], complex]], computed: Reactions) -> float:
    """Return the greatest rms difference of a pin's force, by the rms of it."""
    sizes = {pin: _rms(np.abs(force)) for pin, force in computed.pins.items()}
    min_scale = MIN_FORCE_SCALE * max(sizes.values())
    differences = []
    for pin, force in computed.pins.items():
        measured = np.array([sample[pin] for sample in forces])
        differences.append(_rms(np.abs(measured - force)) / max(sizes[pin], min_scale))
    return max(differences)


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
