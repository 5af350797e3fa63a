"""The leg file with the calibrated numbers, which every program takes."""

from math import radians
from typing import Any

from klann_ros.kinematics.klann import NUMBERS, PRESETS
from klann_ros.kinematics.linkage.file import is_linkage, LENGTH_UNITS
from klann_ros.kinematics.linkage.file_checks import body_bars
from klann_ros.robot import RobotLeg
from klann_ros.robot.file import of_leg, solver_section
from klann_ros.sanitize.files import is_regular_file
from klann_ros.sanitize.text import printable_line
from klann_ros.sanitize.yaml_text import dump, parse, parse_file

from .fit import Calibration

_DIGITS = 9


def built_file(calibration: Calibration, leg: RobotLeg, drawing: str | None, run: str) -> str:
    """
    Return the parameter file of the calibrated leg.

    Parameters
    ----------
    calibration : Calibration
        The result.
    leg : RobotLeg
        The leg as drawn.
    drawing, run : str
        The file of the drawing, None for that in the run, and the run.

    """
    numbers = dict(calibration.linkage.dimensions)
    parameters: dict[str, Any] = _other_parameters(drawing, leg.name) if drawing else {}
    if leg.description:
        parameters['linkage_description'] = dump(_linkage(leg.description, calibration)) + '\n'
    else:
        parameters |= {name: round(numbers[name], _DIGITS) for name in NUMBERS}
        parameters['assembly'] = [*calibration.linkage.assembly]
    parameters |= {
        'phase': round(calibration.phase, _DIGITS),
        'direction': leg.direction,
        'crank_joint': leg.crank_joint,
    }
    errors = zip(calibration.model.names, calibration.standard_errors, strict=True)
    drawn = printable_line(drawing or 'in it')
    lines = [
        f'# Calibrated from {printable_line(run)}; the drawing is {drawn}.',
        '# Standard errors [m, rad]; unobservable combinations are as in the drawing:',
        *(
            f'#   {printable_line(name)}: {error:.2g}'.replace('nan', 'not observable')
            for name, error in errors
        ),
    ]
    return '\n'.join([*lines, dump({'/**': {'ros__parameters': parameters}})]) + '\n'


def _other_parameters(file: str, name: str) -> dict[str, Any]:
    """Return the parameters of a leg's file that a calibration does not change."""
    if not is_regular_file(file):
        # A shipped leg; those of the courses are made of rods.
        return {'bar_density': 1.0, 'foot_mass': 0.0} if file in PRESETS else {}
    content = parse_file(file)
    found = {} if is_linkage(content) else of_leg(solver_section(content), name)
    names = ('bar_density', 'foot_mass', 'mount_xyz', 'mount_rpy')
    return {key: found[key] for key in names if key in found}


def _linkage(text: str, calibration: Calibration) -> Any:
    """Return the content of a linkage's file with the calibrated numbers, in its own units."""
    content, linkage = parse(text), calibration.linkage
    units = content.get('units', {})
    metre = LENGTH_UNITS[units.get('length', 'm')]
    radian = radians(1.0) if units.get('angle', 'rad') == 'deg' else 1.0
    order = [body.angle for body in linkage.structure.bodies]
    bars: list[Any] = [bar for name in order for bar in body_bars(content['bodies'][name])]
    for dimension, number in zip(linkage.structure.dimensions, linkage.numbers, strict=True):
        place = dimension.place
        scale = radian if dimension.kind == 'bend' else metre
        value = round(number / scale, _DIGITS)
        if dimension.kind in {'x', 'y'}:
            pivot = content['pivots'][linkage.structure.pivots[place]]
            pivot['xy'.index(dimension.kind)] = value
        elif dimension.kind == 'brace':
            bars[place]['brace']['length'] = value
        elif dimension.kind == 'bend':
            bars[place]['direction' if 'direction' in bars[place] else 'bend'] = value
        else:
            bars[place]['length'] = value
    return content
