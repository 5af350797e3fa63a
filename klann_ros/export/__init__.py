"""
What a robot is given to others as: URDF, and its plates for the cutter as SVG and DXF.

The command `export` writes the MJCF of `klann_ros.twin` as well.

>>> from klann_ros.export import plates, urdf
>>> from klann_ros.robot import robot_of
>>> robot = robot_of('sem104')
>>> [plate.title for plate in plates(robot, hole=3.2e-3, width=20e-3)]
['ground A D E', 'alpha A B', 'gamma B C G', 'beta D C', 'delta E F', 'theta F G H']
>>> urdf(robot).count('<joint')
12

Nothing here knows ROS. Of the formats only DXF needs a package, ezdxf, imported when it is used.
"""

from .drawing import Drawing, drawing
from .dxf import dxf, NoEzdxfError
from .plates import ExportError, Plate, plates
from .svg import svg
from .urdf import urdf

__all__ = [
    'Drawing',
    'ExportError',
    'NoEzdxfError',
    'Plate',
    'drawing',
    'dxf',
    'plates',
    'svg',
    'urdf',
]
