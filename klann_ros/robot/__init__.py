"""
A robot from its file: legs, mounts, drives and masses.

A file has the parameters of solver_node for a leg or a walker, or is a linkage. Drawing, dynamics,
simulation and control all read robots by this package; it is without ROS.

>>> from klann_ros.robot import robot_of
>>> leg = robot_of('sem104').legs[0]
>>> leg.linkage.structure.foot, leg.crank_joint
('H', 'crank')
"""

from .file import robot_from_file, robot_from_parameters, robot_of, RobotFileError, solver_section
from .robot import CrankDrive, Mount, Robot, RobotLeg, WalkerBody

__all__ = [
    'CrankDrive',
    'Mount',
    'Robot',
    'RobotFileError',
    'RobotLeg',
    'WalkerBody',
    'robot_from_file',
    'robot_from_parameters',
    'robot_of',
    'solver_section',
]
