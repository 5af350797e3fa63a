"""`calibrate`: the leg as it was built, from a run in which somebody measured points of it."""

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
import json
from math import inf, isnan
from typing import Any

from klann_ros.cli import (
    ArgumentParser,
    check_installed,
    NOT_READ,
    number_type,
    output_files,
    path,
    save_texts,
    UsageError,
)
from klann_ros.kinematics import content_with_numbers, is_linkage, NUMBER_DIGITS, NUMBERS, PRESETS
from klann_ros.log import NotALogError
from klann_ros.robot import of_leg, Robot, robot_of, RobotFileError, RobotLeg, solver_parameters
from klann_ros.sanitize.files import is_regular_file
from klann_ros.sanitize.text import listed, printable, printable_line
from klann_ros.sanitize.yaml_text import content_of_file, dump, parameter_file, parse_file

from .fit import calibrate, Calibration
from .load import described_run, load_run, point_topics, Request
from .measurements import MeasurementError
from .model import CAMERAS
from .page import page
from .problem import Prior
from .report import report, text_lines
from .tables import load_table, TABLE_SUFFIXES, TableOptions

NOT_OBSERVABLE = 1
# Parameters of a leg that a calibration does not change.
KEPT_PARAMETERS = ('bar_density', 'foot_mass', 'mount_xyz', 'mount_rpy')
CALIBRATE_ERRORS = dict.fromkeys(
    (RobotFileError, MeasurementError, NotALogError, OSError), NOT_READ
)
CAMERA_HELP = """unknown: its pose in the leg's plane is fitted as well; scale: and its scale, as
of pixels; tilt: and the angle at which it looks (default: known)"""
FRAME_RATE = number_type(lambda rate: 0.0 < rate < 1e6, 'frames a second, above 0')
DESCRIPTION = """\
Calibrate a leg: the lengths, pivots and bends as they were built, and the zero of its encoder,
with standard errors, from measured points of the turning leg.

RUN is a run's folder, an .mcap or .db3 file, or a table (.csv, .tsv, .txt) with the columns time
[s], crank [rad], and H.x, H.y, G.x, ... [m] in the leg's plane. Without an encoder a tracked
point of the crank, such as its pin B, tells its angle.
TOPIC is a PointStamped, PoseStamped, PoseWithCovarianceStamped, TransformStamped, TFMessage or
Marker; TOPIC:KEY chooses a frame of a TFMessage or a marker."""
EPILOG = """\
FILE of --prior is YAML: standard deviations of dimensions by name [m, rad].
Exit code: 0 calibrated, 1 something is not observable (the report names it and the remedy),
2 RUN, the leg or a topic is refused, 3 an OUT cannot be written."""


def main(argv: Sequence[str] | None = None) -> int:
    """Calibrate a leg; return the exit code."""
    return _parser().run(_calibrate, CALIBRATE_ERRORS, argv)


def _calibrate(options: argparse.Namespace) -> int:
    """Calibrate the leg of a run and save the answers; return the exit code."""
    check_installed('scipy')
    files = output_files(
        options, ('output', 'html', 'json'), (options.run, options.leg, options.prior)
    )
    requests = [*options.point, *options.angle, *options.distance]
    drawn = options.leg and robot_of(options.leg)
    if options.run.lower().endswith(TABLE_SUFFIXES):
        if drawn is None:
            raise UsageError('a table does not contain the leg: name its file with --leg')
        leg = _leg(drawn, options.leg_name)
        parameters = _parameters(options.leg)
        table_options = TableOptions(dict(options.column), options.rate, options.angle_unit)
        loaded = load_table(options.run, leg, requests, table_options)
    else:
        robot, parameters, topics = described_run(options.run, drawn)
        parameters = _parameters(options.leg) if drawn else parameters
        leg = _leg(robot, options.leg_name)
        if not requests:
            named = point_topics(topics, leg.linkage, leg.name)
            requests = [Request(point, topic) for point, topic in named.items()]
        if not requests:
            raise MeasurementError(
                'no topic has the name of a point, as /mocap/h: name one with --point H=/foot'
            )
        loaded = load_run(options.run, leg, requests, options.crank, options.angle_unit)
    for note in loaded.notes:
        print(note)
    calibration = calibrate(
        leg.linkage,
        loaded.measured,
        direction=leg.encoder_direction,
        phase=leg.encoder_phase,
        camera=options.camera,
        delay=options.delay == 'unknown',
        prior=_prior(options.prior),
    )
    further = calibration.further()
    leg_parameters = of_leg(parameters, leg.name)
    file_parameters = {n: leg_parameters[n] for n in KEPT_PARAMETERS if n in leg_parameters}
    built = _built_file(calibration, leg, file_parameters, (options.run, options.leg or 'in it'))
    print(*text_lines(calibration, further), sep='\n')
    views: dict[str, Callable[[], str]] = {
        '--output': lambda: built,
        '--html': partial(page, calibration, further, options.run, built),
        '--json': lambda: (
            json.dumps(report(calibration, further), indent=2, allow_nan=False) + '\n'
        ),
    }
    save_texts(files, views)
    return 0 if calibration.is_complete else NOT_OBSERVABLE


def _leg(robot: Robot, name: str | None) -> RobotLeg:
    for leg in robot.legs:
        if leg.name == name or (name is None and len(robot.legs) == 1):
            return leg
    names = listed([leg.name for leg in robot.legs], 12)
    raise UsageError(f'name the leg with --leg-name: {names}')


def _prior(option: str | None) -> Prior:
    """Return the prior: a number of millimetres, or a file's standard deviations."""
    if option is None:
        return None
    try:
        deviation = float(option) / 1e3
    except ValueError:
        return content_of_file(option, deviations_by_name, 'standard deviations', MeasurementError)
    if not 0.0 < deviation < 1.0:
        raise UsageError(f'--prior {option}: it must be millimetres, above 0 and below 1000')
    return deviation


def deviations_by_name(content: Any) -> dict[str, float]:
    """Return the standard deviations in a mapping; a ValueError for anything else."""
    numbers: list[Any] = [*content.values()] if isinstance(content, dict) else [None]
    if not all(type(number) in {int, float} and 0.0 < number < inf for number in numbers):
        raise ValueError('it must be a mapping of dimensions to numbers > 0')
    return {str(name): float(number) for name, number in content.items()}


def _parameters(drawing: str) -> Mapping[str, Any]:
    """Return the parameters of a leg's file; the shipped ones of the courses are made of rods."""
    if not is_regular_file(drawing):
        return {'bar_density': 1.0, 'foot_mass': 0.0} if drawing in PRESETS else {}
    content = parse_file(drawing)
    return {} if is_linkage(content) else solver_parameters(content)


def _built_file(
    calibration: Calibration,
    leg: RobotLeg,
    leg_parameters: Mapping[str, Any],
    sources: tuple[str, str],
) -> str:
    """Return a leg file for all programs: the calibrated numbers, with their errors as comment."""
    parameters = dict(leg_parameters)
    if leg.description:
        content = content_with_numbers(leg.description, calibration.linkage)
        parameters['linkage_description'] = dump(content) + '\n'
    else:
        dimensions = calibration.linkage.dimensions
        parameters |= {name: round(dimensions[name], NUMBER_DIGITS) for name in NUMBERS}
        parameters['assembly'] = [*calibration.linkage.assembly]
    encoder_phase = calibration.phase if calibration.model.has_encoder else leg.encoder_phase
    phase = encoder_phase + leg.direction * leg.drive.zero
    parameters |= {'phase': round(phase, NUMBER_DIGITS), 'direction': leg.direction}
    parameters['crank_joint'] = leg.crank_joint
    run, drawing = map(printable_line, sources)
    lines = [
        f'# Calibrated from {run}; the drawing is {drawing}.',
        '# Standard errors [m, rad]; unobservable combinations are as in the drawing:',
    ]
    for name, error in zip(calibration.model.names, calibration.standard_errors, strict=True):
        text = 'not observable' if isnan(error) else f'{error:.2g}'
        lines.append(f'#   {printable_line(name)}: {text}')
    comment = '\n'.join(lines)
    return f'{comment}\n{parameter_file({"/**": parameters})}'


def _request(text: str) -> Request:
    """Return a request NAME=TOPIC or NAME=TOPIC:KEY."""
    name, topic_and_key = _assignment(text, 'NAME=TOPIC')
    topic, _, key = topic_and_key.partition(':')
    return Request(name, topic, key)


def _assignment(text: str, form: str) -> tuple[str, str]:
    """Return the name and the target of a text NAME=TARGET."""
    name, _, target = text.partition('=')
    if not (name and target):
        raise argparse.ArgumentTypeError(f'{printable(text)} is refused: it must be {form}')
    return name, target


def _parser() -> ArgumentParser:
    parser = ArgumentParser('calibrate', DESCRIPTION, EPILOG)
    add = parser.add_argument
    add('run', metavar='RUN', type=path, help='the run, or a CSV file')
    drawn = 'the leg as drawn, or a shipped name (default: the leg in the run)'
    add('--leg', metavar='FILE', type=path, help=drawn)
    add('--leg-name', metavar='NAME', help='which leg of a walker')
    examples = {'point': 'H=/mocap/foot', 'angle': 'theta=/encoder2:theta', 'distance': 'A-H=/d:x'}
    for kind, example in examples.items():
        text = f'a measured {kind}, such as {example}'
        option = partial(add, f'--{kind}', metavar='NAME=TOPIC', help=text)
        option(type=_request, action='append', default=[])
    add('--crank', metavar='TOPIC', default='', help="of the crank's encoder (default: found)")
    add('--camera', choices=CAMERAS, default='known', help=CAMERA_HELP)
    delay = 'of the points (default: known)'
    add('--delay', choices=('known', 'unknown'), default='known', help=delay)
    column = 'of a table: time=NAME, crank=NAME, H.x=NAME, ... or by number from 1 on'
    add_column = partial(add, '--column', metavar='WHAT=NAME', action='append', default=[])
    add_column(type=partial(_assignment, form='WHAT=NAME'), help=column)
    frames = 'frames a second, of a table with frames instead of times'
    add('--rate', metavar='HZ', type=FRAME_RATE, help=frames)
    unit = 'of the crank and measured angles (default: by the header, or found)'
    add('--angle-unit', choices=('rad', 'deg'), default='', help=unit)
    prior = 'standard deviation of the dimensions [mm], or a FILE of them'
    add('--prior', metavar='MM', help=prior)
    add('-o', '--output', metavar='OUT', help='the leg file with the calibrated numbers')
    add('--html', metavar='OUT', help='the page: residuals, error ellipses, the corrected drawing')
    add('--json', metavar='OUT', help='the result for machines, in SI units')
    return parser
