"""The drawing: every bar ends where the pose's points are."""

from klann_ros.kinematics import KlannLeg
from klann_ros.review.drawing import draw_angles, draw_foot_path, draw_leg, label_plane
from matplotlib.figure import Figure
import numpy as np
import pytest

LETTERS = 'ABCDEFGH'
BODIES = {
    'crank': 'AB',
    'coupler': 'BCG',
    'lower rocker': 'DC',
    'upper rocker': 'EF',
    'leg': 'FGH',
}


def test_bars_end_at_the_points_and_every_letter_stands_at_its_own() -> None:
    axes = Figure().add_subplot()
    pose = KlannLeg().solve(1.0)
    draw_leg(axes, pose)
    points = dict(zip(LETTERS, pose.points, strict=True))
    bars = {line.get_label(): line.get_xydata() for line in axes.lines[: len(BODIES)]}
    for name, letters in BODIES.items():
        np.testing.assert_array_equal(bars[name], [points[letter] for letter in letters])
    letters = {text.get_text(): text.xy for text in axes.texts}
    assert set(letters) == set('ABCDEFGH')
    for letter, position in letters.items():
        np.testing.assert_array_equal(position, points[letter])


def test_the_plane_is_equally_scaled() -> None:
    axes = Figure().add_subplot()
    draw_foot_path(axes, np.zeros((3, 2)), 'path')
    label_plane(axes, 'title')
    assert axes.get_aspect() == 1


def test_an_arc_leads_from_the_horizontal_to_its_bar() -> None:
    axes = Figure().add_subplot()
    pose = KlannLeg().solve(1.0)
    draw_angles(axes, pose, radius=0.05)
    points = dict(zip(LETTERS, pose.points, strict=True))
    bars = ['AB', 'DC', 'BC', 'EF', 'FG']
    assert len(axes.patches) == len(bars)
    for arc, (start, end) in zip(axes.patches, bars, strict=True):
        np.testing.assert_array_equal(arc.center, points[start])
        x, y = points[end] - points[start]
        direction = np.degrees(np.arctan2(y, x))
        assert 0.0 in (arc.theta1, arc.theta2)
        assert arc.theta1 + arc.theta2 == pytest.approx(direction)
