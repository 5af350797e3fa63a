"""Where the feet and the centre of mass of a walker are, for any angles of its cranks."""

from collections.abc import Sequence
from math import floor
from typing import Any, NamedTuple

from klann_ros.dynamics import body_motion
from klann_ros.kinematics import periodic_cubics, turns_fully
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import ComplexArray, FloatArray
from klann_ros.robot import Robot, RobotLeg, WalkerBody
import numpy as np
from numpy.typing import ArrayLike

# Angles a turn between which a cubic is within 1e-9 of a leg's size.
CUBIC_SAMPLES = 720
_POWERS = np.arange(4.0)


class NoWalkerError(ValueError):
    """A robot that cannot walk; the text says why."""


class Placed(NamedTuple):
    """Feet and centre of mass in base_link, of one pose or many."""

    # Where the n feet touch the ground, shape (..., n, 3) [m].
    feet: FloatArray
    # Rolling displacement of the spherical feet, shape (..., n, 2) [m]: a foot that rolls moves
    # without sliding.
    rolled: FloatArray
    # The centre of mass of all, shape (..., 3) [m].
    centre: FloatArray

    def tolist(self) -> tuple[list[Any], list[Any], list[Any]]:
        """Return the three in plain numbers."""
        return self.feet.tolist(), self.rolled.tolist(), self.centre.tolist()


class Feet:
    """
    The feet of a robot over the angles of its cranks.

    A turn of each leg is computed once, as cubics that are exact to some 1e-10 m.

    Parameters
    ----------
    robot : Robot
        Its legs; at least three of them, each of which turns fully.
    foot_radius : float
        Of the feet, which are balls around the linkages' feet [m].

    Attributes
    ----------
    robot : Robot
        The robot.
    joints : tuple of str
        The joints of its cranks; angles and rates of cranks are in this order.
    sides : numpy.ndarray, shape (c,)
        On which side each crank drives: +1 left, -1 right, 0 both.
    senses : numpy.ndarray, shape (c,)
        Which way each crank turns to walk forwards, +1 or -1.
    reach : float
        The greatest distance of a foot from base_link over the ground [m].
    gyration : float
        The radius of gyration about the vertical; half the reach without masses [m].

    Raises
    ------
    NoWalkerError
        It has less than three legs, or one that does not turn fully; or the legs of a crank drive
        against each other, or to the sides only.

    """

    def __init__(self, robot: Robot, *, foot_radius: float = 0.0) -> None:
        self.robot, self.joints = robot, robot.crank_joints
        if len(robot.legs) < 3:
            raise NoWalkerError(
                f'{robot.source or robot.name} is no walker: it has {len(robot.legs)} '
                f'{"leg" if len(robot.legs) == 1 else "legs"}, and stands on three'
            )
        for leg in robot.legs:
            if not turns_fully(leg.linkage):
                raise NoWalkerError(
                    f'{leg.name or "the leg"} does not turn fully, so it cannot walk'
                )
        self._crank_of = np.array([self.joints.index(leg.crank_joint) for leg in robot.legs])
        # Intervals of the table, by leg and angle.
        per_radian = CUBIC_SAMPLES / TURN
        self._scales = np.array([leg.direction * per_radian for leg in robot.legs])
        self._starts = np.array([leg.phase * per_radian for leg in robot.legs])
        masses = [leg.masses.total if leg.masses else 0.0 for leg in robot.legs]
        body = robot.body or WalkerBody(0.0, (0.0, 0.0, 0.0))
        total = sum(masses) + body.mass or 1.0
        self._shares = np.array(masses) / total
        self._fixed = np.array(body.centre) * body.mass / total
        # By leg and interval, by column, by power.
        turn = np.array([_leg_cubics(leg, foot_radius) for leg in robot.legs])
        self._cubics, self._rows = np.concatenate(turn), CUBIC_SAMPLES * np.arange(len(turn))
        # In plain numbers: crank, scale, start and row of each leg; shares; the body's part.
        columns = (
            each.tolist() for each in (self._crank_of, self._scales, self._starts, self._rows)
        )
        self._legs = list(zip(*columns, strict=True))
        self._leg_shares, self._body = self._shares.tolist(), self._fixed.tolist()
        places = turn[..., 0]
        self.reach = float(np.hypot(places[..., 0], places[..., 1]).max())
        square = self._shares @ (places[..., 5:7] ** 2).sum(axis=(1, 2)) / CUBIC_SAMPLES
        (x, y, _), (*_, inertia) = body.centre, body.inertia
        square += (inertia + (x**2 + y**2) * body.mass) / total
        self.gyration = float(np.sqrt(square)) or self.reach / 2.0
        # A crank whose legs are on both sides is in the middle, within a micrometre.
        every = [[leg.mount.xyz[1] for leg in robot.on_joint(each)] for each in self.joints]
        self.sides = np.array([float(min(y) > 1e-6) - float(max(y) < -1e-6) for y in every])
        # A foot that moves backwards at the lowest point of its plane drives forwards.
        ups = np.array([leg.mount.rotate((0.0, 1.0)) for leg in robot.legs])[..., None]
        lowest = np.arange(len(turn)), (places[..., :3] @ ups)[..., 0].argmin(axis=1)
        forwards = np.bincount(self._crank_of, -turn[..., 0, 1][lowest] * self._scales)
        for joint, forward in zip(self.joints, forwards.tolist(), strict=True):
            if abs(forward) < 1e-6 * self.reach:
                raise NoWalkerError(f'the legs of {joint} drive the robot nowhere')
        self.senses = np.sign(forwards)

    def pose(self, cranks: Sequence[float]) -> tuple[list[Any], list[Any], list[float]]:
        """Return `at(cranks).tolist()` of a single pose, faster: with two arrays."""
        rows: list[int] = []
        powers: list[float] = []
        for crank, scale, start, row in self._legs:
            turned = cranks[crank] * scale + start
            whole = floor(turned)
            t = turned - whole
            rows.append(whole % CUBIC_SAMPLES + row)
            powers += (1.0, t, t * t, t * t * t)
        cubics = self._cubics.take(rows, axis=0)
        legs = (cubics @ np.array(powers).reshape(-1, 4, 1))[..., 0].tolist()
        x, y, z = self._body
        for share, leg in zip(self._leg_shares, legs, strict=True):
            x += share * leg[5]
            y += share * leg[6]
            z += share * leg[7]
        return [leg[:3] for leg in legs], [leg[3:5] for leg in legs], [x, y, z]

    def at(self, cranks: ArrayLike) -> Placed:
        """Return where the feet are at angles of the cranks [rad], shape (..., c)."""
        angles = np.asarray(cranks, dtype=np.float64).take(self._crank_of, axis=-1)
        turned = angles * self._scales + self._starts
        whole = np.floor(turned)
        powers = (turned - whole)[..., None] ** _POWERS
        cubic = self._cubics.take(whole.astype(np.int64) % CUBIC_SAMPLES + self._rows, axis=0)
        # Foot, rolling and centre of mass of each leg, shape (..., n, 8).
        values: FloatArray = (cubic @ powers[..., None])[..., 0]
        centre = self._fixed + self._shares @ values[..., 5:]
        return Placed(values[..., :3], values[..., 3:5], centre)


def _leg_cubics(leg: RobotLeg, radius: float) -> FloatArray:
    """Return a turn of `_columns`: by interval, column and power of t from 0 to 1 in it."""
    p, step = _columns(leg, radius), TURN / CUBIC_SAMPLES
    # The derivatives of periodic functions.
    orders = np.fft.rfftfreq(CUBIC_SAMPLES, 1.0 / CUBIC_SAMPLES)[:, None]
    v = np.fft.irfft(1j * orders * np.fft.rfft(p, axis=0), CUBIC_SAMPLES, axis=0) * step
    return np.stack(periodic_cubics(p, v, axis=0), axis=-1)


def _columns(leg: RobotLeg, radius: float) -> FloatArray:
    """Return foot, rolling and centre of mass in base_link over a turn, shape (k, 8)."""
    step = TURN / CUBIC_SAMPLES
    moving = body_motion(leg.linkage, np.arange(CUBIC_SAMPLES) * step)
    structure = leg.linkage.structure
    foot = leg.mount.transform(_plane(moving.point(structure.foot)[0]))
    foot[:, 2] -= radius
    rate = moving.rotation_1[structure.first_owner(structure.foot)]
    turned = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2.0 * step)])
    # A foot link that turns fully would roll on without bound; no such leg stands on its foot.
    rolling = 0.0 if round(float(rate.mean())) else radius
    # Rolling counter-clockwise, seen from the plane's z, it goes towards -x.
    rolled = rolling * turned[:, None] * leg.mount.rotate((1.0, 0.0))[:2]
    bodies = leg.masses.bodies if leg.masses else ()
    centre = np.zeros(CUBIC_SAMPLES, dtype=np.complex128)
    whole = sum(body.mass for body in bodies) or 1.0
    for j, body in enumerate(bodies):
        centre += body.mass / whole * moving.fixed_to(j, body.centre)[0]
    return np.concatenate([foot, rolled, leg.mount.transform(_plane(centre))], axis=1)


def _plane(values: ComplexArray) -> FloatArray:
    return np.stack([values.real, values.imag], axis=-1)
