"""Random tasks of four-bars, and their motion traced step by step: the oracle of synthesis."""

import math
from math import pi

from klann_ros.kinematics import FourBar, FourBarGeometry, GeometryError
from klann_ros.kinematics.linkage.reach import crank_limits
from klann_ros.synthesis import place, PlacedFourBar, Position
import numpy as np

# Steps of the crank in a trace of a turn.
TRACE = 720


def random_task(rng: np.random.Generator, count: int) -> tuple[PlacedFourBar, list[float]]:
    """Return a four-bar and crank angles of one assembly mode, apart from each other."""
    while True:
        ground, crank, coupler, rocker = rng.uniform(0.3, 1.5, 4).tolist()
        mode = int(rng.choice([-1, 1]))
        try:
            geometry = FourBarGeometry(ground, crank, coupler, rocker, mode)
        except GeometryError:
            continue
        near, far = crank_limits(geometry.lengths)
        gaps = rng.uniform(0.2, 1.0, count + 1)
        first = -far if near == 0.0 else near
        ends = first + (far - first) * np.cumsum(gaps) / gaps.sum()
        thetas = [math.remainder(theta, 2.0 * pi) for theta in rng.permutation(ends[:-1])]
        bar = FourBar(*geometry.lengths, geometry.assembly)
        if all(math.sin(bar.transmission_angle(theta)) > 0.05 for theta in thetas):
            return place(geometry, thetas[0], *rng.uniform(-1.0, 1.0, 2)), thetas


def position_at(linkage: PlacedFourBar, theta2: float) -> Position:
    """Return the position at a crank angle from the ground, in the first assembly mode."""
    (a, b, _), axis = place(linkage.geometry, theta2).positions[0], linkage.o4 - linkage.o2
    a, b = (linkage.o2 + axis / abs(axis) * x for x in (a, b))
    return Position(a, b, a + linkage.coupler_vector * (b - a))


def with_positions(
    linkage: PlacedFourBar, thetas: list[float], flip: int | None = None
) -> PlacedFourBar:
    """Return a four-bar with its positions, one of them in the other assembly mode."""
    positions = [position_at(linkage, theta) for theta in thetas]
    if flip is not None:
        a, b, _ = place(linkage.geometry.mirrored(), thetas[flip]).positions[0]
        positions[flip] = Position(a, b, a + linkage.coupler_vector * (b - a))
    return PlacedFourBar(linkage.o2, linkage.o4, tuple(positions))


def rockers(linkage: PlacedFourBar, thetas: np.ndarray) -> np.ndarray:
    """Return the rocker's directions at crank angles, where two circles meet; else NaN [rad]."""
    ground, crank, coupler, rocker = linkage.geometry.lengths
    axis = (linkage.o4 - linkage.o2) / ground
    arms = crank * np.exp(1j * thetas) - ground
    reach = np.abs(arms)
    along = (reach**2 + rocker**2 - coupler**2) / (2.0 * reach)
    with np.errstate(invalid='ignore'):
        across = np.sqrt(rocker**2 - along**2)
    turns: np.ndarray = np.angle(axis * arms * (along - 1j * linkage.geometry.assembly * across))
    return turns


def is_traced(linkage: PlacedFourBar) -> bool:
    """Return whether a motion by small steps of the crank meets all positions in their order."""
    directions = [float(np.angle(position.b - linkage.o4)) for position in linkage.positions]
    for sense in (1.0, -1.0):
        angles = linkage.thetas[0] + sense * 2.0 * pi * np.arange(TRACE) / TRACE
        rocker_angles = rockers(linkage, angles)
        # The crank stops where the bars do not reach.
        end = np.flatnonzero(np.isnan([*rocker_angles, np.nan]))[0]
        first = 0
        for theta, direction in zip(linkage.thetas, directions, strict=True):
            is_met = remainder(angles - theta) <= pi / TRACE * 1.001
            is_met &= remainder(rocker_angles - direction) < 0.05
            steps = np.flatnonzero(is_met[first:end])
            if not len(steps):
                break
            first += int(steps[0]) + 1
        else:
            return True
    return False


def remainder(angles: np.ndarray) -> np.ndarray:
    """Return how far angles are from whole turns [rad]."""
    gaps: np.ndarray = np.abs((angles + pi) % (2.0 * pi) - pi)
    return gaps


def is_joined(linkage: PlacedFourBar, start: float, end: float) -> bool:
    """Return whether the crank goes from one angle to another, either way round."""
    ways = (end - start, end - start - math.copysign(2.0 * pi, end - start))
    shares = np.linspace(0.0, 1.0, 241)
    return any(not np.isnan(rockers(linkage, start + way * shares)).any() for way in ways)
