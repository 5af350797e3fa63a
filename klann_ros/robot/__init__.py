"""
A robot from its file: legs, mounts, drives and masses.

A file has the parameters of solver_node for a leg or a walker, or is a linkage. Drawing, dynamics,
simulation and control all read robots by this package; it is without ROS.

>>> from klann_ros.robot import robot_of
>>> leg = robot_of('sem104').legs[0]
>>> leg.linkage.structure.foot, leg.crank_joint
('H', 'crank')
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .file import (
        LEG_PARAMETERS,
        OF_CRANK,
        of_leg,
        preset_names,
        robot_from_file,
        robot_from_parameters,
        robot_from_text,
        robot_of,
        RobotFileError,
        solver_parameters,
    )
    from .robot import CrankDrive, Mount, Robot, RobotLeg, SEPARATORS, Triple, WalkerBody
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
