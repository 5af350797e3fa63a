"""The files of a found leg, which every program takes: the leg, and a walker made of it."""

from collections.abc import Mapping
from math import pi
from typing import Any

from klann_ros.dynamics import ASSUMED_DENSITY
from klann_ros.kinematics import (
    content_with_numbers,
    foot_path,
    Linkage,
    linkage_from_text,
    linkage_poses,
    LinkageLeg,
    NUMBER_DIGITS,
    NUMBERS,
    units_of,
)
from klann_ros.robot import RobotLeg
from klann_ros.sanitize.yaml_text import dump, parameter_file
import numpy as np

# Masses of a walker [kg].
DEFAULT_BODY_MASS, DEFAULT_FOOT_MASS = 1.0, 0.005
# Relative to the leg's size: half the width of a body, from plane to plane of the legs, and
# between the legs at both ends.
HALF_WIDTH, PLANE_STEP, GAP = 0.2, 0.12, 0.04
# Whether the left leg of each row is in the second group of the gait, by the number of legs.
GAITS = {
    4: {'front': False, 'rear': True},
    6: {'front': False, 'middle': True, 'rear': False},
    8: {'front': False, 'rear': True, 'outer_front': True, 'outer_rear': False},
}
DEFAULT_LEGS = 6
DEFAULT_MOTORS = 2


def with_numbers(leg: RobotLeg, linkage: Linkage) -> RobotLeg:
    """Return a leg with other dimensions, as its file has them: rounded."""
    if not leg.description:
        numbers = {name: round(linkage.dimensions[name], NUMBER_DIGITS) for name in NUMBERS}
        return RobotLeg('', linkage.varied(numbers), masses=leg.masses)
    content = content_with_numbers(leg.description, linkage)
    metre, radian = units_of(content)
    if linkage.is_dyadic:
        # Its start need not close with the new numbers.
        content.pop('start', None)
        content['assembly'] = [*linkage.assembly_at(0.0)]
    else:
        content['start'] = {}
        for body, coordinate in zip(linkage.structure.bodies, linkage.start, strict=True):
            unit = metre if body.slides else radian
            content['start'][body.angle] = round(coordinate / unit, NUMBER_DIGITS)
    if 'material' in content.get('parts', ()):
        for body in content['bodies'].values():
            body.pop('mass', None)
    else:
        content.setdefault('density', ASSUMED_DENSITY)
    content['source'] = f'design, from the {content["name"]}'
    text = dump(content) + '\n'
    return RobotLeg('', linkage_from_text(text, 'the leg'), masses=leg.masses, description=text)


def leg_text(leg: RobotLeg) -> str:
    """Return the file of a leg: a linkage, or parameters of solver_node."""
    if leg.description:
        return leg.description
    return parameter_text({'bar_density': ASSUMED_DENSITY, **_geometry(leg)})


def parameter_text(parameters: Mapping[str, Any]) -> str:
    """Return a file of parameters, such as a walker's."""
    return parameter_file({'/**': parameters})


def _geometry(leg: RobotLeg) -> dict[str, Any]:
    """Return the parameters of a leg's linkage."""
    if leg.description:
        return {'linkage_description': leg.description}
    numbers = {name: leg.linkage.dimensions[name] for name in NUMBERS}
    return {**numbers, 'assembly': [*leg.linkage.assembly]}


def walker_parameters(leg: RobotLeg, options: Mapping[str, Any]) -> dict[str, Any]:
    """
    Return the parameters of a walker made of one leg, as of solver_node.

    The rear legs are front legs turned by half a turn about the vertical, whose cranks turn the
    other way; the middle of their stance is that of the front legs of their group. With six legs
    the middle ones stand beside the body's middle, with eight there are two legs at each corner,
    half a turn apart; these are outside of the others. Raises a KinematicsError for a leg without
    a foot path or a stance.
    """
    linkage = leg.linkage
    structure = linkage.structure
    path = foot_path(LinkageLeg(linkage))
    stance = path.stance()
    stance_x = float(path.h[stance.holds(path.alphas), 0].mean())
    ground = path.y_range[0]
    points: Any = linkage_poses(linkage, path.alphas, points=True).points
    size = max(path.y_range[1], float(points[..., 1].max())) - ground
    # At both ends of the body a leg is wholly in front of the middle.
    mount_x = GAP * size - float(points[..., 0].min())
    # A positive rate of the cranks walks forward.
    forward = -stance.direction
    has_two_motors = options.get('motors', DEFAULT_MOTORS) == 2
    legs: dict[str, Any] = {}
    for row, left_is_second in GAITS[options.get('legs', DEFAULT_LEGS)].items():
        is_rear = row.endswith('rear')
        is_outer = row == 'middle' or row.startswith('outer')
        y = (HALF_WIDTH + PLANE_STEP * is_outer) * size
        x = -stance_x if row == 'middle' else -mount_x if is_rear else mount_x
        for side in ('left', 'right'):
            is_left = side == 'left'
            is_second = left_is_second == is_left
            # At alpha = phase +- angle both are in the middle of their stance at one angle.
            group_phase = pi * is_second
            phase = stance.start + stance.end - group_phase if is_rear else group_phase
            legs[f'{row}_{side}'] = {
                'crank_joint': f'{side}_crank' if has_two_motors else 'crank',
                'phase': phase % (2.0 * pi),
                'direction': -forward if is_rear else forward,
                'mount_xyz': [round(x, 6), round(y if is_left else -y, 6), 0.0],
                'mount_rpy': [pi / 2.0, 0.0, pi * is_rear],
            }
    pivots = points[0, [structure.points.index(name) for name in structure.pivots], 1]
    top = float(pivots.max())
    bottom = float(pivots.min())
    body_length = 2.0 * (mount_x + float(np.abs(points[0, 0, 0])))
    density = options.get('bar_density', None if leg.description else ASSUMED_DENSITY)
    body_size = (body_length, 1.5 * HALF_WIDTH * size, max(0.1 * size, top - bottom))
    return {
        'legs': [*legs],
        **_geometry(leg),
        # The file of a linkage has a density, which the leg's own file keeps.
        **({'bar_density': density, 'foot_mass': DEFAULT_FOOT_MASS} if density else {}),
        'body_mass': options.get('body_mass', DEFAULT_BODY_MASS),
        'body_size': [round(length, 6) for length in body_size],
        'body_centre': [0.0, 0.0, round((top + bottom) / 2.0, 6)],
        **legs,
    }
