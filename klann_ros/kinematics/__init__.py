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
from .foot.inverse import Nearest
from .foot.path import foot_path, FootPath, NoFootPathError
from .foot.stance import NoStanceError, Stance
from .four_bar.dead_points import DeadPoint, RockerLimits
from .four_bar.geometry import FourBarGeometry
from .four_bar.grashof import Grashof
from .four_bar.linkage import FourBar
from .four_bar.motion import FourBarAcceleration, FourBarVelocity
from .four_bar.pose import FourBarPose
from .four_bar.transmission import TransmissionExtremes
from .klann.acceleration import KlannAcceleration
from .klann.geometry import KlannGeometry
from .klann.leg import KlannLeg
from .klann.margins import length_margins, Margin, PartialTurnError, turns_fully
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
from .virtual_work import ImmobileDirectionError

__all__ = [
    'CrankAngleError',
    'DeadPoint',
    'FootPath',
    'FourBar',
    'FourBarAcceleration',
    'FourBarGeometry',
    'FourBarPose',
    'FourBarVelocity',
    'GeometryError',
    'Grashof',
    'ImmobileDirectionError',
    'KinematicsError',
    'KlannAcceleration',
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
    'Margin',
    'Nearest',
    'NoFootPathError',
    'NoStanceError',
    'NotConvergedError',
    'PartialTurnError',
    'Reason',
    'RockerLimits',
    'SingularPoseError',
    'Stance',
    'ToleranceStudy',
    'TransmissionExtremes',
    'UnreachableError',
    'foot_path',
    'klann_poses',
    'length_margins',
    'linkage_from_file',
    'linkage_from_text',
    'reachable_arcs',
    'shipped_linkage',
    'shipped_linkages',
    'tolerance_study',
    'turns_fully',
]
