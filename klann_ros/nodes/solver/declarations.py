"""The parameters of `solver_node`, beside those of its legs."""

from math import pi

from klann_ros.log import LINKAGE_PARAMETER
from klann_ros.nodes.leg_declarations import (
    drive,
    ENCODER_REMEDIES,
    ENCODERS,
    FOR_OTHERS,
    GEOMETRY,
    LEGS,
    OF_LEG,
)
from klann_ros.nodes.parameters import Declaration
from klann_ros.robot import OF_CRANK

SETTINGS = (
    Declaration(
        'tolerance',
        1e-12,
        'largest correction of a converged pose [rad]',
        constraint='> 0, <= 1e-3',
    ),
    Declaration(
        'max_crank_step', 0.35, 'larger crank steps are split [rad]', constraint='finite, > 0'
    ),
)
INPUTS = (
    Declaration(
        'crank_angle_type',
        'float64',
        'std_msgs/Float64, or Float32',
        choices=('float64', 'float32'),
    ),
    *ENCODERS,
)
_FLOAT64 = 'std_msgs/msg/Float64'
_FLOAT32 = 'std_msgs/msg/Float32'
# What to do about a publisher of another type, by the type that is taken and the published one.
INPUT_TYPE_REMEDIES = {
    (_FLOAT64, _FLOAT32): 'crank_angle_type:=float32',
    (_FLOAT32, _FLOAT64): 'crank_angle_type:=float64',
    **ENCODER_REMEDIES,
}
PUBLISHED = (
    Declaration('frame_id', 'leg_plane', 'frame of the published point: the plane of the leg'),
    Declaration(
        'min_transmission_angle',
        0.349,
        'diagnostics warn when min(mu, pi - mu) of a dyad is below it [rad]',
        limits=(0.0, pi / 2),
    ),
    Declaration('publish_markers', True, 'whether the legs are published as markers'),
    Declaration('diagnostics_period', 1.0, 'time between diagnostics [s]', limits=(0.01, 3600.0)),
)
SOLVER_PARAMETERS = (*GEOMETRY, *LEGS, *SETTINGS, *drive(), *INPUTS, *PUBLISHED)
# Parameters in leg_description, with any leg's name before them: no files.
DESCRIBED = frozenset(
    (
        *OF_LEG,
        *(p.name for p in (*LEGS, *SETTINGS, *ENCODERS)),
        *FOR_OTHERS,
        *OF_CRANK,
        LINKAGE_PARAMETER,
        'frame_id',
        'use_sim_time',
    )
) - {'linkage'}
