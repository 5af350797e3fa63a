"""The legs on the page: their shapes by their solvers' parameters, their poses by joint states."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import islice
from math import isfinite, nan, pi
from typing import Any, TypeGuard

from klann_ros.kinematics import (
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
from klann_ros.robot import of_leg, RobotLeg
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


@dataclass(frozen=True, eq=False)
class LiveLeg:
    """A leg of a solver."""

    # '' for the only, unnamed one.
    name: str
    solver: LegSolver
    # The pose of its plane in base_link [m], [rad]; None if unknown.
    mount_xyz: tuple[float, ...] | None = None
    mount_rpy: tuple[float, ...] = _UPRIGHT
    # The text of its linkage's file; '' for a Klann leg.
    description: str = ''

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the published names of its joints, the crank's first; none if it is unknown."""
        return self.solver.published_joints(self.name) if self.solver.leg else ()

    def as_data(self) -> dict[str, Any]:
        """Return it for the page, ready for JSON."""
        data: dict[str, Any] = {
            'name': printable(self.name, 60),
            'kind': '',
            'point': 'foot',
            'joints': [],
            'slides': [],
            'shape': None,
            'mount': {'xyz': self.mount_xyz, 'rpy': self.mount_rpy} if self.mount_xyz else None,
            'direction': float(self.solver.direction) or 1.0,
            'phase': float(self.solver.phase),
        }
        leg = self.solver.leg
        if leg:
            linkage = leg.linkage
            data['kind'] = printable(linkage.name, 60)
            data['joints'] = [printable(name, 60) for name in leg.joint_names]
            data['slides'] = [body.slides for body in linkage.structure.bodies]
            data['shape'] = drawn_shape(linkage)
            robot_leg = RobotLeg(self.name, linkage, description=self.description)
            if not (self.mount_xyz or robot_leg.has_foot):
                data['point'] = 'coupler point'
        return data


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
    # Its parameters without names of files.
    parameters: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_walker(self) -> bool:
        """Return whether it has several legs on a body."""
        return sum(leg.mount_xyz is not None for leg in self.legs) > 1

    def as_data(self) -> dict[str, Any]:
        """Return its legs and lengths, ready for JSON."""
        lengths = []
        for name, length in self.lengths.items():
            leg = name.rpartition('.')[0]
            lengths.append({'name': name, 'value': length, 'unit': unit_of(name), 'leg': leg})
        return {
            'node': printable(self.node, 100),
            'legs': [leg.as_data() for leg in self.legs],
            'does': self.does,
            'note': self.note,
            'lengths': lengths,
        }


def walker_data(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return a walker's body in base_link, if it is known, and its floor's slope [m], [rad]."""
    size = _triple(parameters.get('body_size'))
    centre = _triple(parameters.get('body_centre')) or (0.0, 0.0, 0.0)
    body = {'size': size, 'centre': centre} if size and min(size) > 0.0 else None
    slope = parameters.get('slope')
    return {'body': body, 'slope': slope if _is_finite(slope) and abs(slope) < 1.5 else 0.0}


def unit_of(name: str) -> str:
    """Return the unit of a geometry's parameter; '' for the signs."""
    last = name.rpartition('.')[2]
    return 'rad' if last in BENDS else 'm' if last in NUMBERS else ''


def solver_of(recorded: SolverParameters) -> LiveSolver:
    """Return the solver of published parameters, which are untrusted."""
    legs = _make_legs([recorded], parent(recorded.node))
    lengths = _settable_lengths(recorded.parameters, [leg.name for leg in legs])
    return LiveSolver(recorded.node, legs, lengths, parameters=recorded.without_files)


def replayed_solver(node: str, topic: str, records: Sequence[SolverParameters]) -> LiveSolver:
    """
    Return the solver of the legs on a topic that a player publishes, both by their full names.

    `records`, at least one, are the solvers in its run, in the order of time.
    """
    namespace = parent(topic.removeprefix(parent(node)))
    has_changed = any(solver.leg_time for solver in leg_solvers(records, namespace).values())
    return LiveSolver(
        node,
        _make_legs(records, namespace),
        does='replayed by',
        note=_CHANGED if has_changed else '',
        parameters=records[-1].without_files,
    )


def assumed_solver(node: str, names: Sequence[str]) -> LiveSolver:
    """Return the Klann legs whose joints a node publishes without their lengths."""
    legs = list(published_legs(names, JOINTS))
    leg = KlannLeg(KlannGeometry.sem104())
    live_legs = []
    for name, separator in legs[:MAX_LEGS]:
        live_legs.append(LiveLeg(name, LegSolver(leg=leg, joint_separator=separator)))
    return LiveSolver(
        node, tuple(live_legs), does='published by', note=_ASSUMED if legs else _UNKNOWN_SOLVER
    )


def _make_legs(records: Sequence[SolverParameters], namespace: str) -> tuple[LiveLeg, ...]:
    node_parameters = {record.node: record.parameters for record in records}
    legs = []
    for name, solver in islice(leg_solvers(records, namespace).items(), MAX_LEGS):
        parameters = node_parameters[solver.nodes[-1]]
        # The unnamed leg has no mount.
        xyz = _triple(parameters.get(f'{name}.mount_xyz'))
        rpy = _triple(parameters.get(f'{name}.mount_rpy'))
        description = of_leg(parameters, name).get(LINKAGE_PARAMETER) or ''
        legs.append(LiveLeg(name, solver, xyz, rpy or _UPRIGHT, description))
    return tuple(legs)


def _settable_lengths(
    parameters: Mapping[str, Any], legs: Sequence[str]
) -> dict[str, float | list[int]]:
    """Return the parameters that can be set: a Klann leg's numbers, none of a linkage's file."""
    lengths: dict[str, float | list[int]] = {}
    for leg in legs:
        prefix = f'{leg}.' if leg else ''
        if of_leg(parameters, leg).get(LINKAGE_PARAMETER):
            continue
        for name in NUMBERS:
            length = parameters.get(prefix + name)
            if _is_finite(length):
                lengths[prefix + name] = float(length)
        signs = parameters.get(f'{prefix}assembly')
        if isinstance(signs, list) and len(signs) == 2 and set(signs) <= {-1, 1}:
            lengths[f'{prefix}assembly'] = [int(sign) for sign in signs]
    return lengths


def _triple(value: Any) -> tuple[float, ...] | None:
    is_triple = isinstance(value, list) and len(value) == 3
    return tuple(map(float, value)) if is_triple and all(map(_is_finite, value)) else None


def _is_finite(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and isfinite(value)


@lru_cache(maxsize=32)
def drawn_shape(linkage: Linkage) -> dict[str, Any]:
    """Return a linkage's shape, the path of its foot, and the bounding box of both [m]."""
    return {**leg_shape(linkage), **_path_and_box(linkage)}


def _path_and_box(linkage: Linkage) -> dict[str, Any]:
    turns = linkage.change_points.period
    alphas = np.linspace(0.0, 2.0 * pi * turns, _POSES * turns + 1)
    poses = linkage_poses(linkage, alphas, points=True)
    points = poses.points
    if points is None or not np.isfinite(points).any():
        return {'path': [], 'box': None}
    reached = points[np.isfinite(points).all(axis=-1)]
    box = [*reached.min(axis=0).tolist(), *reached.max(axis=0).tolist()]
    path: list[list[float] | None] = []
    for x, y in poses.h.tolist():
        path.append([round(x, _DIGITS), round(y, _DIGITS)] if isfinite(x + y) else None)
    return {'path': path, 'box': box}


def joint_positions(
    joints: Sequence[str], names: Sequence[str], values: Sequence[float]
) -> list[float] | None:
    """Return the positions of a leg's joints in a joint state; None if one is missing."""
    if len(names) != len(values) or not joints:
        return None
    by_name = dict(zip(names, values, strict=True))
    positions = [by_name.get(joint, nan) for joint in joints]
    return [float(p) for p in positions] if all(map(isfinite, positions)) else None
