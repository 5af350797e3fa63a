"""
Dynamics of linkages with one crank: torque, energies and joint reactions; without ROS.

>>> import numpy as np
>>> from klann_ros.dynamics import Dynamics, rods
>>> from klann_ros.kinematics import KlannGeometry
>>> leg = Dynamics(KlannGeometry.sem104(), rods(KlannGeometry.sem104(), 1.0))  # 1 kg/m
>>> turn = leg.turn(2.0)  # at 2 rad/s, under its weight
>>> round(float(turn.torque.min()), 3), round(float(turn.torque.max()), 3)
(-3.537, 1.58)

`Masses` of a linkage: `rods` computes those of slender rods, `masses_from_text` reads a linkage's
file. `Dynamics` has crank torque, reduced inertia, energies and joint reactions, at many crank
angles at once (inverse dynamics); `simulate` integrates the motion by a torque (forward dynamics).
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .balance import Reactions
    from .forces import (
        Dynamics,
        GRAVITY,
        NoScipyError,
        simulate,
        Simulation,
        turn_mean,
        TurnOfForces,
    )
    from .masses import (
        ASSUMED_DENSITY,
        BodyMass,
        MassBasis,
        MassError,
        Masses,
        masses_from_text,
        rods,
        Spring,
        TorsionSpring,
        with_foot,
        with_rods,
    )
    from .motion import body_motion
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
