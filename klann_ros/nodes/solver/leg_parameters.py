"""The legs that the parameters tell: Klann legs of their lengths, or the linkage in a file."""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
import re
from typing import Any

from klann_ros.kinematics import (
    AnyLeg,
    GeometryError,
    KlannGeometry,
    KlannLeg,
    linkage_from_text,
    LinkageLeg,
)
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.klann.geometry import PRESETS
from klann_ros.kinematics.linkage.file import linkage_text, SHIPPED, shipped_linkages
from klann_ros.log.run_parameters import LINKAGE_PARAMETER
from klann_ros.nodes.parameters import (
    declare,
    declare_constant,
    declare_given,
    must,
    StartError,
)
from klann_ros.untrusted.text import printable
from rclpy.node import Node
from rclpy.parameter import Parameter

from .declarations import drive, GEOMETRY, GEOMETRY_NAMES, LEGS, MASSES, named_leg, SETTINGS
from .driven_leg import DrivenLeg

_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*')
_PRESETS = {name: make() for name, make in PRESETS.items()}


class LegParameters:
    """
    The legs of a node, and the parameters that they are made from.

    Parameters
    ----------
    node : rclpy.node.Node
        On which they are declared.

    Attributes
    ----------
    legs : list of DrivenLeg
        The legs, in the order of their names.

    Raises
    ------
    StartError
        They are no legs; the text says why.

    """

    def __init__(self, node: Node) -> None:
        values = declare(node, (*GEOMETRY, *LEGS, *SETTINGS))
        self._settings = {name: values[name] for name in ('tolerance', 'max_crank_step')}
        self._start_values = values
        self._file = values['linkage'] and str(Path(values['linkage']).expanduser())
        names = _names(values['legs'])
        self._prefixes = {name: f'{name}.' for name in names} if names else {'': ''}
        for name in names:
            values.update(declare(node, named_leg(name, values)))
        if not names:
            values.update(declare(node, drive()))
        try:
            description = self._description()
            self.legs = [
                DrivenLeg(
                    name, *_drive(name, prefix, values), self._leg(prefix, values, description)
                )
                for name, prefix in self._prefixes.items()
            ]
        except ValueError as error:
            # A GeometryError, or what a leg says of tolerance and max_crank_step.
            raise StartError(str(error)) from error
        declare_constant(
            node,
            LINKAGE_PARAMETER,
            description,
            "content of the linkage's file; empty for Klann legs",
        )
        masses = [prefix + name for prefix in {'', *self._prefixes.values()} for name in MASSES]
        declare_given(node, masses, 'of no use to the solver: for whoever reviews a run of it')

    @property
    def summary(self) -> str:
        """Return which legs there are, in words."""
        kinds = {leg.name: self._kind(leg.leg) for leg in self.legs}
        kind = self._kind(self.legs[0].leg)
        if len(kinds) == 1:
            return f'{kind} ({", ".join(kinds)})' if self.legs[0].name else kind
        if len(set(kinds.values())) == 1:
            return f'{len(kinds)} legs ({", ".join(kinds)}), each a {kind}'
        legs = ', '.join(f'{name} a {kind}' for name, kind in kinds.items())
        return f'{len(kinds)} legs: {legs}'

    def _kind(self, leg: AnyLeg) -> str:
        if not self._file:
            names = [name for name, preset in _PRESETS.items() if preset.linkage == leg.linkage]
            return f'Klann leg {names[0]}' if names else 'Klann leg of its own lengths'
        return f'linkage {printable(leg.linkage.name)} ({printable(self._file)})'

    def changed(self, parameters: Sequence[Parameter]) -> dict[str, AnyLeg]:
        """
        Return the legs that parameters change, by name, as they become.

        A GeometryError says that they are no leg, or that there are no such lengths.
        """
        changed: dict[str, AnyLeg] = {}
        rest = {p.name: p.value for p in parameters if not self._is_unchanged_constant(p)}
        for driven in self.legs:
            prefix = self._prefixes[driven.name]
            changes = {
                name: rest.pop(prefix + name) for name in GEOMETRY_NAMES if prefix + name in rest
            }
            if changes:
                leg = self._changed(driven.leg, changes)
                if leg is not driven.leg:
                    changed[driven.name] = leg
        common = [name for name in rest if name in GEOMETRY_NAMES]
        if common:
            first = next(iter(self._prefixes.values()))
            raise GeometryError(
                f'{", ".join(common)}: each leg has its own, which can be changed: '
                f'{first}{common[0]}'
            )
        return changed

    def _is_unchanged_constant(self, parameter: Parameter) -> bool:
        """Return whether lengths that cannot be changed are set to the values that they have."""
        name, value = parameter.name, parameter.value
        if not self._file and ('' in self._prefixes or name not in GEOMETRY_NAMES):
            return False
        value = value if isinstance(value, int | float | str) else list(value)
        return bool(self._start_values.get(name) == value)

    def _changed(self, leg: AnyLeg, changes: dict[str, Any]) -> AnyLeg:
        if self._file:
            raise GeometryError(
                f'{", ".join(changes)} cannot be changed: the leg is the linkage in {self._file}'
            )
        if 'assembly' in changes:
            # rclpy has arrays of its own.
            changes['assembly'] = list(changes['assembly'])
        values = {**leg.linkage.dimensions, 'assembly': leg.assembly, **changes}
        geometry = _geometry(values, '')
        return leg if geometry.linkage == leg.linkage else KlannLeg(geometry, **self._settings)

    def _description(self) -> str:
        if not self._file:
            return ''
        try:
            return linkage_text(self._file)
        except GeometryError as error:
            name = Path(self._file).name.removesuffix('.yaml')
            if name in shipped_linkages() and not Path(self._file).exists():
                shipped = SHIPPED / f'{name}.yaml'
                raise StartError(f'{error}; the shipped one is {shipped}') from error
            raise

    def _leg(self, prefix: str, values: Mapping[str, Any], description: str) -> AnyLeg:
        if self._file:
            return LinkageLeg(linkage_from_text(description, self._file), **self._settings)
        try:
            return KlannLeg(_geometry(values, prefix), **self._settings)
        except GeometryError as error:
            raise GeometryError(f'{prefix}{error}' if prefix else str(error)) from error


def _geometry(values: Mapping[str, Any], prefix: str) -> KlannGeometry:
    return KlannGeometry(**{name: values[prefix + name] for name in GEOMETRY_NAMES})


def _names(names: Sequence[str]) -> list[str]:
    """Return the names of the legs; an empty one stands for none, as ROS has no empty lists."""
    named = [name for name in names if name]
    are_names = all(map(_NAME.fullmatch, named)) and len(set(named)) == len(named)
    must(are_names, 'legs', named, 'names of letters, digits and _, a letter first, each once')
    return named


def _drive(name: str, prefix: str, values: Mapping[str, Any]) -> tuple[str, float, int]:
    """Return the joint that turns a leg's crank, its phase and its direction."""
    phase, direction = values[f'{prefix}phase'], values[f'{prefix}direction']
    must(isfinite(phase), f'{prefix}phase', phase, 'finite')
    must(direction in (-1, 1), f'{prefix}direction', direction, '+1 or -1')
    joint = values['crank_joint']
    if not name:
        return joint, float(phase), int(direction)
    place = {word: list(values[f'{prefix}{word}']) for word in ('mount_xyz', 'mount_rpy')}
    for word, numbers in place.items():
        is_place = len(numbers) == 3 and all(map(isfinite, numbers))
        must(is_place, f'{prefix}{word}', numbers, 'three finite numbers')
    rpy = place['mount_rpy']
    within = 'radians, not degrees: within +-2 pi'
    must(max(map(abs, rpy)) <= TURN, f'{prefix}mount_rpy', rpy, within)
    return values[f'{prefix}crank_joint'] or joint, float(phase), int(direction)
