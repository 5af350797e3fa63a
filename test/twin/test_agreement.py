"""What was computed of a leg, and what the engine makes of it as it turns the leg, agree."""

from functools import cache
import math

from klann_ros.dynamics import rods
from klann_ros.dynamics.motion import body_motion
from klann_ros.kinematics import LinkageLeg, LinkagePose, shipped_linkage, shipped_linkages
from klann_ros.robot import Robot, robot_of, RobotLeg
from klann_ros.twin import Agreement, agreement, robot_mjcf
from klann_ros.twin.tree import joint_rates, spanning_tree
import mujoco
import numpy as np
import pytest


@cache
def compared(name: str) -> Agreement:
    """Return how far they agree at a turn a second; `benchmarks/twin.py` does so of all legs."""
    return agreement(robot_of(name), 2 * math.pi, samples=100)


# A leg, many loops, slides, springs.
@pytest.mark.slow
@pytest.mark.parametrize('name', ['sem104', 'jansen', 'quick_return', 'andrews'])
def test_foot_torque_and_reactions_are_those_of_the_engine(name: str) -> None:
    assert compared(name).foot <= 3e-6
    assert compared(name).torque_as_moved <= 2e-4
    assert compared(name).reactions <= 2e-4


@pytest.mark.parametrize('name', ['sem104', 'jansen', 'quick_return'])
def test_the_servo_of_the_model_turns_the_leg_evenly_and_feels_its_torque(name: str) -> None:
    assert compared(name).ripple <= 2e-4
    assert compared(name).torque <= 5e-3


RATE, CHANGE = 2.0, 3.0


def weighed(name: str) -> Robot:
    """Return a linkage of rods; what slides without one weighs as much as 0.1 m of them."""
    linkage = shipped_linkage(name)
    masses = rods(linkage, 1.0, foot_mass=0.2)
    for j, body in enumerate(masses.bodies):
        if body.mass == 0.0:
            masses = masses.with_mass(j, body._replace(mass=0.1, inertia=1e-4))
    return Robot(name, (RobotLeg('', linkage, masses=masses),))


def turned(leg: RobotLeg, pose: LinkagePose) -> list[float]:
    """Return the rotation of each body, and last that of the ground."""
    frames, senses = leg.linkage.structure.frames, leg.linkage.structure.senses
    return [senses[f] * pose.joints[f] if f >= 0 else 0.0 for f in frames] + [0.0]


@pytest.mark.parametrize('name', shipped_linkages())
def test_the_crank_torque_is_that_of_its_inverse_dynamics(name: str) -> None:
    """The motion is prescribed exactly; the engine knows the tree, and we what closes it."""
    robot = weighed(name)
    (leg,) = robot.legs
    linkage = leg.linkage
    solver = LinkageLeg(linkage)
    tree, _ = spanning_tree(linkage)
    (start, end), *_ = solver.reachable_arcs()
    written = start + 0.3 * (end - start)
    model = mujoco.MjModel.from_xml_string(robot_mjcf(robot, crank=written))
    model.opt.disableflags = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
    data = mujoco.MjData(model)
    zero = turned(leg, solver.closed_form(written))
    alphas = np.linspace(start + 0.05 * (end - start), end - 0.05 * (end - start), 12)
    torques = []
    for alpha in alphas.tolist():
        pose = solver.closed_form(alpha)
        rates = joint_rates(linkage, tree, alpha)
        bends = [*body_motion(linkage, alpha).rotation_2[:, 0], 0.0]
        slopes = np.zeros(model.nv)
        now = turned(leg, pose)
        for j, parent, _ in tree:
            position = now[j] - zero[j] - (now[parent] - zero[parent])
            bend = bends[j] - bends[parent]
            if linkage.structure.bodies[j].slides:
                bend = solver.acceleration(pose, 1.0, 0.0).joints[j]
            if j == 0 or linkage.structure.bodies[j].slides:
                position = pose.joints[j]
            k = model.joint(linkage.joint_names[j] if j else 'crank').qposadr[0]
            data.qpos[k] = position
            slopes[k] = rates[j]
            data.qvel[k] = rates[j] * RATE
            data.qacc[k] = rates[j] * CHANGE + bend * RATE**2
        mujoco.mj_inverse(model, data)
        # Virtual work of the tree's joints, all moved by the crank, without its large rotor.
        rotor = float(model.dof_armature.max())
        torques.append(float(data.qfrc_inverse @ slopes) - rotor * CHANGE)
        for point, place in zip(linkage.structure.points, pose.points, strict=True):
            assert data.site(point.lower()).xpos[[0, 2]] == pytest.approx(place, abs=1e-12)
    expected = robot.dynamics(leg).crank_torque(alphas, RATE, CHANGE)
    np.testing.assert_allclose(torques, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
