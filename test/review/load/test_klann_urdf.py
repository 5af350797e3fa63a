"""Legs out of URDFs: those that the xacro makes to the last bit, and no leg of another robot."""

from pathlib import Path
import re
from typing import Any

from hypothesis import given, HealthCheck, settings, strategies as st
from klann_ros.kinematics import KlannGeometry
from klann_ros.review.load.columns import MAX_DESCRIPTION_SIZE
from klann_ros.review.load.geometry import klann_legs_in_urdf
import pytest
from strategies import legs
from xacro_legs import ROOT, urdf_of
import yaml

SEM104 = KlannGeometry.sem104()
URDF = (ROOT / 'urdf' / 'klann.urdf').read_text(encoding='utf-8')
WALKER = (ROOT / 'urdf' / 'walker6.urdf').read_text(encoding='utf-8')


def numbers(geometry: KlannGeometry) -> dict[str, Any]:
    parameters = geometry.as_dict()
    del parameters['assembly']
    return parameters


@pytest.mark.parametrize(('name', 'count'), [('klann', 1), ('walker4', 4), ('walker6', 6)])
def test_the_shipped_urdfs_are_of_the_shipped_legs(name: str, count: int) -> None:
    urdf_legs = klann_legs_in_urdf((ROOT / 'urdf' / f'{name}.urdf').read_text(encoding='utf-8'))
    assert list(urdf_legs.values()) == [numbers(SEM104)] * count


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(geometry=legs())
def test_a_leg_is_found_to_the_last_bit(
    geometry: KlannGeometry, tmp_path_factory: pytest.TempPathFactory
) -> None:
    file = tmp_path_factory.mktemp('leg') / 'leg.yaml'
    content = {'/**': {'ros__parameters': geometry.as_dict()}}
    file.write_text(yaml.safe_dump(content), encoding='utf-8')
    assert klann_legs_in_urdf(urdf_of(file)) == {'': numbers(geometry)}


def test_legs_with_lengths_and_frames_of_their_own_are_separate(tmp_path: Path) -> None:
    file = tmp_path / 'walker.yaml'
    shared = {'legs': ['left', 'right'], 'left': {'l_gh': 0.1 + 0.2}, 'right': {'x_e': -0.1}}
    file.write_text(yaml.safe_dump({'/**': {'ros__parameters': {'l_ab': 0.11, **shared}}}))
    common = {**numbers(SEM104), 'l_ab': 0.11}
    expected = {'left': {**common, 'l_gh': 0.1 + 0.2}, 'right': {**common, 'x_e': -0.1}}
    for options in ({}, {'frame_prefix': 'a/', 'base_frame': 'trunk', 'frame_id': 'plane'}):
        assert klann_legs_in_urdf(urdf_of(file, **options)) == expected


def test_a_leg_that_is_a_part_of_another_robot_is_found() -> None:
    arm = (
        '<link name="arm"><visual><geometry><box size="9 9 9"/></geometry></visual></link>'
        '<joint name="shoulder" type="revolute"><parent link="base_link"/><child link="arm"/>'
        '<origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><limit effort="1" velocity="1"/></joint>'
    )
    assert klann_legs_in_urdf(URDF.replace('</robot>', f'{arm}</robot>')) == {'': numbers(SEM104)}


# One of them has half of a character, which libyaml refuses.
CHANGES = yaml.safe_load(Path(__file__).with_name('urdf_changes.yaml').read_text())


@pytest.mark.parametrize('change', CHANGES.values(), ids=CHANGES)
def test_other_urdfs_are_not_a_klann_leg(change: tuple[str, str]) -> None:
    original, replacement = change
    assert original in URDF
    changed = URDF.replace(original, replacement)
    # A text has no encoding, whatever its declaration.
    expected = {'': numbers(SEM104)} if 'encoding="x"' in changed else {}
    assert klann_legs_in_urdf(changed) == expected


@pytest.mark.parametrize(
    'text', ['', 'robot', '<robot/>', '<a>' * 50_000, '\n' * (MAX_DESCRIPTION_SIZE + 1)]
)
def test_invalid_urdfs_have_no_legs(text: str) -> None:
    assert klann_legs_in_urdf(text) == {}


@settings(max_examples=120, deadline=None)
@given(
    st.integers(0, len(URDF) - 1),
    st.integers(0, 60),
    st.text(st.sampled_from('<>/"=!&; 0.-einfa\0\udc80\u202e'), max_size=12),
)
def test_no_text_is_an_error(begin: int, size: int, text: str) -> None:
    end = begin + size
    assert set(klann_legs_in_urdf(URDF[:begin] + text + URDF[end:])) <= {''}


@given(st.integers(0, 5))
def test_one_broken_leg_hides_no_other(index: int) -> None:
    names = list(klann_legs_in_urdf(WALKER))
    broken = re.sub(f'name="{names.pop(index)}/gamma"', 'name="gone"', WALKER)
    assert list(klann_legs_in_urdf(broken)) == names
