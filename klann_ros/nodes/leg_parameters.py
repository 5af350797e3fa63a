"""The legs that the parameters tell: Klann legs of their lengths, or the linkage in a file."""

from collections.abc import Mapping, Sequence
from math import isfinite, pi
import re
from typing import Any

from klann_ros.kinematics import GeometryError, KlannLeg, linkage_from_text, LinkageLeg
from klann_ros.kinematics.leg_types import Leg
from klann_ros.kinematics.linkage.file import linkage_text
from klann_ros.log.run_parameters import LINKAGE_PARAMETER
from rclpy.node import Node
from rclpy.parameter import Parameter

from . import geometry_parameters
from .parameters import declare, declare_constant, Declared
from .process import StartError
from .solved_leg import Mounting, SolvedLeg

_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*')
UPRIGHT = (pi / 2, 0.0, 0.0)

COMMON = (
    *geometry_parameters.declared(),
    Declared(
        'legs', [''], 'names of the legs; none for one unnamed leg', constraint='names, all others'
    ),
    Declared('linkage', '', "a linkage's YAML file; empty: the Klann leg of the lengths"),
    Declared('crank_joint', 'crank', 'the joint in crank_state that turns the crank'),
    Declared(
        'tolerance',
        1e-12,
        'largest correction of a converged pose [rad]',
        constraint='> 0, <= 1e-3',
    ),
    Declared(
        'max_crank_step', 0.35, 'larger crank steps are split [rad]', constraint='finite, > 0'
    ),
)


def _drive(prefix: str) -> list[Declared]:
    """Return the parameters of how a leg is driven."""
    return [
        Declared(
            f'{prefix}phase',
            0.0,
            "the leg's crank angle where the crank is at 0 [rad]",
            constraint='finite',
            any_number=True,
        ),
        Declared(
            f'{prefix}direction',
            1,
            '+1, or -1 for a leg whose crank turns the other way',
            constraint='+1 or -1',
            any_number=True,
        ),
    ]


def _own(name: str, common: Mapping[str, Any]) -> list[Declared]:
    """Return the parameters of a named leg; its geometry is the common one where not given."""
    geometry = [
        Declared(
            f'{name}.{p.name}',
            common[p.name],
            f'{name}: {p.description}',
            constraint=p.constraint,
            read_only=False,
        )
        for p in geometry_parameters.declared()
    ]
    return [
        *geometry,
        *_drive(f'{name}.'),
        Declared(f'{name}.crank_joint', '', 'its own joint in crank_state; empty: crank_joint'),
        Declared(f'{name}.mount_xyz', [0.0] * 3, 'where its plane is in base_link [m]'),
        Declared(f'{name}.mount_rpy', list(UPRIGHT), 'how its plane is turned in it [rad]'),
    ]


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
        self._file = values['linkage']
        names = _names(values['legs'])
        self._prefixes = {name: f'{name}.' for name in names} if names else {'': ''}
        for name in names:
            values.update(declare(node, _own(name, values)))
        if not names:
            values.update(declare(node, _drive('')))
        try:
            description = linkage_text(self._file) if self._file else ''
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

    def changed(self, parameters: Sequence[Parameter]) -> dict[str, Leg]:
        """
        Return the legs that parameters change, by name, as they become.

        Raises
        ------
        GeometryError
            They are no leg, or there are no such lengths.

        """
        changed: dict[str, Leg] = {}
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

    def _changed(self, solved: SolvedLeg, changes: dict[str, Any]) -> Leg:
        leg = solved.leg
        if not isinstance(leg, KlannLeg):
            msg = f'{", ".join(changes)} cannot be changed: the leg is the linkage in {self._file}'
            raise GeometryError(msg)
        if 'assembly' in changes:
            # rclpy has arrays of its own.
            changes['assembly'] = list(changes['assembly'])
        geometry = geometry_parameters.geometry({**leg.geometry.as_dict(), **changes})
        return leg if geometry == leg.geometry else KlannLeg(geometry, **self._settings)

    def _leg(self, prefix: str, values: Mapping[str, Any], description: str) -> Leg:
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
            msg = f'legs = {found!r} is refused: letters, digits and _, a letter first, each once'
            raise StartError(msg)
    return found


def _mounting(name: str, prefix: str, values: Mapping[str, Any]) -> Mounting:
    phase, direction = values[f'{prefix}phase'], values[f'{prefix}direction']
    if not isfinite(phase):
        msg = f'{prefix}phase = {phase!r} is refused: it must be finite'
        raise StartError(msg)
    if direction not in (-1, 1):
        msg = f'{prefix}direction = {direction!r} is refused: it must be +1 or -1'
        raise StartError(msg)
    place = [tuple(values.get(f'{name}.{word}', ())) for word in ('mount_xyz', 'mount_rpy')]
    for word, numbers in zip(('mount_xyz', 'mount_rpy'), place, strict=True):
        if name and not (len(numbers) == 3 and all(map(isfinite, numbers))):
            msg = f'{prefix}{word} = {list(numbers)} is refused: it must be three finite numbers'
            raise StartError(msg)
    return Mounting(
        name,
        values.get(f'{name}.crank_joint') or values['crank_joint'],
        float(phase),
        int(direction),
        place[0],
        place[1],
    )
