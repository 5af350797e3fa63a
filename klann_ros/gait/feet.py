"""Where the feet and the centre of mass of a walker are, for any angles of its cranks."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from klann_ros.dynamics.motion import body_motion, BodyMotion
from klann_ros.kinematics import foot_path, LinkageLeg, turns_fully
from klann_ros.kinematics.angles import TURN
from klann_ros.robot import Robot, RobotLeg
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
# Angles a turn between which a cubic is within 1e-9 of a leg's size.
CUBIC_SAMPLES = 720
_POWERS = np.arange(4.0)


class NoWalkerError(ValueError):
    """A robot that cannot walk; the text says why."""


@dataclass(frozen=True, eq=False)
class Placed:
    """Feet and centre of mass in base_link; over many poses."""

    # Where the n feet touch the ground, shape (..., n, 3) [m].
    feet: Array
    # Rolling displacement of the spherical feet, shape (..., n, 2) [m]: a foot that rolls moves
    # without sliding.
    rolled: Array
    # The centre of mass of all, shape (..., 3) [m].
    centre: Array


class Feet:
    """
    The feet of a robot over the angles of its cranks.

    A turn of each leg is computed once, as a table of points and derivatives, between which a
    cubic is exact to some 1e-10 m.

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

    Raises
    ------
    NoWalkerError
        It has less than three legs, or one that does not turn fully.

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
        self.crank_of = np.array([self.joints.index(leg.crank_joint) for leg in robot.legs])
        # Intervals of the table, by leg and angle.
        per_radian = CUBIC_SAMPLES / TURN
        self._scales = np.array([leg.direction * per_radian for leg in robot.legs])
        self._starts = np.array([leg.phase * per_radian for leg in robot.legs])
        masses = [leg.masses.total if leg.masses else 0.0 for leg in robot.legs]
        body = robot.body
        self._total = sum(masses) + (body.mass if body else 0.0)
        self._shares = np.array(masses) / (self._total or 1.0)
        self._fixed = np.zeros(3)
        if body is not None:
            self._fixed = np.array(body.centre) * body.mass / self._total
        # By leg and interval, by column, by power.
        self._cubics = np.concatenate([_leg_cubics(leg, foot_radius) for leg in robot.legs])
        self._rows = CUBIC_SAMPLES * np.arange(len(robot.legs))

    @property
    def count(self) -> int:
        """Return how many feet there are."""
        return len(self.robot.legs)

    @cached_property
    def sides(self) -> Array:
        """Return on which side each crank drives: +1 left, -1 right, 0 both, shape (c,)."""
        # A crank whose legs are on both sides is in the middle, within a micrometre.
        every = [[leg.mount.xyz[1] for leg in self.robot.on_joint(each)] for each in self.joints]
        return np.array([float(min(y) > 1e-6) - float(max(y) < -1e-6) for y in every])

    @cached_property
    def senses(self) -> Array:
        """
        Return which way each crank turns to walk forwards, +1 or -1, shape (c,).

        Raises
        ------
        NoWalkerError
            The legs of a crank drive against each other, or to the sides only.

        """
        forwards = np.zeros(len(self.joints))
        for crank, leg in zip(self.crank_of, self.robot.legs, strict=True):
            drive = foot_path(LinkageLeg(leg.linkage)).stance().speed(leg.direction)
            forwards[crank] += drive * leg.mount.rotate((1.0, 0.0))[0]
        for joint, forward in zip(self.joints, forwards.tolist(), strict=True):
            if abs(forward) < 1e-6 * self.reach:
                raise NoWalkerError(f'the legs of {joint} drive the robot nowhere')
        return np.sign(forwards)

    @cached_property
    def reach(self) -> float:
        """Return the greatest distance of a foot from base_link over the ground [m]."""
        values = self._values(np.linspace(0.0, TURN, 60)[:, None] * np.ones(len(self.joints)))
        return float(np.hypot(*values[..., :2].T).max())

    @cached_property
    def gyration(self) -> float:
        """Return the radius of gyration about the vertical [m]; half the reach without masses."""
        if not self._total:
            return self.reach / 2.0
        values = self._values(np.linspace(0.0, TURN, 12)[:, None] * np.ones(len(self.joints)))
        squares = float(self._shares @ (values[..., 5:7] ** 2).sum(axis=-1).mean(axis=0))
        body = self.robot.body
        if body is not None:
            x, y, _ = body.centre
            squares += body.inertia[2] / self._total + (x**2 + y**2) * body.mass / self._total
        return float(np.sqrt(squares))

    def at(self, cranks: ArrayLike) -> Placed:
        """Return where the feet are at angles of the cranks [rad], shape (..., c)."""
        values = self._values(cranks)
        centre = self._fixed + self._shares @ values[..., 5:]
        return Placed(values[..., :3], values[..., 3:5], centre)

    def pose(
        self, cranks: Sequence[float]
    ) -> tuple[list[list[float]], list[list[float]], list[float]]:
        """Return feet, rolling and centre of mass of one pose: `at`, in plain numbers."""
        values = self._values(cranks)
        centre, rows = self._fixed + self._shares @ values[:, 5:], values.tolist()
        return [row[:3] for row in rows], [row[3:5] for row in rows], centre.tolist()

    def _values(self, cranks: ArrayLike) -> Array:
        """Return foot, rolling and centre of mass of each leg, shape (..., n, 8)."""
        angles = np.asarray(cranks, dtype=np.float64).take(self.crank_of, axis=-1)
        turned = angles * self._scales + self._starts
        whole = np.floor(turned)
        powers = (turned - whole)[..., None] ** _POWERS
        cubic = self._cubics.take(whole.astype(np.int64) % CUBIC_SAMPLES + self._rows, axis=0)
        return np.asarray((cubic @ powers[..., None])[..., 0], dtype=np.float64)


def _leg_cubics(leg: RobotLeg, radius: float) -> Array:
    """Return a turn in base_link: by interval, column and power of t from 0 to 1 in it."""
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
    # A foot link that turns fully would roll on without bound; no such leg stands on its foot.
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
