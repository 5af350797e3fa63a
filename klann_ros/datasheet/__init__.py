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

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .chart import Chart, ChartLine, grid
    from .computing import data_sheet, peak_efforts
    from .motor import Motor, motor_from, motor_from_file, MotorFileError, MotorVerdict
    from .page import PAGE_PARTS
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
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
