"""
The motion of a planar mechanism by the coordinates of its points alone: no code of ours.

No angle is an unknown. A link is two points at a fixed distance and others that are fixed complex
combinations of these two; a point in a slot has no component across the line of its carrier. So
all equations are quadratic: their coefficients follow from values at unit vectors, and derivatives
are exact. The motion is followed in steps of the crank, along the tangent, by Newton's method.
"""

from collections.abc import Callable, Iterator, Sequence
from math import pi, radians
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

GROUND = 'ground'
Points: TypeAlias = npt.NDArray[np.complex128]
Equation: TypeAlias = Callable[[Points], float]


class Row(NamedTuple):
    """A joint of a table."""

    position: complex
    # R, P or RP.
    kind: str
    # The direction of the line [deg], or the numbers of two joints on it.
    angle: float
    line: tuple[int, ...]
    links: tuple[str, ...]
    driven: str


def read_rows(table: str) -> list[Row]:
    """
    Return the joints of a table, one a line: x, y, kind, links; the driven link ends with `!`.

    >>> read_rows('11.88 0 RP@30 ground L2')[0].angle, read_rows('2 3 RP@4-5 L1 L2!')[0].line
    (30.0, (4, 5))
    """
    rows = []
    for line in table.splitlines():
        x, y, kind, *words = line.split()
        kind, _, place = kind.partition('@')
        ends = tuple(map(int, place.split('-'))) if '-' in place[1:] else ()
        angle = float(place or 0.0) if not ends else 0.0
        links = tuple(word.rstrip('!') for word in words)
        driven = ''.join(word[:-1] for word in words if word.endswith('!'))
        rows.append(Row(complex(float(x), float(y)), kind, angle, ends, links, driven))
    return rows


def _without_idle_links(rows: Sequence[Row]) -> list[Row]:
    """Return joints without links on two fixed points, which are ground, or on one point alone."""
    count: dict[str, int] = {}
    fixed: dict[str, int] = {}
    for row in rows:
        for link in row.links:
            count[link] = count.get(link, 0) + 1
            fixed[link] = fixed.get(link, 0) + (GROUND in row.links and row.kind == 'R')
    idle = {link for link in count if link != GROUND and (count[link] == 1 or fixed[link] > 1)}
    moving = []
    for row in rows:
        links = tuple(link for link in row.links if link not in idle)
        if row.kind != 'R' and row.links[0] in idle:
            links = (GROUND, *links)
        moving.append(row._replace(links=links))
    return moving


class NaturalCoordinates:
    """A mechanism with one driven link; lengths are in units of its size."""

    def __init__(self, rows: Sequence[Row]) -> None:
        rows = self._rows = _without_idle_links(rows)
        positions = np.array([row.position for row in rows])
        self.size = max(np.ptp(positions.real), np.ptp(positions.imag))
        start = list(positions / self.size)
        members: dict[str, list[int]] = {GROUND: []}
        for number, row in enumerate(rows):
            for link in row.links:
                members.setdefault(link, [])
            for link in row.links if row.kind == 'R' else row.links[1:]:
                points = members[link]
                # A slider's joint and a pin of its link may be in one place.
                if all(rows[point].position != row.position for point in points):
                    points.append(number)
        # Every link has a direction, a slider with a single point too.
        for points in members.values():
            while len(points) < 2:
                points.append(len(start))
                start.append((start[points[0]] if len(points) > 1 else 0.0) + 0.3 + 0.1j)
        self._members = members
        self._start = np.array(start)
        self._pivot = next(number for number, row in enumerate(rows) if row.driven)
        self._crank = members[rows[self._pivot].driven]
        fixed = {*members[GROUND], *self._crank}
        moving = [number for number in range(len(start)) if number not in fixed]
        self._unknowns = np.array([*moving, *(len(start) + number for number in moving)])
        self._crank_name = rows[self._pivot].driven
        self._find_coefficients(list(self._equations()))

    def turn(self, steps: int) -> Iterator[tuple[float, Points]]:
        """Yield the crank's rotation [rad] and all joints over a turn, in the table's lengths."""
        xy = self._turned(np.concatenate([self._start.real, self._start.imag]), 0.0)
        joints = slice(len(self._rows))
        count = len(self._start)
        for step in range(steps + 1):
            rotation = 2.0 * pi * step / steps
            before = xy
            xy = self._turned(xy, rotation)
            # The tangent: the unknowns change as the crank does.
            jacobian = self._jacobian(before)
            xy[self._unknowns] -= np.linalg.solve(
                jacobian[:, self._unknowns], jacobian @ (xy - before)
            )
            for _ in range(9):
                jacobian = self._jacobian(xy)[:, self._unknowns]
                correction = np.linalg.solve(jacobian, self._residual(xy))
                xy[self._unknowns] -= correction
                if np.abs(correction).max() < 1e-13:
                    break
            yield rotation, self.size * (xy[:count] + 1j * xy[count:])[joints]

    def _turned(self, xy: npt.NDArray[np.float64], rotation: float) -> npt.NDArray[np.float64]:
        """Return all coordinates with the crank at a rotation from its start."""
        pivot = self._start[self._pivot]
        crank = pivot + (self._start[self._crank] - pivot) * np.exp(1j * rotation)
        turned = xy.copy()
        turned[self._crank] = crank.real
        turned[len(self._start) + np.array(self._crank)] = crank.imag
        return turned

    def _equations(self) -> Iterator[Equation]:
        for link, points in self._members.items():
            if link not in {GROUND, self._crank_name}:
                yield from self._rigid(*points)
        for number, row in enumerate(self._rows):
            if row.kind == 'R':
                continue
            direction = np.exp(1j * radians(row.angle))
            if row.line:
                direction = self._start[row.line[1]] - self._start[row.line[0]]
            yield self._slot(number, row.links[0], direction)
            if row.kind == 'P':
                yield self._parallel(*row.links)

    def _rigid(self, a: int, b: int, *others: int) -> Iterator[Equation]:
        length = abs(self._start[b] - self._start[a]) ** 2
        yield lambda p: abs(p[b] - p[a]) ** 2 - length
        for number in others:
            ratio = (self._start[number] - self._start[a]) / (self._start[b] - self._start[a])
            for part in (1.0, 1j):
                yield (
                    lambda p, n=number, r=ratio, part=part: (
                        ((p[n] - p[a] - r * (p[b] - p[a])) / part).real
                    )
                )

    def _slot(self, number: int, carrier: str, direction: complex) -> Equation:
        """Keep a joint on the line of a carrier, through its place at the start."""
        a, b = self._members[carrier][:2]
        links = self._rows[number].links
        number = next(
            point
            for point in (*self._members[links[1]], number)
            if self._start[point] == self._start[number]
        )
        base = self._start[b] - self._start[a]
        place = (self._start[number] - self._start[a]) / base
        way = direction / abs(direction) / base
        return lambda p: (
            ((p[number] - p[a] - place * (p[b] - p[a])) * np.conj(way * (p[b] - p[a]))).imag
        )

    def _parallel(self, carrier: str, slider: str) -> Equation:
        """Keep the angle between two links."""
        a, b = self._members[carrier][:2]
        c, d = self._members[slider][:2]
        ratio = (self._start[d] - self._start[c]) / (self._start[b] - self._start[a])
        return lambda p: ((p[d] - p[c]) * np.conj(ratio * (p[b] - p[a]))).imag

    def _find_coefficients(self, equations: Sequence[Equation]) -> None:
        """Find f(x) = c + L x + x Q x / 2 of all equations from values at units."""
        count = len(self._start)

        def values(*units: int) -> npt.NDArray[np.float64]:
            xy = np.zeros(2 * count)
            for unit in units:
                xy[unit] += 1.0
            p = xy[:count] + 1j * xy[count:]
            return np.array([equation(p) for equation in equations], float)

        self._c = values()
        single = np.array([values(i) for i in range(2 * count)])
        self._Q = np.zeros((len(equations), 2 * count, 2 * count))
        for i in range(2 * count):
            for j in range(i + 1):
                mixed = values(i, j) - single[i] - single[j] + self._c
                self._Q[:, i, j] = self._Q[:, j, i] = mixed
        self._L = (single - self._c).T - np.einsum('kii->ki', self._Q) / 2.0

    def _residual(self, xy: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return self._c + (self._L + self._Q @ xy / 2.0) @ xy

    def _jacobian(self, xy: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return self._L + self._Q @ xy
