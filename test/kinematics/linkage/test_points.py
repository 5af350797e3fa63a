"""A linkage by the coordinates of its points in one pose is the linkage by their lengths."""

from pathlib import Path
from typing import Any

from klann_ros.kinematics import (
    content_with_numbers,
    GeometryError,
    Linkage,
    linkage_from_text,
    linkage_poses,
    LinkageFileError,
    LinkageLeg,
    LinkagePose,
    shipped_linkage,
    shipped_linkages,
)
from klann_ros.sanitize.yaml_text import dump
import numpy as np
from point_files import firm_pose, point_file
import pytest
from random_linkages import random_linkage
from yaml_tables import read_table

ALPHAS = np.linspace(-3.0, 3.0, 61)
FOLDER = Path(__file__).parent
FILES = read_table(FOLDER / 'point_files.yaml')
FOUR_BAR = FILES['four-bar']


def assert_same_motion(linkage: Linkage, pose: LinkagePose) -> None:
    """Compare a linkage with that of a pose: there, and at all crank angles."""
    names = pose.linkage.structure.points
    order = [linkage.structure.points.index(name) for name in names]
    assert LinkageLeg(linkage).solve(pose.alpha).points[order] == pytest.approx(
        pose.points, rel=0, abs=1e-12 * pose.linkage.size
    )
    expected = linkage_poses(pose.linkage, ALPHAS, points=True, transmission_angles=True)
    poses = linkage_poses(linkage, ALPHAS, points=True)
    assert poses.reason.tolist() == expected.reason.tolist()
    difference = np.abs(poses.points[:, order] - expected.points).max(axis=(1, 2))
    # Rounding of the coordinates grows towards dead points.
    sines: Any = np.abs(np.sin(expected.transmission_angles)).min(axis=1)
    assert np.nanmax(difference * sines) < 1e-11 * pose.linkage.size


@pytest.mark.parametrize('name', shipped_linkages())
def test_points_of_a_pose_make_the_same_linkage(name: str) -> None:
    pose = firm_pose(shipped_linkage(name))
    assert_same_motion(linkage_from_text(point_file(pose), name), pose)


@pytest.mark.slow
@pytest.mark.parametrize('coupled', [False, True])
def test_points_of_random_linkages_make_the_same(coupled: bool) -> None:
    compared = 0
    for seed in range(24):
        linkage = random_linkage(seed, coupled=coupled)
        try:
            pose = firm_pose(linkage)
        except GeometryError:
            continue
        text = point_file(pose, directions=bool(seed % 2))
        assert_same_motion(linkage_from_text(text, 'points'), pose)
        compared += 1
    assert compared > 12


@pytest.mark.parametrize(
    ('name', 'old', 'new', 'reason'),
    [(name, *row) for name, rows in FILES['refused'].items() for row in rows],
)
def test_an_error_is_reported_in_one_line(name: str, old: str, new: str, reason: str) -> None:
    assert old in FILES[name]
    with pytest.raises(LinkageFileError) as caught:
        linkage_from_text(FILES[name].replace(old, new, 1), 'test.yaml')
    assert str(caught.value).startswith('test.yaml holds no linkage: ')
    assert reason in str(caught.value)
    assert '\n' not in str(caught.value)
    assert len(str(caught.value)) < 500


def edited(text: str, *changes: tuple[str, str]) -> str:
    """Return a text with parts of it replaced."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def test_the_order_of_points_decides_on_nothing_but_angles() -> None:
    pose = LinkageLeg(linkage_from_text(FOUR_BAR, 'four-bar')).solve(0.4)
    turned = edited(FOUR_BAR, ('crank: [A, B]', 'crank: [B, A]'), ('[B, C, P]', '[P, B, C]'))
    turned = edited(turned, ('[D, C]', '{points: [C, D], clockwise: true}'), ('[A, D]', '[D, A]'))
    other_pose = LinkageLeg(linkage_from_text(turned, 'turned')).solve(0.4)
    names = pose.linkage.structure.points
    order = [other_pose.linkage.structure.points.index(name) for name in names]
    assert other_pose.points[order] == pytest.approx(pose.points, abs=1e-16)
    # The crank's angle is from its pivot, that of another body from its first point.
    u = dict(zip(names, pose.points @ (1.0, 1j), strict=True))
    crank, coupler, rocker = other_pose.joints
    assert crank == pytest.approx(pose.joints[0])
    assert coupler == pytest.approx(np.angle(u['B'] - u['P']))
    assert rocker == pytest.approx(-np.angle(u['D'] - u['C']))


def test_rounded_coordinates_are_rounded_numbers() -> None:
    pose = firm_pose(shipped_linkage('quick_return'))
    exact = linkage_from_text(point_file(pose, directions=True), 'exact')
    text = point_file(pose, directions=True, digits=4)
    rounded = linkage_from_text(text, 'rounded')
    assert rounded.numbers == pytest.approx(exact.numbers, abs=1e-3)
    # Lines whose directions are stated have them.
    assert rounded.dimensions['direction of P-E'] == exact.dimensions['direction of P-E']


IN_LINE = edited(FOUR_BAR, ('  C: [80, 50]', '  C: [50, 6.25]'))


@pytest.mark.parametrize('sign', [1, -1])
def test_at_a_dead_point_the_assembly_is_stated(sign: int) -> None:
    linkage = linkage_from_text(f'{IN_LINE}assembly: [{sign}]\n', 'in line')
    assert linkage.assembly == (sign,)
    alpha = float(np.arctan2(10.0, 20.0))
    pose = LinkageLeg(linkage).solve(alpha)
    index = linkage.structure.points.index('C')
    # At a dead point rounding has the root of its size.
    assert pose.points[index] == pytest.approx((0.050, 0.00625), abs=1e-8)
    written = dump(content_with_numbers(f'{IN_LINE}assembly: [{sign}]\n', linkage))
    assert linkage_from_text(written, 'written').assembly == (sign,)


@pytest.mark.parametrize('text', [FOUR_BAR, FILES['shaper']], ids=['four-bar', 'shaper'])
def test_changed_numbers_are_written_by_bars(text: str) -> None:
    linkage = linkage_from_text(text, 'points')
    longer = linkage.varied({'A-B': 1.01 * linkage.dimensions['A-B']})
    content = content_with_numbers(text, longer)
    assert 'points' not in content
    written = linkage_from_text(dump(content), 'bars')
    assert written.structure == linkage.structure
    assert written.numbers == pytest.approx(longer.numbers, abs=1e-11)
    assert written.assembly == linkage.assembly


def test_points_and_bodies_are_bounded() -> None:
    many = ''.join(f'  Q{n}: [{n}, 1]\n' for n in range(1000))
    start = '  P: [60, 60]\n'
    with pytest.raises(LinkageFileError, match='points: there must be 500 or fewer'):
        linkage_from_text(edited(FOUR_BAR, (start, start + many)), 'many')


def coupler_directions(linkage: Linkage) -> list[complex]:
    """Return B - A before and after the pose in line, at 0.64 rad [m]."""
    leg = LinkageLeg(linkage)
    directions = []
    for alpha in (0.3, 1.0):
        points = dict(zip(linkage.structure.points, leg.solve(alpha).points, strict=True))
        directions.append(complex(*(points['B'] - points['A'])))
    return directions


def test_a_change_point_is_left_as_the_assembly_states() -> None:
    ground = pytest.approx(0.160 + 0.120j, abs=1e-9)
    text = f'{FILES["parallelogram"]}assembly: [1]\n'
    parallel = linkage_from_text(text, 'parallel')
    crossed = linkage_from_text(text.replace('[1]', '[-1]'), 'crossed')
    assert coupler_directions(parallel) == [ground, ground]
    assert ground not in coupler_directions(crossed)
    for linkage in (parallel, crossed):
        written = linkage_from_text(dump(content_with_numbers(text, linkage)), 'written')
        directions = pytest.approx(coupler_directions(linkage), abs=1e-9)
        assert coupler_directions(written) == directions
