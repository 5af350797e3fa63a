"""What users copy: the parameter files are the presets."""

from pathlib import Path

from klann_ros.kinematics import KlannGeometry
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize('preset', ['sem104', 'patent'])
def test_a_parameter_file_is_its_preset_to_the_last_digit(preset: str) -> None:
    content = yaml.safe_load((ROOT / 'config' / f'{preset}.yaml').read_text())
    assert list(content) == ['/**']
    parameters = content['/**']['ros__parameters']
    geometry = getattr(KlannGeometry, preset)()
    assert parameters == {**geometry.as_dict(), 'bar_density': 1.0, 'foot_mass': 0.0}
    # A double written as 1 would be an integer to ROS.
    assert {type(value) for name, value in parameters.items() if name != 'assembly'} == {float}
