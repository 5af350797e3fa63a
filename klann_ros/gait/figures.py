"""What a walker does over a turn of its cranks, before anything is built."""

from cmath import rect
from dataclasses import dataclass

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray, with_short_repr
from klann_ros.robot import Robot
import numpy as np

from .feet import CUBIC_SAMPLES, Feet
from .stance import body_displacement, edge_distance, from_above, stance_pose, support


@with_short_repr
@dataclass(frozen=True, eq=False)
class GaitFigures:
    """
    A turn of a walker whose cranks turn alike, forwards, on level ground.

    Where the body's centre of mass is outside of all feet, it does not rest: supports are empty,
    the margin is negative, and the attitude NaN.
    """

    legs: tuple[str, ...]  #: their names
    alphas: FloatArray  #: rotation of the cranks, evenly over a turn from 0 on, shape (k,) [rad]
    loads: FloatArray  #: the part of the weight that each foot carries, shape (k, n)
    height: FloatArray  #: of base_link's origin above the ground, shape (k,) [m]
    roll: FloatArray  #: as in REP 103, shape (k,) [rad]
    pitch: FloatArray
    margin: FloatArray  #: the static margin, shape (k,) [m]
    #: The pose after each step: x, y [m] and yaw [rad], shape (k, 3); the last is that of a turn.
    advance: FloatArray
    slid: float  #: how far its feet slide in the turn, each by the weight that it carries [m]

    @property
    def stride(self) -> float:
        """Return how far it walks in a turn [m]."""
        return float(self.advance[-1, 0])

    @property
    def speed(self) -> float:
        """Return the mean speed at a crank rate of 1 rad/s [m/rad]."""
        return self.stride / TURN

    @property
    def height_variation(self) -> float:
        """Return how far the body goes up and down [m]."""
        return float(np.nanmax(self.height) - np.nanmin(self.height))

    @property
    def greatest_pitch(self) -> float:
        """Return the largest magnitude of the pitch [rad]."""
        return float(np.nanmax(np.abs(self.pitch)))

    @property
    def greatest_roll(self) -> float:
        """Return the largest magnitude of the roll [rad]."""
        return float(np.nanmax(np.abs(self.roll)))

    @property
    def least_margin(self) -> float:
        """Return the least static margin [m]."""
        return float(self.margin.min())

    @property
    def stable_fraction(self) -> float:
        """Return the part of the turn during which the body rests on its feet."""
        return float(np.mean(self.margin >= 0.0))

    @property
    def warnings(self) -> list[str]:
        """Return the warnings about the walker, a line each."""
        unstable = 1.0 - self.stable_fraction
        if unstable > 0.5:
            text = (
                f'it is statically unstable for {unstable:.0%} of a turn: its centre of mass is '
                'not above its feet; check body_centre, mount_xyz and phase'
            )
            return [text]
        text = (
            'it walks backwards: its feet on the ground move forwards in base_link where '
            'their stance moves back; check mount_rpy (x forward, y left, z up) and direction'
        )
        return [text] if self.speed < 0.0 else []

    def support_patterns(self) -> dict[tuple[str, ...], float]:
        """Return the part of the turn on each group of feet, the longest first."""
        groups, counts = np.unique(self.loads > 0.0, axis=0, return_counts=True)
        order = np.argsort(-counts, kind='stable')
        names = np.array(self.legs, dtype=object)
        return {tuple(names[groups[k]]): float(counts[k]) / len(self.alphas) for k in order}


def walk_figures(
    robot: Robot, *, foot_radius: float = 0.0, samples: int = CUBIC_SAMPLES
) -> GaitFigures:
    """
    Return what a walker does over a turn of its cranks.

    Parameters
    ----------
    robot : Robot
        The walker; without masses its centre of mass is base_link's origin.
    foot_radius : float
        Radius of its feet, which are balls [m].
    samples : int
        Into how many steps the turn is divided.

    Raises
    ------
    NoWalkerError
        It has less than three legs, or one that does not turn fully.

    """
    feet = Feet(robot, foot_radius=foot_radius)
    alphas = np.linspace(0.0, TURN, samples + 1)
    poses = zip(*feet.at(alphas[:, None] * feet.senses).tolist(), strict=True)
    place = 0j
    yaw = slid = 0.0
    path = []
    loads = np.zeros((samples + 1, len(robot.legs)))
    # Height, roll, pitch and margin.
    stances = np.full((samples + 1, 4), np.nan)
    last_pose = facet = None
    for k, (points, rolled, centre) in enumerate(poses):
        # Without support it falls, to an unknown pose.
        pose = None
        if standing := support(points, centre, facet):
            facet = standing.facet
            pose = stance_pose(points, rolled, standing)
            loads[k, list(standing.feet)] = standing.loads
            stances[k] = standing.height, standing.roll, standing.pitch, standing.margin
        else:
            *flat, flat_centre = from_above([*points, centre])
            stances[k, 3] = -edge_distance(flat, flat_centre)
        if last_pose and pose:
            step = body_displacement(last_pose, pose)
            place += step.motion * rect(1.0, yaw + step.yaw / 2.0)
            yaw += step.yaw
            slid += step.slid
        last_pose = pose
        path.append((place.real, place.imag, yaw))
    height, roll, pitch, margin = stances[:-1].T
    legs = tuple(leg.name or str(index) for index, leg in enumerate(robot.legs))
    advance = np.array(path[1:])
    return GaitFigures(legs, alphas[:-1], loads[:-1], height, roll, pitch, margin, advance, slid)
