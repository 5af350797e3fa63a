"""The URDF by xacro is that of `export`, whose links are held against the solved leg."""

import io
from math import isclose
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from klann_ros.export import urdf
from klann_ros.kinematics import LinkageLeg
from klann_ros.robot import Robot, robot_of
import numpy as np
import pytest
from xacro_legs import ROOT, urdf_of

if TYPE_CHECKING:
    import yourdfpy

CONFIG = ROOT / 'config'
PLAIN = {'klann': 'sem104', 'walker4': 'walker4', 'walker6': 'walker6'}
NAMES = {'base_frame': 'body', 'frame_id': 'plane', 'frame_prefix': 'left/'}
TWO = '/**: {ros__parameters: {legs: [one, two], l_gh: 0.5, two: {l_gh: 0.6, direction: -1}}}'


def loaded(text: str) -> 'yourdfpy.URDF':
    # When called: its meshes' library takes half a second, in each worker that collects this.
    import yourdfpy

    return yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False)


def published(robot: Robot, crank: float) -> dict[str, float]:
    """Return the joints of all legs as a solver publishes them."""
    positions: dict[str, float] = {}
    for leg in robot.legs:
        pose = LinkageLeg(leg.linkage).closed_form(leg.direction * crank + leg.phase)
        names = [f'{leg.prefix}{name}' for name in leg.linkage.joint_names]
        positions |= dict(zip(names, pose.joints, strict=True))
    return positions


def facts(joint: 'yourdfpy.Joint') -> tuple:
    """Return what makes a joint what it is, but for its place."""
    mimic = joint.mimic and (joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset)
    axis = None if joint.type == 'fixed' else tuple(map(float, joint.axis))
    return joint.name, joint.type, joint.parent, joint.child, axis, mimic


@pytest.mark.slow
@pytest.mark.parametrize(
    ('file', 'names'),
    [
        *((CONFIG / f'{name}.yaml', {}) for name in ('sem104', 'patent', 'walker4', 'walker6')),
        (CONFIG / 'sem104.yaml', NAMES),
        ('my legs.yaml', {}),
    ],
)
def test_its_joints_and_frames_are_those_of_the_export(
    file: str | Path, names: dict[str, str], tmp_path: Path
) -> None:
    (tmp_path / 'my legs.yaml').write_text(TWO)
    robot = robot_of(str(tmp_path / file))
    ours = loaded(urdf_of(tmp_path / file, **names))
    theirs = loaded(urdf(robot, joint_separator='/', **names))
    assert ours.base_link == theirs.base_link
    assert {facts(j) for j in ours.robot.joints} == {facts(j) for j in theirs.robot.joints}
    for crank in np.linspace(-np.pi, np.pi, 10, endpoint=False).tolist():
        for model in (ours, theirs):
            model.update_cfg(published(robot, crank))
        for link in theirs.robot.links:
            position, expected = (model.get_transform(link.name) for model in (ours, theirs))
            np.testing.assert_allclose(position, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize('plain', PLAIN)
def test_a_plain_urdf_is_up_to_date(plain: str) -> None:
    shipped = ET.parse(ROOT / 'urdf' / f'{plain}.urdf')  # noqa: S314  # our own
    fresh = ET.fromstring(urdf_of(CONFIG / f'{PLAIN[plain]}.yaml'))  # noqa: S314  # our own
    for element, fresh_element in zip(shipped.iter(), fresh.iter(), strict=True):
        assert element.tag == fresh_element.tag
        assert element.keys() == fresh_element.keys()
        for key in element.keys():  # noqa: SIM118  # an element's iteration is over its children
            assert same(element.get(key), fresh_element.get(key)), (
                f'{key} of {element.tag}: {element.attrib}'
            )


def same(text: str, other_text: str) -> bool:
    """Return whether two attributes are alike, numbers but for the last digits of a libm."""
    try:
        numbers = [[float(word) for word in text.split()] for text in (text, other_text)]
    except ValueError:
        return text == other_text
    return all(isclose(a, b, abs_tol=1e-9) for a, b in zip(*numbers, strict=True))


def test_the_slider_turns_the_crank_and_nothing_else() -> None:
    import yourdfpy

    crank = yourdfpy.URDF.load(ROOT / 'urdf' / 'crank.urdf')
    (joint,) = crank.robot.joints
    assert joint.name == 'crank'
    assert joint.limit.upper - joint.limit.lower >= 2 * np.pi
