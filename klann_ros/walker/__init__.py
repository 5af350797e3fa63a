"""
A body on legs: what it stands on, how it moves, and how it is driven; knows nothing of ROS.

`walk_figures(robot)` is what a walker does over a turn: on which feet it stands, with which
margin, how it bobs and tilts, and how fast it is. `Steering` goes from a wanted motion to the
rates of the cranks and back. A `Walker` is what walker_node is around: a `WalkController` (limits,
phase lock, what stops it) and an `Odometry` (where it is, and how far that may be off).
"""

from .controller import Level, Settings, WalkController
from .feet import Feet, NoWalkerError
from .figures import walk_figures, WalkFigures
from .imu import imu_reading, ImuReading
from .limits import Limits
from .odometry import Errors, Odometer, Odometry
from .phase_lock import CrankCommand, PhaseLock
from .steering import Motion, Rates, Steering
from .walker import Walker

__all__ = [
    'CrankCommand',
    'Errors',
    'Feet',
    'ImuReading',
    'Level',
    'Limits',
    'Motion',
    'NoWalkerError',
    'Odometer',
    'Odometry',
    'PhaseLock',
    'Rates',
    'Settings',
    'Steering',
    'WalkController',
    'WalkFigures',
    'Walker',
    'imu_reading',
    'walk_figures',
]
