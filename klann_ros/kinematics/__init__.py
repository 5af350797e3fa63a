"""
Kinematics of leg linkages: geometry in, poses out; knows nothing of ROS.

>>> from klann_ros.kinematics import deg, foot_path, KlannLeg
>>> leg = KlannLeg()  # SEM 104's
>>> pose = leg.solve(60 * deg)
>>> pose
KlannPose(alpha=1.047198, gamma=0.1860426, beta=1.175121, delta=0.6015098, theta=0.7980158, \
h=(0.7960057, -0.3037628))
>>> leg.velocity(pose, 2.0)  # the crank at 2 rad/s
KlannMotion(alpha=2, gamma=..., theta=..., h=(-0.3882752, 0.04400816))
>>> round(foot_path(leg).stride, 6)
0.490957

The interface by subject. Angles are in rad: 60 degrees are `60 * deg` (`deg`). Lengths are in m.

=====================  ================================================================
Solvers                `KlannLeg`, `FourBar`, `LinkageLeg`: `solve`, `closed_form`,
                       `newton`, `velocity`, `acceleration`, `gradient`,
                       `crank_torque`, `foot_force`, `reachable_arcs`, `table`
Geometry               `KlannGeometry`, `FourBarGeometry`, `Linkage`; `shipped_linkage`,
                       `shipped_linkages`, `linkage_from_file`, `linkage_from_text`
Results                `KlannPose`, `FourBarPose`, `LinkagePose`, their motions;
                       `Iterations`, `LegTable` of `table`
Assembly modes         `assemblies`, `assembly_poses`, `reachable_arcs`, `path_arcs`
The foot               `foot_path`: `FootPath`, `Stance`, `Nearest`
Batches                `linkage_poses`, `klann_poses`: `LinkagePoses`, `Reason`;
                       `Variants`
Tolerances             `turns_fully`, `length_margins`: `Margin`;
                       `tolerance_study`: `ToleranceStudy`
The four-bar           `Grashof`, `DeadPoint`, `RockerLimits`, `TransmissionExtremes`
Errors                 `KinematicsError`: `GeometryError`, `LinkageFileError`,
                       `CrankAngleError`, `UnreachableError`, `LoopsOpenError`,
                       `NotConvergedError`, ...
=====================  ================================================================

Other packages of klann_ros use these as well; they may change with any version.

=====================  ================================================================
Constants              `BENDS`, `JOINTS`, `LENGTHS`, `NUMBERS`, `PRESETS` of the Klann
                       leg; `FIXED`, `GROUND`, `GROUND_BAND`; `COLOURS`, `colour_of`
Files                  `LENGTH_UNITS`, `NUMBER_DIGITS`, `SHIPPED`, `is_linkage`,
                       `linkage_text`, `content_with_numbers`, `bodies_of`,
                       `units_of`, `schema_error`, `structure_of`
Structure              `as_linkage`, `Structure`, `Bar`, `body_points`, `moved_numbers`
Motion of bodies       `body_vectors`, `solve_rates`, `vector_velocity`,
                       `velocity_product`, `cross`, `SAME_ANGLE`, `ChangePoint`
Parts of batches       `vectors`, `feet`, `loop_errors`, `transmission_angles`,
                       `differences`, `wrapped`, `whole_turns`, `driven_clearances`
Foot paths             `path_figures`, `SampledPaths`, `periodic_cubics`
Searches and checks    `peak`, `parabola_peak`, `crank_limits`, `check_rate`, `real_array`
Drawing                `PoseDrawing`, `pose_svg`
=====================  ================================================================
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .angles import deg
    from .batch.margins import length_margins, Margin, PartialTurnError, turns_fully
    from .batch.poses import (
        differences,
        feet,
        linkage_poses,
        loop_errors,
        transmission_angles,
        vectors,
        wrapped,
    )
    from .batch.results import LinkagePoses, Reason
    from .batch.tables import LegTable
    from .batch.tolerance_study import tolerance_study, ToleranceStudy
    from .batch.turn_clearance import driven_clearances
    from .batch.turns import whole_turns
    from .cubics import periodic_cubics
    from .drawing import colour_of, COLOURS, PoseDrawing
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
    from .foot.figures import path_figures, SampledPaths
    from .foot.inverse import Nearest
    from .foot.path import foot_path, FootPath, GROUND_BAND, NoFootPathError
    from .foot.stance import NoStanceError, Stance
    from .four_bar.geometry import FourBarGeometry
    from .four_bar.linkage import FourBar, FourBarMotion, FourBarPose, TransmissionExtremes
    from .four_bar.mobility import DeadPoint, Grashof, RockerLimits
    from .klann import (
        BENDS,
        JOINTS,
        klann_poses,
        KlannGeometry,
        KlannLeg,
        KlannMotion,
        KlannPose,
        LENGTHS,
        NUMBERS,
        PRESETS,
    )
    from .linkage.assemblies import assemblies, assembly_poses
    from .linkage.change_points import ChangePoint, SAME_ANGLE
    from .linkage.dyads import cross
    from .linkage.equations import body_points, moved_numbers
    from .linkage.file import (
        content_with_numbers,
        is_linkage,
        linkage_from_file,
        linkage_from_text,
        linkage_text,
        LinkageFileError,
        NUMBER_DIGITS,
        schema_error,
        SHIPPED,
        shipped_linkage,
        shipped_linkages,
        structure_of,
    )
    from .linkage.joints import body_vectors, solve_rates, vector_velocity, velocity_product
    from .linkage.leg import AnyLeg, Leg, LinkageLeg
    from .linkage.linkage import as_linkage, Linkage
    from .linkage.points import bodies_of, LENGTH_UNITS, units_of
    from .linkage.pose import LinkageMotion, LinkagePose
    from .linkage.reach import crank_limits, path_arcs, reachable_arcs
    from .linkage.structure import Bar, FIXED, GROUND, Structure
    from .linkage.variants import Variants
    from .newton import Iterations
    from .searches import parabola_peak, peak
    from .svg import pose_svg
    from .validation import check_rate, real_array
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
