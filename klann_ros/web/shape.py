"""A linkage as drawing.js draws it: where its points are by its coordinates, and its bars."""

from collections.abc import Sequence
from typing import Any

from klann_ros.kinematics import as_linkage


def leg_shape(leg: Any) -> dict[str, Any]:
    """
    Return a leg's shape, ready for JSON.

    The point p is at the sum of w_j u_j over the bodies, plus a constant: `terms` has its j, Re
    w_j and Im w_j. A body that turns has u_j = exp(i s_j x_j), and `senses` has the s_j; one that
    slides has u_j = x_j u_f, and `frames` has its f: -1 for the ground, null for what turns.

    Parameters
    ----------
    leg : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.

    Raises
    ------
    TypeError
        `leg` is none of these.

    """
    linkage = as_linkage(leg)
    structure, (q_u, q) = linkage.structure, linkage.point_equations
    names = structure.points
    bodies = zip(structure.bodies, structure.labels, strict=True)
    return {
        'senses': structure.senses,
        'frames': [None if f == j else f for j, f in enumerate(structure.frames)],
        'pivots': _indices(structure.pivots, names),
        'foot': structure.foot,
        'points': [
            {
                'name': name,
                'at': [at.real, at.imag],
                'terms': [(j, w.real, w.imag) for j, w in enumerate(row.tolist()) if w],
            }
            for name, row, at in zip(names, q_u, q.tolist(), strict=True)
        ],
        'bodies': [
            {
                'name': label,
                'bars': [_indices((bar.start, bar.end), names) for bar in body.rigid],
                # The line that it slides along.
                'line': _indices((body.line.start, body.line.end), names) if body.line else None,
            }
            for body, label in bodies
        ],
    }


def _indices(some: Sequence[str], names: Sequence[str]) -> list[int]:
    return [names.index(name) for name in some]
