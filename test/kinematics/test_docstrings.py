"""The examples in the docstrings do what they show."""

import doctest
import importlib
import pkgutil

import klann_ros.kinematics
import pytest

MODULES = [
    module.name
    for module in pkgutil.walk_packages(klann_ros.kinematics.__path__, 'klann_ros.kinematics.')
]


# The other packages have an example each.
OTHERS = [f'klann_ros.{name}' for name in ('datasheet', 'dynamics', 'export', 'robot', 'twin')]


@pytest.mark.parametrize('name', ['klann_ros.kinematics', *MODULES, *OTHERS])
def test_the_examples_are_true(name: str) -> None:
    options = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    assert doctest.testmod(importlib.import_module(name), optionflags=options).failed == 0


def test_every_public_name_is_documented_with_examples() -> None:
    text = klann_ros.kinematics.__doc__ or ''
    assert text.count('>>>') >= 5
    undocumented = {name for name in klann_ros.kinematics.__all__ if f'`{name}`' not in text}
    assert undocumented == {
        # Named by what they belong to.
        *('AnyLeg', 'Leg', 'KlannMotion', 'FourBarMotion', 'LinkageMotion'),
        *('ImmobileDirectionError', 'NoFootPathError', 'NoStanceError', 'NotAssembledError'),
        *('PartialTurnError', 'SingularPoseError'),
    }
