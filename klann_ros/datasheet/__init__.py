"""
The data sheet of a leg or a walker before it is built: motion, forces and the choice of a motor.

>>> from klann_ros.datasheet import data_sheet
>>> from klann_ros.robot import robot_of
>>> sheet = data_sheet(robot_of('sem104'), speed=2.0, load=10.0)
>>> leg = sheet.legs[0]
>>> round(leg.path.stride, 3), round(leg.stance.duty_factor, 3)
(0.491, 0.477)
>>> round(sheet.cranks[0].loaded.peak, 3)  # [N m]
3.537

All values are in SI units. `klann_ros.datasheet.text`, `.json_report` and `.page` show the same
`DataSheet`.
"""

from .computing import data_sheet, peak_efforts
from .motor import Motor, motor_from, motor_from_file, MotorFileError, MotorVerdict
from .sheet import (
    BarFigures,
    CrankSheet,
    DataSheet,
    JointForce,
    LegForces,
    LegSheet,
    SheetError,
    Transmission,
)

__all__ = [
    'BarFigures',
    'CrankSheet',
    'DataSheet',
    'JointForce',
    'LegForces',
    'LegSheet',
    'Motor',
    'MotorFileError',
    'MotorVerdict',
    'SheetError',
    'Transmission',
    'data_sheet',
    'motor_from',
    'motor_from_file',
    'peak_efforts',
]
