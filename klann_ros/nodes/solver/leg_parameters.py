"""The legs of solver_node, made from its parameters."""

from collections.abc import Sequence
from typing import Any

from klann_ros.kinematics import AnyLeg, GeometryError, KlannGeometry, KlannLeg, LinkageLeg
from klann_ros.kinematics.klann import PRESETS
from klann_ros.log.run_parameters import LINKAGE_PARAMETER
from klann_ros.nodes.parameters import (
    declare,
    declare_constant,
    declare_given,
    overrides,
    parameter_folders,
    plain,
    StartError,
)
from klann_ros.robot import Robot, robot_from_parameters
from klann_ros.sanitize.text import printable
from rclpy.node import Node
from rclpy.parameter import Parameter

from .declarations import drive, GEOMETRY, GEOMETRY_NAMES, LEGS, MASSES, named_leg, SETTINGS
from .driven_leg import DrivenLeg

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
        for name in dict.fromkeys(filter(None, values['legs'])):
            # Characters that ROS does not allow in a name are refused with the others.
            if name.isidentifier():
                values.update(declare(node, named_leg(name, values)))
        if not any(values['legs']):
            values.update(declare(node, drive()))
        given = given_descriptions(node)
        try:
            robot = robot_from_parameters(
                {name: plain(value) for name, value in {**values, **given}.items()},
                folders=parameter_folders(),
                weigh=False,
            )
            separator = values['joint_separator']
            robot.joint_names(separator)
            self._prefixes = {leg.name: f'{leg.name}.' * bool(leg.name) for leg in robot.legs}
            self._files = {leg.name: leg.linkage_file for leg in robot.legs if leg.description}
            self.legs = [
                DrivenLeg(leg, LinkageLeg(leg.linkage, **self._settings), separator)
                for leg in robot.legs
            ]
        except ValueError as error:
            # A GeometryError, or what a leg says of tolerance and max_crank_step.
            raise StartError(str(error)) from error
        self._declare_descriptions(node, robot)
        masses = [prefix + name for prefix in {'', *self._prefixes.values()} for name in MASSES]
        declare_given(node, masses, 'unused by the solver, recorded for review')

    def _declare_descriptions(self, node: Node, robot: Robot) -> None:
        """Declare the text of the legs' linkage, and of each leg's where they differ."""
        texts = {self._prefixes[leg.name]: leg.description for leg in robot.legs}
        if len(set(texts.values())) == 1:
            texts = {'': robot.legs[0].description}
        for prefix, text in {'': '', **texts}.items():
            what = "content of the linkage's file; empty for Klann legs"
            declare_constant(node, f'{prefix}{LINKAGE_PARAMETER}', text, what)

    @property
    def summary(self) -> str:
        """Return which legs there are, in words."""
        kinds = {leg.name: self._kind(leg) for leg in self.legs}
        kind = self._kind(self.legs[0])
        if len(kinds) == 1:
            return f'{kind} ({", ".join(kinds)})' if self.legs[0].name else kind
        if len(set(kinds.values())) == 1:
            return f'{len(kinds)} legs ({", ".join(kinds)}), each a {kind}'
        legs = ', '.join(f'{name} a {kind}' for name, kind in kinds.items())
        return f'{len(kinds)} legs: {legs}'

    def _kind(self, driven: DrivenLeg) -> str:
        linkage = driven.leg.linkage
        if driven.name not in self._files:
            names = [name for name, preset in _PRESETS.items() if preset.linkage == linkage]
            return f'Klann leg {names[0]}' if names else 'Klann leg of its own lengths'
        file = self._files[driven.name] or LINKAGE_PARAMETER
        return f'linkage {printable(linkage.name)} ({printable(file)})'

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
                leg = self._changed(driven, changes)
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
        leg, _, length = parameter.name.rpartition('.')
        if length not in GEOMETRY_NAMES or (leg in self._prefixes and leg not in self._files):
            return False
        return bool(plain(self._start_values.get(parameter.name)) == plain(parameter.value))

    def _changed(self, driven: DrivenLeg, changes: dict[str, Any]) -> AnyLeg:
        if driven.name in self._files:
            file = self._files[driven.name] or LINKAGE_PARAMETER
            raise GeometryError(
                f'{", ".join(changes)} cannot be changed: the leg is the linkage in {file}'
            )
        leg = driven.leg
        changes = {name: plain(value) for name, value in changes.items()}
        values = {**leg.linkage.dimensions, 'assembly': leg.assembly, **changes}
        geometry = KlannGeometry(**values)
        return leg if geometry.linkage == leg.linkage else KlannLeg(geometry, **self._settings)


def given_descriptions(node: Node) -> dict[str, Any]:
    """Return the given texts of linkages: a dump of the parameters holds them."""
    return {
        name: parameter.value
        for name, parameter in overrides(node).items()
        if name.rpartition('.')[2] == LINKAGE_PARAMETER
    }
