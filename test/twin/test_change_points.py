"""Through a change point the engine's inertia takes a linkage along its tangent."""

from math import pi

from change_point_linkages import change_point_file, FEET
from klann_ros.robot import robot_of
from klann_ros.twin import robot_mjcf
from klann_ros.twin.tree import joint_rates, spanning_tree
import mujoco
import numpy as np
import pytest

# Slower, gravity and the engine's soft loops decide at a change point: level_foot at 1 turn/s.
RATE = 8.0 * pi
TIME_STEP = 1e-4
TURNS = 2


def engine_feet(name: str, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the crank angles [rad] and the feet [m] of a linkage that turns in the engine."""
    robot = robot_of(str(change_point_file(name)))
    (leg,) = robot.legs
    start = leg.linkage.start[0]
    model = mujoco.MjModel.from_xml_string(robot_mjcf(robot, time_step=TIME_STEP, crank=start))
    data = mujoco.MjData(model)
    tree, _ = spanning_tree(leg.linkage)
    rates = joint_rates(leg.linkage, tree, start)
    for j, joint in enumerate(leg.linkage.joint_names[1:], 1):
        data.joint(joint).qvel = rate * rates[j]
    crank = data.joint('crank')
    crank.qvel = data.ctrl[0] = rate
    foot = data.site(leg.linkage.structure.foot.lower())
    alphas = []
    feet = []
    for step in range(int(TURNS * 2.0 * pi / abs(rate) / TIME_STEP)):
        mujoco.mj_step(model, data)
        if step % 20 == 0:
            mujoco.mj_forward(model, data)
            alphas.append(crank.qpos[0])
            feet.append(complex(foot.xpos[0], foot.xpos[2]))
    return np.array(alphas), np.array(feet)


@pytest.mark.parametrize('rate', [RATE, -RATE])
@pytest.mark.parametrize('name', FEET)
def test_inertia_takes_it_along_the_tangent(name: str, rate: float) -> None:
    alphas, feet = engine_feet(name, rate)
    errors = np.abs(feet - FEET[name](alphas))
    size = np.ptp(np.column_stack([feet.real, feet.imag]), axis=0).max()
    # The engine's loops are soft, most so beside the change points.
    assert errors.max() <= 1e-2 * size
    assert np.median(errors) <= 1e-6 * size
