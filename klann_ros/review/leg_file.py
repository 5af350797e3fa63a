"""A leg from what tells it: a file, or the parameters in a run."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from klann_ros.kinematics import (
    KlannGeometry,
    KlannLeg,
    linkage_from_text,
    LinkageFileError,
    LinkageLeg,
)
from klann_ros.kinematics.klann.geometry import NUMBERS
from klann_ros.kinematics.leg_types import Leg
from klann_ros.kinematics.linkage.yaml_text import parse
from klann_ros.log.errors import LogError
from klann_ros.log.run_parameters import LINKAGE_PARAMETER

# One of them is enough to tell that a file is meant to be a linkage.
_LINKAGE_KEYS = {'pivots', 'bodies', 'crank', 'foot'}


class LegFileError(LogError):
    """A file that holds no leg; the text says why."""


def leg_from_file(path: str) -> Leg:
    """
    Return the leg in a YAML file: solver_node's parameters, a mapping of lengths, or a linkage.

    Raises
    ------
    LegFileError
        The file cannot be read, or holds no leg.

    """
    try:
        text = Path(path).read_text(encoding='utf-8')
        content = parse(text)
        if isinstance(content, dict) and not _LINKAGE_KEYS.isdisjoint(content):
            return LinkageLeg(linkage_from_text(text, path))
        return leg_from_parameters(_ros_parameters(content))
    except LinkageFileError as error:
        raise LegFileError(str(error)) from error
    except (OSError, ValueError, TypeError) as error:
        # A path that is none, a text that is none, and a geometry that is none.
        msg = f'{path} holds no geometry: {" ".join(str(error).split())}'
        raise LegFileError(msg) from error


def leg_from_parameters(parameters: Mapping[str, Any]) -> Leg:
    """
    Return the leg that a solver's parameters tell; others among them do not matter.

    Raises
    ------
    TypeError
        There is no length among them, or it is no number.
    GeometryError
        They are no linkage.

    """
    linkage = parameters.get(LINKAGE_PARAMETER)
    if isinstance(linkage, str) and linkage:
        return LinkageLeg(linkage_from_text(linkage, f'the parameter {LINKAGE_PARAMETER}'))
    names = (*NUMBERS, 'assembly')
    numbers = {name: parameters[name] for name in names if name in parameters}
    if not numbers:
        msg = f'none of {", ".join(names)} is in it'
        raise TypeError(msg)
    return KlannLeg(KlannGeometry(**numbers))


def _ros_parameters(content: Any) -> Mapping[str, Any]:
    if not isinstance(content, dict):
        msg = 'it must be a mapping, such as config/sem104.yaml is'
        raise TypeError(msg)
    for value in content.values():
        if isinstance(value, dict):
            return value.get('ros__parameters', value)  # type: ignore[no-any-return]
    return content
