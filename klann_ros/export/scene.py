"""The parts of a robot for the renderer `web/static/scene.js`, ready for JSON."""

from collections.abc import Iterable
from typing import Any

from klann_ros.kinematics import FIXED, Linkage
from klann_ros.robot import Robot

from .frame import placed_legs
from .outline import Outline
from .parts import Part, Role
from .weights import part_settings, part_sizes


def scene_parts(robot: Robot) -> dict[str, Any]:
    """Return models of the parts of legs, and each leg's; errors as `placed_legs`."""
    models: dict[Any, dict[str, Any]] = {}
    legs = {}
    for placed in placed_legs(robot, part_sizes(part_settings(robot.legs, {}, 1.0))):
        # A leg that carries walls or beams of the frame has more parts than its equals.
        key = placed.leg.linkage, placed.parts
        if key not in models:
            models[key] = _model(*key)
            models[key]['radius'] = placed.stack.plates[0].width / 2.0
        legs[placed.leg.name] = {
            'model': [*models].index(key),
            'direction': placed.direction,
            'offset': placed.offset,
        }
    return {'models': [*models.values()], 'legs': legs}


def _model(linkage: Linkage, parts: Iterable[Part]) -> dict[str, Any]:
    """Return the bodies of a linkage by its points, and its parts."""
    structure = linkage.structure
    names = structure.points
    bodies = []
    for body, frame in zip(structure.bodies, structure.frames, strict=True):
        along = None
        if frame != FIXED:
            bar = structure.bodies[frame].bars[0]
            along = [names.index(bar.start), names.index(bar.end)]
        bodies.append({'origin': names.index(body.points[0]), 'along': along})
    part_data = []
    for part in parts:
        prisms = []
        for prism in part.prisms:
            curves = {'outlines': _curves(prism.outlines), 'cuts': _curves(prism.cuts)}
            prisms.append({'low': prism.low, 'high': prism.high, **curves})
        is_link = part.role in {Role.LINK, Role.CRANK}
        part_data.append({'body': part.body, 'isLink': is_link, 'prisms': prisms})
    return {'bodies': bodies, 'parts': part_data}


def _curves(outlines: Iterable[Outline]) -> list[list[float]]:
    """Return the corners of each outline in a row: x [m], y [m], bulge, x, ..."""
    curves = []
    for outline in outlines:
        curve: list[float] = []
        for corner in outline:
            # Tenths of a micrometre.
            curve += round(corner.at.real, 7), round(corner.at.imag, 7), round(corner.bulge, 7)
        curves.append(curve)
    return curves
