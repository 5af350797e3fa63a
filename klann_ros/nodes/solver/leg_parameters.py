"""The legs that the parameters tell: Klann legs of their lengths, or the linkage in a file."""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
import re
from typing import Any

from klann_ros.kinematics import AnyLeg, GeometryError, KlannLeg, linkage_from_text, LinkageLeg
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.linkage.file import linkage_text, SHIPPED, shipped_linkages
from klann_ros.log.run_parameters import LINKAGE_PARAMETER
from klann_ros.nodes import geometry_parameters
from klann_ros.nodes.leg_declarations import COMMON, drive, own
from klann_ros.nodes.parameters import declare, declare_constant, refusal, StartError
from klann_ros.untrusted.text import printable
from rclpy.node import Node
from rclpy.parameter import Parameter

from .solved_leg import Mounting, SolvedLeg

_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*')


class LegParameters:
    """
    The legs of a node, and the parameters that they are made from.

    Parameters
    ----------
    node : rclpy.node.Node
        On which they are declared.

    Attributes
    ----------
    legs : list of SolvedLeg
        The legs, in the order of their names.

    Raises
    ------
    StartError
        They are no legs; the text says why.

    """

    def __init__(self, node: Node) -> None:
        """Declare the parameters and make the legs."""
        values = declare(node, COMMON)
        self._settings = {name: values[name] for name in ('tolerance', 'max_crank_step')}
        self._file = values['linkage'] and str(Path(values['linkage']).expanduser())
        names = _names(values['legs'])
        self._prefixes = {name: f'{name}.' for name in names} if names else {'': ''}
        for name in names:
            values.update(declare(node, own(name, values)))
        if not names:
            values.update(declare(node, drive('')))
        try:
            description = self._description()
            self.legs = [
                SolvedLeg(_mounting(name, prefix, values), self._leg(prefix, values, description))
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

    @property
    def summary(self) -> str:
        """Return which legs there are, in words."""
        kinds = {leg.mounting.name: self._kind(leg.leg) for leg in self.legs}
        kind = self._kind(self.legs[0].leg)
        if len(kinds) == 1:
            return f'{kind} ({", ".join(kinds)})' if self.legs[0].mounting.name else kind
        if len(set(kinds.values())) == 1:
            return f'{len(kinds)} legs ({", ".join(kinds)}), each a {kind}'
        legs = ', '.join(f'{name} a {kind}' for name, kind in kinds.items())
        return f'{len(kinds)} legs: {legs}'

    def _kind(self, leg: AnyLeg) -> str:
        if not self._file:
            return geometry_parameters.in_words(leg.linkage)
        return f'linkage {printable(leg.linkage.name)} ({printable(self._file)})'

    def changed(self, parameters: Sequence[Parameter]) -> dict[str, AnyLeg]:
        """
        Return the legs that parameters change, by name, as they become.

        Raises
        ------
        GeometryError
            They are no leg, or there are no such lengths.

        """
        changed: dict[str, AnyLeg] = {}
        rest = {p.name: p.value for p in parameters}
        for solved in self.legs:
            prefix = self._prefixes[solved.mounting.name]
            changes = {
                name: rest.pop(prefix + name)
                for name in geometry_parameters.NAMES
                if prefix + name in rest
            }
            if changes:
                leg = self._changed(solved, changes)
                if leg is not solved.leg:
                    changed[solved.mounting.name] = leg
        common = [name for name in rest if name in geometry_parameters.NAMES]
        if common:
            first = next(iter(self._prefixes.values()))
            msg = (
                f'{", ".join(common)}: each leg has its own, which can be changed: '
                f'{first}{common[0]}'
            )
            raise GeometryError(msg)
        return changed

    def _changed(self, solved: SolvedLeg, changes: dict[str, Any]) -> AnyLeg:
        leg = solved.leg
        if self._file:
            msg = f'{", ".join(changes)} cannot be changed: the leg is the linkage in {self._file}'
            raise GeometryError(msg)
        if 'assembly' in changes:
            # rclpy has arrays of its own.
            changes['assembly'] = list(changes['assembly'])
        geometry = geometry_parameters.geometry(
            {**leg.linkage.dimensions, 'assembly': leg.assembly, **changes}
        )
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
        own = {name: values[prefix + name] for name in geometry_parameters.NAMES}
        try:
            return KlannLeg(geometry_parameters.geometry(own), **self._settings)
        except GeometryError as error:
            raise GeometryError(f'{prefix}{error}' if prefix else str(error)) from error


def _names(names: Sequence[str]) -> list[str]:
    """Return the names of the legs; an empty one stands for none, as ROS has no empty lists."""
    found = [name for name in names if name]
    for name in found:
        if not _NAME.fullmatch(name) or found.count(name) > 1:
            what = 'names of letters, digits and _, a letter first, each once'
            raise StartError(refusal('legs', found, what))
    return found


def _mounting(name: str, prefix: str, values: Mapping[str, Any]) -> Mounting:
    phase, direction = values[f'{prefix}phase'], values[f'{prefix}direction']
    if not isfinite(phase):
        raise StartError(refusal(f'{prefix}phase', phase, 'finite'))
    if direction not in (-1, 1):
        raise StartError(refusal(f'{prefix}direction', direction, '+1 or -1'))
    place = [tuple(values.get(f'{name}.{word}', ())) for word in ('mount_xyz', 'mount_rpy')]
    for word, numbers in zip(('mount_xyz', 'mount_rpy'), place, strict=True):
        if name and not (len(numbers) == 3 and all(map(isfinite, numbers))):
            raise StartError(refusal(f'{prefix}{word}', list(numbers), 'three finite numbers'))
    if name and not max(map(abs, place[1])) <= TURN:
        within = 'radians, not degrees: within +-2 pi'
        raise StartError(refusal(f'{prefix}mount_rpy', list(place[1]), within))
    return Mounting(
        name,
        values.get(f'{name}.crank_joint') or values['crank_joint'],
        float(phase),
        int(direction),
        place[0],
        place[1],
    )
