"""
Message classes by the name of their type.

Who names a type may be a stranger: a log, or a publisher on the network. To import a module is to
run it, so only packages are imported that are installed as packages of interfaces. Whether one of
that name comes first on Python's own path, such as in a folder of PYTHONPATH, is beyond this.
"""

from importlib import import_module
from typing import Any

from klann_ros.log.definitions import is_installed, split_type
from klann_ros.untrusted.text import printable
from rclpy.type_support import check_is_valid_msg_type


class UnknownMessageTypeError(Exception):
    """A message type that is not installed, or none at all; the text says which."""


def message_class(type_name: str) -> Any:
    """
    Return the class of a message type such as `sensor_msgs/msg/JointState`.

    Raises
    ------
    UnknownMessageTypeError
        The type is not installed, or the name is no message type's.

    """
    shown = printable(type_name)
    named = split_type(type_name)
    if named is None:
        raise UnknownMessageTypeError(f"'{shown}' is no message type, such as std_msgs/msg/String")
    package, name = named
    try:
        kind = (
            getattr(import_module(f'{package}.msg'), name, None) if is_installed(package) else None
        )
        if kind is not None:
            check_is_valid_msg_type(kind)
    # A package that is installed by halves raises whatever it likes.
    except Exception as error:
        reason = f"message type '{shown}' cannot be used: {printable(error)}"
        raise UnknownMessageTypeError(reason) from error
    if kind is None:
        raise UnknownMessageTypeError(f"message type '{shown}' is not installed")
    return kind
