"""Plots: the drawing has the numbers of the kinematics, to the last digit."""

from collections.abc import Callable, Sequence
import math
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

from change_point_linkages import change_point_linkage, FEET
import klann_ros
from klann_ros import plotting
from klann_ros.kinematics import (
    AnyLeg,
    foot_path,
    FourBar,
    KlannGeometry,
    KlannLeg,
    Linkage,
    LinkageLeg,
    LinkagePose,
    shipped_linkage,
    shipped_linkages,
    UnreachableError,
)
from klann_ros.kinematics.drawing import PoseDrawing
from klann_ros.plotting import plane
from klann_ros.plotting.plane import draw_angles, PoseArtists
import numpy as np
import pytest

ALPHA, GUESS = math.radians(60.0), np.radians([15.0, 60.0, 45.0, 60.0])
BODIES = {
    'crank': 'AB',
    'coupler': 'BCG',
    'lower rocker': 'DC',
    'upper rocker': 'EF',
    'leg': 'FGH',
}
# Of class II: its crank swings.
TRIPLE_ROCKER = FourBar(0.180, 0.120, 0.130, 0.140)


@pytest.fixture(scope='module', autouse=True)
def without_a_screen() -> None:
    import matplotlib as mpl

    mpl.use('Agg')


def new_axes() -> Any:
    from matplotlib.figure import Figure

    return Figure().add_subplot()


def every_linkage() -> list[Linkage]:
    return [shipped_linkage(name) for name in shipped_linkages()]


def test_bars_end_at_the_points_and_every_letter_stands_at_its_own() -> None:
    pose = KlannLeg().solve(1.0)
    ax = plotting.plot_pose(pose, ax=new_axes())
    points = dict(zip('ABCDEFGH', pose.points, strict=True))
    bars = {line.get_label(): line.get_xydata() for line in ax.lines[: len(BODIES)]}
    for name, letters in BODIES.items():
        np.testing.assert_array_equal(bars[name], [points[letter] for letter in letters])
    letters = {text.get_text(): text.xy for text in ax.texts}
    assert set(letters) == set(points)
    for letter, position in letters.items():
        np.testing.assert_array_equal(position, points[letter])


@pytest.mark.parametrize('linkage', every_linkage(), ids=lambda linkage: linkage.name)
def test_every_point_of_any_linkage_is_drawn_once_as_its_joint(linkage: Linkage) -> None:
    alpha = linkage.start[0]
    ax = plotting.plot_pose(linkage, alpha, ax=new_axes())
    pose = LinkageLeg(linkage).closed_form(alpha)
    # Blocks are beneath the joints.
    joints = [line for line in ax.lines if line.get_zorder() == 3]
    drawn = np.vstack([line.get_xydata() for line in joints])
    assert sorted(map(tuple, drawn)) == sorted(map(tuple, pose.points))
    assert {text.get_text() for text in ax.texts} == set(linkage.structure.points)
    fixed = joints[0].get_xydata()
    expected = [pose.points[linkage.structure.points.index(n)] for n in linkage.structure.pivots]
    assert sorted(map(tuple, fixed)) == sorted(map(tuple, expected))


def test_a_pin_joins_bodies_and_a_point_does_not() -> None:
    joints = PoseDrawing.of(KlannLeg().solve(1.0)).joints
    assert {kind: ''.join(names) for kind, names in joints.items()} == {
        'pivot': 'ADE',
        'pin': 'BCFG',
        'point': 'H',
    }


@pytest.mark.parametrize('linkage', every_linkage(), ids=lambda linkage: linkage.name)
def test_no_letter_is_on_a_bar(linkage: Linkage) -> None:
    pose = LinkageLeg(linkage).closed_form(linkage.start[0])
    drawing = PoseDrawing.of(pose)
    for name, point in drawing.points.items():
        side = np.array(drawing.free_side(name))
        for body in drawing.bodies:
            for bar in body.bars:
                if name in bar:
                    end = drawing.points[bar[1] if bar[0] == name else bar[0]]
                    along = (end - point) / np.hypot(*(end - point))
                    assert side @ along < math.cos(math.radians(30.0)), (name, bar)


@pytest.mark.parametrize(
    'linkage',
    [
        KlannGeometry.sem104(),
        KlannGeometry.sem104().linkage,
        KlannLeg(),
        FourBar(0.18, 0.08, 0.2, 0.15),
        FourBar(180, 80, 200, 150, unit='mm').inversion('crank').geometry.scaled(2.0),
        LinkageLeg(shipped_linkage('stephenson')),
    ],
    ids=lambda linkage: type(linkage).__name__,
)
def test_a_linkage_a_geometry_or_a_leg_is_drawn(linkage: object) -> None:
    for ax in (
        plotting.plot_pose(linkage, 1.0, ax=new_axes()),
        plotting.plot_foot_path(linkage, ax=new_axes()),
    ):
        assert ax.get_aspect() == 1
        # The lengths of a four-bar are in any unit, which it names if it was given.
        units = {'FourBar': '', 'FourBarGeometry': ' / mm'}
        unit = units.get(type(linkage).__name__, ' / m')
        assert (ax.get_xlabel(), ax.get_ylabel()) == (f'x{unit}', f'y{unit}')
    assert plotting.plot_turn(linkage, ax=new_axes()).lines
    assert plotting.plot_turn(linkage, 'foot', ax=new_axes()).get_ylabel() == f'x, y{unit}'


@pytest.mark.parametrize('wrong', [None, 'jansen', KlannGeometry])
def test_anything_but_a_linkage_is_refused(wrong: object) -> None:
    for plot in (plotting.plot_pose, plotting.plot_foot_path, plotting.animate):
        with pytest.raises(TypeError, match='is refused: it must be a Linkage'):
            plot(wrong)


def test_a_leg_keeps_its_last_pose() -> None:
    leg = KlannLeg()
    pose = leg.solve(0.3)
    plotting.plot_turn(leg, ax=new_axes())
    plotting.plot_pose(leg, 2.0, ax=new_axes())
    plotting.animate(leg, frames=2, ax=new_axes())._draw_was_started = True
    assert leg.last is pose


def test_an_unreachable_angle_is_refused_before_anything_is_drawn() -> None:
    ax = new_axes()
    with pytest.raises(UnreachableError):
        plotting.plot_pose(TRIPLE_ROCKER, math.pi, ax=ax)
    assert not ax.lines


def test_the_path_is_the_foot_path_and_closed() -> None:
    (line,) = plotting.plot_foot_path(KlannLeg(), ax=new_axes(), lw=3, label='path').lines
    path = foot_path(KlannLeg()).h
    np.testing.assert_array_equal(line.get_xydata(), np.vstack([path, path[:1]]))
    assert (line.get_linewidth(), line.get_label()) == (3, 'path')


def test_the_path_of_an_arc_is_open_and_that_of_two_is_broken() -> None:
    (line,) = plotting.plot_foot_path(TRIPLE_ROCKER, ax=new_axes()).lines
    np.testing.assert_array_equal(line.get_xydata(), foot_path(TRIPLE_ROCKER).h)
    two = FourBar(0.180, 0.150, 0.050, 0.200)
    path = foot_path(two)
    assert len(path.arcs) == 2
    data = plotting.plot_foot_path(two, ax=new_axes()).lines[0].get_xydata()
    assert np.isnan(data).all(axis=1).sum() == 1
    np.testing.assert_array_equal(data[~np.isnan(data[:, 0])], path.h)


def test_the_path_of_any_point_is_drawn() -> None:
    bars, point = FourBar(0.2, 0.1, 0.25, 0.25), ('theta3', 0.5, 0.0)
    (line,) = plotting.plot_foot_path(bars, point=point, ax=new_axes()).lines
    np.testing.assert_array_equal(line.get_xydata()[:-1], foot_path(bars, point=point).h)
    (line,) = plotting.plot_foot_path(KlannGeometry(), point='G', ax=new_axes()).lines
    assert line.get_label() == 'G'
    assert line.get_xydata()[0] == pytest.approx(KlannLeg().closed_form(0.0).points[6], abs=1e-12)


def coordinates(pose: LinkagePose, *, slides: bool) -> list[float]:
    bodies = pose.linkage.structure.bodies[1:]
    return [x for body, x in zip(bodies, pose.x, strict=True) if body.slides == slides]


PATENT, JANSEN = KlannLeg(KlannGeometry.patent()), LinkageLeg(shipped_linkage('jansen'))
SLIDING = [LinkageLeg(one) for one in every_linkage() if one.structure.slides]
QUANTITIES: dict[str, tuple[Callable[[LinkagePose], Sequence[float]], str]] = {
    'angles': (lambda pose: coordinates(pose, slides=False), ' / °'),
    'distances': (lambda pose: coordinates(pose, slides=True), ' / m'),
    'transmission': (lambda pose: pose.transmission_angles, ' / °'),
    'condition': (lambda pose: (pose.condition,), ''),
    'foot': (lambda pose: pose.h, ' / m'),
}


@pytest.mark.parametrize(
    ('leg', 'quantity'),
    [
        *((PATENT, quantity) for quantity in ('angles', 'distances')),
        *((JANSEN, quantity) for quantity in ('transmission', 'condition', 'foot')),
        *((leg, quantity) for leg in SLIDING for quantity in ('angles', 'distances')),
    ],
    ids=lambda value: value if isinstance(value, str) else value.linkage.name,
)
def test_a_turn_shows_a_quantity_of_the_poses(leg: AnyLeg, quantity: str) -> None:
    numbers, unit = QUANTITIES[quantity]
    if not numbers(leg.solve(1.0)):
        with pytest.raises(ValueError, match=f'the linkage has no {quantity}'):
            plotting.plot_turn(leg, quantity, ax=new_axes())
        return
    ax = plotting.plot_turn(leg, quantity, ax=new_axes())
    assert ax.get_ylabel().endswith(unit)
    assert ax.get_xlim() == (0.0, 360.0)
    for k, line in enumerate(ax.lines):
        alphas, curve = line.get_xydata()[::40].T
        expected = [numbers(leg.closed_form(math.radians(alpha)))[k] for alpha in alphas]
        if unit == ' / °':
            assert np.abs(np.diff(line.get_ydata())).max() < 6.0
            difference = np.remainder(np.radians(curve) - expected + np.pi, 2 * np.pi) - np.pi
            assert np.abs(difference).max() < 1e-12
        else:
            assert curve == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_a_linkage_of_several_turns_has_them_all() -> None:
    linkage = change_point_linkage('two_turns')
    axes = plotting.plot_turn(linkage, 'foot')
    assert axes.get_xlim() == (0.0, 720.0)
    alphas, x = axes.get_lines()[0].get_data()
    np.testing.assert_allclose(x, FEET['two_turns'](np.radians(alphas)).real, atol=1e-9)
    middle = plane._crank_angles(LinkageLeg(linkage), 8)[4]
    assert middle == pytest.approx(2.0 * math.pi)


def test_a_crank_that_does_not_turn_fully_has_its_arc() -> None:
    ((start, end),) = TRIPLE_ROCKER.reachable_arcs()
    ax = plotting.plot_turn(TRIPLE_ROCKER, 'transmission', ax=new_axes())
    assert ax.get_xlim() != (0.0, 360.0)
    alphas = np.radians(ax.lines[0].get_xdata())
    assert (alphas[0], alphas[-1]) == pytest.approx((start, end), rel=1e-12)


def test_convergence_is_that_of_newtons_iterates() -> None:
    leg = KlannLeg()
    x = leg.newton(ALPHA, GUESS)
    f = np.array([leg.linkage.f(ALPHA, row) for row in x])
    errors, corrections = np.abs(x[:-1] - x[-1]), np.abs(np.diff(x, axis=0))
    expected = {
        'errors': (errors[:, :2].max(axis=1), errors[:, 2:].max(axis=1)),
        'corrections': (corrections[:, :2].max(axis=1), corrections[:, 2:].max(axis=1)),
        'residuals': (np.hypot(f[:, 0], f[:, 1]), np.hypot(f[:, 2], f[:, 3])),
    }
    for measure, (first, second) in expected.items():
        ax = plotting.plot_convergence(leg, ALPHA, GUESS, measure, ax=new_axes())
        for line, expected_curve in zip(ax.lines, (first, second), strict=True):
            k, curve = line.get_xydata().T
            np.testing.assert_array_equal(k, 1 + np.arange(len(expected_curve)))
            np.testing.assert_allclose(np.nan_to_num(curve), expected_curve, rtol=1e-12)
        assert ax.get_yscale() == 'log'


def test_an_unknown_quantity_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match="'speed' is refused: it must be one of angles, dist"):
        plotting.plot_turn(KlannLeg(), 'speed')
    with pytest.raises(ValueError, match="'speed' is refused: it must be one of errors, corr"):
        plotting.plot_convergence(KlannLeg(), ALPHA, GUESS, 'speed')
    with pytest.raises(ValueError, match='frames'):
        plotting.animate(KlannLeg(), frames=1)


def test_a_frame_of_an_animation_is_its_pose() -> None:
    leg, ax = LinkageLeg(shipped_linkage('jansen')), new_axes()
    animation = plotting.animate(leg, frames=8, ax=ax)
    limits = ax.get_xlim(), ax.get_ylim()
    for frame in (0, 3, 7):
        animation._draw_frame(frame)
        pose = leg.closed_form(frame * math.tau / 8)
        points = dict(zip(leg.linkage.structure.points, pose.points, strict=True))
        assert {t.get_text(): tuple(t.xy) for t in ax.texts} == {
            name: tuple(point) for name, point in points.items()
        }
        joints = [line.get_xydata() for line in ax.lines if line.get_linestyle() == 'None']
        assert sorted(map(tuple, np.vstack(joints))) == sorted(map(tuple, pose.points))
        crank = next(line for line in ax.lines if line.get_label() == 'm')
        np.testing.assert_array_equal(crank.get_xydata(), [points['Z'], points['X']])
        # The lower triangle.
        corners = ax.patches[-1].get_xy()[:3]
        assert sorted(map(tuple, corners)) == sorted(tuple(points[n]) for n in 'UTS')
    assert (ax.get_xlim(), ax.get_ylim()) == limits
    animation._draw_was_started = True


def test_an_arc_is_animated_to_and_fro_within_it() -> None:
    ax = new_axes()
    animation = plotting.animate(TRIPLE_ROCKER, frames=12, ax=ax)
    ((start, end),) = TRIPLE_ROCKER.reachable_arcs()
    places = []
    for frame in range(12):
        animation._draw_frame(frame)
        places.append(next(t.xy for t in ax.texts if t.get_text() == 'A'))
    np.testing.assert_allclose(places[1:6], places[:6:-1], atol=1e-12)
    angles = np.unwrap([math.atan2(y, x) for x, y in places])
    assert np.ptp(angles) == pytest.approx(end - start, rel=1e-9)
    animation._draw_was_started = True


def test_an_animation_is_a_page_and_a_gif(tmp_path: Path) -> None:
    animation = plotting.animate(KlannLeg(), frames=2)
    assert animation.to_jshtml().count('data:image/png;base64') == 2
    animation.save(tmp_path / 'leg.gif', writer='pillow')
    assert (tmp_path / 'leg.gif').read_bytes().startswith(b'GIF89a')


def test_an_arc_leads_from_the_horizontal_to_its_bar() -> None:
    ax = new_axes()
    pose = KlannLeg().solve(1.0)
    draw_angles(ax, pose, radius=0.05)
    points = dict(zip('ABCDEFGH', pose.points, strict=True))
    bars = ['AB', 'BC', 'DC', 'EF', 'FG']
    from matplotlib.patches import Arc

    arcs = [patch for patch in ax.patches if isinstance(patch, Arc)]
    for arc, (start, end) in zip(arcs, bars, strict=True):
        np.testing.assert_array_equal(arc.center, points[start])
        x, y = points[end] - points[start]
        assert 0.0 in (arc.theta1, arc.theta2)
        assert arc.theta1 + arc.theta2 == pytest.approx(math.degrees(math.atan2(y, x)))


def test_without_matplotlib_there_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / 'matplotlib.py').write_text('raise ImportError("none here")\n')
    package = Path(klann_ros.__file__).resolve().parents[1]
    script = (
        'import sys\n'
        'from klann_ros import plotting\n'
        'assert "matplotlib" not in sys.modules\n'
        'from klann_ros.kinematics import KlannLeg\n'
        'for plot in (plotting.plot_pose, plotting.plot_foot_path, plotting.plot_turn,\n'
        '             plotting.animate, lambda leg: plotting.plot_convergence(leg, 1, [1] * 4)):\n'
        '    try:\n'
        '        plot(KlannLeg())\n'
        '    except plotting.NoMatplotlibError as error:\n'
        '        print(error)\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', script],
        env=os.environ | {'PYTHONPATH': os.pathsep.join([str(tmp_path), str(package)])},
        cwd=tmp_path,
        capture_output=True,
        check=True,
        text=True,
    )
    assert done.stdout == 5 * "a plot needs matplotlib: pip install 'klann_ros[plot]'\n"


@pytest.mark.parametrize('alpha', [0.0, 1.0, math.pi / 2])
@pytest.mark.parametrize('name', ['slider_crank', 'quick_return', 'scotch_yoke'])
def test_a_sliding_body_is_a_block_along_its_line(name: str, alpha: float) -> None:
    leg = LinkageLeg(shipped_linkage(name))
    artists = PoseArtists(new_axes(), leg.closed_form(2.0))
    pose = leg.closed_form(alpha)
    artists.move(pose)
    points = dict(zip(leg.linkage.structure.points, pose.points, strict=True))
    sliding = [body for body in leg.linkage.structure.bodies if body.slides]
    assert len(artists.blocks) == len(artists.guides) == len(sliding)
    for body, block, guide in zip(sliding, artists.blocks, artists.guides, strict=True):
        corners, (first, last) = block.get_marker().vertices, guide.get_xydata()
        start, end = points[body.bars[0].start], points[body.bars[0].end]
        np.testing.assert_array_equal(block.get_xydata(), [end])
        np.testing.assert_allclose(corners[:4].mean(axis=0), 0.0, atol=1e-15)
        along = (last - first) / np.hypot(*(last - first))
        for way in (corners[1] - corners[0], end - start):
            assert abs(along[0] * way[1] - along[1] * way[0]) <= 1e-12
        assert (start - first) @ along > 0 < (last - end) @ along
