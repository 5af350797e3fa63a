"""A leg from what tells it: a file, or the parameters in a run."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from klann_ros.kinematics import (
    AnyLeg,
    KlannGeometry,
    KlannLeg,
    linkage_from_text,
    LinkageFileError,
    LinkageLeg,
    shipped_linkage,
)
from klann_ros.kinematics.klann.geometry import NUMBERS, PRESETS
from klann_ros.kinematics.linkage.file import is_linkage
from klann_ros.log.errors import LogError
from klann_ros.log.run_parameters import LINKAGE_PARAMETER
from klann_ros.robot.file import preset_names
from klann_ros.untrusted.files import read_plain
from klann_ros.untrusted.text import printable_line
from klann_ros.untrusted.yaml_text import LONGEST, parse


class LegFileError(LogError):
    """A file that holds no leg; the text says why."""


LEG_PARAMETERS = (*NUMBERS, 'assembly', LINKAGE_PARAMETER)
"""Those of a solver that tell its leg."""


def leg_of(name: str) -> AnyLeg:
    """
    Return the leg in a file, or the one of a name if no file is called so.

    Raises
    ------
    LegFileError
        There is neither, or the file holds no leg.

    """
    if name in preset_names() and not Path(name).exists():
        preset = PRESETS.get(name)
        return KlannLeg(preset()) if preset else LinkageLeg(shipped_linkage(name))
    return leg_from_file(name)


def leg_from_file(path: str) -> AnyLeg:
    """
    Return the leg in a YAML file: solver_node's parameters, a mapping of lengths, or a linkage.

    A LegFileError says that the file cannot be read, or holds no leg.
    """
    try:
        text = read_plain(path, LONGEST)
        content = parse(text)
        if is_linkage(content):
            return LinkageLeg(linkage_from_text(text, path))
        return leg_from_parameters(_ros_parameters(content))
    except LinkageFileError as error:
        raise LegFileError(str(error)) from error
    except OSError as error:
        also = f'; shipped are {", ".join(preset_names())}' * isinstance(error, FileNotFoundError)
        raise LegFileError(f'{path} cannot be read: {error.strerror}{also}') from error
    except (ValueError, TypeError) as error:
        # A path that is none, a text that is none, and a geometry that is none.
        raise LegFileError(f'{path} holds no geometry: {printable_line(error)}') from error


def leg_from_parameters(parameters: Mapping[str, Any]) -> AnyLeg:
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
