"""The physics engine: imported when it is used."""

from importlib import import_module
from typing import Any


class NoMujocoError(ImportError):
    """The physics engine is not installed; the text says how to get it."""


def engine() -> Any:
    """
    Return the module of the physics engine.

    Raises
    ------
    NoMujocoError
        It is not installed.

    """
    try:
        return import_module('mujoco')
    except ImportError as error:
        msg = "the physics engine is not installed: pip install 'klann_ros[sim]'"
        raise NoMujocoError(msg) from error
