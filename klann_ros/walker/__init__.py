"""
A body on legs: what it stands on, how it moves, and how it is driven; knows nothing of ROS.

`walk_figures(robot)` is what a walker does over a turn: on which feet it stands, with which
margin, how it bobs and tilts, and how fast it is. `Steering` goes from a wanted motion to the
rates of the cranks and back. A `Walker` is what walker_node is around: a `WalkController` (limits,
phase lock, what stops it) and an `Odometry` (where it is, and how far that may be off).
"""

from .control_laws import ControllerSettings, CrankCommand, MotionLimits, PhaseLock
from .controller import DiagnosticLevel, WalkController
from .feet import Feet, NoWalkerError
from .figures import GaitFigures, walk_figures
from .imu import imu_reading, ImuReading
from .odometry import Odometry, OdometryEstimate, OdometryNoise
from .steering import Rates, Steering, Twist2D
from .walker import Walker

__all__ = [
    'ControllerSettings',
    'CrankCommand',
    'DiagnosticLevel',
    'Feet',
    'GaitFigures',
    'ImuReading',
    'MotionLimits',
    'NoWalkerError',
    'Odometry',
    'OdometryEstimate',
    'OdometryNoise',
    'PhaseLock',
    'Rates',
    'Steering',
    'Twist2D',
    'WalkController',
    'Walker',
    'imu_reading',
    'walk_figures',
]
