"""`export`: a robot as MJCF and URDF, and its plates for the cutter as SVG and DXF."""

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
import sys
from typing import BinaryIO

from klann_ros.review.report.outputs import Output, OutputError, outputs
from klann_ros.robot import Robot, robot_of, RobotFileError
from klann_ros.twin import robot_mjcf
from klann_ros.untrusted.arguments import ArgumentParser, path
from klann_ros.untrusted.text import counted, printable, printable_line

from .drawing import Drawing, drawing
from .dxf import dxf, NoEzdxfError
from .mjcf import weighed
from .plates import near, plates
from .svg import svg
from .urdf import urdf

NOT_READ, NOT_WRITTEN = 2, 3
HOLE = 3.2
# The default of the width: so many holes, but at least this part of the longest plate.
HOLES, PART = 3.0, 0.04
FORMATS = ('mjcf', 'urdf', 'svg', 'dxf')
DESCRIPTION = """\
Write a leg or a walker for others: MuJoCo, ROS, and the laser cutter. Several at once.

FILE is a parameter file of solver_node, a linkage's YAML file, or a shipped name: sem104."""
EPILOG = """\
SVG and DXF have each body as a plate with holes in mm, and how many there are of it.
The shell's own `export` comes before this one: `ros2 run klann_ros export FILE ...`,
`env export FILE ...` start this one.
Exit code: 0 written, 2 FILE or an option is refused, 3 an OUT cannot be written. No OUT may be
FILE, or a YAML file."""


def main(argv: Sequence[str] | None = None) -> int:
    """Export a robot; return the exit code."""
    parser = _parser()
    options = parser.parse_args(argv)
    asked = {f'--{name}': getattr(options, name) for name in FORMATS}
    if not any(asked.values()):
        parser.error(f'what is to be written? one of {", ".join(asked)} is needed')
    try:
        robot = robot_of(options.file)
        return _export(robot, options, outputs(asked, [options.file]))
    except (OutputError, NoEzdxfError) as error:
        return _fail(error, NOT_WRITTEN)
    except (RobotFileError, ValueError) as error:
        # What is no robot, and what cannot be made of one: all have it in the text.
        return _fail(error, NOT_READ)


def _fail(error: Exception, code: int) -> int:
    print(f'export: {printable_line(error)}', file=sys.stderr)
    return code


def _export(robot: Robot, options: argparse.Namespace, files: list[Output]) -> int:
    for file in files:
        if Path(file.path).suffix.lower() in ('.yaml', '.yml'):
            what = 'a file of parameters or a linkage may be there, which FILE may name'
            raise OutputError(f'{file.option} {printable(file.path)} is refused: {what}')
    # All of it before any of it is written: so one that fails leaves nothing half done.
    made = _made(robot, options)
    for file in files:
        file.save(partial(_write, made[file.option]))
        print(f'written: {file.option} {printable(file.path)}')
    return 0


def _write(content: bytes, file: BinaryIO) -> None:
    file.write(content)


def _made(robot: Robot, options: argparse.Namespace) -> dict[str, bytes]:
    made: dict[str, bytes] = {}
    if options.mjcf is not None:
        density = options.bar_density
        heavy = robot if density is None else weighed(robot, density)
        made['--mjcf'] = robot_mjcf(heavy).encode()
    if options.urdf is not None:
        made['--urdf'] = urdf(robot).encode()
    if options.svg is not None or options.dxf is not None:
        drawn = _drawn(robot, options)
        if options.svg is not None:
            made['--svg'] = svg(drawn).encode()
        if options.dxf is not None:
            made['--dxf'] = dxf(drawn)
    return made


def _drawn(robot: Robot, options: argparse.Namespace) -> Drawing:
    """Return the plates laid out; tell what is wrong with them, and how large they are."""
    hole, width = options.hole / 1e3, options.width
    if width is None:
        sizes = [leg.linkage.scaled(options.scale).size for leg in robot.legs]
        width = max(HOLES * options.hole, 1e3 * PART * max(sizes))
    cut = plates(robot, hole=hole, width=width / 1e3, scale=options.scale)
    for plate in cut:
        warning = near(plate, hole)
        if warning:
            print(f'export: {warning}: they need a plate each, or smaller holes', file=sys.stderr)
    drawn = drawing(cut, hole=hole, width=width / 1e3)
    count = counted(sum(plate.count for plate in cut), 'plate')
    sheet = f'{drawn.size.real:.0f} x {drawn.size.imag:.0f} mm'
    print(f'{count}, bars {width:.4g} mm wide, holes {options.hole:g} mm, drawn on {sheet}')
    return drawn


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < 1e6:
        raise argparse.ArgumentTypeError(f'{text} is no number > 0 (and < 1e6)')
    return value


def _parser() -> ArgumentParser:
    parser = ArgumentParser('export', DESCRIPTION, EPILOG)
    parser.add_argument('file', metavar='FILE', type=path, help='a leg, a walker or a linkage')
    parser.add_argument('--mjcf', metavar='OUT.xml', help='a model of MuJoCo, with its masses')
    parser.add_argument('--urdf', metavar='OUT.urdf', help='for robot_state_publisher')
    parser.add_argument('--svg', metavar='OUT.svg', help='the plates, in mm')
    parser.add_argument('--dxf', metavar='OUT.dxf', help="the plates, in mm (extra 'dxf')")
    parser.add_argument(
        '--hole',
        metavar='MM',
        type=_positive,
        default=HOLE,
        help=f'diameter of holes [mm], {HOLE}: for M3',
    )
    parser.add_argument(
        '--width', metavar='MM', type=_positive, help='width of bars [mm]; 4 %% of the size'
    )
    parser.add_argument(
        '--scale', type=_positive, default=1.0, help='of the plates; hole and width stay'
    )
    parser.add_argument(
        '--bar-density',
        metavar='KG_PER_M',
        type=_positive,
        help='what bars weigh in the MJCF, for a leg whose masses FILE does not tell [kg/m]',
    )
    return parser
