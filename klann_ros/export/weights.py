"""
What the parts of legs weigh: their materials, and files with the masses of their bodies.

A printed part has solid walls, bottom and top, and an infill between them. Parts of the ground
have no mass in a file: the `body_mass` of a walker includes them.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from math import pi
from pathlib import Path
from typing import Any, NamedTuple

from klann_ros.dynamics import BodyMass
from klann_ros.kinematics import (
    bodies_of,
    content_with_numbers,
    is_linkage,
    NUMBER_DIGITS,
    SHIPPED,
    units_of,
)
from klann_ros.robot import LEG_PARAMETERS, Robot, robot_from_text, RobotLeg, solver_parameters
from klann_ros.sanitize.files import is_regular_file
from klann_ros.sanitize.text import did_you_mean
from klann_ros.sanitize.units import warn_of_lengths
from klann_ros.sanitize.yaml_text import dump, parameter_file, parse, parse_file
import numpy as np

from .frame import placed_legs
from .outline import FINE_TOLERANCE, polyline
from .parts import Part, PartSizes, PlacedLeg, Prism
from .plates import ExportError

MATERIALS: dict[str, float] = parse_file(Path(__file__).with_name('materials.yaml'))
"""Densities [kg/m^3] by the names of materials."""

# Thickness of printed walls, bottoms and tops [m]: the mass is then within 3.5 % of the filament
# that PrusaSlicer takes for two perimeters, and 4 and 5 solid layers of 0.2 mm.
DEFAULT_WALL = 1e-3
# A greater size of a part was probably given in another unit [m].
MAX_PART_SIZE = 0.5
SIZES = tuple(field.name for field in fields(PartSizes))
LENGTHS = (*SIZES, 'wall')
_DESCRIPTION = 'linkage_description'
# Parameters of a leg that its weighed linkage replaces.
_REPLACED = {*LEG_PARAMETERS, 'bar_density'}


class Material(NamedTuple):
    """A material [kg/m^3]; `infill` is the filled part of the space inside of its walls [m]."""

    name: str
    density: float
    infill: float = 1.0
    wall: float = DEFAULT_WALL

    def mass(self, part: Part) -> BodyMass:
        """Return the mass of a part; centre and inertia are those of an even infill."""
        solid = part.mass(self.density)
        core = sum(self._core_volume(prism, part) for prism in part.prisms) / part.volume
        filled = 1.0 - (1.0 - self.infill) * core
        return solid._replace(mass=filled * solid.mass, inertia=filled * solid.inertia)

    def _core_volume(self, prism: Prism, part: Part) -> float:
        """Return the volume inside of the walls of a prism [m^3], by Steiner's formula."""
        height = prism.high - prism.low
        # There is no wall between prisms of one outline: a plate with seats.
        layers = [layer for layer in part.prisms if layer.outlines == prism.outlines]
        walls = 2 - sum(layer.low == prism.high or layer.high == prism.low for layer in layers)
        curves = (*prism.outlines, *prism.cuts)
        # All curves but the outer one have the material outside.
        area = prism.moments[0].real / height + pi * self.wall**2 * (2 - len(curves))
        for curve in curves:
            points = np.array([*polyline(curve, FINE_TOLERANCE)])
            area -= self.wall * abs(points - np.roll(points, 1)).sum()
        return max(0.0, height - walls * self.wall) * max(0.0, float(area))


def part_settings(
    legs: Iterable[RobotLeg], changes: Mapping[str, Any], unit: float
) -> dict[str, Any]:
    """Return `parts` of the first leg that has them in its file, changed by others [unit]; [m]."""
    contents = (parse(leg.description) for leg in legs if leg.description)
    content: Any = next((content for content in contents if 'parts' in content), {})
    of_file = _converted(content.get('parts', {}), units_of(content)[0])
    settings = of_file | _converted(changes, unit)
    for name in ('holes', 'seats'):
        settings[name] = {**of_file.get(name, {}), **settings.get(name, {})}
    scalars = {name for name in LENGTHS if isinstance(settings.get(name), float)}
    sizes = {f'parts.{name}': settings[name] for name in scalars}
    warn_of_lengths(sizes, 'write units: {length: mm}', MAX_PART_SIZE)
    if 'material' in settings:
        _materials(settings)
    return settings


def _converted(settings: Mapping[str, Any], unit: float) -> dict[str, Any]:
    """Return settings of parts with lengths in another unit, rounded as numbers of files."""

    def convert(length: Any) -> Any:
        if isinstance(length, Mapping):
            return {joint: convert(size) for joint, size in length.items()}
        return np.round(unit * np.array(length), NUMBER_DIGITS).tolist()

    converted = {}
    for name, setting in settings.items():
        if setting not in ({}, ()):
            converted[name] = convert(setting) if name in LENGTHS else setting
    return converted


def part_sizes(settings: Mapping[str, Any]) -> PartSizes:
    """Return the sizes in settings of parts."""
    return PartSizes(**{name: settings[name] for name in SIZES if name in settings})


def _materials(settings: Mapping[str, Any]) -> tuple[Material, Material]:
    """Return the materials of links and of pins in settings; an ExportError without any."""
    infill = {name: settings[name] for name in ('infill', 'wall') if name in settings}
    material = _material(settings, 'material', **infill)
    return material, _material(settings, 'pins') if 'pins' in settings else material


def _material(settings: Mapping[str, Any], key: str, **infill: float) -> Material:
    name = settings.get(key, '')
    density = MATERIALS.get(str(name), name)
    if not isinstance(density, int | float) or density <= 0.0:
        names = f'{", ".join(MATERIALS)}, or a density [kg/m^3]{did_you_mean(name, MATERIALS)}'
        raise ExportError(f'parts.{key} must be one of {names}')
    return Material(name if density is not name else f'{name:g} kg/m^3', density, **infill)


def weighed_leg(leg: RobotLeg, settings: Mapping[str, Any]) -> RobotLeg:
    """Return a leg with the masses of its parts, if they have a material; settings in [m]."""
    if 'material' not in settings:
        return leg
    (placed,) = placed_legs(Robot('', (leg,)), part_sizes(settings))
    return robot_from_text(_weighed_linkage(placed, settings), 'the leg').legs[0]


def _weighed_linkage(placed: PlacedLeg, settings: Mapping[str, Any]) -> str:
    """Return a leg's linkage as a file with the masses of its parts; settings in [m]."""
    leg = placed.leg
    if leg.description:
        content = parse(leg.description)
    else:
        text = (SHIPPED / 'klann.yaml').read_text(encoding='utf-8')
        content = content_with_numbers(text, leg.linkage)
        del content['start'], content['source']
        content['assembly'] = [*leg.linkage.assembly]
    material, pins = _materials(settings)
    masses: dict[int, BodyMass] = {}
    for part in placed.parts:
        mass = (pins if part.role.is_hardware else material).mass(part)
        masses[part.body] = masses.get(part.body, BodyMass()).plus(mass)
    metre, _ = units_of(content)
    content.pop('density', None)
    sizes = {**asdict(part_sizes(settings)), 'width': placed.stack.plates[0].width}
    content['parts'] = _converted({**settings, **sizes}, 1.0 / metre)
    filled = f', infill {100.0 * material.infill:g} %' if material.infill < 1.0 else ''
    of_pins = f', pins of {pins.name}' if pins is not material else ''
    material_text = f'{material.name}, {1e3 * sizes["thickness"]:g} mm{filled}{of_pins}'
    content['mass_source'] = f'parts of {material_text}, by export'
    bodies = bodies_of(content)
    for j, name in enumerate(leg.linkage.structure.angles):
        mass = masses.get(j, BodyMass())
        centre = mass.centre.real, mass.centre.imag
        bodies[name] |= {
            'mass': float(f'{mass.mass:.9g}'),
            'centre': [round(length / metre, NUMBER_DIGITS) + 0.0 for length in centre],
            'inertia': float(f'{mass.inertia:.9g}'),
        }
    return dump(content) + '\n'


def weighed_file(file: str, legs: Sequence[PlacedLeg], settings: Mapping[str, Any]) -> str:
    """
    Return the file of a robot with the masses of its parts; settings have lengths in [m].

    A linkage stays a linkage. A parameter file has the parameters of solver_node, for all nodes,
    with the linkages of its legs in it. An ExportError says that a material is missing.
    """
    parameters = {}
    for placed in legs:
        name = f'{placed.leg.name}.{_DESCRIPTION}'.lstrip('.')
        parameters[name] = _weighed_linkage(placed, settings)
    document = parse_file(file) if is_regular_file(file) else None
    if document is None or is_linkage(document):
        return parameters[_DESCRIPTION]
    if len({*parameters.values()}) == 1:
        parameters = {_DESCRIPTION: parameters.popitem()[1]}
    robot_parameters = solver_parameters(document)
    for name in [*robot_parameters]:
        if name.rpartition('.')[2] in _REPLACED:
            del robot_parameters[name]
    return parameter_file({'/**': robot_parameters | parameters})


def weighed(file: str, robot: Robot) -> Robot:
    """Return the robot of a file; with the masses of its parts, if it has only their material."""
    settings = part_settings(robot.legs, {}, 1.0)
    if 'material' not in settings or all(leg.masses for leg in robot.legs):
        return robot
    legs = placed_legs(robot, part_sizes(settings))
    return robot_from_text(weighed_file(file, legs, settings), file)
