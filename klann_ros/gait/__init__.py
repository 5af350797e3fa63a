"""
The gait of a body on legs: quasi-static, without state and time.

`walk_figures(robot)` is what a walker does over a turn: on which feet it stands, with which
margin, how it bobs and tilts, and how fast it is. `Steering` goes from a wanted motion to the
rates of the cranks and back. The estimator and the controller of `klann_ros.walker` are built on
`stance`: which feet carry the body, and how it moves when they slip.
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
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
    from .steering import clip, Rates, Steering, Twist2D
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
