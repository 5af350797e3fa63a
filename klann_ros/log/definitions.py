"""
Message types: the grammar of their names, who is installed, and the text of their definitions.

A name, by a log or a publisher, is taken apart and looked up in ament's index before anything is
done with it: it becomes a path here and a module elsewhere, and to import a module is to run it.

The format of a definition is MCAP's ``ros2msg``: the type's own .msg file, then for each type it
is made of, depth first and each once, a line of 80 ``=``, a line ``MSG: pkg/Type`` and that type's
file.
"""

from collections.abc import Iterable, Iterator
import os
from pathlib import Path
import re
import sys

from klann_ros.sanitize.files import is_regular_file, open_regular

from .errors import AnyPath, UnknownTypeError

SEPARATOR = '=' * 80

_LONGEST = 1_000_000

_PRIMITIVES = {
    'bool', 'byte', 'char', 'float32', 'float64', 'int8', 'uint8', 'int16', 'uint16', 'int32',
    'uint32', 'int64', 'uint64', 'string', 'wstring',
}  # fmt: skip
_FIELD = re.compile(r'\s*([A-Za-z][\w/]*)', re.ASCII)

INDEX = Path('share', 'ament_index', 'resource_index', 'rosidl_interfaces')
"""Where a prefix has a file for each package of interfaces that is installed under it."""

# As rosidl has it for packages, letters of both cases: .idl files may have names that .msg files
# may not.
_WORD = '[A-Za-z][A-Za-z0-9]*(?:_[A-Za-z0-9]+)*'
_NAME = re.compile(f'({_WORD})/(msg/)?({_WORD})')


def definition(type_name: str, prefixes: Iterable[AnyPath] | None = None) -> str:
    """
    Return the complete definition of a message type.

    Parameters
    ----------
    type_name
        Such as ``sensor_msgs/msg/JointState``.
    prefixes
        Install prefixes that are searched in this order for ``share/PKG/msg/Type.msg``; by
        default those of AMENT_PREFIX_PATH, then ``sys.prefix``, where pip's wheels put them.

    Raises
    ------
    UnknownTypeError
        The name is not one of a message, or its .msg file or that of a type in it is missing.

    """
    places = default_prefixes() if prefixes is None else [Path(prefix) for prefix in prefixes]
    package, name = _split(type_name)
    texts: dict[str, str] = {}
    _collect(package, name, places, texts)
    (_, text), *others = texts.items()
    for other, other_text in others:
        text = f'{_line_end(text)}{SEPARATOR}\nMSG: {other}\n{other_text}'
    return text


def _collect(package: str, name: str, places: list[Path], texts: dict[str, str]) -> None:
    """Put a type's text and then those of the types in it into texts; one met before is done."""
    key = f'{package}/{name}'
    if key in texts:
        return
    texts[key] = _read(package, name, places)
    for field in _field_types(texts[key]):
        if field not in _PRIMITIVES:
            _collect(*_split(field if '/' in field else f'{package}/{field}'), places, texts)


def _split(type_name: str) -> tuple[str, str]:
    named = split_type(type_name, short=True)
    if named is None:
        raise UnknownTypeError(type_name, 'a message type is named like std_msgs/msg/Float64')
    return named


def _read(package: str, name: str, places: list[Path]) -> str:
    relative = Path('share', package, 'msg', f'{name}.msg')
    for place in places:
        if is_regular_file(place / relative):
            return _text(place / relative, f'{package}/msg/{name}')
    searched = os.pathsep.join(map(str, places)) or 'no prefix'
    raise UnknownTypeError(f'{package}/msg/{name}', f'{relative} is not under {searched}')


def _text(path: Path, type_name: str) -> str:
    try:
        with open_regular(path) as file:
            # Bytes, so that the line ends stay as they are in the file.
            data = file.read(_LONGEST + 1)
    except OSError as error:
        raise UnknownTypeError(type_name, f'{path} cannot be read: {error.strerror}') from error
    if len(data) > _LONGEST:
        raise UnknownTypeError(type_name, f'{path} is longer than {_LONGEST} bytes')
    return data.decode('utf-8', 'replace')


def _field_types(text: str) -> Iterator[str]:
    """Yield the type of each field and constant: the first word, without array and bound."""
    for line in text.splitlines():
        match = _FIELD.match(line)
        if match:
            yield match[1]


def _line_end(text: str) -> str:
    return text if not text or text.endswith('\n') else f'{text}\n'


def split_type(name: str, *, short: bool = False) -> tuple[str, str] | None:
    """
    Return the package and the message of a type such as ``std_msgs/msg/Float64``.

    Parameters
    ----------
    name
        The name, by anybody.
    short
        Whether ``std_msgs/Float64``, as definitions write it, is taken as well.

    Returns
    -------
    tuple of str, or None
        None for whatever is not written like a message type.

    """
    match = _NAME.fullmatch(name)
    if match is None or not (short or match[2]):
        return None
    return match[1], match[3]


def is_installed(package: str, prefixes: Iterable[AnyPath] | None = None) -> bool:
    """
    Return whether a package is one of interfaces, by ament's index under these prefixes.

    Where AMENT_PREFIX_PATH is not set, as beside pip's wheels, ament's own library knows none.
    """
    places = default_prefixes() if prefixes is None else prefixes
    return any(is_regular_file(Path(place) / INDEX / package) for place in places)


def default_prefixes() -> list[Path]:
    """Return the prefixes of a sourced ROS, then the one of this Python."""
    sourced = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    return [Path(prefix) for prefix in [*sourced, sys.prefix] if prefix]
