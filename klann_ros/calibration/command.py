"""`calibrate`: the leg as it was built, from a run in which somebody measured points of it."""

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
import json
from math import inf
from typing import Any

from klann_ros.cli import (
    ArgumentParser,
    NOT_READ,
    output_files,
    path,
    save_all,
    save_text,
    UsageError,
)
from klann_ros.kinematics import content_with_numbers, is_linkage, NUMBER_DIGITS, NUMBERS, PRESETS
from klann_ros.log import NotALogError
from klann_ros.robot import of_leg, Robot, robot_of, RobotFileError, RobotLeg, solver_section
from klann_ros.sanitize.files import is_regular_file
from klann_ros.sanitize.text import listed, printable, printable_line
from klann_ros.sanitize.yaml_text import content_of_file, dump, parameter_file, parse_file

from .fit import calibrate, Calibration
from .load import described_run, load_csv, load_run, point_topics, Request
from .measurements import MeasurementError
from .page import page
from .report import report, text_lines

NOT_OBSERVABLE = 1
# Parameters of a leg that a calibration does not change.
KEPT_PARAMETERS = ('bar_density', 'foot_mass', 'mount_xyz', 'mount_rpy')
CALIBRATE_ERRORS = dict.fromkeys(
    (RobotFileError, MeasurementError, NotALogError, OSError), NOT_READ
)
DESCRIPTION = """\
Calibrate a leg: the lengths, pivots and bends as they were built, and the zero of its encoder,
with standard errors, from measured points of the turning leg.

RUN is a run's folder, an .mcap or .db3 file, or a .csv with the columns time [s], crank [rad], and
H.x, H.y, G.x, ... [m] in the leg's plane.
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
    files = output_files(
        options, ('output', 'html', 'json'), (options.run, options.leg, options.prior)
    )
    requests = [*options.point, *options.angle, *options.distance]
    drawn = options.leg and robot_of(options.leg)
    if options.run.lower().endswith('.csv'):
        if drawn is None:
            raise UsageError('a table does not contain the leg: name its file with --leg')
        leg, parameters = _leg(drawn, options.leg_name), _parameters(options.leg)
        measured = load_csv(options.run, leg, requests)
    else:
        robot, parameters, topics = described_run(options.run, drawn)
        parameters = _parameters(options.leg) if drawn else parameters
        leg = _leg(robot, options.leg_name)
        named = point_topics(topics, leg.linkage, leg.name)
        requests = requests or [Request(point, topic) for point, topic in named.items()]
        if not requests:
            msg = 'no topic has the name of a point, as /mocap/h: name one with --point H=/foot'
            raise MeasurementError(msg)
        measured = load_run(options.run, leg, requests, options.crank)
    found = calibrate(
        leg.linkage,
        measured,
        direction=leg.encoder_direction,
        phase=leg.encoder_phase,
        camera=options.camera == 'unknown',
        delay=options.delay == 'unknown',
        prior=_prior(options.prior),
    )
    further = found.further()
    other = {k: v for k, v in of_leg(parameters, leg.name).items() if k in KEPT_PARAMETERS}
    built = _built_file(found, leg, other, (options.run, options.leg or 'in it'))
    print(*text_lines(found, further), sep='\n')
    views: dict[str, Callable[[], str]] = {
        '--output': lambda: built,
        '--html': partial(page, found, further, options.run, built),
        '--json': lambda: json.dumps(report(found, further), indent=2, allow_nan=False) + '\n',
    }
    save_all(files, {option: partial(save_text, view) for option, view in views.items()})
    return 0 if found.is_complete else NOT_OBSERVABLE


def _leg(robot: Robot, name: str | None) -> RobotLeg:
    for leg in robot.legs:
        if leg.name == name or (name is None and len(robot.legs) == 1):
            return leg
    there = listed([leg.name for leg in robot.legs], 12)
    raise UsageError(f'name the leg with --leg-name: {there}')


def _prior(given: str | None) -> float | Mapping[str, float] | None:
    """Return the prior: a number of millimetres, or a file's standard deviations."""
    if given is None:
        return None
    try:
        value = float(given) / 1e3
    except ValueError:
        return content_of_file(given, _by_name, 'standard deviations', MeasurementError)
    if not 0.0 < value < 1.0:
        raise UsageError(f'--prior {given}: it must be millimetres, above 0 and below 1000')
    return value


def _by_name(content: Any) -> dict[str, float]:
    numbers: list[Any] = [*content.values()] if isinstance(content, dict) else [None]
    if not all(type(value) in {int, float} and 0.0 < value < inf for value in numbers):
        raise ValueError('it must be a mapping of dimensions to numbers > 0')
    return {str(name): float(value) for name, value in content.items()}


def _parameters(drawing: str) -> Mapping[str, Any]:
    """Return the parameters of a leg's file; the shipped ones of the courses are made of rods."""
    if not is_regular_file(drawing):
        return {'bar_density': 1.0, 'foot_mass': 0.0} if drawing in PRESETS else {}
    content = parse_file(drawing)
    return {} if is_linkage(content) else solver_section(content)


def _built_file(
    found: Calibration, leg: RobotLeg, other: Mapping[str, Any], sources: tuple[str, str]
) -> str:
    """Return the leg file with the calibrated numbers, which every program takes."""
    parameters = dict(other)
    if leg.description:
        content = content_with_numbers(leg.description, found.linkage)
        parameters['linkage_description'] = dump(content) + '\n'
    else:
        own = found.linkage.dimensions
        parameters |= {name: round(own[name], NUMBER_DIGITS) for name in NUMBERS}
        parameters['assembly'] = [*found.linkage.assembly]
    phase = found.phase + leg.direction * leg.drive.zero
    parameters |= {'phase': round(phase, NUMBER_DIGITS), 'direction': leg.direction}
    parameters['crank_joint'] = leg.crank_joint
    errors = zip(found.model.names, found.standard_errors, strict=True)
    run, drawing = map(printable_line, sources)
    lines = [
        f'# Calibrated from {run}; the drawing is {drawing}.',
        '# Standard errors [m, rad]; unobservable combinations are as in the drawing:',
        *(f'#   {printable_line(name)}: {error:.2g}' for name, error in errors),
    ]
    comment = '\n'.join(lines).replace(': nan', ': not observable')
    return f'{comment}\n{parameter_file({"/**": parameters})}'


def _request(text: str) -> Request:
    """Return a request NAME=TOPIC or NAME=TOPIC:KEY."""
    name, equals, rest = text.partition('=')
    topic, _, key = rest.partition(':')
    if not (name and equals and topic):
        raise argparse.ArgumentTypeError(f'{printable(text)} is refused: it must be NAME=TOPIC')
    return Request(name, topic, key)


def _parser() -> ArgumentParser:
    parser = ArgumentParser('calibrate', DESCRIPTION, EPILOG)
    add = parser.add_argument
    add('run', metavar='RUN', type=path, help='the run, or a CSV file')
    drawn = 'the leg as drawn, or a shipped name (default: the leg in the run)'
    add('--leg', metavar='FILE', type=path, help=drawn)
    add('--leg-name', metavar='NAME', help='which leg of a walker')
    examples = {'point': 'H=/mocap/foot', 'angle': 'theta=/encoder2:theta', 'distance': 'A-H=/d:x'}
    for kind, example in examples.items():
        what: dict[str, Any] = {'type': _request, 'action': 'append', 'default': []}
        text = f'a measured {kind}, such as {example}'
        add(f'--{kind}', metavar='NAME=TOPIC', help=text, **what)
    add('--crank', metavar='TOPIC', default='', help="of the crank's encoder (default: found)")
    for name, what_ in (('camera', "pose in the leg's plane"), ('delay', 'of the points')):
        text = f'{what_} (default: known)'
        add(f'--{name}', choices=('known', 'unknown'), default='known', help=text)
    prior = 'standard deviation of the dimensions [mm], or a FILE of them'
    add('--prior', metavar='MM', help=prior)
    add('-o', '--output', metavar='OUT', help='the leg file with the calibrated numbers')
    add('--html', metavar='OUT', help='the page: residuals, error ellipses, the corrected drawing')
    add('--json', metavar='OUT', help='the result for machines, in SI units')
    return parser
