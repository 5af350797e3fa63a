"""
The outline of links of one width: the curve at a distance from segments.

It consists of lines beside the segments and arcs about their ends, cut at their intersections.
Pieces nearer to a segment than the distance are inside and left out.
"""

from cmath import phase, rect
from collections.abc import Iterator, Sequence
from itertools import chain, pairwise
from math import acos, atan, ceil, pi, sin, sqrt, tan, tau
from typing import Any, NamedTuple

import numpy as np

# As parts of the distance: rounding, the shortest piece, gaps between pieces, the least curve.
ZERO, MIN_PIECE, MAX_PIECE_GAP, MIN_EXTENT = 1e-9, 1e-6, 1e-5, 1e-3
# Distance of chords from arcs where moments and lengths are measured [m].
FINE_TOLERANCE = 2e-7
Segment = tuple[complex, complex]


class Corner(NamedTuple):
    """A corner of an outline, as in DXF."""

    at: complex
    # The tangent of a quarter of the arc to the next corner, > 0 counter-clockwise; 0 for a line.
    bulge: float = 0.0


Outline = tuple[Corner, ...]


class _Piece(NamedTuple):
    """A part of an outline, its inside to the left."""

    start: complex
    end: complex
    middle: complex
    bulge: float = 0.0


def nearest_on(segment: Segment, point: complex) -> complex:
    """Return the point of a segment nearest to a point."""
    start, end = segment
    along = end - start
    if not along:
        return start
    share = ((point - start) * along.conjugate()).real / abs(along) ** 2
    return start + min(max(share, 0.0), 1.0) * along


def distance_to(segment: Segment, point: complex) -> float:
    """Return the distance of a point from a segment."""
    return abs(point - nearest_on(segment, point))


def crosses(segment_a: Segment, segment_b: Segment) -> bool:
    """Return whether two segments cross within both."""
    along_a = segment_a[1] - segment_a[0]
    along_b = segment_b[1] - segment_b[0]
    offset = segment_b[0] - segment_a[0]
    determinant = (along_a.conjugate() * along_b).imag
    if not determinant:
        return False
    s = (offset.conjugate() * along_b).imag / determinant
    t = (offset.conjugate() * along_a).imag / determinant
    return 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0


def outlines(segments: Sequence[Segment], radius: float) -> tuple[Outline, ...]:
    """
    Return the closed curves at a distance from segments, the outer one first.

    An outer curve is counter-clockwise, one around a window clockwise. A segment of length 0 is a
    disc.
    """
    pieces = _edges(segments, radius)
    curves = []
    while pieces:
        chain = [pieces.pop()]
        while pieces:
            end = chain[-1].end
            following = min(pieces, key=lambda piece: abs(piece.start - end))
            if abs(following.start - end) > MAX_PIECE_GAP * radius:
                break
            pieces.remove(following)
            chain.append(following)
        corners = []
        extent = 0.0
        for piece in chain:
            corners.append(Corner(piece.start, piece.bulge))
            extent = max(extent, abs(piece.start - chain[0].start))
        # Where pieces only touch, one of no size is left over.
        if extent > MIN_EXTENT * radius:
            curves.append(tuple(corners))
    return tuple(sorted(curves, key=lambda curve: min(corner.at.real for corner in curve)))


def polyline(outline: Outline, tolerance: float) -> Iterator[complex]:
    """Yield the corners of a polygon within a tolerance of a curve, of equal area on arcs [m]."""
    for corner, following in zip(outline, (*outline[1:], outline[0]), strict=True):
        if not corner.bulge:
            yield corner.at
            continue
        angle = 4.0 * atan(corner.bulge)
        arm = (corner.at - following.at) / (1.0 - rect(1.0, angle))
        max_step = 2.0 * acos(1.0 - min(tolerance / abs(arm), 0.25))
        count = ceil(angle / max_step)
        step = angle / count
        for k in range(count):
            yield corner.at - arm + arm * rect(sqrt(step / sin(step)), k * step)


def moments(outline: Outline) -> Any:
    """Return the area of a curve, and its first and polar second moments about the origin."""
    start = np.array([*polyline(outline, FINE_TOLERANCE)])
    end = np.roll(start, -1)
    doubled = (start.conj() * end).imag
    squares = abs(start) ** 2 + (start * end.conj()).real + abs(end) ** 2
    first = doubled * (start + end)
    return np.array([doubled.sum() / 2.0, first.sum() / 6.0, (doubled * squares).sum() / 12.0])


def _edges(segments: Sequence[Segment], radius: float) -> list[_Piece]:
    """Return the pieces outside all segments, each once."""
    gap = MAX_PIECE_GAP * radius
    boundary: list[_Piece] = []
    for piece in (*_lines(segments, radius), *_arcs(segments, radius)):
        clearance = min(distance_to(segment, piece.middle) for segment in segments)
        is_outside = clearance >= radius * (1.0 - ZERO)
        if is_outside and not any(_coincide(piece, earlier, gap) for earlier in boundary):
            boundary.append(piece)
    return boundary


def _coincide(piece: _Piece, earlier: _Piece, gap: float) -> bool:
    ends = abs(piece.start - earlier.start) + abs(piece.end - earlier.end)
    return ends < gap and abs(piece.middle - earlier.middle) < gap


def _sides(segments: Sequence[Segment], radius: float) -> list[Segment]:
    """Return the lines beside segments, the segment to the left."""
    sides = []
    for segment in segments:
        if segment[0] != segment[1]:
            for start, end in (segment, segment[::-1]):
                offset = -1j * radius * _unit(end - start)
                sides.append((start + offset, end + offset))
    return sides


def _lines(segments: Sequence[Segment], radius: float) -> Iterator[_Piece]:
    """Yield the straight sides of bars, cut where sides and circles cross them."""
    sides = _sides(segments, radius)
    centres = set(chain.from_iterable(segments))
    for start, end in sides:
        along = _unit(end - start)
        length = abs(end - start)
        cuts = [0.0, length]
        for side_start, side_end in sides:
            side = side_end - side_start
            across = (along.conjugate() * side).imag
            if abs(across) > ZERO * abs(side):
                cuts.append(-((side_start - start) * side.conjugate()).imag / across)
        for centre in centres:
            position = (centre - start) * along.conjugate()
            half_chord = sqrt(max(radius**2 - position.imag**2, 0.0))
            cuts += [position.real - half_chord, position.real, position.real + half_chord]
        for low, high in pairwise(sorted(cuts)):
            if low >= 0.0 and high <= length and high - low > MIN_PIECE * radius:
                middle = start + (low + high) / 2.0 * along
                yield _Piece(start + low * along, start + high * along, middle)


def _arcs(segments: Sequence[Segment], radius: float) -> Iterator[_Piece]:
    """Yield the arcs about the ends of bars, cut where sides and other arcs cross them."""
    sides = _sides(segments, radius)
    centres = dict.fromkeys(chain.from_iterable(segments))
    for centre in centres:
        cuts = [0.0, pi]
        for start, end in sides:
            along = _unit(end - start)
            height = ((start - centre) * along.conjugate()).imag
            if abs(height) <= radius * (1.0 + ZERO):
                half_chord = sqrt(max(radius**2 - height**2, 0.0))
                cuts.append(phase((-half_chord + 1j * height) * along))
                cuts.append(phase((half_chord + 1j * height) * along))
        for neighbour in centres:
            offset = neighbour - centre
            distance = abs(offset)
            if 0.0 < distance <= 2.0 * radius:
                half_chord = sqrt(max(radius**2 - distance**2 / 4.0, 0.0))
                cuts.append(phase((distance / 2.0 - 1j * half_chord) * _unit(offset)))
                cuts.append(phase((distance / 2.0 + 1j * half_chord) * _unit(offset)))
        cuts = sorted(cut % tau for cut in cuts)
        for low, high in pairwise([*cuts, cuts[0] + tau]):
            if high - low > MIN_PIECE:
                first = centre + rect(radius, low)
                last = centre + rect(radius, high)
                middle = centre + rect(radius, (low + high) / 2.0)
                yield _Piece(first, last, middle, tan((high - low) / 4.0))


def _unit(vector: complex) -> complex:
    return vector / abs(vector)
