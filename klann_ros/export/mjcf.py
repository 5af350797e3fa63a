"""Masses for a robot whose file tells none, as MJCF needs them."""

from dataclasses import replace

from klann_ros.dynamics import Masses, rods
from klann_ros.dynamics.masses import BodyMass
from klann_ros.kinematics import Linkage
from klann_ros.robot import Robot

# As a part of the linkage's size.
SLIDER = 0.1


def weighed(robot: Robot, density: float) -> Robot:
    """
    Return a robot all of whose legs have masses: slender rods where its file tells none.

    Raises
    ------
    MassError
        The density [kg/m] is none.

    """
    legs = (
        leg if leg.masses else replace(leg, masses=_rods(leg.linkage, density))
        for leg in robot.legs
    )
    return replace(robot, legs=tuple(legs))


def _rods(linkage: Linkage, density: float) -> Masses:
    """Return masses of rods; what slides without one weighs as a short one does."""
    masses, length = rods(linkage, density), SLIDER * linkage.size
    mass = density * length
    for j, body in enumerate(linkage.structure.bodies):
        if not body.rigid:
            masses = masses.with_mass(j, BodyMass(mass, 0j, mass * length**2 / 12.0))
    return masses
