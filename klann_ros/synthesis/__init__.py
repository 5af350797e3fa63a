"""
Synthesis of four-bars: from a task to all linkages that fulfil it, each with its defects.

======================  ===================================================================
Functions               `function_task`, `precision_points`, `function_generators`,
                        `freudenstein`
Poses and timed paths   `motion_generators` of dyads: `burmester_curve`, `burmester_points`,
                        `dyad_of_pin`, `dyad_of_pivot`, `dyad_of_rotations`,
                        `dyads_of_rotation`
Limits                  `quick_returns`, `toggle_couplers`
Results                 `PlacedFourBar`: `defects`, `grashof`, `cognates`, `instant_centres`
======================  ===================================================================
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .dyads import (
        burmester_curve,
        burmester_points,
        BurmesterPair,
        dyad_of_pin,
        dyad_of_pivot,
        dyad_of_rotations,
        dyads_of_rotation,
        motion_generators,
        pins,
        PlanePose,
    )
    from .function import (
        freudenstein,
        function_generators,
        function_task,
        FunctionTask,
        precision_points,
    )
    from .limits import quick_returns, toggle_couplers
    from .placed import Defects, place, PlacedFourBar, Position
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
