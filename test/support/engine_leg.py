"""A linkage of `change_point_linkages` that turns in the physics engine: its poses."""

from math import pi

from change_point_linkages import change_point_file
from klann_ros.kinematics import LinkagePose
from klann_ros.robot import robot_of
from klann_ros.twin import robot_mjcf
from klann_ros.twin.tree import joint_rates, spanning_tree
import mujoco
import numpy as np

TIME_STEP = 1e-4


def engine_poses(name: str, rate: float, *, turns: int, count: int) -> list[LinkagePose]:
    """
    Return poses, evenly spread over turns of the crank at a rate [rad/s].

    Each holds the crank's angle, the other coordinates and the foot; the rest is empty.
    """
    robot = robot_of(str(change_point_file(name)))
    (leg,) = robot.legs
    linkage = leg.linkage
    structure = linkage.structure
    start = linkage.start[0]
    model = mujoco.MjModel.from_xml_string(robot_mjcf(robot, time_step=TIME_STEP, crank=start))
    data = mujoco.MjData(model)
    tree, _ = spanning_tree(linkage)
    rates = joint_rates(linkage, tree, start)
    for j, joint in enumerate(linkage.joint_names[1:], 1):
        data.joint(joint).qvel = rate * rates[j]
    crank = data.joint('crank')
    crank.qvel = data.ctrl[0] = rate
    foot = data.site(structure.foot.lower())
    steps = int(turns * 2.0 * pi / abs(rate) / TIME_STEP / count)
    poses = []
    for _ in range(count):
        mujoco.mj_forward(model, data)
        x = []
        for j, body in enumerate(structure.bodies[1:], 1):
            if body.slides:
                x.append(float(data.joint(body.angle).qpos[0]))
                continue
            matrix = data.body(body.angle).xmat.reshape(3, 3)
            # The engine's bodies are not rotated at the start; x is forward and z up.
            rotation = float(np.arctan2(matrix[2, 0], matrix[0, 0]))
            angle = linkage.start[j] + structure.senses[j] * rotation
            x.append(float(np.angle(np.exp(1j * angle))))
        h = float(foot.xpos[0]), float(foot.xpos[2])
        poses.append(LinkagePose(float(crank.qpos[0]), tuple(x), h, 0, 0.0, (), (), linkage))
        for _ in range(steps):
            mujoco.mj_step(model, data)
    return poses
