"""
What runs while a robot walks: the control of its cranks and its odometry; knows nothing of ROS.

A `Walker` is what walker_node is around: a `WalkController` (limits, phase lock, what stops it)
and an `Odometry` (where it is, and how far that may be off). Its feet and its steering are those
of `klann_ros.gait`.
"""

from .commissioning import Commissioning, CommissioningSettings, Rates
from .control_laws import CrankCommand, PhaseLock
from .controller import WalkController
from .drives import CrankDrives
from .faults import DiagnosticLevel, Fault, FaultKind, FaultLatch, RefusalKind
from .imu import imu_reading, ImuReading
from .limits import MotionLimits
from .odometry import Odometry, OdometryEstimate
from .odometry_scale import OdometryScale
from .settings import ControllerSettings, OdometryNoise
from .walker import Walker

__all__ = [
    'Commissioning',
    'CommissioningSettings',
    'ControllerSettings',
    'CrankCommand',
    'CrankDrives',
    'DiagnosticLevel',
    'Fault',
    'FaultKind',
    'FaultLatch',
    'ImuReading',
    'MotionLimits',
    'Odometry',
    'OdometryEstimate',
    'OdometryNoise',
    'OdometryScale',
    'PhaseLock',
    'Rates',
    'RefusalKind',
    'WalkController',
    'Walker',
    'imu_reading',
]
