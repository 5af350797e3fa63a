"""A turn of a leg as cubics: where its foot is, what it has rolled, where its masses are."""

from klann_ros.dynamics.motion import body_motion, BodyMotion
from klann_ros.kinematics.angles import TURN
from klann_ros.robot import RobotLeg
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Angles a turn between which a cubic is within 1e-9 of a leg's size.
CUBIC_SAMPLES = 720
# Foot (3), rolling (2), centre of mass (3).
COLUMNS = 8


def leg_cubics(leg: RobotLeg, radius: float) -> Array:
    """
    Return a leg's turn in base_link, shape (CUBIC_SAMPLES, COLUMNS, 4).

    By interval, by column, by power: a + b t + c t^2 + d t^3 for t from 0 to 1 in the interval.

    Parameters
    ----------
    leg : RobotLeg
        The leg, which turns fully.
    radius : float
        Of its foot, a ball around the linkage's foot [m].

    """
    moving = body_motion(leg.linkage, np.arange(CUBIC_SAMPLES) * (TURN / CUBIC_SAMPLES))
    at, at_1 = (_columns(leg, moving, radius, order) for order in (0, 1))
    step = TURN / CUBIC_SAMPLES
    p, q = at, np.roll(at, -1, axis=0)
    v, w = at_1 * step, np.roll(at_1, -1, axis=0) * step
    return np.stack([p, v, 3.0 * (q - p) - 2.0 * v - w, 2.0 * (p - q) + v + w], axis=-1)


def _columns(leg: RobotLeg, moving: BodyMotion, radius: float, order: int) -> Array:
    """Return foot, rolling and centre of mass in base_link, or their derivatives, (k, 8)."""
    place = leg.mount.rotate if order else leg.mount.transform
    structure = leg.linkage.structure
    foot = place(_plane(moving.point(structure.foot)[order]))
    owner = structure.first_owner(structure.foot)
    turned = moving.rotation_1[owner] if order else _turned(moving, owner)
    # Rolling counter-clockwise, seen from the plane's z, it goes towards -x.
    along = leg.mount.rotate((1.0, 0.0))[:2]
    # One that turns about itself would roll on from turn to turn: none is known that stands.
    spins = round(float(moving.rotation_1[owner].mean())) != 0
    rolled = (0.0 if spins else radius) * turned[:, None] * along
    if not order:
        foot[:, 2] -= radius
    centre = np.zeros((moving.alphas.size, 2))
    masses = leg.masses
    if masses is not None and masses.total > 0.0:
        for j, body in enumerate(masses.bodies):
            share = body.mass / masses.total
            centre += share * _plane(moving.fixed_to(j, body.centre)[order])
    return np.concatenate([foot, rolled, place(centre)], axis=1)


def _plane(values: NDArray[np.complex128]) -> Array:
    return np.stack([values.real, values.imag], axis=-1)


def _turned(moving: BodyMotion, body: int) -> Array:
    """Return the rotation of a body since the first angle [rad]."""
    rate = moving.rotation_1[body]
    step = np.diff(moving.alphas)
    steps = (rate[1:] + rate[:-1]) / 2.0 * step
    return np.concatenate([[0.0], np.cumsum(steps)])
