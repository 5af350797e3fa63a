"""
Message types: the grammar of their names, the installed ones, and their definitions.

An untrusted name is parsed and looked up in ament's index first: it becomes a path here and a
module elsewhere, and importing a module executes it.

A definition has MCAP's format ``ros2msg``: the type's own .msg file, then for each type in it,
depth first and each once, a line of 80 ``=``, a line ``MSG: pkg/Type`` and that type's file.
"""

from collections.abc import Iterable
import os
from pathlib import Path
import re
import sys

from klann_ros.sanitize.files import is_regular_file, open_regular

from .errors import AnyPath, UnknownTypeError

SEPARATOR = '=' * 80

_MAX_FILE_SIZE = 1_000_000

_PRIMITIVES = {
    'bool', 'byte', 'char', 'float32', 'float64', 'int8', 'uint8', 'int16', 'uint16', 'int32',
    'uint32', 'int64', 'uint64', 'string', 'wstring',
}  # fmt: skip
_FIELD = re.compile(r'\s*([A-Za-z][\w/]*)', re.ASCII)

INDEX = Path('share', 'ament_index', 'resource_index', 'rosidl_interfaces')
"""Folder of a prefix with a file for each installed package of interfaces."""

# rosidl's rule for packages with letters of both cases, as .idl files allow.
_WORD = '[A-Za-z][A-Za-z0-9]*(?:_[A-Za-z0-9]+)*'
_NAME = re.compile(f'({_WORD})/(msg/)?({_WORD})')


def definition(type_name: str, prefixes: Iterable[AnyPath] | None = None) -> str:
    """
    Return the complete definition of a message type, such as ``sensor_msgs/msg/JointState``.

    The install prefixes are searched in their order for ``share/PKG/msg/Type.msg``; by default
    those of AMENT_PREFIX_PATH, then ``sys.prefix`` for pip's wheels. An UnknownTypeError: the name
    is no message type, or its .msg file or that of a type in it is missing.
    """
    folders = default_prefixes() if prefixes is None else list(map(Path, prefixes))
    texts: dict[str, str] = {}
    _collect(type_name, folders, texts)
    (_, text), *dependencies = texts.items()
    for dependency, dependency_text in dependencies:
        line_end = '' if not text or text.endswith('\n') else '\n'
        text += f'{line_end}{SEPARATOR}\nMSG: {dependency}\n{dependency_text}'
    return text


def _collect(type_name: str, prefixes: list[Path], texts: dict[str, str]) -> None:
    """Add to `texts` that of a type and those of the types in it, each once."""
    words = split_type(type_name, short=True)
    if words is None:
        raise UnknownTypeError(type_name, 'a message type is named like std_msgs/msg/Float64')
    package, name = words
    key = f'{package}/{name}'
    if key not in texts:
        texts[key] = _read(package, name, prefixes)
        # The first word of a line, without array and bound, is the type of a field or constant.
        for match in filter(None, map(_FIELD.match, texts[key].splitlines())):
            field_type = match[1]
            if field_type not in _PRIMITIVES:
                inner = field_type if '/' in field_type else f'{package}/{field_type}'
                _collect(inner, prefixes, texts)


def _read(package: str, name: str, prefixes: list[Path]) -> str:
    relative = Path('share', package, 'msg', f'{name}.msg')
    for prefix in prefixes:
        if is_regular_file(prefix / relative):
            return _text(prefix / relative, f'{package}/msg/{name}')
    searched = os.pathsep.join(map(str, prefixes)) or 'no prefix'
    raise UnknownTypeError(f'{package}/msg/{name}', f'{relative} is not under {searched}')


def _text(path: Path, type_name: str) -> str:
    try:
        with open_regular(path) as file:
            # Bytes: the line ends stay.
            data = file.read(_MAX_FILE_SIZE + 1)
    except OSError as error:
        raise UnknownTypeError(type_name, f'{path} cannot be read: {error.strerror}') from error
    if len(data) > _MAX_FILE_SIZE:
        raise UnknownTypeError(type_name, f'{path} is longer than {_MAX_FILE_SIZE} bytes')
    return data.decode('utf-8', 'replace')


def split_type(name: str, *, short: bool = False) -> tuple[str, str] | None:
    """
    Return package and message of a type such as ``std_msgs/msg/Float64``; None if it is none.

    With ``short``, ``std_msgs/Float64`` is accepted too, as in definitions.
    """
    match = _NAME.fullmatch(name)
    if match is None or not (short or match[2]):
        return None
    return match[1], match[3]


def is_installed(package: str, prefixes: Iterable[AnyPath] | None = None) -> bool:
    """
    Return whether a package of interfaces is in ament's index under these prefixes.

    Without AMENT_PREFIX_PATH, as with pip's wheels, ament's own library finds none.
    """
    folders = default_prefixes() if prefixes is None else prefixes
    return any(is_regular_file(Path(folder) / INDEX / package) for folder in folders)


def default_prefixes() -> list[Path]:
    """Return the prefixes of a sourced ROS, then the one of this Python."""
    sourced = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    return [Path(prefix) for prefix in [*sourced, sys.prefix] if prefix]
