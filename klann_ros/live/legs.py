"""The legs on the page: their shapes by their solvers' parameters, their poses by joint states."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, pi
from typing import Any

from klann_ros.kinematics import (
    AnyLeg,
    BENDS,
    JOINTS,
    KlannGeometry,
    KlannLeg,
    Linkage,
    linkage_poses,
    NUMBERS,
)
from klann_ros.log import LINKAGE_PARAMETER, SolverParameters
from klann_ros.review import leg_solvers, LegSolver, parent, published_legs
from klann_ros.robot import of_leg
from klann_ros.sanitize.text import printable
from klann_ros.web import leg_shape
import numpy as np

# The page shows at most this many legs.
MAX_LEGS = 24
# Poses a turn from which foot path and reach are drawn.
_POSES = 240
_UPRIGHT = (pi / 2, 0.0, 0.0)
# Digits of a foot path: a tenth of a micrometre.
_DIGITS = 7
_ASSUMED = 'It publishes no lengths: the leg is drawn as SEM 104, which may not be its own.'
_UNKNOWN_SOLVER = 'Its lengths are unknown, and its joints are not a Klann leg: not drawn.'
_CHANGED = (
    'Its lengths were changed while it was recorded: the leg is drawn with the last ones, which '
    'are not its own before that.'
)
# Shapes that are kept: all legs of a walker have one linkage.
_MAX_SHAPES = 32
_shapes: list[tuple[Linkage, dict[str, Any]]] = []


@dataclass(frozen=True, eq=False)
class LiveLeg:
    """A leg of a solver."""

    # '' for the only, unnamed one.
    name: str
    # Its solver; None if its linkage is unknown.
    leg: AnyLeg | None
    # alpha = direction * crank + phase.
    direction: float = 1.0
    phase: float = 0.0
    crank_joint: str = 'crank'
    # The pose of its plane in base_link [m], [rad]; None if unknown.
    mount_xyz: tuple[float, ...] | None = None
    mount_rpy: tuple[float, ...] = _UPRIGHT
    joint_separator: str = '/'

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the published names of its joints, the crank's first."""
        names = self.leg.joint_names if self.leg else ()
        prefix = f'{self.name}{self.joint_separator}' if self.name else ''
        return tuple(prefix + name for name in names)

    def as_data(self) -> dict[str, Any]:
        """Return it for the page, ready for JSON."""
        mount = {'xyz': self.mount_xyz, 'rpy': self.mount_rpy} if self.mount_xyz else None
        linkage = self.leg.linkage if self.leg else None
        return {
            'name': printable(self.name, 60),
            'kind': printable(linkage.name, 60) if linkage else '',
            'joints': [printable(name, 60) for name in self.leg.joint_names] if self.leg else [],
            'slides': [b.slides for b in linkage.structure.bodies] if linkage else [],
            'shape': drawn_shape(linkage) if linkage else None,
            'mount': mount,
            'direction': self.direction,
            'phase': self.phase,
        }


@dataclass(frozen=True, eq=False)
class LiveSolver:
    """A node that publishes legs, and their parameters that can be set."""

    node: str
    legs: tuple[LiveLeg, ...]
    # Lengths, bends and the two signs [m], [rad].
    lengths: Mapping[str, float | list[int]] = field(default_factory=dict)
    # Its role on the page, and a note about its lengths.
    does: str = 'solved by'
    note: str = ''

    def as_data(self) -> dict[str, Any]:
        """Return its legs and lengths, ready for JSON."""
        return {
            'node': printable(self.node, 100),
            'legs': [leg.as_data() for leg in self.legs],
            'does': self.does,
            'note': self.note,
            'lengths': [
                {
                    'name': name,
                    'value': value,
                    'unit': unit_of(name),
                    'leg': name.rpartition('.')[0],
                }
                for name, value in self.lengths.items()
            ],
        }


def unit_of(name: str) -> str:
    """Return the unit of a geometry's parameter; '' for the signs."""
    last = name.rpartition('.')[2]
    return 'rad' if last in BENDS else 'm' if last in NUMBERS else ''


def solver_of(recorded: SolverParameters) -> LiveSolver:
    """Return the solver of published parameters, which are untrusted."""
    legs = _legs([recorded], parent(recorded.node))
    return LiveSolver(
        recorded.node, legs, _lengths(recorded.parameters, [leg.name for leg in legs])
    )


def replayed_solver(node: str, topic: str, records: Sequence[SolverParameters]) -> LiveSolver:
    """
    Return the solver of the legs on a topic that a player publishes, both by their full names.

    `records`, at least one, are the solvers in its run, in the order of time.
    """
    namespace = parent(topic.removeprefix(parent(node)))
    has_changed = any(solver.leg_time for solver in leg_solvers(records, namespace).values())
    return LiveSolver(
        node, _legs(records, namespace), does='replayed by', note=_CHANGED if has_changed else ''
    )


def assumed_solver(node: str, names: Sequence[str]) -> LiveSolver:
    """Return the Klann legs whose joints a node publishes without their lengths."""
    legs = list(published_legs(names, JOINTS))
    leg = KlannLeg(KlannGeometry.sem104())
    return LiveSolver(
        node,
        tuple(LiveLeg(name, leg, joint_separator=mark) for name, mark in legs[:MAX_LEGS]),
        does='published by',
        note=_ASSUMED if legs else _UNKNOWN_SOLVER,
    )


def _legs(records: Sequence[SolverParameters], namespace: str) -> tuple[LiveLeg, ...]:
    parameters = {record.node: record.parameters for record in records}
    return tuple(
        _leg(name, solver, parameters[solver.nodes[-1]])
        for name, solver in list(leg_solvers(records, namespace).items())[:MAX_LEGS]
    )


def _leg(name: str, solver: LegSolver, parameters: Mapping[str, Any]) -> LiveLeg:
    return LiveLeg(
        name,
        solver.leg,
        float(solver.direction) or 1.0,
        float(solver.phase),
        str(parameters.get(f'{name}.crank_joint') or solver.crank_joint)[:200],
        _triple(parameters.get(f'{name}.mount_xyz')) if name else None,
        (_triple(parameters.get(f'{name}.mount_rpy')) if name else None) or _UPRIGHT,
        solver.joint_separator,
    )


def _lengths(parameters: Mapping[str, Any], legs: Sequence[str]) -> dict[str, float | list[int]]:
    """Return the parameters that can be set: a Klann leg's numbers, none of a linkage's file."""
    found: dict[str, float | list[int]] = {}
    for leg in legs:
        prefix = f'{leg}.' if leg else ''
        if of_leg(parameters, leg).get(LINKAGE_PARAMETER):
            continue
        for name in NUMBERS:
            value = parameters.get(prefix + name)
            if isinstance(value, int | float) and isfinite(value):
                found[prefix + name] = float(value)
        signs = parameters.get(f'{prefix}assembly')
        if isinstance(signs, list) and len(signs) == 2 and set(signs) <= {-1, 1}:
            found[f'{prefix}assembly'] = [int(sign) for sign in signs]
    return found


def _triple(value: Any) -> tuple[float, ...] | None:
    is_triple = isinstance(value, list) and len(value) == 3
    if not is_triple or not all(isinstance(v, int | float) and isfinite(v) for v in value):
        return None
    return tuple(map(float, value))


def drawn_shape(linkage: Linkage) -> dict[str, Any]:
    """Return a linkage's shape, the path of its foot, and the bounding box of both [m]."""
    for known, shape in _shapes:
        if known == linkage:
            return shape
    shape = {**leg_shape(linkage), **_reach(linkage)}
    _shapes.append((linkage, shape))
    del _shapes[:-_MAX_SHAPES]
    return shape


def _reach(linkage: Linkage) -> dict[str, Any]:
    alphas = np.linspace(0.0, 2.0 * pi, _POSES + 1)
    poses = linkage_poses(linkage, alphas, points=True)
    points = poses.points
    if points is None or not np.isfinite(points).any():
        return {'path': [], 'box': None}
    flat = points[np.isfinite(points).all(axis=-1)]
    low, high = flat.min(axis=0), flat.max(axis=0)
    path = [
        [round(x, _DIGITS), round(y, _DIGITS)] if isfinite(x + y) else None
        for x, y in poses.h.tolist()
    ]
    return {'path': path, 'box': [*low.tolist(), *high.tolist()]}


def positions(
    joints: Sequence[str], names: Sequence[str], values: Sequence[float]
) -> list[float] | None:
    """Return the positions of a leg's joints in a joint state; None if one is missing."""
    if len(names) != len(values) or not joints:
        return None
    by_name = dict(zip(names, values, strict=True))
    found = [by_name.get(joint) for joint in joints]
    if any(value is None or not isfinite(value) for value in found):
        return None
    return [float(value) for value in found if value is not None]
