"""
The outline of links of one width: the curve at a distance from segments.

It consists of lines beside the segments and arcs about their ends, cut at their intersections.
Pieces nearer to a segment than the distance are inside and left out.
"""

from cmath import phase, rect
from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import pi, sqrt, tan, tau
from typing import NamedTuple

# As parts of the distance: rounding, the shortest piece, gaps between pieces, the least curve.
ZERO, MIN_PIECE, MAX_PIECE_GAP, MIN_EXTENT = 1e-9, 1e-6, 1e-5, 1e-3
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


def nearest_on(segment: Segment, at: complex) -> complex:
    """Return the point of a segment nearest to a place."""
    start, end = segment
    along = end - start
    if not along:
        return start
    part = ((at - start) * along.conjugate()).real / abs(along) ** 2
    return start + min(max(part, 0.0), 1.0) * along


def distance_to(segment: Segment, at: complex) -> float:
    """Return the distance of a place from a segment."""
    return abs(at - nearest_on(segment, at))


def crosses(one: Segment, other: Segment) -> bool:
    """Return whether two segments cross within both."""
    a, b, apart = one[1] - one[0], other[1] - other[0], other[0] - one[0]
    across = (a.conjugate() * b).imag
    if not across:
        return False
    s, t = (apart.conjugate() * b).imag / across, (apart.conjugate() * a).imag / across
    return 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0


def outlines(segments: Sequence[Segment], radius: float) -> tuple[Outline, ...]:
    """
    Return the closed curves at a distance from segments, the outer one first.

    An outer curve is counter-clockwise, one around a window clockwise. A segment of length 0 is a
    disc.
    """
    gap, pieces, found = MAX_PIECE_GAP * radius, _edges(segments, radius), []
    while pieces:
        chain = [pieces.pop()]
        while pieces:
            at = chain[-1].end
            following = min(pieces, key=lambda piece: abs(piece.start - at))
            if abs(following.start - at) > gap:
                break
            pieces.remove(following)
            chain.append(following)
        # Where pieces only touch, one of no size is left over.
        if max(abs(piece.start - chain[0].start) for piece in chain) > MIN_EXTENT * radius:
            found.append(tuple(Corner(piece.start, piece.bulge) for piece in chain))
    return tuple(sorted(found, key=lambda outline: min(corner.at.real for corner in outline)))


def _edges(segments: Sequence[Segment], radius: float) -> list[_Piece]:
    """Return the pieces outside all segments, each once."""
    gap = MAX_PIECE_GAP * radius
    boundary: list[_Piece] = []
    for piece in (*_lines(segments, radius), *_arcs(segments, radius)):
        inside = any(distance_to(s, piece.middle) < radius * (1.0 - ZERO) for s in segments)
        is_known = any(
            abs(piece.start - one.start) + abs(piece.end - one.end) < gap
            and abs(piece.middle - one.middle) < gap
            for one in boundary
        )
        if not inside and not is_known:
            boundary.append(piece)
    return boundary


def _sides(segments: Sequence[Segment], radius: float) -> list[Segment]:
    """Return the lines beside segments, the segment to the left."""
    directed = [(a, b) for s in segments if s[0] != s[1] for a, b in (s, s[::-1])]
    return [(a + side, b + side) for a, b in directed for side in [-1j * radius * _unit(b - a)]]


def _lines(segments: Sequence[Segment], radius: float) -> Iterator[_Piece]:
    sides, centres = _sides(segments, radius), {end for segment in segments for end in segment}
    for start, end in sides:
        along, size = _unit(end - start), abs(end - start)
        cuts = [0.0, size]
        for other in sides:
            across = (along.conjugate() * (other[1] - other[0])).imag
            if abs(across) > ZERO * abs(other[1] - other[0]):
                to = (other[0] - start) * (other[1] - other[0]).conjugate()
                cuts.append(-to.imag / across)
        for centre in centres:
            at = (centre - start) * along.conjugate()
            half = sqrt(max(radius**2 - at.imag**2, 0.0))
            cuts += [at.real - half, at.real, at.real + half]
        cuts = sorted(cut for cut in cuts if 0.0 <= cut <= size)
        for a, b in pairwise(cuts):
            if b - a > MIN_PIECE * radius:
                p, q, middle = (start + cut * along for cut in (a, b, (a + b) / 2.0))
                yield _Piece(p, q, middle)


def _arcs(segments: Sequence[Segment], radius: float) -> Iterator[_Piece]:
    sides = _sides(segments, radius)
    for centre in dict.fromkeys(end for segment in segments for end in segment):
        cuts = [0.0, pi]
        for start, end in sides:
            along = _unit(end - start)
            at = (start - centre) * along.conjugate()
            if abs(at.imag) <= radius * (1.0 + ZERO):
                half = sqrt(max(radius**2 - at.imag**2, 0.0))
                cuts += [phase((x + 1j * at.imag) * along) for x in (-half, half)]
        for other in {end for segment in segments for end in segment}:
            apart = other - centre
            if 0.0 < abs(apart) <= 2.0 * radius:
                half = sqrt(max(radius**2 - abs(apart) ** 2 / 4.0, 0.0))
                cuts += [phase((abs(apart) / 2.0 + 1j * h) * _unit(apart)) for h in (-half, half)]
        cuts = sorted(cut % tau for cut in cuts)
        for a, b in zip(cuts, [*cuts[1:], cuts[0] + tau], strict=True):
            if b - a > MIN_PIECE:
                p, q, middle = (centre + rect(radius, cut) for cut in (a, b, (a + b) / 2.0))
                yield _Piece(p, q, middle, tan((b - a) / 4.0))


def _unit(vector: complex) -> complex:
    return vector / abs(vector)
