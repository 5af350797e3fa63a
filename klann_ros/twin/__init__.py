"""
The twin of a robot in the physics engine MuJoCo; knows nothing of ROS.

>>> from klann_ros.robot import robot_of
>>> from klann_ros.twin import robot_mjcf
>>> model = robot_mjcf(robot_of('klann'))
>>> '<velocity name="crank"' in model, '<site name="h"' in model
(True, True)

`robot_mjcf` writes a suspended leg, or a walker on a floor, as a model of the engine; it does not
need the engine. `agreement` compares a leg in the engine with its kinematics and forces. `Twin` is
a simulated robot: motors with speed commands, noisy sensors, and the true state. The engine is
the extra `sim`; without it these raise a NoMujocoError. A `FaultInjector` changes commands and
readings as faults of the hardware do.
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .comparison import Agreement, agreement
    from .injection import described_faults, FaultInjector, injected_faults, Injection
    from .mjcf import Floor, robot_mjcf, start_angle
    from .tree import spanning_tree
    from .twin import (
        DivergedError,
        Imu,
        ImuSampling,
        Motors,
        NoMujocoError,
        Pace,
        Sensors,
        SimulatedCrank,
        Truth,
        Twin,
        TwinError,
    )
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
