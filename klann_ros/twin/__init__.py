"""
The twin of a robot in the physics engine MuJoCo; knows nothing of ROS.

>>> from klann_ros.robot import robot_of
>>> from klann_ros.twin import robot_mjcf
>>> model = robot_mjcf(robot_of('klann'))
>>> '<velocity name="crank"' in model, '<site name="h"' in model
(True, True)

`robot_mjcf` writes a leg, hung up, or a walker on a floor as a model of the engine, which it does
not need for that. `agreement` turns a leg in the engine and tells how far it agrees with its
kinematics and forces. `Twin` is a robot of its own: motors that take speeds, sensors that are not
perfect, and the truth. The engine is the extra `sim`; without it the user gets a
NoMujocoError.
"""

from .agreement import Agreement, agreement
from .engine import NoMujocoError
from .mjcf import Floor, robot_mjcf
from .pace import Pace, RealTimeFactor
from .parts import Imu, Motors, Sensors, SimulatedCrank, Truth, TwinError
from .twin import DivergedError, Twin

__all__ = [
    'Agreement',
    'DivergedError',
    'Floor',
    'Imu',
    'Motors',
    'NoMujocoError',
    'Pace',
    'RealTimeFactor',
    'Sensors',
    'SimulatedCrank',
    'Truth',
    'Twin',
    'TwinError',
    'agreement',
    'robot_mjcf',
]
