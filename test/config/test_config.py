"""What users copy: the parameter files are the presets."""

from pathlib import Path
from typing import Any

from klann_ros.kinematics import KlannGeometry
from klann_ros.nodes.walker.declarations import WALKER_PARAMETERS
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize('preset', ['sem104', 'patent'])
def test_a_parameter_file_is_its_preset_to_the_last_digit(preset: str) -> None:
    content = yaml.safe_load((ROOT / 'config' / f'{preset}.yaml').read_text())
    assert list(content) == ['/**']
    parameters = content['/**']['ros__parameters']
    geometry = getattr(KlannGeometry, preset)()
    assert parameters == {**geometry.as_dict(), 'bar_density': 1.0, 'foot_mass': 0.0}
    # A double written as 1 would be an integer to ROS.
    assert {type(value) for name, value in parameters.items() if name != 'assembly'} == {float}


def refused(section: Any, known: Any) -> list[str]:
    """Return the names of a section that are unknown, or whose value has another type."""
    if isinstance(known, list):
        return [] if all(type(element).__name__ == known[0] for element in section) else ['type']
    if not isinstance(known, dict):
        return [] if type(section).__name__ == known else ['type']
    names = []
    for name, content in section.items():
        description = known.get(name, known.get('any'))
        below = [] if description is None else refused(content, description)
        names += [name] if description is None else [f'{name}: {inner}' for inner in below]
    return names


def test_the_gamepad_is_configured_by_parameters_that_exist() -> None:
    content = yaml.safe_load((ROOT / 'config' / 'gamepad.yaml').read_text())
    known = yaml.safe_load((ROOT / 'test' / 'support' / 'gamepad_parameters.yaml').read_text())
    known['walker_node'] = {p.name: type(p.default).__name__ for p in WALKER_PARAMETERS}
    sections = {node.removeprefix('/**/'): of['ros__parameters'] for node, of in content.items()}
    assert set(sections) == set(known)
    assert refused(sections, known) == []
    # A stick that is held repeats its command before walker_node times out.
    assert sections['joy_node']['autorepeat_rate'] > 2.0 / 0.5


def test_an_unknown_parameter_and_another_type_are_seen() -> None:
    known = {'joy_node': {'deadzone': 'float'}, 'locks': {'any': {'priority': 'int'}}}
    assert refused({'joy_node': {'deadzone': 1}}, known) == ['joy_node: deadzone: type']
    assert refused({'joy_node': {'dead': 1.0}}, known) == ['joy_node: dead']
    assert refused({'locks': {'a': {'topic': 'x'}}}, known) == ['locks: a: topic']
