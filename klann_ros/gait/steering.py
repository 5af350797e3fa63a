"""
Crank rates for a motion of the body, and the motion at crank rates.

Cranks on the left get one rate, those on the right another, and cranks with legs on both sides
their mean. Speed and yaw rate are means over all phases of both, linear in the rates; straight on,
where all cranks keep the phases of the gait, the speed is that of the gait. Where the robot is its
own mirror image, mirrored rates give mirrored motions, to the last digit.

With a and b for the phases of left and right, p = (a + b) / 2 is their mean and q = (b - a) / 2
half their difference. At each (p, q) the body rests on the most upright facet of its feet and
moves so that frictional dissipation is minimal, as in `stance.minimize_slip`. In the mean over q
the twist is linear in p' and q' within a few per cent: speed comes from p' and yaw from q'.

The yaw for q' depends on p by up to 30 times: where the standing feet of both sides are at the
wrong ends of the body, their drives cancel. On the spot p stands still, so a walker may hardly
turn for minutes; in a tight curve one side hardly turns, to the same effect. So q moves where
turning is effective,

    q' = w s(p) G(p) / (M d(p) max(g(p, q), r G(p))),   p' = v / (V d(p)),

g being the yaw gain, G its mean over q, V the speed gain, s ~ G^n with mean 1, M the mean of s G,
r and n tuning, and d = 1 - T + T s G / M the relative time at a phase, with mean 1: T of the time
is for turning, the rest for walking on. On the spot p stays where min(g, mean g) has the greatest
mean over q; walking there makes up for the drift of the body, and q' for the yaw by that.
"""

from collections.abc import Sequence
from itertools import combinations
from math import floor
from operator import mul
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import TURN, wrap
from klann_ros.kinematics.arrays import ComplexArray, FloatArray, IntArray
import numpy as np

from .feet import CUBIC_SAMPLES, Feet
from .stance import FootMotion, ITERATIONS, least_squares, STICK_TOLERANCE

# Points of a map in a turn of p, and of q: its means are within 0.5 % of those of 192.
MAP_POINTS = 64


def phase_twists(
    feet: Feet, sides: FloatArray, phases: FloatArray, *rates: tuple[float, float]
) -> list[FloatArray]:
    """
    Return speed [m/s] and yaw rate [rad/s], shape (..., 2), in pairs of phases for pairs of rates.

    Phases are those of the left and the right side [rad], shape (..., 2), and rates theirs
    [rad/s]; `sides` holds the rotations of each crank for 1 rad of a side, shape (2, c). The twist
    is zero where the body does not rest.
    """
    cranks = phases.reshape(-1, 2) @ sides
    placed = feet.at(cranks)
    facets, loads = _facets(placed.feet, placed.centre)
    rests = np.asarray(loads.any(axis=1))
    # By foot and pose from here on.
    cranks = cranks[rests]
    facets = facets[rests].T
    loads = loads[rests].T
    standing = np.arange(len(cranks)), facets
    # Seen from the ground, so that a tilt moves no foot.
    ground = np.array([0.0, 0.0, placed.feet[..., 2].min(axis=1).mean()])

    def level(angles: FloatArray) -> ComplexArray:
        turned = feet.at(angles)
        return _level(turned.feet[standing] - ground) + _flat(turned.rolled[standing])

    arms = 1j * level(cranks)
    # Step of the central differences [rad].
    step = 1e-5
    twists = []
    for rate in rates:
        change = step * (rate @ sides)
        moves = (level(cranks + change) - level(cranks - change)) / (2.0 * step)
        pose_twists = np.zeros((len(rests), 2))
        pose_twists[rests] = _least_slip([*map(FootMotion, moves, arms, loads)])
        twists.append(pose_twists.reshape(phases.shape))
    return twists


def phase_map(
    feet: Feet, sides: FloatArray, points: int = MAP_POINTS
) -> tuple[FloatArray, FloatArray]:
    """
    Return the twist on a grid of p and q, at p' = 1 rad/s and at q' = 1 rad/s.

    The grid is the middles of equal intervals of a turn of both, an even number of points; the
    twist has speed [m/rad] and rotation [rad/rad] along its last axis.
    """
    angles = (np.arange(points) + 0.5) * (TURN / points)
    half = points // 2
    p, q = np.meshgrid(angles[:half], angles, indexing='ij')
    phases = np.stack([p - q, p + q], axis=-1)
    # Half a turn of both p and q is a turn of the right side.
    straight, turning = phase_twists(feet, sides, phases, (1.0, 1.0), (-1.0, 1.0))
    whole_straight = np.concatenate([straight, np.roll(straight, half, axis=1)])
    whole_turning = np.concatenate([turning, np.roll(turning, half, axis=1)])
    return whole_straight, whole_turning


class TurnPlan:
    """
    Rates of p and q, by p and q.

    `speed` and the yaw rate `crossed` at p' = 1 rad/s and the `yaw` rate at q' = 1 rad/s are those
    of `phase_map`, shape (n, n). It `is_possible` if in some phases q' turns it to the left.
    """

    # Its tuning was chosen in MuJoCo on two robots, see `benchmarks/walk.py --grid`.
    # Exponent of the gain: how narrow the range of p is in which a walker turns.
    sharpness = 2.0
    # Least ratio of local to mean gain that q' is raised for.
    min_ratio = 0.2
    # Standard deviation of the gains' low-pass filter over p and q [rad].
    gain_filter = 0.1
    # p' in phases in which it cannot turn, at least, as a part of the rate for turning.
    passing_rate = 0.6
    # p' towards the best phase, on the spot, as a part of that rate; the distance from which on it
    # is slower [rad]; and the part of it that walking on the spot may have, so that p stays near.
    seeking_rate = 2.0
    seeking_range = 0.3
    hold_share = 1.2
    # Multiple of the variation of the speed over q by which walking on the spot follows it.
    step_swing = 1.5
    # Phases that turn it this evenly, as a part of the most even ones, are as good on the spot.
    even_ratio = 0.995
    # Greatest q' that is raised for phases which hardly turn it, on the spot [rad/s].
    hurry_rate = 2.5
    # Greatest part of the yaw rate on the spot that comes from p', which q' makes up for.
    walking_yaw = 0.5
    # Least relative time at a phase.
    min_density = 0.02

    def __init__(self, speed: FloatArray, yaw: FloatArray, crossed: FloatArray) -> None:
        smooth = _low_pass(yaw, self.gain_filter)
        gain = np.maximum(smooth.mean(axis=1), 0.0)
        self.is_possible = bool(gain.any() and yaw.mean() > 0.0)
        if not self.is_possible:
            return
        self._count = len(yaw)
        share = gain**self.sharpness / (gain**self.sharpness).mean()
        effective = float((share * gain).mean())
        # The part of q' that is needed where turning is effective.
        self._part = float(yaw.mean()) / effective
        self._turning = (share * self._part).tolist()
        self._time = (share * gain / effective).tolist()
        ratio = smooth / np.maximum(gain, np.finfo(float).tiny)[:, None]
        self._boost = (1.0 / np.maximum(ratio, self.min_ratio)).tolist()
        steps = _low_pass(speed, self.gain_filter) / speed.mean()
        self._crossed = (_low_pass(crossed, self.gain_filter) / yaw.mean()).tolist()
        swing = self.step_swing * (steps - steps.mean(axis=1)[:, None])
        self._step = (1.0 + swing).tolist()
        # There the supports of left and right do not change at once, which stops the turn.
        even = np.minimum(smooth, yaw.mean()).mean(axis=1)
        best = np.flatnonzero(even >= self.even_ratio * even.max())
        self._best_phases: list[float] = ((best + 0.5) * (TURN / self._count)).tolist()

    def rates(
        self, p: float, q: float, walking: float, turning: float, *, on_spot: bool = False
    ) -> tuple[float, float]:
        """
        Return p' and q' [rad/s] for `walking` and `turning`, their means over all phases [rad/s].

        With `on_spot` p stays at a best phase.
        """
        if not turning:
            return walking, 0.0
        effective = abs(turning) * self._part
        share = 1.0 if on_spot else 1.0 - min(0.5, abs(walking) / (self.passing_rate * effective))
        time = max(self.min_density, 1.0 + share * (_interpolated(self._time, p) - 1.0))
        turns = turning * _interpolated(self._turning, p) / time
        boosted = turns * _interpolated(self._boost, p, q)
        if not on_spot:
            return walking / time, boosted
        max_rate = self.seeking_rate * effective
        # Walking in phases in which a step is long, and back where it is short.
        walks = clip(walking * _interpolated(self._step, p, q), self.hold_share * max_rate)
        distance = min((wrap(best - p) for best in self._best_phases), key=abs)
        walks += max_rate * clip(distance / self.seeking_range, 1.0)
        crossed = walks * _interpolated(self._crossed, p, q) / turning
        crossed_share = clip(crossed, self.walking_yaw)
        walks *= crossed_share / crossed if crossed else 1.0
        turns_on_spot = boosted * (1.0 - crossed_share)
        return walks, clip(turns_on_spot, max(self.hurry_rate, abs(turns)))


def _facets(feet: FloatArray, centre: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the most upright facet below each centre, (k, 3), and its loads: 0 without one."""
    # A facet of a smaller projected area is vertical [m^2]; the tolerance of an edge.
    vertical = 1e-6
    rounding = 1e-9
    count = len(feet)
    min_steepness = np.full(count, np.inf)
    facets = np.zeros((count, 3), dtype=np.int64)
    loads = np.zeros((count, 3))
    flat = _flat(feet)
    flat_centre = _flat(centre)
    for triple in combinations(range(feet.shape[1]), 3):
        a, b, c = feet[:, triple].swapaxes(0, 1)
        nx, ny, nz = np.cross(b - a, c - a).T
        is_facet = np.abs(nz) > vertical
        slope = (nx - 1j * ny) / np.where(is_facet, nz, np.inf)
        above = feet[..., 2] + (slope[:, None] * flat).real
        level = above[:, triple[0]]
        steepness = 1.0 + np.abs(slope) ** 2
        is_lowest = above.min(axis=1) >= level - rounding
        poses = np.flatnonzero(is_facet & is_lowest & (steepness < min_steepness))
        height = centre[poses, 2] + (slope[poses] * flat_centre[poses]).real - level[poses]
        below = flat_centre[poses] - height / steepness[poses] * slope[poses].conj()
        p, q, r = flat[poses][:, triple].T - below
        shares = np.stack([q.conj() * r, r.conj() * p, p.conj() * q], axis=-1).imag
        shares /= shares.sum(axis=-1, keepdims=True)
        is_carried = shares.min(axis=-1) >= -rounding
        poses = poses[is_carried]
        min_steepness[poses] = steepness[poses]
        facets[poses] = triple
        loads[poses] = shares[is_carried]
    return facets, np.maximum(loads, 0.0)


def _flat(points: FloatArray) -> ComplexArray:
    """Return points seen from above: x + jy."""
    return np.asarray(points[..., 0] + 1j * points[..., 1])


def _level(feet: FloatArray) -> ComplexArray:
    """Return three feet in the frame in which their plane is level, seen from above, (3, k)."""
    normal = np.cross(feet[1] - feet[0], feet[2] - feet[0])
    normal *= (np.sign(normal[:, 2]) / np.linalg.norm(normal, axis=1))[:, None]
    nx, ny, nz = normal.T
    x, y, z = np.moveaxis(feet, -1, 0)
    across = np.hypot(ny, nz)
    ahead = across * x - nx * (ny * y + nz * z) / across
    aside = (nz * y - ny * z) / across
    return np.asarray(ahead + 1j * aside)


def _least_slip(feet: Sequence[FootMotion]) -> FloatArray:
    """Return speed and yaw rate, (k, 2): `minimize_slip`, but five times as fast for a map."""
    scale = np.max([np.abs(foot.motion.real) + np.abs(foot.motion.imag) for foot in feet], axis=0)
    min_square = (STICK_TOLERANCE * scale) ** 2 + np.finfo(float).tiny
    motion, yaw = least_squares(feet)
    for _ in range(ITERATIONS):
        weighted = []
        for foot in feet:
            slip = np.abs(foot.motion + motion + yaw * foot.arm)
            weighted.append(foot._replace(load=foot.load / np.sqrt(slip**2 + min_square)))
        motion, yaw = least_squares(weighted)
    return np.stack([motion.real, yaw], axis=-1)


def _interpolated(samples: Sequence[Any], angle: float, *more_angles: float) -> float:
    """Return a periodic function of angles, given in the middles of equal intervals of each."""
    count = len(samples)
    position = angle / TURN * count - 0.5
    low = floor(position)
    low_value = samples[low % count]
    high_value = samples[(low + 1) % count]
    if more_angles:
        low_value = _interpolated(low_value, *more_angles)
        high_value = _interpolated(high_value, *more_angles)
    return float(low_value + (position - low) * (high_value - low_value))


def _low_pass(samples: FloatArray, width: float) -> FloatArray:
    """Return a periodic map through a Gaussian filter of a width [rad]."""
    order = np.fft.fftfreq(len(samples), 1.0 / len(samples)) * width
    weights = np.exp(-0.5 * (order[:, None] ** 2 + order**2))
    return np.asarray(np.fft.ifft2(np.fft.fft2(samples) * weights).real, dtype=np.float64)


def clip(number: float, bound: float) -> float:
    """Return a number within +- a bound."""
    return max(-bound, min(bound, number))


class Twist2D(NamedTuple):
    """How a body moves: forwards [m/s], and counter-clockwise seen from above [rad/s]."""

    linear: float
    angular: float


class Rates(NamedTuple):
    """How fast the sides drive, forwards being positive [rad/s]."""

    left: float
    right: float


class Steering:
    """
    Crank rates and motions of a walker on its `feet`.

    `speed` is that straight on at 1 rad/s, with all cranks in phase [m/rad]. It `can_turn` if it
    has cranks on the left and on the right; `turn_plan` holds the rates for turning, by phase.
    """

    def __init__(self, feet: Feet) -> None:
        self.feet = feet
        # The rotation of each crank when the left, or the right side turns by 1 rad.
        left_shares = (1.0 + feet.sides) / 2.0 * feet.senses
        right_shares = (1.0 - feet.sides) / 2.0 * feet.senses
        side_shares = np.array([left_shares, right_shares])
        self._shares: list[tuple[float, float]] = side_shares.T.tolist()
        in_phase = np.linspace(0.0, TURN, CUBIC_SAMPLES, endpoint=False)[:, None] * (1.0, 1.0)
        (twists,) = phase_twists(feet, side_shares, in_phase, (1.0, 1.0))
        self.speed = float(twists[:, 0].mean())
        is_left = feet.sides == 1.0
        is_right = feet.sides == -1.0
        self.can_turn = bool(is_left.any() and is_right.any())
        if not self.can_turn:
            return
        # The share of each crank in the mean phase of the left, and of the right side.
        self._left_weights = (is_left * feet.senses / is_left.sum()).tolist()
        self._right_weights = (is_right * feet.senses / is_right.sum()).tolist()
        walking, turning = phase_map(feet, side_shares)
        self.turn_plan = TurnPlan(walking[..., 0], turning[..., 1], walking[..., 1])
        # Speed and yaw rate at 1 rad/s of both sides, and of the right against the left.
        walking_speed, walking_yaw = walking.mean(axis=(0, 1)).tolist()
        turning_speed, turning_yaw = turning.mean(axis=(0, 1)).tolist()
        # Cross gains within the error of the map (`MAP_POINTS`) are those of a mirrored walker.
        is_straight = abs(walking_yaw) * feet.reach < 0.005 * abs(walking_speed)
        if is_straight and abs(turning_speed) < 0.005 * abs(turning_yaw) * feet.reach:
            walking_yaw = turning_speed = 0.0
        self._gains = walking_speed, walking_yaw, turning_speed, turning_yaw

    def crank_rates(self, rates: Rates) -> list[float]:
        """Return the rates of its cranks, in the order of `Feet.joints` [rad/s]."""
        return [left * rates.left + right * rates.right for left, right in self._shares]

    def motion(self, rates: Rates) -> Twist2D:
        """Return how the body moves at rates of the sides."""
        walking = (rates.left + rates.right) / 2.0
        turning = (rates.right - rates.left) / 2.0
        if turning == 0.0 or not self.can_turn:
            return Twist2D(self.speed * walking, 0.0)
        v, w, x, y = self._gains
        return Twist2D(v * walking + x * turning, w * walking + y * turning)

    @property
    def unit_motion(self) -> Twist2D:
        """Return the speed at 1 rad/s straight on, and the yaw rate at 1 rad/s on the spot."""
        return Twist2D(self.speed, self.motion(Rates(-1.0, 1.0)).angular)

    def rates(self, twist: Twist2D) -> Rates:
        """Return the rates of the sides for a motion; a walker that cannot turn does not."""
        walking, turning = self._mean_rates(twist)
        return Rates(walking - turning, walking + turning)

    def _mean_rates(self, twist: Twist2D) -> tuple[float, float]:
        """Return the mean rate of the sides, and half of their difference [rad/s]."""
        linear, angular = twist
        if abs(angular) < 1e-9 or not self.can_turn:
            return linear / self.speed, 0.0
        v, w, x, y = self._gains
        determinant = v * y - x * w
        walking = (linear * y - angular * x) / determinant
        turning = (angular * v - linear * w) / determinant
        return walking, turning

    def planned_rates(
        self, twist: Twist2D, cranks: list[float], *, on_spot: bool = False
    ) -> Rates:
        """
        Return the rates of the sides for a motion, at crank angles [rad].

        The motion is their mean over a cycle of phases, see `TurnPlan`.
        With `on_spot` the mean phase stays where turning is the most effective.
        """
        walking, turning = self._mean_rates(twist)
        if turning and self.turn_plan.is_possible:
            left = sum(map(mul, self._left_weights, cranks))
            right = sum(map(mul, self._right_weights, cranks))
            walking, turning = self.turn_plan.rates(
                (left + right) / 2.0, (right - left) / 2.0, walking, turning, on_spot=on_spot
            )
        return Rates(walking - turning, walking + turning)
