"""What a notebook shows of legs, poses, foot paths and margins, without matplotlib."""

import math
from xml.etree import ElementTree as ET

from change_point_linkages import change_point_linkage
from klann_ros.kinematics import (
    foot_path,
    FourBar,
    KlannLeg,
    length_margins,
    LinkageLeg,
    shipped_linkage,
    shipped_linkages,
)
from klann_ros.kinematics.drawing import PoseDrawing
from klann_ros.kinematics.svg import animation_svg
import numpy as np
import pytest

SVG = '{http://www.w3.org/2000/svg}'


def shapes(svg: str, tag: str) -> list[dict[str, str]]:
    return [element.attrib for element in ET.fromstring(svg).iter(SVG + tag)]  # noqa: S314


@pytest.mark.parametrize('name', shipped_linkages())
def test_a_leg_is_drawn_with_its_joints_and_keeps_its_pose(name: str) -> None:
    leg = LinkageLeg(shipped_linkage(name))
    start, end = leg.reachable_arcs()[0]
    leg.solve(start + 0.3 * (end - start))
    pose = leg.solve(start + 0.3 * (end - start))
    circles = shapes(leg._repr_svg_(), 'circle')
    assert len(circles) == len(PoseDrawing.of(pose).on_bars)
    assert len(circles) == len(shapes(pose._repr_svg_(), 'circle'))
    moving = ET.fromstring(animation_svg(leg))  # noqa: S314 - our own
    # The next solution starts from the leg's own last pose.
    assert leg.solve(pose.crank_angle) == pose
    assert len(list(moving.iter(SVG + 'circle'))) == len(circles)
    assert {
        len(animation.attrib['values'].split(';')) for animation in moving.iter(SVG + 'animate')
    } in ({91}, {182})


def test_an_animation_has_all_turns_until_the_leg_is_back() -> None:
    leg = LinkageLeg(change_point_linkage('two_turns'))
    moving = ET.fromstring(animation_svg(leg))  # noqa: S314 - our own
    pin, *_ = moving.iter(SVG + 'animate')
    assert pin.attrib['dur'] == '8s'
    assert len(pin.attrib['values'].split(';')) == 181
    path = next(moving.iter(SVG + 'polyline')).attrib['points'].split()
    # After one turn it is elsewhere, after both where it was.
    assert path[0] == path[-1] != path[90]


def test_points_are_where_the_pose_has_them_up_to_one_scale() -> None:
    pose = KlannLeg().solve(math.radians(60))
    centres = [(float(c['cx']), -float(c['cy'])) for c in shapes(pose._repr_svg_(), 'circle')]
    names = [*pose.linkage.structure.pivots]
    names += [n for n in pose.linkage.structure.points if n not in names]
    drawn = np.ptp(np.array(centres), axis=0)
    real = np.ptp(pose.points, axis=0)
    assert drawn[0] / real[0] == pytest.approx(drawn[1] / real[1], rel=2e-3)


def test_a_foot_path_is_closed_over_a_turn_and_open_over_an_arc() -> None:
    closed = shapes(foot_path(KlannLeg())._repr_svg_(), 'polyline')[0]['points'].split()
    assert closed[0] == closed[-1]
    arc = shapes(foot_path(FourBar(1.0, 0.9, 0.8, 0.6))._repr_svg_(), 'polyline')[0]
    assert arc['points'].split()[0] != arc['points'].split()[-1]


def test_margins_are_a_dict_and_a_table() -> None:
    margins = length_margins(KlannLeg())
    assert margins['l_ab'].value == 0.12
    assert margins._repr_html_().count('<tr>') == len(margins) + 1
