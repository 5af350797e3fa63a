"""Kinematics of leg linkages: geometry in, poses out; knows nothing of ROS."""

from .batch.batch import LinkagePoses
from .batch.margins import length_margins, Margin, PartialTurnError, turns_fully
from .batch.poses import klann_poses, linkage_poses
from .batch.reason import Reason
from .batch.tolerance_study import tolerance_study, ToleranceStudy
from .errors import (
    CrankAngleError,
    GeometryError,
    ImmobileDirectionError,
    KinematicsError,
    LoopsOpenError,
    NotAssembledError,
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
from .four_bar.pose import FourBarMotion, FourBarPose
from .four_bar.table import FourBarTable
from .four_bar.transmission import TransmissionExtremes
from .klann.geometry import KlannGeometry
from .klann.leg import KlannLeg, KlannMotion, KlannPose
from .linkage.assemblies import assemblies, assembly_poses
from .linkage.file import (
    linkage_from_file,
    linkage_from_text,
    LinkageFileError,
    shipped_linkage,
    shipped_linkages,
)
from .linkage.leg import AnyLeg, Leg, LinkageLeg
from .linkage.linkage import Linkage
from .linkage.pose import LinkageMotion, LinkagePose
from .linkage.reach import reachable_arcs
from .linkage.variants import Variants
from .newton import Iterations

__all__ = [
    'AnyLeg',
    'CrankAngleError',
    'DeadPoint',
    'FootPath',
    'FourBar',
    'FourBarGeometry',
    'FourBarMotion',
    'FourBarPose',
    'FourBarTable',
    'GeometryError',
    'Grashof',
    'ImmobileDirectionError',
    'Iterations',
    'KinematicsError',
    'KlannGeometry',
    'KlannLeg',
    'KlannMotion',
    'KlannPose',
    'Leg',
    'Linkage',
    'LinkageFileError',
    'LinkageLeg',
    'LinkageMotion',
    'LinkagePose',
    'LinkagePoses',
    'LoopsOpenError',
    'Margin',
    'Nearest',
    'NoFootPathError',
    'NoStanceError',
    'NotAssembledError',
    'NotConvergedError',
    'PartialTurnError',
    'Reason',
    'RockerLimits',
    'SingularPoseError',
    'Stance',
    'ToleranceStudy',
    'TransmissionExtremes',
    'UnreachableError',
    'Variants',
    'assemblies',
    'assembly_poses',
    'foot_path',
    'klann_poses',
    'length_margins',
    'linkage_from_file',
    'linkage_from_text',
    'linkage_poses',
    'reachable_arcs',
    'shipped_linkage',
    'shipped_linkages',
    'tolerance_study',
    'turns_fully',
]
