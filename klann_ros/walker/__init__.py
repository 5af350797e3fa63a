"""
What runs while a robot walks: the control of its cranks and its odometry; knows nothing of ROS.

A `Walker` is what walker_node is around: a `WalkController` (limits, phase lock, what stops it)
and an `Odometry` (where it is, and how far that may be off). Its feet and its steering are those
of `klann_ros.gait`.
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .commissioning import Commissioning, CommissioningSettings, Rates
    from .control_laws import CrankCommand, PhaseLock
    from .controller import WalkController
    from .faults import DiagnosticLevel, Fault, FaultKind, FaultLatch, RefusalKind
    from .imu import imu_reading, ImuReading
    from .limits import MotionLimits
    from .odometry import Odometry, OdometryEstimate
    from .settings import ControllerSettings, OdometryNoise
    from .walker import CrankDrives, OdometryScale, Walker
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
