"""The legs of `solver_node` from its parameters, some of which change while it runs."""

from collections.abc import Sequence
from typing import Any

from klann_ros.kinematics import (
    AnyLeg,
    GeometryError,
    KlannGeometry,
    KlannLeg,
    LinkageLeg,
    PRESETS,
)
from klann_ros.log import LINKAGE_PARAMETER
from klann_ros.nodes.leg_declarations import (
    drive,
    FOR_OTHERS,
    GEOMETRY,
    GEOMETRY_NAMES,
    LEGS,
    named_leg,
)
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

from .declarations import SETTINGS
from .driven_leg import DrivenLeg


class LegParameters:
    """The legs of a node, in the order of their names, and their parameters."""

    def __init__(self, node: Node) -> None:
        """Declare the parameters; a StartError says why they are no legs."""
        values = declare(node, (*GEOMETRY, *LEGS, *SETTINGS))
        self._settings = {name: values[name] for name in ('tolerance', 'max_crank_step')}
        self._start_values = values
        for name in dict.fromkeys(filter(None, values['legs'])):
            # Characters that ROS does not allow in a name are refused with the others.
            if name.isidentifier():
                values.update(declare(node, named_leg(name, values)))
        if not any(values['legs']):
            values.update(declare(node, drive()))
        parameters = {name: plain(values[name]) for name in values}
        for name, parameter in overrides(node).items():
            # A dump of the parameters holds the text of each linkage.
            if name.rpartition('.')[2] == LINKAGE_PARAMETER or name.startswith('cranks.'):
                parameters[name] = plain(parameter.value)
        cranks = [name for name in parameters if name.startswith('cranks.')]
        declare_given(node, cranks, 'encoder or motor of a crank joint')
        # The legs, by the order of their names; their prefixes of parameters, by name.
        self.legs: list[DrivenLeg] = []
        self._prefixes: dict[str, str] = {}
        # The linkage's file of each leg that is no Klann leg.
        self._files: dict[str, str] = {}
        try:
            robot = robot_from_parameters(parameters, folders=parameter_folders(), weigh=False)
            separator = values['joint_separator']
            robot.joint_names(separator)
            for leg in robot.legs:
                self._prefixes[leg.name] = f'{leg.name}.' if leg.name else ''
                if leg.description:
                    self._files[leg.name] = leg.linkage_file
                solver = LinkageLeg(leg.linkage, **self._settings)
                self.legs.append(DrivenLeg(leg, solver, separator))
        except ValueError as error:
            # Also a GeometryError, and the solver's refusal of tolerance or max_crank_step.
            raise StartError(str(error)) from error
        self._declare_descriptions(node, robot)
        for prefix in {'', *self._prefixes.values()}:
            names = [prefix + name for name in FOR_OTHERS]
            declare_given(node, names, 'unused by the solver, described for other programs')

    def _declare_descriptions(self, node: Node, robot: Robot) -> None:
        """Declare the text of the legs' linkage, and of each leg's where they differ."""
        texts = {self._prefixes[leg.name]: leg.description for leg in robot.legs}
        if len(set(texts.values())) == 1:
            texts = {'': robot.legs[0].description}
        for prefix, text in {'': '', **texts}.items():
            description = "content of the linkage's file; empty for Klann legs"
            declare_constant(node, f'{prefix}{LINKAGE_PARAMETER}', text, description)

    @property
    def summary(self) -> str:
        """Return the legs in words."""
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
            for name, make_geometry in PRESETS.items():
                if make_geometry().linkage == linkage:
                    return f'Klann leg {name}'
            return 'Klann leg of its own lengths'
        file = self._files[driven.name] or LINKAGE_PARAMETER
        return f'{printable(linkage.name)} ({printable(file)})'

    def changed(self, parameters: Sequence[Parameter]) -> dict[str, AnyLeg]:
        """Return the legs that parameters change, by name; a GeometryError for refused ones."""
        changed_legs: dict[str, AnyLeg] = {}
        values = {p.name: p.value for p in parameters if not self._is_unchanged_constant(p)}
        for driven in self.legs:
            prefix = self._prefixes[driven.name]
            changes = {}
            for name in GEOMETRY_NAMES:
                if prefix + name in values:
                    changes[name] = plain(values.pop(prefix + name))
            if changes:
                leg = self._changed(driven, changes)
                if leg is not driven.leg:
                    changed_legs[driven.name] = leg
        common = [name for name in values if name in GEOMETRY_NAMES]
        if common:
            example = next(iter(self._prefixes.values())) + common[0]
            raise GeometryError(
                f'{", ".join(common)}: each leg has its own, which can be changed: {example}'
            )
        return changed_legs

    def _is_unchanged_constant(self, parameter: Parameter) -> bool:
        """Return whether a length that cannot be changed is set to its present value."""
        leg, _, name = parameter.name.rpartition('.')
        if name not in GEOMETRY_NAMES or (leg in self._prefixes and leg not in self._files):
            return False
        return bool(plain(self._start_values.get(parameter.name)) == plain(parameter.value))

    def _changed(self, driven: DrivenLeg, changes: dict[str, Any]) -> AnyLeg:
        if driven.name in self._files:
            file = self._files[driven.name] or LINKAGE_PARAMETER
            raise GeometryError(
                f'{", ".join(changes)} cannot be changed: the leg is the linkage in {file}'
            )
        leg = driven.leg
        geometry = KlannGeometry(**{**leg.linkage.dimensions, 'assembly': leg.assembly, **changes})
        return leg if geometry.linkage == leg.linkage else KlannLeg(geometry, **self._settings)
