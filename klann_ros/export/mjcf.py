"""A robot as MJCF, also one whose file tells no masses."""

from dataclasses import replace

from klann_ros.dynamics import Masses, rods
from klann_ros.dynamics.masses import BodyMass
from klann_ros.dynamics.mjcf import mjcf
from klann_ros.kinematics import Linkage, LinkageLeg, UnreachableError
from klann_ros.robot import Robot
from klann_ros.untrusted.text import printable

from .travel import crank_angles, ExportError

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


def robot_as_mjcf(robot: Robot) -> str:
    """
    Return a robot with masses as MJCF.

    Raises
    ------
    MassError
        Its legs have no masses: see `weighed`.
    ExportError
        It has several legs, or reaches no angle.

    """
    if robot.is_walker:
        raise ExportError('a walker cannot be written as MJCF yet')
    leg = robot.legs[0]
    alpha = float(leg.crank_angles(0.0))
    try:
        LinkageLeg(leg.linkage).closed_form(alpha)
    except UnreachableError:
        reached = crank_angles(leg.linkage, 3)
        if not len(reached):
            raise
        alpha = float(reached[1])
    return mjcf(robot.dynamics(leg), alpha, name=printable(robot.name), crank=leg.crank_joint)
