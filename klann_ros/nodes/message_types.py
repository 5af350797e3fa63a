"""Message classes by the name of their type."""

from importlib import import_module
from typing import Any


class UnknownMessageTypeError(Exception):
    """A message type that is not installed; the text says which."""


def message_class(type_name: str) -> Any:
    """
    Return the class of a message type such as `sensor_msgs/msg/JointState`.

    Raises
    ------
    UnknownMessageTypeError
        The type is not installed, or the name is no message type's.

    """
    try:
        package, kind, name = type_name.split('/')
        if kind == 'msg':
            return getattr(import_module(f'{package}.msg'), name)
    except (ValueError, ImportError, AttributeError):
        pass
    msg = f'message type {type_name!r} is not installed'
    raise UnknownMessageTypeError(msg)
