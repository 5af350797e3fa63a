"""The parameters of legs and encoders, which several nodes read."""

from collections.abc import Mapping
from dataclasses import replace
from math import pi
from typing import Any

from klann_ros.kinematics import BENDS, KlannGeometry, LENGTHS, NUMBERS
from klann_ros.robot import SEPARATORS

from .parameters import Declaration, number

_DESCRIPTIONS = {
    'l_ab': 'length of the crank AB',
    'l_bc': 'length of the coupler from the crank pin B to the elbow C',
    'l_dc': 'length of the lower rocker DC',
    'l_cg': 'length of the coupler from the elbow C to the hip G',
    'l_ef': 'length of the upper rocker EF',
    'l_fg': 'length of the leg from the knee F to the hip G',
    'l_gh': 'length of the leg from the hip G to the foot H',
    'x_d': 'x of the lower rocker pivot D, whose y is 0',
    'y_a': 'y of the crank axle A, whose x is 0',
    'x_e': 'x of the upper rocker pivot E',
    'y_e': 'y of the upper rocker pivot E',
    'angle_bcg': 'bend of the coupler at C',
    'angle_fgh': 'bend of the leg at G',
}
_CONSTRAINTS = {
    **dict.fromkeys(LENGTHS, 'finite, > 0'),
    **dict.fromkeys(BENDS, 'radians, not degrees: within +-2 pi'),
}
_SEM104 = KlannGeometry.sem104()
# A Klann leg's geometry, with the names and the order of the interface.
GEOMETRY = (
    *(
        Declaration(
            name,
            getattr(_SEM104, name),
            f'{_DESCRIPTIONS[name]} [{"rad" if name in BENDS else "m"}]',
            constraint=_CONSTRAINTS.get(name, 'finite'),
            read_only=False,
        )
        for name in NUMBERS
    ),
    Declaration(
        'assembly',
        list(_SEM104.assembly),
        'assembly branch: the signs of sin(gamma + beta) and sin(delta + theta)',
        constraint='two signs, each +1 or -1',
        read_only=False,
    ),
)
GEOMETRY_NAMES = tuple(parameter.name for parameter in GEOMETRY)
LEGS = (
    Declaration(
        'legs', [''], 'names of the legs; none for one unnamed leg', constraint='names, all others'
    ),
    Declaration(
        'linkage', '', "a linkage's YAML file or shipped name; empty: the Klann leg of the lengths"
    ),
    Declaration('crank_joint', 'crank', 'the joint in crank_state that turns the crank'),
    Declaration(
        'joint_separator',
        '/',
        "separates a leg's name and its joint's in joint_states; exports write _",
        choices=SEPARATORS,
    ),
)
ENCODERS = (
    Declaration(
        'crank_state_type',
        'joint_state',
        'sensor_msgs/JointState, or counts of an encoder (std_msgs/Int32), those of several '
        'cranks on crank_state/JOINT',
        choices=('joint_state', 'ticks'),
    ),
    number('counts_per_turn', 0.0, 'ticks in a turn of a crank; ticks need it', 0.0, 1e9),
)
_JOINT_STATE = 'sensor_msgs/msg/JointState'
_TICKS = 'std_msgs/msg/Int32'
# What to do about a publisher of another type, by the type that is taken and the published one.
ENCODER_REMEDIES = {
    (_JOINT_STATE, _TICKS): 'crank_state_type:=ticks and counts_per_turn',
    (_TICKS, _JOINT_STATE): 'crank_state_type:=joint_state',
}
# Masses and sizes in leg files, for other programs: declared where they are given.
FOR_OTHERS = ('bar_density', 'foot_mass', 'body_mass', 'body_size', 'body_centre')
_UPRIGHT = (pi / 2, 0.0, 0.0)


def drive(prefix: str = '') -> tuple[Declaration, ...]:
    """Return the parameters of a leg's drive."""
    return (
        Declaration(
            f'{prefix}phase',
            0.0,
            "the leg's crank angle where the crank is at 0 [rad]",
            constraint='finite',
        ),
        Declaration(
            f'{prefix}direction',
            1,
            '+1, or -1 for a leg whose crank turns the other way',
            constraint='+1 or -1',
        ),
    )


def place(name: str) -> tuple[Declaration, ...]:
    """Return the parameters that only a named leg has."""
    return (
        Declaration(f'{name}.linkage', '', 'its own linkage; empty: linkage'),
        Declaration(f'{name}.crank_joint', '', 'its own joint in crank_state; empty: crank_joint'),
        Declaration(f'{name}.mount_xyz', [0.0] * 3, 'where its plane is in base_link [m]'),
        Declaration(f'{name}.mount_rpy', list(_UPRIGHT), 'how its plane is turned in it [rad]'),
    )


def named_leg(name: str, common: Mapping[str, Any]) -> tuple[Declaration, ...]:
    """Return the parameters of a named leg; its geometry defaults to the common one."""
    geometry = []
    for parameter in GEOMETRY:
        description = f'{name}: {parameter.description}'
        default = common[parameter.name]
        own_name = f'{name}.{parameter.name}'
        geometry.append(
            replace(parameter, name=own_name, default=default, description=description)
        )
    return (*geometry, *drive(f'{name}.'), *place(name))


# The names of a leg's own parameters, without the leg's.
OF_LEG = frozenset(p.name.removeprefix('LEG.') for p in (*drive('LEG.'), *place('LEG'))) | {
    *GEOMETRY_NAMES
}
