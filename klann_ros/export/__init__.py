"""
A robot in other formats: URDF, flat plates for a cutter as SVG and DXF, and parts for a printer.

The command `export` writes the MJCF of `klann_ros.twin` as well.

>>> from klann_ros.export import layers, plates, urdf
>>> from klann_ros.robot import robot_of
>>> robot = robot_of('sem104')
>>> [plate.title for plate in plates(robot, hole=3.2e-3, width=20e-3)]
['ground A D E', 'alpha A B', 'gamma B C G', 'beta D C', 'delta E F', 'theta F G H']
>>> layers(robot.legs[0].linkage, plates(robot, hole=3.2e-3, width=20e-3)).layer
(0, 1, 2, 1, 1, 0)
>>> urdf(robot).count('<joint')
11

It does not need ROS. DXF needs ezdxf, and solids need trimesh and manifold3d, which are imported
only to write them.
"""

from .assembly import assembly
from .drawing import Drawing, drawing, dxf, NoEzdxfError, svg
from .frame import placed_legs
from .layers import Layers, layers
from .parts import Part, PartSizes, PlacedLeg, Role
from .plates import ExportError, Plate, plates
from .scene import scene_parts
from .urdf import urdf
from .weights import part_settings, weighed, weighed_leg

__all__ = [
    'Drawing',
    'ExportError',
    'Layers',
    'NoEzdxfError',
    'Part',
    'PartSizes',
    'PlacedLeg',
    'Plate',
    'Role',
    'assembly',
    'drawing',
    'dxf',
    'layers',
    'part_settings',
    'placed_legs',
    'plates',
    'scene_parts',
    'svg',
    'urdf',
    'weighed',
    'weighed_leg',
]
