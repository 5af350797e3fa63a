"""What a leg is drawn from: points that its angles place, and the bodies that join them."""

from collections.abc import Sequence
from typing import Any

from klann_ros.kinematics import AnyLeg, foot_path, KinematicsError
import numpy as np
from numpy.typing import NDArray

from . import packed

Complex = NDArray[np.complex128]


def leg_shape(leg: AnyLeg) -> dict[str, Any]:
    """
    Return a leg's shape.

    The point p is at the sum of w_j u_j over the bodies, plus a constant: `terms` has its j, Re
    w_j and Im w_j. A body that turns has u_j = exp(i s_j x_j), and `senses` has the s_j; one that
    slides has u_j = x_j u_f, and `frames` has its f: -1 for the ground, null for what turns.
    """
    linkage = leg.linkage
    structure, (q_u, q) = linkage.structure, linkage.point_equations
    names = structure.points
    shape = {
        'senses': structure.senses,
        'frames': [None if f == j else f for j, f in enumerate(structure.frames)],
        'pivots': _indices(structure.pivots, names),
        'foot': structure.foot,
    }
    bodies = [
        (label, [(bar.start, bar.end) for bar in body.bars], body.slides)
        for body, label in zip(structure.bodies, structure.labels, strict=True)
    ]
    return {
        **shape,
        'points': [
            {'name': name, 'at': [at.real, at.imag], 'terms': _terms(row)}
            for name, row, at in zip(names, q_u, q.tolist(), strict=True)
        ],
        'bodies': [
            {
                'name': name,
                'bars': [_indices(bar, names) for bar in bars[slides:]],
                # The line that it slides along.
                'line': _indices(bars[0], names) if slides else None,
            }
            for name, bars, slides in bodies
        ],
        **_path(leg),
    }


def _path(leg: AnyLeg) -> dict[str, Any]:
    """Return the path that the foot has by the geometry, and whether it ends where it began."""
    try:
        path = foot_path(leg)
    except KinematicsError:
        return {'path': None}
    return {'path': [packed.floats(s) for s in path.h.T], 'closed': path.full_turn}


def _terms(row: Complex) -> list[tuple[int, float, float]]:
    return [(j, w.real, w.imag) for j, w in enumerate(row.tolist()) if w]


def _indices(some: Sequence[str], names: Sequence[str]) -> list[int]:
    return [names.index(name) for name in some]
