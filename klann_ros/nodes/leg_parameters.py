"""The leg that the parameters tell: a Klann leg of their lengths, or the linkage in a file."""

from collections.abc import Mapping, Sequence
from typing import Any

from klann_ros.kinematics import (
    GeometryError,
    KlannLeg,
    KlannPose,
    KlannVelocity,
    linkage_from_text,
    LinkageLeg,
    LinkageMotion,
    LinkagePose,
)
from klann_ros.kinematics.linkage.file import linkage_text
from rclpy.parameter import Parameter

from . import geometry_parameters
from .parameters import Declared

DECLARED = (
    *geometry_parameters.declared(),
    Declared('linkage', '', "a linkage's YAML file; empty: the Klann leg of the lengths"),
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

Leg = KlannLeg | LinkageLeg
LegPose = KlannPose | LinkagePose
LegVelocity = KlannVelocity | LinkageMotion


class LegParameters:
    """
    A leg and the parameters that it is made from.

    Parameters
    ----------
    values : mapping of str to object
        The parameters' values at start, by name.

    Attributes
    ----------
    leg : KlannLeg or LinkageLeg
        The leg.
    description : str
        The content of the linkage's file; empty for a Klann leg.

    Raises
    ------
    ValueError
        They are no leg; the text says why.

    """

    def __init__(self, values: Mapping[str, Any]) -> None:
        """Make the leg."""
        self._settings = {name: values[name] for name in ('tolerance', 'max_crank_step')}
        self._file = values['linkage']
        self.description = ''
        self.leg: Leg
        if self._file:
            self.description = linkage_text(self._file)
            self.leg = LinkageLeg(
                linkage_from_text(self.description, self._file), **self._settings
            )
        else:
            self.leg = KlannLeg(geometry_parameters.geometry(values), **self._settings)

    def changed(self, parameters: Sequence[Parameter]) -> Leg:
        """
        Return the leg as parameters change it; the same object where they do not.

        Raises
        ------
        GeometryError
            They are no leg, or this one has no such lengths.

        """
        changes = {p.name: p.value for p in parameters if p.name in geometry_parameters.NAMES}
        if not changes:
            return self.leg
        if not isinstance(self.leg, KlannLeg):
            msg = f'{", ".join(changes)} cannot be changed: the leg is the linkage in {self._file}'
            raise GeometryError(msg)
        if 'assembly' in changes:
            # rclpy has arrays of its own.
            changes['assembly'] = list(changes['assembly'])
        known = self.leg.geometry.as_dict()
        geometry = geometry_parameters.geometry({**known, **changes})
        return self.leg if geometry == self.leg.geometry else KlannLeg(geometry, **self._settings)
