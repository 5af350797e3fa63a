"""A linkage as drawing.js draws it: where its points are by its coordinates, and its bars."""

from collections.abc import Sequence
from typing import Any

from klann_ros.kinematics import as_linkage


def leg_shape(leg: Any) -> dict[str, Any]:
    """
    Return a leg's shape, ready for JSON.

    The point p is at the sum of w_j u_j over the bodies, plus a constant: `terms` has its j, Re
    w_j and Im w_j. A body that turns has u_j = exp(i s_j x_j), and `senses` has the s_j; one that
    slides has u_j = x_j u_f, and `frames` has its f: -1 for the ground, null for what turns. The
    leg may be a Linkage, a KlannGeometry or a FourBarGeometry; a TypeError for anything else.
    """
    linkage = as_linkage(leg)
    structure = linkage.structure
    names = structure.points
    weights, constants = linkage.point_equations
    points = []
    for name, row, constant in zip(names, weights, constants.tolist(), strict=True):
        terms = [(j, w.real, w.imag) for j, w in enumerate(row.tolist()) if w]
        points.append({'name': name, 'at': [constant.real, constant.imag], 'terms': terms})
    bodies = []
    for body, label in zip(structure.bodies, structure.labels, strict=True):
        bars = [_indices((bar.start, bar.end), names) for bar in body.rigid]
        # The line that it slides along.
        line = _indices((body.line.start, body.line.end), names) if body.line else None
        bodies.append({'name': label, 'bars': bars, 'line': line})
    return {
        'senses': structure.senses,
        'frames': [None if f == j else f for j, f in enumerate(structure.frames)],
        'pivots': _indices(structure.pivots, names),
        'foot': structure.foot,
        'points': points,
        'bodies': bodies,
    }


def _indices(ends: Sequence[str], names: Sequence[str]) -> list[int]:
    return [names.index(end) for end in ends]
