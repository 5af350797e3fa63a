"""
The gait of a body on legs: quasi-static, without state and time.

`walk_figures(robot)` is what a walker does over a turn: on which feet it stands, with which
margin, how it bobs and tilts, and how fast it is. `Steering` goes from a wanted motion to the
rates of the cranks and back. The estimator and the controller of `klann_ros.walker` are built on
`stance`: which feet carry the body, and how it moves when they slip.
"""

from .feet import Feet, NoWalkerError
from .figures import GaitFigures, walk_figures
from .stance import (
    Facet,
    FootMotion,
    gravity_aligned,
    Point,
    StancePose,
    Support,
    Symmetric,
    Triple,
)
from .steering import Rates, Steering, Twist2D

__all__ = [
    'Facet',
    'Feet',
    'FootMotion',
    'GaitFigures',
    'NoWalkerError',
    'Point',
    'Rates',
    'StancePose',
    'Steering',
    'Support',
    'Symmetric',
    'Triple',
    'Twist2D',
    'gravity_aligned',
    'walk_figures',
]
