"""
The motion of a walker's body by the phases of its left and right cranks.

With a and b for the phases of left and right, p = (a + b) / 2 is their mean and q = (b - a) / 2
half their difference. At each (p, q) the body rests on the most upright facet of its feet and
moves so that frictional dissipation is minimal, as in `stance.minimize_slip`. In the mean over q
the twist is linear in p' and q' within a few per cent.
"""

from collections.abc import Sequence
from itertools import combinations

from klann_ros.kinematics.angles import TURN
import numpy as np
from numpy.typing import NDArray

from .feet import Feet

Array = NDArray[np.float64]
# Points of a map in a turn of p, and of q: its means are within 0.5 % of those of 192.
MAP_POINTS = 64
# Step of phase derivatives [rad].
PHASE_STEP = 1e-5
# A facet of a smaller projected area is vertical [m^2]; the tolerance of an edge.
MIN_PROJECTED_AREA, ROUNDING = 1e-6, 1e-9
# Iteratively reweighted least squares: steps, and the relative slip of a foot that sticks.
ITERATIONS, STICK_TOLERANCE = 12, 1e-3


class PhasePoses:
    """
    A walker in pairs of crank phases, and how its standing feet move there.

    Parameters
    ----------
    feet : Feet
        The walker's.
    left, right : numpy.ndarray, shape (c,)
        Rotation of each crank when the left, or the right side turns by 1 rad.
    phases : numpy.ndarray, shape (k, 2)
        Phases of the left and the right side [rad].

    """

    def __init__(self, feet: Feet, left: Array, right: Array, phases: Array) -> None:
        cranks = phases[:, :1] * left + phases[:, 1:] * right
        placed = feet.at(cranks)
        facets, loads = _facets(placed.feet, placed.centre)
        self._rests = np.asarray(loads.any(axis=1))
        cranks, facets = cranks[self._rests], facets[self._rests]
        # Seen from the ground, so that a tilt moves no foot.
        ground = np.array([0.0, 0.0, placed.feet[..., 2].min(axis=1).mean()])

        def level(angles: Array) -> Array:
            at = feet.at(angles)
            chosen = np.arange(len(facets))[:, None], facets
            return _level(at.feet[chosen] - ground) + at.rolled[chosen]

        flat = level(cranks)
        self._arms = np.stack([-flat[..., 1], flat[..., 0]], axis=-1)
        self._slopes = [
            (level(cranks + PHASE_STEP * each) - level(cranks - PHASE_STEP * each))
            / (2.0 * PHASE_STEP)
            for each in (left, right)
        ]
        self._loads = loads[self._rests]

    def twists(self, left: float, right: float) -> Array:
        """
        Return speed [m/s] and yaw rate [rad/s] at rates of the sides [rad/s], shape (k, 2).

        Zero where the body does not rest.
        """
        moves = left * self._slopes[0] + right * self._slopes[1]
        scale = np.abs(moves).sum(axis=-1).max(axis=-1, keepdims=True)
        least = (STICK_TOLERANCE * scale) ** 2 + np.finfo(float).tiny
        x, yaw = _balance(self._loads, moves, self._arms)
        for _ in range(ITERATIONS):
            slides = moves + x[:, None] + yaw[:, None, None] * self._arms
            weights = self._loads / np.sqrt((slides**2).sum(axis=-1) + least)
            x, yaw = _balance(weights, moves, self._arms)
        found = np.zeros((len(self._rests), 2))
        found[self._rests] = np.stack([x[:, 0], yaw], axis=-1)
        return found


def phase_map(
    feet: Feet, left: Array, right: Array, points: int = MAP_POINTS
) -> tuple[Array, Array]:
    """
    Return the twist on a grid of p and q, at p' = 1 rad/s and at q' = 1 rad/s.

    Parameters
    ----------
    feet : Feet
        The walker's.
    left, right : numpy.ndarray, shape (c,)
        Rotation of each crank when the left, or the right side turns by 1 rad.
    points : int
        Points in a turn of p, and of q: the middles of as many equal intervals from 0 on.

    Returns
    -------
    straight, turning : numpy.ndarray, shape (points, points, 2)
        Speed [m/rad] and rotation [rad/rad], by p and by q.

    """
    p, q = np.meshgrid(*2 * [(np.arange(points) + 0.5) * (TURN / points)], indexing='ij')
    poses = PhasePoses(feet, left, right, np.stack([(p - q).ravel(), (p + q).ravel()], axis=-1))
    straight, turning = (
        poses.twists(*rates).reshape(points, points, 2) for rates in ((1.0, 1.0), (-1.0, 1.0))
    )
    return straight, turning


def _facets(feet: Array, centre: Array) -> tuple[NDArray[np.int64], Array]:
    """Return the most upright facet below each centre, (k, 3), and its loads: 0 without one."""
    count = len(feet)
    best = np.full(count, np.inf)
    facets, loads = np.zeros((count, 3), dtype=np.int64), np.zeros((count, 3))
    for triple in combinations(range(feet.shape[1]), 3):
        a, b, c = (feet[:, i] for i in triple)
        normal = np.cross(b - a, c - a)
        is_facet = np.abs(normal[:, 2]) > MIN_PROJECTED_AREA
        slope = normal[:, :2] / np.where(is_facet, normal[:, 2], np.inf)[:, None]
        level = a[:, 2] + _dot(a[:, :2], slope)
        steepness = 1.0 + _dot(slope, slope)
        above = (feet[..., 2] + _dot(feet[..., :2], slope[:, None])).min(axis=1)
        found = np.flatnonzero(is_facet & (above >= level - ROUNDING) & (steepness < best))
        middle, tilt = centre[found], slope[found]
        height = (middle[:, 2] + _dot(middle[:, :2], tilt) - level[found]) / steepness[found]
        over = middle[:, :2] - height[:, None] * tilt
        p, q, r = (feet[found, i, :2] - over for i in triple)
        shares = np.stack([_cross(q, r), _cross(r, p), _cross(p, q)], axis=-1)
        shares /= shares.sum(axis=-1, keepdims=True)
        holds = shares.min(axis=-1) >= -ROUNDING
        found = found[holds]
        best[found], facets[found], loads[found] = steepness[found], triple, shares[holds]
    return facets, np.maximum(loads, 0.0)


def _level(feet: Array) -> Array:
    """Return three feet in the frame in which their plane is level, seen from above, (k, 3, 2)."""
    normal = np.cross(feet[:, 1] - feet[:, 0], feet[:, 2] - feet[:, 0])
    normal *= (np.sign(normal[:, 2]) / np.linalg.norm(normal, axis=1))[:, None]
    nx, ny, nz = (n[:, None] for n in normal.T)
    across = np.hypot(ny, nz)
    x, y, z = np.moveaxis(feet, -1, 0)
    return np.stack([across * x - nx * (ny * y + nz * z) / across, (nz * y - ny * z) / across], -1)


def _balance(weights: Array, moves: Array, arms: Array) -> tuple[Array, Array]:
    """Return d and psi of the weighted least squares of moves + d + psi arms."""
    whole = weights.sum(axis=-1)
    by = weights[..., None]
    along, arm = (by * moves).sum(axis=1), (by * arms).sum(axis=1)
    below = (by * arms * arms).sum(axis=(1, 2)) - _dot(arm, arm) / whole
    yaw = (_dot(arm, along) / whole - (by * arms * moves).sum(axis=(1, 2))) / below
    return -(along + yaw[:, None] * arm) / whole[:, None], yaw


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=-1), dtype=np.float64)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], dtype=np.float64)


def are_mirrored(feet: Feet, sides: Sequence[tuple[Array, Array]], tolerance: float) -> bool:
    """
    Return whether the right side of a walker is the left one in a mirror, but for its phase.

    Parameters
    ----------
    feet : Feet
        The walker's.
    sides : 2 tuples of numpy.ndarray
        What each crank turns when the left, or the right side turns by 1 rad; shape (c,), and
        whether each leg is on that side, shape (n,).
    tolerance : float
        Of positions [m].

    """
    (left, on_left), (right, on_right) = sides
    if on_left.sum() != on_right.sum() or (on_left == on_right).any():
        return False
    a, b = np.random.default_rng(0).uniform(0.0, TURN, (2, 12, 1))
    phases = np.array([leg.phase for leg in feet.robot.legs])
    differences = np.subtract.outer(phases[on_right], phases[on_left]).ravel()
    mirror = np.array([1.0, -1.0, 1.0])
    for shift in np.unique(np.round(np.concatenate([differences, -differences]) % TURN, 9)):
        one = feet.at(a * left + (b + shift) * right)
        other = feet.at(b * left + (a + shift) * right)
        if np.abs(one.centre * mirror - other.centre).max() > tolerance:
            continue
        pairs = ((one.feet, other.feet), (other.feet, one.feet))
        if all(_are_paired(p[:, on_left] * mirror, q[:, on_right], tolerance) for p, q in pairs):
            return True
    return False


def _are_paired(feet: Array, others: Array, tolerance: float) -> bool:
    """Return whether each foot is where the same one of the others is, in all poses."""
    apart = np.abs(feet[:, :, None] - others[:, None]).max(axis=(0, 3))
    return bool((apart.min(axis=0) < tolerance).all() and (apart.min(axis=1) < tolerance).all())
