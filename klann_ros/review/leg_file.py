"""A geometry from the parameters that tell it: those of a file, or those in a run."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from klann_ros.kinematics import GeometryError, KlannGeometry
from klann_ros.kinematics.klann.geometry import BENDS, COORDINATES, LENGTHS
from klann_ros.log.errors import LogError
import yaml


class GeometryFileError(LogError):
    """A file that holds no geometry; the text says why."""


def geometry_from_file(path: str) -> KlannGeometry:
    """
    Return the geometry in a YAML file: a parameter file of solver_node, or a mapping of lengths.

    Raises
    ------
    GeometryFileError
        The file cannot be read, or holds no geometry.

    """
    try:
        content = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
        return geometry_from_parameters(_ros_parameters(content))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, TypeError, GeometryError) as error:
        msg = f'{path} holds no geometry: {" ".join(str(error).split())}'
        raise GeometryFileError(msg) from error


def geometry_from_parameters(parameters: Mapping[str, Any]) -> KlannGeometry:
    """
    Return the geometry that a solver's parameters tell; others among them do not matter.

    Raises
    ------
    TypeError
        There is no length among them, or it is no number.
    GeometryError
        They are no linkage.

    """
    names = (*LENGTHS, *COORDINATES, *BENDS, 'assembly')
    numbers = {name: parameters[name] for name in names if name in parameters}
    if not numbers:
        msg = f'none of {", ".join(names)} is in it'
        raise TypeError(msg)
    return KlannGeometry(**numbers)


def _ros_parameters(content: Any) -> Mapping[str, Any]:
    if not isinstance(content, dict):
        msg = 'it must be a mapping, such as config/sem104.yaml is'
        raise TypeError(msg)
    for value in content.values():
        if isinstance(value, dict):
            return value.get('ros__parameters', value)  # type: ignore[no-any-return]
    return content
