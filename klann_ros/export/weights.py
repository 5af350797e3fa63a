"""The masses of plates: their material by width and thickness, holes and slots off."""

from collections.abc import Iterator, Sequence
from math import atan
from typing import Any

from klann_ros.dynamics import BodyMass
from klann_ros.kinematics import FIXED, LENGTH_UNITS
from klann_ros.robot import Robot
from klann_ros.sanitize.yaml_text import dump, parse
import numpy as np

from .outline import Outline, outlines
from .plates import ExportError, Hole, Plate, Slot

# Chords of an arc: its area is then exact to 1e-5.
ARC_CHORDS = 256


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
    moments = np.zeros(3, dtype=complex)
    for curve in outlines(plate.links, plate.width / 2.0):
        moments += _moments(curve)
    cuts: list[Hole | Slot] = [*plate.holes, *plate.slots]
    for cut in cuts:
        (curve,) = outlines([cut.line], cut.diameter / 2.0)
        moments -= _moments(curve)
    area, first, second = moments
    inertia = (second - abs(first) ** 2 / area).real
    weight = density * thickness
    return BodyMass(float(weight * area.real), complex(first / area), float(weight * inertia))


def _moments(curve: Outline) -> Any:
    """Return the area of a curve, and its first and polar second moments about the origin."""
    start = np.array([*_points(curve)])
    end = np.roll(start, -1)
    doubled = (start.conj() * end).imag
    squares = abs(start) ** 2 + (start * end.conj()).real + abs(end) ** 2
    first = doubled * (start + end)
    return np.array([doubled.sum() / 2.0, first.sum() / 6.0, (doubled * squares).sum() / 12.0])


def _points(curve: Outline) -> Iterator[complex]:
    """Yield the corners of a curve, and points on its arcs."""
    for corner, following in zip(curve, (*curve[1:], curve[0]), strict=True):
        yield corner.at
        if corner.bulge:
            angle = 4.0 * atan(corner.bulge)
            turned = np.expm1(1j * angle * np.arange(1, ARC_CHORDS) / ARC_CHORDS)
            yield from corner.at + (following.at - corner.at) * turned / np.expm1(1j * angle)
