"""Kinematics of leg linkages: geometry in, poses out; knows nothing of ROS."""

from .errors import (
    CrankAngleError,
    GeometryError,
    KinematicsError,
    NotConvergedError,
    SingularPoseError,
    UnreachableError,
)
from .geometry import KlannGeometry
from .leg import KlannLeg
from .pose import KlannPose
from .reach import reachable_arcs
from .velocity import KlannVelocity

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
