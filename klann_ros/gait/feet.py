"""Where the feet and the centre of mass of a walker are, for any angles of its cranks."""

from collections.abc import Sequence
from math import floor
from typing import Any, NamedTuple

from klann_ros.dynamics import body_motion
from klann_ros.kinematics import periodic_cubics, turns_fully
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray, plane_vectors
from klann_ros.robot import Robot, RobotLeg, WalkerBody
import numpy as np
from numpy.typing import ArrayLike

# Angles a turn between which a cubic is within 1e-9 of a leg's size.
CUBIC_SAMPLES = 720
_POWERS = np.arange(4.0)


class NoWalkerError(ValueError):
    """A robot that cannot walk; the text says why."""


class FootPositions(NamedTuple):
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
        self.robot = robot
        self.joints = robot.crank_joints
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
            if leg.linkage.change_points.period > 1:
                raise NoWalkerError(
                    f'{leg.name or "the leg"} is back only after several turns of its crank, so '
                    f'the angles of cranks do not tell where it is'
                )
        self._tables = _LegTables(robot, foot_radius)
        body = robot.body or WalkerBody(0.0, (0.0, 0.0, 0.0))
        masses = [leg.masses.total if leg.masses else 0.0 for leg in robot.legs]
        total = sum(masses) + body.mass or 1.0
        # Shares of the legs in the mass, and the part of the body in the centre of mass [m].
        self._mass_shares = np.array(masses) / total
        self._body_part = np.array(body.centre) * body.mass / total
        # Both in plain numbers.
        self._plain_masses = self._mass_shares.tolist(), self._body_part.tolist()
        nodes = self._tables.nodes
        self.reach = float(np.hypot(nodes[..., 0], nodes[..., 1]).max())
        square = self._mass_shares @ (nodes[..., 5:7] ** 2).sum(axis=(1, 2)) / CUBIC_SAMPLES
        (x, y, _), (*_, inertia) = body.centre, body.inertia
        square += (inertia + (x**2 + y**2) * body.mass) / total
        self.gyration = float(np.sqrt(square)) or self.reach / 2.0
        self.sides = np.array([_side(robot, joint) for joint in self.joints])
        advances = self._tables.advances()
        for joint, advance in zip(self.joints, advances.tolist(), strict=True):
            if abs(advance) < 1e-6 * self.reach:
                raise NoWalkerError(f'the legs of {joint} drive the robot nowhere')
        self.senses = np.sign(advances)

    def pose(self, cranks: Sequence[float]) -> tuple[list[Any], list[Any], list[float]]:
        """Return `at(cranks).tolist()` of a single pose, faster: with two arrays."""
        legs = self._tables.pose(cranks)
        shares, (x, y, z) = self._plain_masses
        feet = []
        rolled = []
        for share, leg in zip(shares, legs, strict=True):
            feet.append(leg[:3])
            rolled.append(leg[3:5])
            x += share * leg[5]
            y += share * leg[6]
            z += share * leg[7]
        return feet, rolled, [x, y, z]

    def at(self, cranks: ArrayLike) -> FootPositions:
        """Return where the feet are at angles of the cranks [rad], shape (..., c)."""
        legs = self._tables.at(np.asarray(cranks, dtype=np.float64))
        centre = self._body_part + self._mass_shares @ legs[..., 5:]
        return FootPositions(legs[..., :3], legs[..., 3:5], centre)


def _side(robot: Robot, joint: str) -> float:
    """Return on which side a crank drives; one whose legs are on both sides is in the middle."""
    offsets = [leg.mount.xyz[1] for leg in robot.on_joint(joint)]
    # Within a micrometre.
    return float(min(offsets) > 1e-6) - float(max(offsets) < -1e-6)


class _LegTables:
    """
    A turn of each leg as cubics of `_columns`, by leg and interval, column and power.

    `nodes` are the columns at the beginning of each interval, shape (n, k, 8).
    """

    def __init__(self, robot: Robot, foot_radius: float) -> None:
        cubics = np.array([_leg_cubics(leg, foot_radius) for leg in robot.legs])
        self.nodes: FloatArray = cubics[..., 0]
        self._cubics = np.concatenate(cubics)
        self._ups = np.array([leg.mount.rotate((0.0, 1.0)) for leg in robot.legs])[..., None]
        # Intervals of the table, by leg and angle.
        per_radian = CUBIC_SAMPLES / TURN
        # Crank, scale, start and first row of each leg in plain numbers.
        self._legs: list[tuple[int, float, float, int]] = []
        for n, leg in enumerate(robot.legs):
            crank = robot.crank_joints.index(leg.crank_joint)
            scale = leg.direction * per_radian
            self._legs.append((crank, scale, leg.phase * per_radian, n * CUBIC_SAMPLES))
        columns = map(np.array, zip(*self._legs, strict=True))
        self._crank_of, self._scales, self._starts, self._first_rows = columns

    def advances(self) -> FloatArray:
        """Return how far the feet of each crank drive forwards by its rotation."""
        # A foot that moves backwards at the lowest point of its plane drives forwards.
        lowest = (self.nodes[..., :3] @ self._ups)[..., 0].argmin(axis=1)
        slopes = self._cubics[self._first_rows + lowest, 0, 1]
        return np.asarray(np.bincount(self._crank_of, -slopes * self._scales))

    def pose(self, cranks: Sequence[float]) -> list[list[float]]:
        """Return the columns of each leg at angles of the cranks [rad]."""
        rows: list[int] = []
        powers: list[float] = []
        for crank, scale, start, first_row in self._legs:
            position = cranks[crank] * scale + start
            interval = floor(position)
            t = position - interval
            rows.append(interval % CUBIC_SAMPLES + first_row)
            powers += (1.0, t, t * t, t * t * t)
        cubics = self._cubics.take(rows, axis=0)
        legs: list[list[float]] = (cubics @ np.array(powers).reshape(-1, 4, 1))[..., 0].tolist()
        return legs

    def at(self, cranks: FloatArray) -> FloatArray:
        """Return the columns of each leg, shape (..., n, 8)."""
        positions = cranks.take(self._crank_of, axis=-1) * self._scales + self._starts
        intervals = np.floor(positions)
        powers = (positions - intervals)[..., None] ** _POWERS
        rows = intervals.astype(np.int64) % CUBIC_SAMPLES + self._first_rows
        return np.asarray((self._cubics.take(rows, axis=0) @ powers[..., None])[..., 0])


def _leg_cubics(leg: RobotLeg, radius: float) -> FloatArray:
    """Return a turn of `_columns`: by interval, column and power of t from 0 to 1 in it."""
    p = _columns(leg, radius)
    step = TURN / CUBIC_SAMPLES
    # The derivatives of periodic functions.
    orders = np.fft.rfftfreq(CUBIC_SAMPLES, 1.0 / CUBIC_SAMPLES)[:, None]
    v = np.fft.irfft(1j * orders * np.fft.rfft(p, axis=0), CUBIC_SAMPLES, axis=0) * step
    return np.stack(periodic_cubics(p, v, axis=0), axis=-1)


def _columns(leg: RobotLeg, radius: float) -> FloatArray:
    """Return foot, rolling and centre of mass in base_link over a turn, shape (k, 8)."""
    step = TURN / CUBIC_SAMPLES
    moving = body_motion(leg.linkage, np.arange(CUBIC_SAMPLES) * step)
    structure = leg.linkage.structure
    foot = leg.mount.transform(plane_vectors(moving.point(structure.foot)[0]))
    foot[:, 2] -= radius
    rate = moving.rotation_1[structure.first_owner(structure.foot)]
    rotation = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2.0 * step)])
    # A foot link that turns fully would roll on without bound; no such leg stands on its foot.
    rolling = 0.0 if round(float(rate.mean())) else radius
    # Rolling counter-clockwise, seen from the plane's z, it goes towards -x.
    rolled = rolling * rotation[:, None] * leg.mount.rotate((1.0, 0.0))[:2]
    bodies = leg.masses.bodies if leg.masses else ()
    centre = np.zeros(CUBIC_SAMPLES, dtype=np.complex128)
    total = sum(body.mass for body in bodies) or 1.0
    for j, body in enumerate(bodies):
        centre += body.mass / total * moving.fixed_to(j, body.centre)[0]
    return np.concatenate([foot, rolled, leg.mount.transform(plane_vectors(centre))], axis=1)
