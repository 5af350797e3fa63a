"""What users copy: the parameter files are the presets."""

from pathlib import Path
from typing import Any

from klann_ros.kinematics import KlannGeometry
from klann_ros.nodes.walker.declarations import WALKER_PARAMETERS
import pytest
from yaml_tables import read_table

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize('preset', ['sem104', 'patent'])
def test_a_parameter_file_is_its_preset_to_the_last_digit(preset: str) -> None:
    content = read_table(ROOT / 'config' / f'{preset}.yaml')
    assert list(content) == ['/**']
    parameters = content['/**']['ros__parameters']
    geometry = getattr(KlannGeometry, preset)()
    assert parameters == {**geometry.as_dict(), 'bar_density': 1.0, 'foot_mass': 0.0}
    # A double written as 1 would be an integer to ROS.
    assert {type(number) for name, number in parameters.items() if name != 'assembly'} == {float}


def refused(section: Any, types: Any) -> list[str]:
    """Return the names of a section that are unknown, or whose parameter has another type."""
    if isinstance(types, list):
        return ['type'] if {type(number).__name__ for number in section} - {*types} else []
    if not isinstance(types, dict):
        return [] if type(section).__name__ == types else ['type']
    names = []
    for name, parameter in section.items():
        if name not in types and 'any' not in types:
            names.append(name)
            continue
        inner_names = refused(parameter, types.get(name, types.get('any')))
        names += [f'{name}: {inner_name}' for inner_name in inner_names]
    return names


def test_the_gamepad_is_configured_by_parameters_that_exist() -> None:
    types = read_table(ROOT / 'test' / 'support' / 'gamepad_parameters.yaml')
    types['walker_node'] = {p.name: type(p.default).__name__ for p in WALKER_PARAMETERS}
    sections = {}
    for node, section in read_table(ROOT / 'config' / 'gamepad.yaml').items():
        sections[node.removeprefix('/**/')] = section['ros__parameters']
    assert set(sections) == set(types)
    assert refused(sections, types) == []
    # A stick that is held repeats its command before walker_node times out.
    assert sections['joy_node']['autorepeat_rate'] > 2.0 / 0.5


def test_an_unknown_parameter_and_another_type_are_seen() -> None:
    types = {'joy_node': {'deadzone': 'float'}, 'locks': {'any': {'priority': 'int'}}}
    assert refused({'joy_node': {'deadzone': 1}}, types) == ['joy_node: deadzone: type']
    assert refused({'joy_node': {'dead': 1.0}}, types) == ['joy_node: dead']
    assert refused({'locks': {'a': {'topic': 'x'}}}, types) == ['locks: a: topic']
