"""`calibrate`: the leg as it was built, from a run in which somebody measured points of it."""

import argparse
from collections.abc import Mapping, Sequence
from functools import partial
import json
from math import isfinite
from typing import Any, BinaryIO

from klann_ros.log import NotALogError
from klann_ros.robot import Robot, robot_of, RobotFileError, RobotLeg
from klann_ros.sanitize.arguments import ArgumentParser, NOT_READ, path, UsageError
from klann_ros.sanitize.outputs import outputs, save_all
from klann_ros.sanitize.text import listed, printable
from klann_ros.sanitize.yaml_text import parse_file, YamlError

from . import page, report
from .built_file import built_file
from .fit import calibrate, Calibration
from .load import described_run, load_csv, load_run, point_topics, Request
from .measurements import MeasurementError, Series
from .observability import Suggestion

NOT_OBSERVABLE = 1
ERROR_CODES = dict.fromkeys((RobotFileError, MeasurementError, NotALogError, OSError), NOT_READ)
DESCRIPTION = """\
Calibrate a leg: the lengths, pivots and bends as they were built, and the zero of its encoder,
with standard errors, from measured points of the turning leg.

RUN is a run's folder, an .mcap or .db3 file, or a .csv with the columns time [s], crank [rad], and
H.x, H.y, G.x, ... [m] in the leg's plane.
TOPIC is a PointStamped, PoseStamped, PoseWithCovarianceStamped, TransformStamped, TFMessage or
Marker; TOPIC:KEY chooses a frame of a TFMessage or a marker."""
EPILOG = """\
FILE of --prior is YAML: standard deviations of dimensions by name [m, rad].
Exit code: 0 calibrated, 1 something cannot be told apart (what, and what would help, is printed),
2 RUN, the leg or a topic is refused, 3 an OUT cannot be written."""


def main(argv: Sequence[str] | None = None) -> int:
    """Calibrate a leg; return the exit code."""
    return _parser().run(_calibrate, ERROR_CODES, argv)


def _calibrate(options: argparse.Namespace) -> int:
    inputs = (options.run, options.leg, options.prior)
    files = outputs(options, ('output', 'html', 'json'), inputs)
    requests = [*options.point, *options.angle, *options.distance]
    robot, topics = _robot(options, requests)
    leg = _leg(robot, options.leg_name)
    found_topics = point_topics(topics, leg.linkage, leg.name)
    requests += [Request(point, topic) for point, topic in found_topics.items()]
    measured = _load(options, leg, requests)
    found = calibrate(
        leg.linkage,
        measured,
        direction=leg.direction,
        phase=leg.phase,
        camera=options.camera == 'unknown',
        delay=options.delay == 'unknown',
        prior=_prior(options.prior),
    )
    further = found.further()
    built = built_file(found, leg, options.leg, options.run)
    print(report.text(found, further), end='')
    views = {
        '--output': lambda: built,
        '--html': partial(page.page, found, further, options.run, built),
        '--json': partial(_json, found, further),
    }
    save_all(files, {option: partial(_save, view) for option, view in views.items()})
    return 0 if found.is_complete else NOT_OBSERVABLE


def _load(options: argparse.Namespace, leg: RobotLeg, requests: Sequence[Request]) -> list[Series]:
    if options.run.lower().endswith('.csv'):
        return load_csv(options.run, leg, requests)
    if not requests:
        raise MeasurementError(
            'no topic has the name of a point, as /mocap/h: name one with --point H=/mocap/foot'
        )
    return load_run(options.run, leg, requests, options.crank)


def _robot(
    options: argparse.Namespace, requests: Sequence[Request]
) -> tuple[Robot, Sequence[str]]:
    """Return the robot as drawn, and the topics to be searched for points if none is named."""
    if options.run.lower().endswith('.csv'):
        if options.leg is None:
            raise UsageError('a table does not contain the leg: name its file with --leg')
        return robot_of(options.leg), []
    robot = robot_of(options.leg) if options.leg is not None else None
    robot, topics = described_run(options.run, robot)
    return robot, [] if requests else topics


def _leg(robot: Robot, name: str | None) -> RobotLeg:
    legs = {leg.name: leg for leg in robot.legs}
    if name is None and len(legs) == 1:
        return next(iter(legs.values()))
    if name not in legs:
        raise UsageError(f'name the leg with --leg-name: {listed(legs, 12)}')
    return legs[name]


def _prior(given: str | None) -> float | Mapping[str, float] | None:
    """Return the prior: a number of millimetres, or a file's standard deviations."""
    if given is None:
        return None
    try:
        value = float(given) / 1e3
    except ValueError:
        return _prior_file(given)
    if not 0.0 < value < 1.0:
        raise UsageError(f'--prior {given}: it must be millimetres, above 0 and below 1000')
    return value


def _prior_file(given: str) -> Mapping[str, float]:
    try:
        content = parse_file(given)
    except (OSError, YamlError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise MeasurementError(f'--prior {printable(given)}: {printable(reason)}') from error
    if not isinstance(content, dict) or not all(map(_is_deviation, content.values())):
        msg = f'--prior {printable(given)}: it must be a mapping of dimensions to numbers > 0'
        raise MeasurementError(msg)
    return {str(name): float(value) for name, value in content.items()}


def _is_deviation(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and isfinite(value) and value > 0.0


def _json(calibration: Calibration, further: Sequence[Suggestion]) -> str:
    return json.dumps(report.report(calibration, further), indent=2, allow_nan=False) + '\n'


def _save(view: Any, file: BinaryIO) -> None:
    file.write(view().encode(errors='replace'))


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
    add(
        '--leg',
        metavar='FILE',
        type=path,
        help='the leg as drawn, or a shipped name (default: the leg in the run)',
    )
    add('--leg-name', metavar='NAME', help='which leg of a walker')
    for option, example in (
        ('point', 'H=/mocap/foot'),
        ('angle', 'theta=/encoder2:theta'),
        ('distance', 'A-H=/wire:d'),
    ):
        add(
            f'--{option}',
            metavar='NAME=TOPIC',
            type=_request,
            action='append',
            default=[],
            help=f'a measured {option}, such as {example}',
        )
    add('--crank', metavar='TOPIC', default='', help="of the crank's encoder (default: found)")
    known = ('known', 'unknown')
    add(
        '--camera',
        choices=known,
        default='known',
        help="its pose in the leg's plane (default: known)",
    )
    add(
        '--delay',
        choices=known,
        default='known',
        help='time offset of the points (default: known, 0)',
    )
    add(
        '--prior',
        metavar='MM',
        help='standard deviation of the dimensions [mm], or a FILE of them',
    )
    add('-o', '--output', metavar='OUT', help='the leg file with the calibrated numbers')
    add('--html', metavar='OUT', help='the page: residuals, error ellipses, the corrected drawing')
    add('--json', metavar='OUT', help='the result for machines, in SI units')
    return parser
