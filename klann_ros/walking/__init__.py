"""
A body on legs: what it stands on and how it moves; knows nothing of ROS.

`walk_figures(robot)` is what a walker does over a turn: on which feet it stands, with which
margin, how it bobs and tilts, and how fast it is.
"""

from .feet import Feet, NoWalkerError
from .figures import walk_figures, WalkFigures

__all__ = ['Feet', 'NoWalkerError', 'WalkFigures', 'walk_figures']
