"""Kinematics of leg linkages: geometry in, poses out; knows nothing of ROS."""

from .errors import (
    CrankAngleError,
    GeometryError,
    KinematicsError,
    NotConvergedError,
    SingularPoseError,
    UnreachableError,
)
from .klann.geometry import KlannGeometry
from .klann.leg import KlannLeg
from .klann.pose import KlannPose
from .klann.reach import reachable_arcs
from .klann.velocity import KlannVelocity

__all__ = [
    'CrankAngleError',
    'GeometryError',
    'KinematicsError',
    'KlannGeometry',
    'KlannLeg',
    'KlannPose',
    'KlannVelocity',
    'NotConvergedError',
    'SingularPoseError',
    'UnreachableError',
    'reachable_arcs',
]
