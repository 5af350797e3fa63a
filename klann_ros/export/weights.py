"""The masses of plates: their material by width and thickness, holes and slots off."""

from collections.abc import Sequence

from klann_ros.dynamics import BodyMass
from klann_ros.kinematics import FIXED, LENGTH_UNITS
from klann_ros.robot import Robot
from klann_ros.sanitize.yaml_text import dump, parse

from .parts import Part, plate_prism, Role
from .plates import ExportError, Plate


def weighed_file(robot: Robot, plates: Sequence[Plate], thickness: float, density: float) -> str:
    """
    Return a linkage's file with the masses of its plates, of a thickness [m] and [kg/m^3].

    An ExportError says that the robot is no linkage's file.
    """
    leg = robot.legs[0]
    if not leg.description or len(robot.legs) > 1:
        raise ExportError(f"{robot.source}: --weighed takes a linkage's file, such as klann")
    content = parse(leg.description)
    metre = LENGTH_UNITS[content.get('units', {}).get('length', 'm')]
    content.pop('density', None)
    for plate in plates:
        if plate.body != FIXED:
            mass = plate_mass(plate, thickness, density)
            content['bodies'][plate.name] |= {
                'mass': mass.mass,
                'centre': [mass.centre.real / metre, mass.centre.imag / metre],
                'inertia': mass.inertia,
            }
    return dump(content) + '\n'


def plate_mass(plate: Plate, thickness: float, density: float) -> BodyMass:
    """Return the mass of a plate of a thickness [m] and a density [kg/m^3]."""
    part = Part(plate.name, Role.LINK, plate.body, (plate_prism(plate, 0.0, thickness),))
    return part.mass(density)
