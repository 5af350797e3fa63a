"""Random tasks of four-bars, and their motion traced step by step: the oracle of synthesis."""

from collections.abc import Iterator
import math
from math import pi

from klann_ros.kinematics import FourBar, FourBarGeometry, GeometryError, UnreachableError
from klann_ros.kinematics.linkage.reach import crank_limits
from klann_ros.synthesis import place, PlacedFourBar
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


def with_positions(
    linkage: PlacedFourBar, thetas: list[float], flip: int | None = None
) -> PlacedFourBar:
    """Return a four-bar with its positions, one of them in the other assembly mode."""
    positions = [linkage.at(theta) for theta in thetas]
    if flip is not None:
        other = place(linkage.geometry.mirrored(), thetas[flip])
        coupler_point = other.a + linkage.coupler_vector * (other.b - other.a)
        positions[flip] = positions[flip]._replace(a=other.a, b=other.b, p=coupler_point)
    return PlacedFourBar(linkage.o2, linkage.o4, *positions[0], tuple(positions))


def trace(linkage: PlacedFourBar, sense: float) -> Iterator[tuple[float, float]]:
    """Yield crank angles and rocker angles of a motion until the crank stops, or a turn."""
    start = linkage.thetas[0]
    for k in range(TRACE):
        theta = start + sense * 2.0 * pi * k / TRACE
        try:
            yield theta, float(np.angle(linkage.at(theta).b - linkage.o4))
        except UnreachableError:
            return


def is_traced(linkage: PlacedFourBar) -> bool:
    """Return whether a trace meets all positions in their order."""
    wanted = [
        (p, float(np.angle(q.b - linkage.o4)))
        for p, q in zip(linkage.thetas, linkage.positions, strict=True)
    ]
    for sense in (1.0, -1.0):
        met = 0
        for theta, rocker in trace(linkage, sense):
            if met < len(wanted):
                away = abs(math.remainder(theta - wanted[met][0], 2 * pi))
                same_rocker = abs(math.remainder(rocker - wanted[met][1], 2 * pi)) < 0.05
                met += away <= pi / TRACE * 1.001 and same_rocker
        if met == len(wanted):
            return True
    return False


def is_joined(linkage: PlacedFourBar, start: float, end: float) -> bool:
    """Return whether the crank goes from one angle to another, either way round."""
    bar = FourBar(*linkage.geometry.lengths, linkage.geometry.assembly)

    def closes(theta: float) -> bool:
        try:
            bar.closed_form(theta)
        except UnreachableError:
            return False
        return True

    ways = (end - start, end - start - math.copysign(2.0 * pi, end - start))
    return any(all(closes(start + way * k / 240) for k in range(241)) for way in ways)
