"""What was computed of a leg, and what the engine makes of it as it turns the leg, agree."""

from functools import cache
import math

from klann_ros.dynamics import rods
from klann_ros.dynamics.motion import body_motion, BodyMotion
from klann_ros.kinematics import LinkageLeg, LinkagePose, shipped_linkage, shipped_linkages
from klann_ros.robot import Robot, robot_of, RobotLeg
from klann_ros.twin import Agreement, agreement, robot_mjcf
from klann_ros.twin.tree import joint_rates, spanning_tree, TreeBody
import mujoco
import numpy as np
import pytest


@cache
def turned(name: str) -> Agreement:
    """Return how far they agree at a turn a second; `benchmarks/twin.py` does so of all legs."""
    return agreement(robot_of(name), 2 * math.pi, samples=100)


# A leg, many loops, slides, springs.
@pytest.mark.parametrize('name', ['sem104', 'jansen', 'quick_return', 'andrews'])
def test_foot_torque_and_reactions_are_those_of_the_engine(name: str) -> None:
    found = turned(name)
    assert found.foot <= 3e-6
    assert found.torque_as_moved <= 2e-4
    assert found.reactions <= 2e-4


@pytest.mark.parametrize('name', ['sem104', 'jansen', 'quick_return'])
def test_the_servo_of_the_model_turns_the_leg_evenly_and_feels_its_torque(name: str) -> None:
    assert turned(name).ripple <= 2e-4
    assert turned(name).torque <= 5e-3


RATE, CHANGE = 2.0, 3.0


def weighed(name: str) -> Robot:
    """Return a linkage of rods; what slides without one weighs as much as 0.1 m of them."""
    linkage = shipped_linkage(name)
    masses = rods(linkage, 1.0, foot_mass=0.2)
    for j, body in enumerate(masses.bodies):
        if body.mass == 0.0:
            masses = masses.with_mass(j, body._replace(mass=0.1, inertia=1e-4))
    return Robot(name, (RobotLeg('', linkage, masses=masses),))


class Tree:
    """The engine's joints, by a linkage's poses."""

    def __init__(self, robot: Robot, alpha: float) -> None:
        (leg,) = robot.legs
        self.linkage, self.leg = leg.linkage, LinkageLeg(leg.linkage)
        self.model = mujoco.MjModel.from_xml_string(robot_mjcf(robot, crank=alpha))
        self.data = mujoco.MjData(self.model)
        self.tree_body, self.start = spanning_tree(leg.linkage)[0], self.leg.closed_form(alpha)
        self.rotor = float(self.model.dof_armature.max())

    def place(self, tree_body: TreeBody) -> int:
        name = 'crank' if tree_body.body == 0 else self.linkage.joint_names[tree_body.body]
        return int(self.model.joint(name).qposadr[0])

    def position(self, tree_body: TreeBody, pose: LinkagePose) -> float:
        if tree_body.body == 0 or self.linkage.structure.bodies[tree_body.body].slides:
            return pose.joints[tree_body.body]
        return self._relative(tree_body, pose) - self._relative(tree_body, self.start)

    def change(self, tree_body: TreeBody, moving: BodyMotion) -> float:
        """Return the second derivative of a joint by the crank angle."""
        j, parent = tree_body.body, tree_body.parent
        if self.linkage.structure.bodies[j].slides:
            pose = self.leg.closed_form(float(moving.alphas[0]))
            return self.leg.acceleration(pose, 1.0, 0.0).joints[j]
        before = moving.rotation_2[parent, 0] if parent >= 0 else 0.0
        return float(moving.rotation_2[j, 0] - before)

    def turned(self, j: int, pose: LinkagePose) -> float:
        frame = self.linkage.structure.frames[j] if j >= 0 else -1
        return 0.0 if frame < 0 else self.linkage.structure.senses[frame] * pose.joints[frame]

    def _relative(self, tree_body: TreeBody, pose: LinkagePose) -> float:
        return self.turned(tree_body.body, pose) - self.turned(tree_body.parent, pose)


@pytest.mark.parametrize('name', shipped_linkages())
def test_the_crank_torque_is_that_of_its_inverse_dynamics(name: str) -> None:
    """The motion is prescribed exactly; the engine knows the tree, and we what closes it."""
    robot = weighed(name)
    dynamics = robot.dynamics(robot.legs[0])
    (start, end), *_ = LinkageLeg(dynamics.linkage).reachable_arcs()
    engine = Tree(robot, start + 0.3 * (end - start))
    engine.model.opt.disableflags = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
    alphas = np.linspace(start + 0.05 * (end - start), end - 0.05 * (end - start), 12)
    expected, found, astray = dynamics.crank_torque(alphas, RATE, CHANGE), [], 0.0
    for alpha in alphas.tolist():
        moving, pose = body_motion(dynamics.linkage, alpha), engine.leg.closed_form(alpha)
        rates, slopes = (
            joint_rates(engine.linkage, engine.tree_body, alpha),
            np.zeros(engine.model.nv),
        )
        for tree_body in engine.tree_body:
            k, first = engine.place(tree_body), rates[tree_body.body]
            engine.data.qpos[k], slopes[k] = engine.position(tree_body, pose), first
            engine.data.qvel[k] = first * RATE
            engine.data.qacc[k] = first * CHANGE + engine.change(tree_body, moving) * RATE**2
        mujoco.mj_inverse(engine.model, engine.data)
        # Virtual work of the tree's joints, all moved by the crank.
        found.append(float(engine.data.qfrc_inverse @ slopes) - engine.rotor * CHANGE)
        astray = max(astray, _astray(engine, pose))
    # The rotor of what drives the crank is large, and taken off again.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    assert astray <= 1e-12


def _astray(engine: Tree, pose: LinkagePose) -> float:
    places = zip(engine.linkage.structure.points, pose.points, strict=True)
    sites = ((engine.data.site(name.lower()).xpos, at) for name, at in places)
    return max(max(abs(site[0] - at[0]), abs(site[2] - at[1])) for site, at in sites)
