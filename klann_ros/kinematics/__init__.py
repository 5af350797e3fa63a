"""Kinematics of leg linkages: geometry in, poses out; knows nothing of ROS."""

from .batch.poses import klann_poses, KlannPoses
from .batch.reason import Reason
from .batch.tolerance_study import tolerance_study, ToleranceStudy
from .errors import (
    CrankAngleError,
    GeometryError,
    KinematicsError,
    LoopsOpenError,
    NotConvergedError,
    SingularPoseError,
    UnreachableError,
)
from .four_bar.linkage import FourBar
from .four_bar.pose import FourBarPose
from .klann.geometry import KlannGeometry
from .klann.leg import KlannLeg
from .klann.pose import KlannPose
from .klann.reach import reachable_arcs
from .klann.velocity import KlannVelocity
from .linkage.file import (
    linkage_from_file,
    linkage_from_text,
    LinkageFileError,
    shipped_linkage,
    shipped_linkages,
)
from .linkage.leg import LinkageLeg
from .linkage.linkage import Linkage
from .linkage.motion import LinkageMotion
from .linkage.pose import LinkagePose

__all__ = [
    'CrankAngleError',
    'FourBar',
    'FourBarPose',
    'GeometryError',
    'KinematicsError',
    'KlannGeometry',
    'KlannLeg',
    'KlannPose',
    'KlannPoses',
    'KlannVelocity',
    'Linkage',
    'LinkageFileError',
    'LinkageLeg',
    'LinkageMotion',
    'LinkagePose',
    'LoopsOpenError',
    'NotConvergedError',
    'Reason',
    'SingularPoseError',
    'ToleranceStudy',
    'UnreachableError',
    'klann_poses',
    'linkage_from_file',
    'linkage_from_text',
    'reachable_arcs',
    'shipped_linkage',
    'shipped_linkages',
    'tolerance_study',
]
