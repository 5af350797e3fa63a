"""The forces, against the physics engine MuJoCo: its inverse dynamics, and its motion."""

import math
from typing import Any

from klann_ros.dynamics import Dynamics, rods
from klann_ros.dynamics.mjcf import Hung, mjcf, tree
from klann_ros.dynamics.motion import Motion, motion
from klann_ros.kinematics import (
    linkage_poses,
    LinkageLeg,
    LinkagePose,
    shipped_linkage,
    shipped_linkages,
)
import mujoco
import numpy as np
import pytest

RATE, CHANGE = 2.0, 3.0


def weighed(name: str) -> Dynamics:
    """Return a linkage of rods; what slides without one weighs as much as 0.1 m of them."""
    linkage = shipped_linkage(name)
    masses = rods(linkage, 1.0, foot_mass=0.2)
    for j, body in enumerate(masses.bodies):
        if body.mass == 0.0:
            masses = masses.with_mass(j, body._replace(mass=0.1, inertia=1e-4))
    return Dynamics(linkage, masses)


class Tree:
    """The engine's joints, by a linkage's poses."""

    def __init__(self, dynamics: Dynamics, alpha: float) -> None:
        self.linkage, self.leg = dynamics.linkage, LinkageLeg(dynamics.linkage)
        self.model = mujoco.MjModel.from_xml_string(mjcf(dynamics, alpha))
        self.data = mujoco.MjData(self.model)
        self.hung, self.start = tree(dynamics)[0], self.leg.closed_form(alpha)

    def place(self, hung: Hung) -> int:
        name = 'crank' if hung.body == 0 else self.linkage.joint_names[hung.body]
        return int(self.model.joint(name).qposadr[0])

    def position(self, hung: Hung, pose: LinkagePose) -> float:
        if self.linkage.structure.bodies[hung.body].slides:
            return pose.joints[hung.body]
        first = self.turned(hung.body, self.start) if hung.body == 0 else 0.0
        return self._relative(hung, pose) - self._relative(hung, self.start) + first

    def rates(self, hung: Hung, moving: Motion) -> tuple[float, float]:
        """Return the first and the second derivative of a joint by the crank angle."""
        j, parent = hung.body, hung.parent
        if self.linkage.structure.bodies[j].slides:
            pose = self.leg.closed_form(float(moving.alphas[0]))
            return (
                self.leg.velocity(pose, 1.0).joints[j],
                self.leg.acceleration(pose, 1.0, 0.0).joints[j],
            )
        first, second = (
            t[j, 0] - (t[parent, 0] if parent >= 0 else 0.0)
            for t in (moving.turning_1, moving.turning_2)
        )
        return float(first), float(second)

    def turned(self, j: int, pose: LinkagePose) -> float:
        frame = self.linkage.structure.frames[j] if j >= 0 else -1
        return 0.0 if frame < 0 else self.linkage.structure.senses[frame] * pose.joints[frame]

    def _relative(self, hung: Hung, pose: LinkagePose) -> float:
        return self.turned(hung.body, pose) - self.turned(hung.parent, pose)


@pytest.mark.parametrize('name', shipped_linkages())
def test_the_crank_torque_is_that_of_its_inverse_dynamics(name: str) -> None:
    """The motion is prescribed exactly; the engine knows the tree, and we what closes it."""
    dynamics = weighed(name)
    (start, end), *_ = LinkageLeg(dynamics.linkage).reachable_arcs()
    engine = Tree(dynamics, start + 0.3 * (end - start))
    engine.model.opt.disableflags = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
    alphas = np.linspace(start + 0.05 * (end - start), end - 0.05 * (end - start), 12)
    expected, found, astray = dynamics.crank_torque(alphas, RATE, CHANGE), [], 0.0
    for alpha in alphas.tolist():
        moving, pose = motion(dynamics.linkage, alpha), engine.leg.closed_form(alpha)
        slopes = np.zeros(engine.model.nv)
        for hung in engine.hung:
            k, (first, second) = engine.place(hung), engine.rates(hung, moving)
            engine.data.qpos[k], slopes[k] = engine.position(hung, pose), first
            engine.data.qvel[k] = first * RATE
            engine.data.qacc[k] = first * CHANGE + second * RATE**2
        mujoco.mj_inverse(engine.model, engine.data)
        # Virtual work of the tree's joints, all moved by the crank.
        found.append(float(engine.data.qfrc_inverse @ slopes))
        astray = max(astray, _astray(engine, pose))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())
    assert astray <= 1e-12


def _astray(engine: Tree, pose: LinkagePose) -> float:
    places = zip(engine.linkage.structure.points, pose.points, strict=True)
    sites = ((engine.data.site(name.lower()).xpos, at) for name, at in places)
    return max(max(abs(site[0] - at[0]), abs(site[2] - at[1])) for site, at in sites)


@pytest.mark.parametrize('rate', [2.0, 2 * math.pi])
@pytest.mark.parametrize('name', ['klann', 'stephenson', 'strider', 'slider_crank'])
def test_a_servo_that_turns_it_feels_the_torque(name: str, rate: float) -> None:
    dynamics = weighed(name)
    engine = Tree(dynamics, 0.0)
    model, data, linkage = engine.model, engine.data, dynamics.linkage
    moving = motion(linkage, 0.0)
    for hung in engine.hung:
        data.qvel[engine.place(hung)] = rate * engine.rates(hung, moving)[0]
    data.ctrl[0] = rate * linkage.structure.senses[0]
    alphas, feet, torques = _turned(model, data, linkage.structure.foot.lower(), rate)
    alphas *= linkage.structure.senses[0]
    apart = np.abs(feet - linkage_poses(linkage, alphas).h).max()
    assert apart <= 20e-6
    expected = dynamics.crank_torque(alphas, rate) * linkage.structure.senses[0]
    error = np.sqrt(((torques - expected) ** 2).mean() / (expected**2).mean())
    assert error <= 0.005


def _turned(model: Any, data: Any, foot: str, rate: float) -> tuple[Any, Any, Any]:
    """Return crank angles, feet and torques of the servo over a turn."""
    rows = []
    steps = int(2 * math.pi / rate / model.opt.timestep)
    for step in range(steps):
        mujoco.mj_step(model, data)
        # Its first steps settle.
        if step % 25 == 24 and step > 0.02 * steps:
            mujoco.mj_forward(model, data)
            at = data.site(foot).xpos
            rows.append((data.joint('crank').qpos[0], at[0], at[2], data.actuator_force[0]))
    table = np.array(rows)
    return table[:, 0], table[:, 1:3], table[:, 3]
