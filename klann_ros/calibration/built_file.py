"""The leg file with the calibrated numbers, which every program takes."""

from typing import Any

from klann_ros.kinematics.klann import NUMBERS, PRESETS
from klann_ros.kinematics.linkage.file import content_with_numbers, is_linkage, NUMBER_DIGITS
from klann_ros.robot import RobotLeg
from klann_ros.robot.file import of_leg, solver_section
from klann_ros.sanitize.files import is_regular_file
from klann_ros.sanitize.text import printable_line
from klann_ros.sanitize.yaml_text import dump, parameter_file, parse_file

from .fit import Calibration


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
        content = content_with_numbers(leg.description, calibration.linkage)
        parameters['linkage_description'] = dump(content) + '\n'
    else:
        parameters |= {name: round(numbers[name], NUMBER_DIGITS) for name in NUMBERS}
        parameters['assembly'] = [*calibration.linkage.assembly]
    parameters |= {
        'phase': round(calibration.phase, NUMBER_DIGITS),
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
    return '\n'.join([*lines, parameter_file({'/**': parameters})])


def _other_parameters(file: str, name: str) -> dict[str, Any]:
    """Return the parameters of a leg's file that a calibration does not change."""
    if not is_regular_file(file):
        # A shipped leg; those of the courses are made of rods.
        return {'bar_density': 1.0, 'foot_mass': 0.0} if file in PRESETS else {}
    content = parse_file(file)
    found = {} if is_linkage(content) else of_leg(solver_section(content), name)
    names = ('bar_density', 'foot_mass', 'mount_xyz', 'mount_rpy')
    return {key: found[key] for key in names if key in found}
