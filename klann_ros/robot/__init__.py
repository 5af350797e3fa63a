"""
A robot as its file tells it: legs where they are mounted, what turns them, and what all weighs.

A file is one leg's or a walker's parameters, as solver_node takes them, or a linkage. Whoever
draws, weighs, simulates or drives a robot starts from here; nothing here knows ROS.

>>> from klann_ros.robot import robot_of
>>> leg = robot_of('sem104').legs[0]
>>> leg.linkage.structure.foot, leg.crank_joint
('H', 'crank')
"""

from .file import robot_from_file, robot_from_parameters, robot_of, RobotFileError
from .robot import Body, Mount, Robot, RobotLeg

__all__ = [
    'Body',
    'Mount',
    'Robot',
    'RobotFileError',
    'RobotLeg',
    'robot_from_file',
    'robot_from_parameters',
    'robot_of',
]
