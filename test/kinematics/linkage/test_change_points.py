"""
Motion through change points, against closed forms that know nothing of signs.

A parallelogram is C = D + (B - A); an antiparallelogram and a kite are the mirror of A, or of the
crank's pin, in a diagonal; where a linkage is back after two turns its motion is continued in
small steps by its velocity.
"""

import math
from typing import Any

from change_point_linkages import change_point_linkage, FEET
from klann_ros.kinematics import (
    foot_path,
    FourBar,
    GeometryError,
    Linkage,
    linkage_from_text,
    linkage_poses,
    LinkageLeg,
    reachable_arcs,
    shipped_linkage,
    turns_fully,
    Variants,
)
import numpy as np
import pytest

TURN = 2.0 * math.pi
PARALLELOGRAM = """
name: parallelogram with a foot
units: {length: mm, angle: deg}
pivots: {A: [0,0], D: [100,0]}
crank: c
foot: P
bodies:
  c: {bars: [{from: A, to: B, length: 40}]}
  k: {bars: [{from: B, to: C, length: 100}, {from: B, to: P, length: 80, bend: -90}]}
  r: {bars: [{from: D, to: C, length: 40}]}
start: {c: 60, k: 0, r: 60}
"""
# The second loop is a parallelogram that the first one's rocker drives.
CHAIN = """
name: two parallelograms one after the other
units: {length: mm, angle: deg}
pivots: {A: [0,0], D: [100,0], F: [187,31]}
crank: c
foot: G
bodies:
  c: {bars: [{from: A, to: B, length: 40}]}
  k: {bars: [{from: B, to: C, length: 100}]}
  r: {bars: [{from: D, to: C, length: 40}, {from: D, to: E, length: 55, bend: 70}]}
  l: {bars: [{from: E, to: G, length: 92.35799911215054}]}
  s: {bars: [{from: F, to: G, length: 55}]}
start: {c: 60, k: 0, r: 60, l: 19.6, s: 130}
"""
CARDAN = """
name: Cardan's slider
units: {length: mm, angle: deg}
pivots: {A: [0,0]}
crank: c
foot: S
bodies:
  c: {bars: [{from: A, to: B, length: 50}]}
  k: {bars: [{from: B, to: S, length: 50}]}
  s: {slides: {along: ground, from: A, to: S}}
start: {c: 30, k: -30, s: 87}
"""
INVERTED = """
name: a line through the crank's pivot on a link as far away as the crank is long
units: {length: mm, angle: deg}
pivots: {A: [0,0], D: [-50,0]}
crank: c
foot: P
bodies:
  c: {bars: [{from: A, to: B, length: 50}]}
  r: {bars: [{from: D, to: P, length: 120}]}
  s: {slides: {along: r, from: D, to: B}}
start: {c: 60, r: 30, s: 86}
"""
TEN_TURNS = np.linspace(-10.0 * TURN, 10.0 * TURN, 977)
# Both sides of change points at 0 and half a turn, and these themselves.
NEAR = np.concatenate(
    [k * math.pi + np.array([-1e-2, -1e-6, 0.0, 1e-12, 1e-7, 1e-3]) for k in range(-5, 6)]
)
ALPHAS = np.concatenate([TEN_TURNS, NEAR])


def apart(x: Any, y: Any) -> Any:
    """Return the distance of angles, modulo a turn [rad]."""
    return np.abs((np.asarray(x) - y + math.pi) % TURN - math.pi)


def poses_every_way(linkage: Linkage, alphas: np.ndarray) -> list[np.ndarray]:
    """Return the coordinates one by one cold, warm, warm backwards, and in bulk, (k, n - 1)."""
    leg = LinkageLeg(linkage)
    cold = [leg.closed_form(alpha).x for alpha in alphas]
    ordered = np.argsort(alphas)
    warm = np.empty((2, *np.shape(cold)))
    for way, order in enumerate((ordered, ordered[::-1])):
        # The first pose is cold: its path angle is its crank angle.
        leg.reset()
        for i in order:
            warm[way, i] = leg.solve(alphas[i]).x
    poses: Any = linkage_poses(linkage, alphas, angles=True)
    assert not poses.reason.any()
    return [np.array(cold), *warm, poses.angles]


@pytest.mark.parametrize(('assembly', 'course'), [(1, 'parallel'), (-1, 'crossed')])
def test_a_parallelogram_stays_one_over_ten_turns_both_ways(assembly: int, course: str) -> None:
    linkage = FourBar(3.0, 1.0, 3.0, 1.0, assembly, at_change_points=course).linkage
    for x in poses_every_way(linkage, ALPHAS):
        assert apart(x[:, 0], 0.0).max() <= 1e-11
        assert apart(x[:, 1], ALPHAS).max() <= 1e-11


@pytest.mark.parametrize(('assembly', 'course'), [(-1, 'parallel'), (1, 'crossed')])
def test_an_antiparallelogram_stays_one(assembly: int, course: str) -> None:
    linkage = FourBar(3.0, 1.0, 3.0, 1.0, assembly, at_change_points=course).linkage
    a = np.exp(1j * ALPHAS)
    # C of the parallelogram, mirrored in the diagonal from A to O4.
    along = (a - 3.0) / np.abs(a - 3.0)
    c = 3.0 + along**2 * np.conj(a)
    for x in poses_every_way(linkage, ALPHAS):
        assert np.abs(3.0 + np.exp(1j * x[:, 1]) - c).max() <= 1e-11


def test_the_rocker_of_a_kite_with_a_short_ground_turns_twice_a_turn() -> None:
    linkage = FourBar(1.0, 2.0, 2.0, 1.0).linkage
    assert linkage.change_points.period == 1
    a = 2.0 * np.exp(1j * ALPHAS)
    along = (a - 1.0) / np.abs(a - 1.0)
    # B is the mirror of O2 in the diagonal A O4.
    b = 1.0 + along**2 * np.conj(-1.0)
    for x in poses_every_way(linkage, ALPHAS):
        assert np.abs(1.0 + np.exp(1j * x[:, 1]) - b).max() <= 1e-11
    theta4 = np.unwrap(
        [LinkageLeg(linkage).closed_form(alpha).x[1] for alpha in np.linspace(0.0, TURN, 100)]
    )
    assert abs(theta4[-1] - theta4[0]) == pytest.approx(2.0 * TURN)


def test_a_kite_whose_ends_coincide_is_back_after_two_turns() -> None:
    linkage = FourBar(1.0, 1.0, 2.0, 2.0).linkage
    assert linkage.change_points.period == 2
    # A - O4 = 2 i sin(theta2 / 2) e^(i theta2 / 2): B is across the middle of it, smoothly.
    half = ALPHAS / 2.0
    along = np.exp(1j * (half + math.pi / 2.0))
    to_a = 2.0 * np.sin(half) * along
    b = 1.0 + to_a / 2.0 + np.sqrt(4.0 - np.sin(half) ** 2) * along / 1j
    for x in poses_every_way(linkage, ALPHAS):
        assert np.abs(1.0 + 2.0 * np.exp(1j * x[:, 1]) - b).max() <= 1e-11


def continued(lengths: tuple[float, ...], theta2: np.ndarray, theta3: float, theta4: float) -> Any:
    """Return theta4 by its velocity and Newton's method, in steps that jump over change points."""
    _, crank, coupler, rocker = lengths
    theta4s = []
    for n, angle in enumerate(theta2):
        if n:
            for _ in range(8):
                f = crank * np.exp(1j * angle) + coupler * np.exp(1j * theta3)
                f -= lengths[0] + rocker * np.exp(1j * theta4)
                p = 1j * coupler * np.exp(1j * theta3)
                q = -1j * rocker * np.exp(1j * theta4)
                change = np.linalg.solve([[p.real, q.real], [p.imag, q.imag]], [-f.real, -f.imag])
                theta3, theta4 = theta3 + change[0], theta4 + change[1]
        theta4s.append(theta4)
        p = 1j * coupler * np.exp(1j * theta3)
        q = -1j * rocker * np.exp(1j * theta4)
        v = -1j * crank * np.exp(1j * angle)
        rate = np.linalg.solve([[p.real, q.real], [p.imag, q.imag]], [v.real, v.imag])
        step = theta2[1] - theta2[0]
        theta3, theta4 = theta3 + step * rate[0], theta4 + step * rate[1]
    return np.array(theta4s)


@pytest.mark.slow
@pytest.mark.parametrize(
    'lengths', [(4.0, 1.0, 2.0, 3.0), (5.0, 2.0, 4.0, 3.0), (2.5, 1.0, 2.0, 1.5)]
)
def test_a_general_change_point_linkage_is_back_after_two_turns(
    lengths: tuple[float, ...],
) -> None:
    bar = FourBar(*lengths)
    linkage = bar.linkage
    assert linkage.change_points.period == 2
    assert turns_fully(linkage)
    # No step ends in a change point.
    theta2 = 0.5 + np.arange(0.0, 5.0 * TURN, 0.0217)
    start = bar.closed_form(0.5)
    theta4 = continued(lengths, theta2, start.theta3, start.theta4)
    for x in poses_every_way(linkage, theta2):
        assert apart(x[:, 1], theta4).max() <= 1e-9
    assert apart(bar.closed_form(0.5 + TURN).theta4, start.theta4) > 0.1
    assert apart(bar.closed_form(0.5 + 2.0 * TURN).theta4, start.theta4) <= 1e-12


def test_a_wrapped_input_goes_on_over_the_seam() -> None:
    bar = FourBar(4.0, 1.0, 2.0, 3.0)
    wrapped = FourBar(4.0, 1.0, 2.0, 3.0)
    for alpha in [*np.arange(0.5, 30.0, 0.17), *np.arange(30.0, -30.0, -0.17)]:
        pose = wrapped.solve(alpha % TURN)
        assert apart(pose.theta4, bar.closed_form(alpha).theta4) <= 1e-9
        assert (alpha - pose.theta2) / TURN % 2 == pytest.approx(pose.turns)
    wrapped.reset()
    assert wrapped.solve(0.5 + TURN).theta4 == pytest.approx(bar.closed_form(0.5 + TURN).theta4)


def test_velocity_and_acceleration_go_on_through_the_point() -> None:
    """Of a parallelogram all but the coupler turns as the crank does."""
    linkage = linkage_from_text(PARALLELOGRAM, 'parallelogram')
    leg = LinkageLeg(linkage)
    for alpha in (-1e-3, -1e-7, 0.0, 1e-9, math.pi, math.pi + 1e-6, math.pi - 4e-3, 2.0):
        pose = leg.solve(alpha)
        velocity = leg.velocity(pose, 3.0)
        assert velocity.joints == pytest.approx((3.0, 0.0, 3.0), abs=1e-9)
        assert velocity.h == pytest.approx(
            (-0.12 * math.sin(alpha), 0.12 * math.cos(alpha)), abs=1e-10
        )
        acceleration = leg.acceleration(pose, 3.0, 5.0)
        assert acceleration.joints == pytest.approx((5.0, 0.0, 5.0), abs=1e-6)
        h_2 = -9.0 * 0.04 * math.cos(alpha) - 0.2 * math.sin(alpha)
        assert acceleration.h[0] == pytest.approx(h_2, abs=1e-7)
    alphas = np.array([0.0, 1e-9, math.pi, 1.0])
    poses: Any = linkage_poses(linkage, alphas, angles=True, velocities=True)
    assert np.abs(poses.angles_1 - [0.0, 1.0]).max() <= 1e-10
    assert np.abs(poses.h_1[:, 0] + 0.04 * np.sin(alphas)).max() <= 1e-10


def test_a_parallelogram_behind_a_parallelogram_stays_one() -> None:
    linkage = linkage_from_text(CHAIN, 'chain')
    assert {point.block for point in linkage.change_points.points} == {1, 2}
    assert linkage.change_points.period == 1
    for x in poses_every_way(linkage, TEN_TURNS):
        assert apart(x[:, 0], 0.0).max() <= 1e-10
        assert apart(x[:, 1], TEN_TURNS).max() <= 1e-10
        assert apart(x[:, 3], TEN_TURNS + math.radians(70.0)).max() <= 1e-9


def test_a_dyad_beside_a_parallelogram_stands_still_at_every_pose() -> None:
    still = """  s: {bars: [{from: A, to: E, length: 80}]}
  t: {bars: [{from: D, to: E, length: 80}]}
start: {c: 60, k: 0, r: 60, s: 51, t: 129}
"""
    linkage = linkage_from_text(PARALLELOGRAM.partition('start')[0] + still, 'still')
    angle = math.acos(50.0 / 80.0)
    for x in poses_every_way(linkage, ALPHAS):
        assert apart(x[:, 1], ALPHAS).max() <= 1e-10
        assert apart(x[:, 2:], [angle, math.pi - angle]).max() <= 1e-10


def test_cardans_slider_moves_over_four_cranks() -> None:
    linkage = linkage_from_text(CARDAN, 'cardan')
    assert len(linkage.change_points.points) == 2
    alphas = np.concatenate([TEN_TURNS, NEAR + math.pi / 2.0])
    for x in poses_every_way(linkage, alphas):
        assert apart(x[:, 0], -alphas).max() <= 1e-11
        assert np.abs(x[:, 1] - 0.1 * np.cos(alphas)).max() <= 1e-12
    # Distances do not wrap, however long.
    large = linkage.scaled(1e4)
    for alpha in (1.0, math.pi / 2.0 + 1e-4, 3.0):
        x = LinkageLeg(large).closed_form(alpha).x
        assert x[1] == pytest.approx(1e3 * math.cos(alpha), abs=1e-8)


def test_a_line_on_a_link_goes_on_where_its_ends_coincide() -> None:
    linkage = linkage_from_text(INVERTED, 'inverted')
    (point, *_) = linkage.change_points.points
    assert point.is_free
    assert linkage.change_points.period == 2
    # B - D = 2 cos(alpha / 2) e^(i alpha / 2) / 20.
    for x in poses_every_way(linkage, ALPHAS):
        assert apart(x[:, 0], ALPHAS / 2.0).max() <= 1e-11
        assert np.abs(x[:, 1] - 0.1 * np.cos(ALPHAS / 2.0)).max() <= 1e-12


def test_by_its_sign_the_motion_turns_back() -> None:
    bar = FourBar(3.0, 1.0, 3.0, 1.0, at_change_points='sign')
    assert not bar.linkage.change_points
    assert apart(bar.closed_form(1.0).theta4, 1.0) <= 1e-12
    assert apart(bar.closed_form(TURN - 1.0).theta4, -1.0) > 0.1


@pytest.mark.parametrize(
    'lengths', [(3.0, 1.0, 3.0, 1.0), (1.0, 2.0, 2.0, 1.0), (1.0, 1.0, 2.0, 2.0)]
)
def test_a_rocker_that_rotates_by_grashof_turns_round(lengths: tuple[float, ...]) -> None:
    bar = FourBar(*lengths)
    assert bar.grashof.roles.rocker == 'rotates'
    assert reachable_arcs(bar) == [(0.0, TURN)]
    assert bar.dead_points('both') == []
    span = bar.linkage.change_points.period * TURN
    theta4 = np.unwrap([bar.closed_form(alpha).theta4 for alpha in np.linspace(0.0, span, 200)])
    assert abs(theta4[-1] - theta4[0]) >= TURN - 1e-9


COUPLED = """
name: a parallelogram, a platform on three cranks, and another parallelogram
units: {{length: mm, angle: deg}}
pivots: {{Z: [-130, -20], A: [0, 0], D: [100, 20], F: [150, -50], I: [210, -20]}}
crank: z
foot: P
bodies:
  z: {{bars: [{{from: Z, to: Y, length: 40}}]}}
  y: {{bars: [{{from: Y, to: B, length: {y}}}]}}
  c: {{bars: [{{from: A, to: B, length: 40}}]}}
  l: {{bars: [{{from: B, to: Q, length: {l}}}]}}
  p:
    bars:
      - {{from: Q, to: C, length: {p}}}
      - {{from: Q, to: E, length: 150, bend: {bend}}}
      - {{from: C, to: P, length: 30, bend: 80}}
  r: {{bars: [{{from: D, to: C, length: 40}}]}}
  s: {{bars: [{{from: F, to: E, length: 40}}, {{from: F, to: G, length: 55, bend: 70}}]}}
  t: {{bars: [{{from: G, to: H, length: {t}}}]}}
  u: {{bars: [{{from: I, to: H, length: 55}}]}}
start: {{z: 20, y: 8.7, c: 20, l: 49.4, p: -51.3, r: 20, s: 20, t: 26.6, u: 90}}
"""


def test_coupled_loops_go_on_through_their_change_points() -> None:
    """Every crank turns as the first, and what joins two of them moves along a circle."""
    y, l, p, bend, t = 130 + 20j, 60 + 70j, 40 - 50j, (90 - 120j) / (40 - 50j), 60 + 30j  # noqa: E741
    text = COUPLED.format(
        y=abs(y), l=abs(l), p=abs(p), bend=math.degrees(np.angle(bend)), t=abs(t)
    )
    linkage = linkage_from_text(text, 'coupled')
    assert [block.is_dyad for block in linkage.blocks] == [True, False, True]
    points = linkage.change_points.points
    assert {point.block for point in points} == {1, 2, 3}
    assert linkage.change_points.period == 1
    offsets = np.array([-1e-2, -1e-6, 0.0, 1e-9, 4e-3, 6e-3])
    near = [point.beta + offsets for point in points]
    alphas = np.concatenate([np.linspace(-10.0 * TURN, 10.0 * TURN, 203), *near])
    shift = math.radians(70.0)
    for x in poses_every_way(linkage, alphas):
        for column, vector in ((0, y), (2, l), (3, p), (6, t)):
            assert apart(x[:, column], np.angle(vector)).max() <= 1e-11
        for column, angle in ((1, 0.0), (4, 0.0), (5, 0.0), (7, shift)):
            assert apart(x[:, column], alphas + angle).max() <= 1e-11
    assert turns_fully(linkage)


@pytest.mark.slow
def test_coupled_loops_are_back_after_the_turns_of_what_drives_them() -> None:
    linkage = change_point_linkage('platform_two_turns')
    assert [block.is_dyad for block in linkage.blocks] == [True, False, True]
    assert {point.block for point in linkage.change_points.points} == {1, 2, 3}
    assert linkage.change_points.period == 2
    assert turns_fully(linkage)
    alphas = np.linspace(-6.0 * TURN, 6.0 * TURN, 403)
    rocker = np.angle(FEET['two_turns'](alphas) - 0.08)
    for x in poses_every_way(linkage, alphas):
        for column, angle in ((1, 0.0), (4, 0.0), (5, 0.0), (7, math.radians(70.0))):
            assert apart(x[:, column], rocker + angle).max() <= 1e-9
    path = foot_path(LinkageLeg(linkage))
    assert path.arcs == ((0.0, 2.0 * TURN),)
    feet = FEET['platform_two_turns'](path.alphas)
    assert np.abs(path.h @ (1.0, 1j) - feet).max() <= 1e-9
    # As the numbers of a file are rounded.
    for error in (-1e-14, -1e-16, 1e-16, 1e-14):
        rounded = linkage.varied({'D-C': linkage.dimensions['D-C'] + error})
        assert np.abs(linkage_poses(rounded, path.alphas).h @ (1.0, 1j) - feet).max() <= 1e-9


def test_an_arc_of_coupled_loops_that_is_nearly_a_turn_is_no_overlap() -> None:
    linkage = shipped_linkage('stephenson').varied({'F-G': 0.16037109375})
    ((start, end),) = reachable_arcs(linkage)
    assert TURN - 0.1 < end - start < TURN
    assert linkage.branch.period == 1
    assert not linkage.change_points


def downstream(along: bool) -> str:
    """Return a crank-rocker whose rocker's end of stroke brings a second dyad just in line."""
    ground, crank, coupler, rocker = 180.0, 80.0, 200.0, 150.0
    reach = crank + coupler
    # The rocker where crank and coupler are stretched out.
    cosine = (ground**2 + rocker**2 - reach**2) / (2.0 * ground * rocker)
    limit = math.pi - math.acos(cosine)
    e = 70.0 * np.exp(1j * limit)
    # Straight on from E beyond D the distance is greatest there; aside it only ends there.
    f = -90.0 * np.exp(1j * limit) if along else e + 160.0 * np.exp(1j * (limit + 2.0))
    x, y, length = map(float, (ground + f.real, f.imag, abs(f - e) - 75.0))
    return f"""
name: in line at the end of a stroke
units: {{length: mm, angle: deg}}
pivots: {{A: [0, 0], D: [{ground}, 0], F: [{x!r}, {y!r}]}}
crank: c
foot: G
bodies:
  c: {{bars: [{{from: A, to: B, length: {crank}}}]}}
  k: {{bars: [{{from: B, to: C, length: {coupler}}}]}}
  r: {{bars: [{{from: D, to: C, length: {rocker}}}, {{from: D, to: E, length: 70}}]}}
  l: {{bars: [{{from: E, to: G, length: {length!r}}}]}}
  s: {{bars: [{{from: F, to: G, length: 75}}]}}
assembly: [1, 1]
"""


@pytest.mark.parametrize(('along', 'order'), [(True, 2), (False, 1)])
def test_contact_of_even_order_keeps_the_side_and_of_odd_order_changes_it(
    along: bool, order: int
) -> None:
    linkage = linkage_from_text(downstream(along), 'downstream')
    points = [point for point in linkage.change_points.points if point.block == 2]
    assert {point.order for point in points} == {order}
    assert linkage.change_points.period == order % 2 + 1
    beta = points[0].beta
    leg = LinkageLeg(linkage)
    # The distance of the joint from the line of its ends, on a side: h or h |h|.
    distances = []
    steps = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
    for step in steps:
        pose = leg.closed_form(beta + 0.02 * step)
        corners = dict(zip(linkage.structure.points, pose.points, strict=True))
        e, f, g = (complex(*corners[name]) for name in 'EFG')
        distances.append((np.conj(f - e) * (g - e)).imag / abs(f - e))
    # Even or odd: what is odd in the one and even in the other is of the next order.
    sides = np.sign(distances)
    assert (sides == (sides[0] if order == 2 else sides[0] * np.sign(-steps))).all()
    assert leg.closed_form(beta).residual <= 1e-13
    path = np.array([leg.closed_form(beta + 0.01 * k).h for k in range(-6, 7)])
    # The path has no corner and no jump of curvature: its fifth differences are small.
    assert np.abs(np.diff(path, 5, axis=0)).max() <= 1e-6


def mirror_of(linkage: Linkage, alpha: float) -> Any:
    return -np.array(LinkageLeg(linkage).closed_form(-alpha).x)


@pytest.mark.parametrize('course', ['parallel', 'crossed', 'sign'])
@pytest.mark.parametrize(
    'lengths',
    [(3.0, 1.0, 3.0, 1.0), (4.0, 1.0, 2.0, 3.0), (1.0, 1.0, 2.0, 2.0), (2.0, 2.0, 1.0, 3.0)],
)
def test_a_mirrored_linkage_has_the_mirrored_motion(
    lengths: tuple[float, ...], course: str
) -> None:
    bar = FourBar(*lengths, at_change_points=course)
    for mirrored in (bar.linkage.mirrored(), bar.geometry.mirrored().linkage):
        for alpha in (-8.0, -2.0, 2.5, 4.0, 9.0):
            x = LinkageLeg(mirrored).closed_form(alpha).x
            assert apart(x, mirror_of(bar.linkage, alpha)).max() <= 1e-11


def test_a_jump_of_more_than_a_turn_takes_the_path_of_the_crank_angle() -> None:
    bar = FourBar(4.0, 1.0, 2.0, 3.0)
    bar.solve(6.0)
    assert bar.solve(0.25).turns == 1
    assert bar.solve(0.25 + 2.2 * TURN).turns == 0


def test_a_crank_that_turns_in_part_passes_its_change_point() -> None:
    """With |A O4| = 4 |sin(theta2 / 2)| up to 2: it reaches 60 deg on both sides."""
    bar = FourBar(2.0, 2.0, 1.0, 1.0)
    ((start, end),) = bar.reachable_arcs()
    assert (start, end) == pytest.approx((5.0 / 6.0 * TURN, 7.0 / 6.0 * TURN), abs=1e-9)
    inside = np.linspace(start + 0.01, end - 0.01, 200)
    half = (inside - TURN) / 2.0
    to_a = 4.0 * np.sin(half)
    along = np.exp(1j * (half + math.pi / 2.0))
    b = 2.0 + along * (to_a / 2.0 - 1j * np.sqrt(1.0 - to_a**2 / 4.0))
    for x in poses_every_way(bar.linkage, inside):
        assert np.abs(2.0 + np.exp(1j * x[:, 1]) - b).max() <= 1e-11
    # A crank angle less a turn is the same pose.
    assert apart(bar.closed_form(-0.5).theta4, bar.closed_form(TURN - 0.5).theta4) <= 1e-12


def test_many_linkages_have_each_its_own_path() -> None:
    """As objects, in any dyad; as arrays where the crank drives the dyad."""
    chain = linkage_from_text(CHAIN, 'chain')
    others = [chain.varied({'F-G': 0.05}), chain, chain.scaled(2.0), chain.varied({'D-C': 0.041})]
    alphas = np.linspace(0.1, 6.2, 50)
    # In a dyad that the crank does not drive alone.
    stroke = linkage_from_text(downstream(along=False), 'downstream')
    for linkages in (others, [stroke.varied({'F-G': 0.076}), stroke]):
        poses: Any = linkage_poses(linkages, alphas, angles=True)
        for linkage, angles, reason in zip(linkages, poses.angles, poses.reason, strict=True):
            single: Any = linkage_poses(linkage, alphas, angles=True)
            assert (single.reason == reason).all()
            np.testing.assert_allclose(single.angles, angles, atol=1e-12)
    four_bar = FourBar(0.18, 0.08, 0.2, 0.15).linkage
    changes = {'ground': [0.18, 0.2], 'coupler': [0.2, 0.2], 'crank': 0.08, 'rocker': [0.15, 0.08]}
    variants: Any = linkage_poses(Variants(four_bar, changes), alphas, angles=True)
    assert apart(variants.angles[1, :, 1], alphas).max() <= 1e-11


def test_a_linkage_that_misses_by_a_hair_is_noted_and_keeps_its_sign() -> None:
    bar = FourBar(3.0, 1.0 - 1e-8, 3.0, 1.0)
    points = bar.linkage.change_points
    assert not points
    assert {miss.block for miss in points.near_misses} == {1}
    assert max(abs(miss.clearance) for miss in points.near_misses) == pytest.approx(1e-8)
    assert not FourBar(3.0, 1.0 - 1e-4, 3.0, 1.0).linkage.change_points.near_misses


def test_the_signs_at_zero_are_those_of_the_same_motion() -> None:
    start = [4.0, 0.0, 4.0]
    for course in ('parallel', 'crossed'):
        linkage = FourBar(3.0, 1.0, 3.0, 1.0).linkage.from_start(start)
        linkage = linkage.at_every_change_point(course)
        assert linkage.assembly == (-1,)
        at_zero = linkage.in_assembly(linkage.assembly_at(0.0), 0.0)
        for alpha in (0.5, 2.0, 4.0, 6.0):
            x = LinkageLeg(linkage).closed_form(alpha).x
            assert apart(LinkageLeg(at_zero).closed_form(alpha).x, x).max() <= 1e-12


def test_coupled_loops_by_their_sign_end_at_the_change_point() -> None:
    y, l, p, bend, t = 130 + 20j, 60 + 70j, 40 - 50j, (90 - 120j) / (40 - 50j), 60 + 30j  # noqa: E741
    text = COUPLED.format(
        y=abs(y), l=abs(l), p=abs(p), bend=math.degrees(np.angle(bend)), t=abs(t)
    )
    linkage = linkage_from_text(f'{text}at_change_points: sign', 'coupled')
    ((_, end),) = reachable_arcs(linkage)
    assert math.degrees(end) % 360.0 == pytest.approx(49.4, abs=0.1)
    crossed = linkage_from_text(f'{text}at_change_points: crossed', 'coupled')
    with pytest.raises(GeometryError, match='crossed is refused for coupled loops'):
        LinkageLeg(crossed)


def test_a_rocker_that_passes_a_change_point_stops_on_both_sides() -> None:
    """Of 4, 1, 2, 3 crank and coupler are stretched out in the triangle of 4, 3 and 1 + 2."""
    points = FourBar(4.0, 1.0, 2.0, 3.0).dead_points('rocker')
    angle = math.pi - math.acos((16.0 + 9.0 - 9.0) / 24.0)
    assert [point.kind for point in points] == ['stretched', 'stretched']
    assert [point.angle for point in points] == pytest.approx([-angle, angle])
    assert len(FourBar(4.0, 1.0, 2.0, 3.0, at_change_points='sign').dead_points('rocker')) == 1
