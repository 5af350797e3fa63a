"""
The twin of a robot in the physics engine MuJoCo; knows nothing of ROS.

>>> from klann_ros.robot import robot_of
>>> from klann_ros.twin import robot_mjcf
>>> model = robot_mjcf(robot_of('klann'))
>>> '<velocity name="crank"' in model, '<site name="h"' in model
(True, True)

`robot_mjcf` writes a leg, hung up, or a walker on a floor as a model of the engine, which it does
not need for that. `agreement` turns a leg in the engine and tells how far it agrees with its
kinematics and forces. The engine is the extra `sim`; whoever uses it without is told by a
NoMujocoError.
"""

from .agreement import Agreement, agreement
from .engine import NoMujocoError
from .mjcf import Floor, robot_mjcf

__all__ = ['Agreement', 'Floor', 'NoMujocoError', 'agreement', 'robot_mjcf']
