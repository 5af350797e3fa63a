"""`describe`: the data sheet of a leg or a walker before it is built."""

import argparse
from collections.abc import Sequence
from functools import partial
from math import isnan

from klann_ros.cli import ArgumentParser, NOT_READ, number_type, output_files, path, save_texts
from klann_ros.dynamics import MassError
from klann_ros.export import ExportError, weighed
from klann_ros.kinematics import KinematicsError, LinkageLeg
from klann_ros.robot import robot_of, RobotFileError
from klann_ros.sanitize.text import printable_line
import numpy as np

from .computing import data_sheet, DEFAULT_SPEED
from .json_report import report
from .motor import motor_from_file, MotorFileError
from .page import page
from .sheet import SheetError
from .text import sheet_text

# The exit code for a motor that cannot turn the cranks.
MOTOR_FAILS = 1
DESCRIBE_ERRORS = dict.fromkeys(
    (RobotFileError, MotorFileError, MassError, SheetError, ExportError, KinematicsError), NOT_READ
)
DESCRIPTION = """\
Describe a leg or a walker before it is built: bars, the path of the foot, transmission angles,
masses, crank torque, joint forces, and whether a motor can turn it.

FILE is a parameter file of solver_node, a linkage's file, or a shipped name such as sem104."""
EPILOG = """\
FILE of --motor is YAML: stall_torque [N m] and no_load_speed [rad/s] of the motor, gear_ratio and
efficiency of its gear, and continuous_torque [N m] for the thermal margin.
Exit code: 0 described, 1 the motor cannot turn it, 2 FILE, the motor or a number is refused, 3 an
OUT cannot be written."""


def main(argv: Sequence[str] | None = None) -> int:
    """Describe a robot; return the exit code."""
    return _parser().run(_describe, DESCRIBE_ERRORS, argv)


def _describe(options: argparse.Namespace) -> int:
    """Print the data sheet of the file and save it as the options ask; return the exit code."""
    inputs = (options.file, options.motor)
    names = 'html', 'json'
    files = output_files(options, names, inputs, refuse_yaml=names)
    motor = motor_from_file(options.motor) if options.motor is not None else None
    robot = robot_of(options.file)
    if options.bar_density is None:
        robot = weighed(options.file, robot)
    else:
        robot = robot.with_rods(options.bar_density)
    numbers = {'speed': options.speed, 'load': options.load}
    sheet = data_sheet(robot, **numbers, motor=motor, margins=options.margins)
    print(sheet_text(sheet), end='')
    for leg in sheet.legs if options.table is not None else ():
        end = 360.0 * leg.linkage.change_points.period + 1e-9
        alphas = np.radians(np.arange(0.0, end, options.table))
        print(f'\n{printable_line(leg.title or sheet.name)} at {options.speed:g} rad/s')
        print(LinkageLeg(leg.linkage).table(alphas, options.speed))
    save_texts(files, {'--html': partial(page, sheet), '--json': partial(report, sheet)})
    return 0 if sheet.motor_turns else MOTOR_FAILS


def _parser() -> ArgumentParser:
    parser = ArgumentParser('describe', DESCRIPTION, EPILOG)
    add = parser.add_argument
    add('file', metavar='FILE', type=path, help='the leg or the walker')

    def is_number(number: float) -> bool:
        return not isnan(number)

    speed = 'of the crank [rad/s], negative for clockwise (default: a turn a second)'
    rate = number_type(is_number, 'a speed in rad/s, or with its unit, as 60rpm', unit='rad/s')
    add('--speed', metavar='RAD_S', type=rate, default=DEFAULT_SPEED, help=speed)
    load = 'ground reaction of each foot in stance [N]'
    force = number_type(is_number, 'a force in N, or with its unit, as 2kgf', unit='N')
    add('--load', metavar='N', type=force, default=0.0, help=load)
    density = 'of all bars, in place of the masses in FILE [kg/m]'
    add('--bar-density', metavar='KG_M', type=float, help=density)
    add('--motor', metavar='FILE', type=path, help='can this motor turn it?')
    add('--margins', action='store_true', help='also of coupled loops, which takes seconds')
    step = number_type(lambda step: 4.0 <= step <= 180.0, 'a step of 4 to 180 [deg]', unit='deg')
    table = 'a turn as a table in such steps, with rates and accelerations [deg]'
    add('--table', metavar='STEP', type=step, help=table)
    add('--html', metavar='OUT', help='the page: the leg moving, and charts')
    add('--json', metavar='OUT', help='the sheet for machines, in SI units')
    return parser
