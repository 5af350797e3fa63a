"""
Kinematics of leg linkages: geometry in, poses out; knows nothing of ROS.

>>> from math import radians
>>> from klann_ros.kinematics import foot_path, KlannLeg
>>> leg = KlannLeg()  # SEM 104's
>>> pose = leg.solve(radians(60))
>>> pose
KlannPose(alpha=1.047198, gamma=0.1860426, beta=1.175121, delta=0.6015098, theta=0.7980158, \
h=(0.7960057, -0.3037628))
>>> leg.velocity(pose, 2.0)  # the crank at 2 rad/s
KlannMotion(alpha=2, gamma=..., theta=..., h=(-0.3882752, 0.04400816))
>>> round(foot_path(leg).stride, 6)
0.490957

The interface by subject. Angles are in rad, lengths in m.

=====================  ================================================================
Solvers                `KlannLeg`, `FourBar`, `LinkageLeg`: `solve`, `closed_form`,
                       `newton`, `velocity`, `acceleration`, `gradient`,
                       `crank_torque`, `foot_force`, `reachable_arcs`
Geometry               `KlannGeometry`, `FourBarGeometry`, `Linkage`; `shipped_linkage`,
                       `shipped_linkages`, `linkage_from_file`, `linkage_from_text`
Results                `KlannPose`, `FourBarPose`, `LinkagePose`, their motions;
                       `Iterations`
Assembly modes         `assemblies`, `assembly_poses`, `reachable_arcs`
The foot               `foot_path`: `FootPath`, `Stance`, `Nearest`
Batches                `linkage_poses`, `klann_poses`: `LinkagePoses`, `Reason`;
                       `Variants`
Tolerances             `turns_fully`, `length_margins`: `Margin`;
                       `tolerance_study`: `ToleranceStudy`
The four-bar           `Grashof`, `DeadPoint`, `RockerLimits`, `TransmissionExtremes`,
                       `FourBarTable`
Errors                 `KinematicsError`: `GeometryError`, `LinkageFileError`,
                       `CrankAngleError`, `UnreachableError`, `LoopsOpenError`,
                       `NotConvergedError`, ...
=====================  ================================================================
"""

from .batch.margins import length_margins, Margin, PartialTurnError, turns_fully
from .batch.poses import klann_poses, linkage_poses
from .batch.results import LinkagePoses, Reason
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
from .four_bar.geometry import FourBarGeometry
from .four_bar.linkage import (
    FourBar,
    FourBarMotion,
    FourBarPose,
    FourBarTable,
    TransmissionExtremes,
)
from .four_bar.mobility import DeadPoint, Grashof, RockerLimits
from .klann import KlannGeometry, KlannLeg, KlannMotion, KlannPose
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
