"""
Names of message types, as a log or a publisher gives them: their grammar, and who is installed.

A name is taken apart and looked up in ament's index before anything is done with it. It becomes a
path here and a module elsewhere, and to import a module is to run it.
"""

from __future__ import annotations

import os
from pathlib import Path
import re
import sys
from typing import TYPE_CHECKING

from klann_ros.untrusted.files import is_plain

if TYPE_CHECKING:
    from collections.abc import Iterable

    from .errors import AnyPath

INDEX = Path('share', 'ament_index', 'resource_index', 'rosidl_interfaces')
"""Where a prefix has a file for each package of interfaces that is installed under it."""

# As rosidl has it for packages, letters of both cases: .idl files may have names that .msg files
# may not.
_WORD = '[A-Za-z][A-Za-z0-9]*(?:_[A-Za-z0-9]+)*'
_NAME = re.compile(f'({_WORD})/(msg/)?({_WORD})')


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
    return any(is_plain(Path(place) / INDEX / package) for place in places)


def default_prefixes() -> list[Path]:
    """Return the prefixes of a sourced ROS, then the one of this Python."""
    sourced = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    return [Path(prefix) for prefix in [*sourced, sys.prefix] if prefix]
