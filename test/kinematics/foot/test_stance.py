"""The stance: while the foot is on the ground and moves backwards."""

import math
import pickle
from typing import Any

from hypothesis import given, settings, strategies as st
from klann_ros.kinematics import (
    foot_path,
    KlannGeometry,
    KlannLeg,
    linkage_from_text,
    LinkageLeg,
    NoStanceError,
)
from klann_ros.kinematics.foot.stance import _Contact, _join_adjacent
import pytest
from strategies import legs

SEM104 = KlannGeometry.sem104()
PATENT = KlannGeometry.patent()


@pytest.mark.parametrize('holds', [True, False])
def test_contacts_that_meet_at_the_start_of_the_turn_are_one(holds: bool) -> None:
    (track,) = foot_path(KlannLeg())._tracks
    first = _Contact(track, 0.2, 0.5, -1, holds)
    separate = _Contact(track, 1.0, 1.5, -1, holds_lowest=False)
    last = _Contact(track, 3.0, 0.2 + math.pi, -1, not holds)
    joined = _Contact(track, 3.0, 0.5 + math.pi, -1, holds_lowest=True)
    assert _join_adjacent([first, separate, last]) == [separate, joined]


def peaucellier(rotation: float) -> LinkageLeg:
    """Return a leg whose foot D draws an exact straight line, at 90 deg to where Q is from O."""
    q = [0.1 * math.cos(math.radians(rotation)), 0.1 * math.sin(math.radians(rotation))]
    bars = {'c': 'QC', 'oa': 'OA', 'ob': 'OB', 'ac': 'AC', 'bc': 'BC', 'ad': 'AD', 'bd': 'BD'}
    lengths = {'c': 0.1, 'oa': 0.3, 'ob': 0.3}
    drawn = {'c': 0, 'oa': 23, 'ob': -23, 'ac': 230, 'bc': 130, 'ad': -45, 'bd': 45}
    start = {name: angle + rotation for name, angle in drawn.items()}
    bodies = [
        f'  {name}: {{bars: [{{from: {p}, to: {r}, length: {lengths.get(name, 0.12)}}}]}}\n'
        for name, (p, r) in bars.items()
    ]
    return LinkageLeg(
        linkage_from_text(
            'name: Peaucellier\nunits: {length: m, angle: deg}\ncrank: c\nfoot: D\n'
            f'pivots: {{O: [0, 0], Q: {q!r}}}\nbodies:\n{"".join(bodies)}'
            f'start: {start!r}\n',
            'peaucellier',
        )
    )


@pytest.mark.slow
def test_along_an_exact_straight_line_the_whole_arc_is_one_stance() -> None:
    path = foot_path(peaucellier(270.0))
    ((start, end),) = path.arcs
    # What the ends of an arc are known to, and not a height.
    assert path.lift < 1e-8
    for ground in (None, 0.001, 0.1):
        (stance,) = path.stances(ground)
        assert (stance.start, stance.end) == pytest.approx((start, end), abs=1e-11)
        assert stance.ground_covered == pytest.approx(path.stride, rel=1e-12)
        assert stance.straightness < 1e-8


def test_a_foot_that_only_rises_and_falls_has_no_stance() -> None:
    path = foot_path(peaucellier(180.0))
    for ground in (None, 0.001, 0.1):
        with pytest.raises(NoStanceError, match='the foot does not move along x') as caught:
            path.stance(ground)
        assert caught.value.stride == path.stride < 1e-8
        assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)  # noqa: S301


def test_a_foot_that_rises_and_falls_all_round_has_no_stance(ellipse: Any) -> None:
    with pytest.raises(NoStanceError):
        foot_path(ellipse(0.0, 0.5)).stance()


def test_a_turn_may_have_a_lower_ground_than_an_arc() -> None:
    assert foot_path(KlannLeg()).stance(1e-10).ground == 1e-10
    with pytest.raises(ValueError, match=r'ground = 1e-10 m is refused: .* at least'):
        foot_path(KlannLeg(KlannGeometry(l_bc=0.33))).stance(1e-10)


@pytest.mark.parametrize('geometry', [SEM104, PATENT])
def test_both_known_legs_are_on_the_ground_for_about_half_a_turn(geometry: KlannGeometry) -> None:
    path = foot_path(KlannLeg(geometry))
    (stance,) = path.stances()
    assert stance.duty_factor == pytest.approx(0.47, abs=0.01)
    assert stance.ground_covered == pytest.approx(path.stride, rel=1e-3)
    assert stance.straightness < 0.05
    # A crank that turns counter-clockwise drives the body to +x.
    assert stance.direction == -1
    assert stance.speed(2.0) == pytest.approx(2.0 * stance.speed_mean)
    assert stance.speed(-2.0) == -stance.speed(2.0)


@pytest.mark.parametrize('geometry', [SEM104, PATENT])
def test_on_the_ground_the_foot_moves_backwards_in_the_band(geometry: KlannGeometry) -> None:
    leg = KlannLeg(geometry)
    path = foot_path(leg)
    for ground in (0.005, 0.02, 0.05, 0.2):
        stances = path.stances(ground)
        for k in range(2000):
            pose = leg.solve((k + 0.5) * math.pi / 1000)
            x_1 = leg.velocity(pose, 1.0).h[0]
            down = pose.h[1] - path.y_range[0] <= ground and x_1 < 0.0
            within = any(
                stance.start <= angle <= stance.end
                for stance in stances
                for angle in (pose.alpha, pose.alpha + 2 * math.pi)
            )
            assert within is down


def test_the_first_stance_holds_the_lowest_point() -> None:
    path = foot_path(KlannLeg())
    # SEM 104's foot is lowest at 151 deg, and nearly as low at 22 deg.
    first, second = path.stances(0.01)
    assert math.degrees(first.start) < 151.0 < math.degrees(first.end)
    assert math.degrees(second.start) < 22.0 < math.degrees(second.end)
    assert path.stance(0.01) == first


def test_an_ellipse_has_its_stance(ellipse: Any) -> None:
    path = foot_path(ellipse(0.5, 0.5))
    stance = path.stance(0.1)
    half = math.acos(0.8)
    assert (stance.start, stance.end) == pytest.approx(
        (1.5 * math.pi - half, 1.5 * math.pi + half), abs=1e-12
    )
    assert stance.direction == 1
    assert stance.duty_factor == pytest.approx(half / math.pi, rel=1e-12)
    assert stance.ground_covered == pytest.approx(0.6, rel=1e-12)
    assert stance.speed_least == pytest.approx(0.4, rel=1e-12)
    assert stance.speed_greatest == pytest.approx(0.5, rel=1e-12)
    assert stance.speed_mean == pytest.approx(0.6 / (2 * half), rel=1e-12)
    assert stance.ripple == pytest.approx(0.1 / stance.speed_mean, rel=1e-9)
    # The line is where the mean height of the arc is.
    mean = math.sin(half) / half
    assert stance.deviation == pytest.approx(0.5 * max(1 - mean, mean - 0.8), rel=1e-9)
    assert stance.straightness == pytest.approx(stance.deviation / 0.6, rel=1e-12)
    # The best line halves the arc's height.
    assert stance.minimax_deviation == pytest.approx(0.5 * (1 - 0.8) / 2, rel=1e-9)


def test_a_band_above_the_whole_path_leaves_the_half_that_moves_backwards(ellipse: Any) -> None:
    (stance,) = foot_path(ellipse(0.5, 0.25)).stances(9.0)
    assert (stance.start, stance.end) == pytest.approx((math.pi, 2 * math.pi), abs=1e-12)


def test_at_a_singular_end_the_foots_speed_is_infinite(half_circle: Any) -> None:
    # Its curve is y = sqrt(1/4 - x^2), x = alpha - 6: x moves evenly, y does not.
    stance = foot_path(half_circle).stance(0.25)
    assert stance.speed_mean == pytest.approx(1.0, rel=1e-9)
    leg = KlannLeg(KlannGeometry(l_bc=0.33))
    stance = foot_path(leg).stance()
    assert stance.end == pytest.approx(leg.reachable_arcs()[0][1] - 2 * math.pi, abs=1e-9)
    assert stance.speed_greatest == math.inf


@settings(max_examples=20)
@given(geometry=legs(), share=st.floats(0.01, 1.0))
def test_every_leg_has_stances(geometry: KlannGeometry, share: float) -> None:
    leg = KlannLeg(geometry)
    path = foot_path(leg)
    ground = share * path.lift
    stances = path.stances(ground)
    assert 0.0 < sum(stance.duty_factor for stance in stances) <= 1.0
    assert len({stance.direction for stance in stances}) == 1
    for stance in stances:
        assert 0.0 <= stance.start < 2 * math.pi
        assert stance.start < stance.end
        assert stance.speed_least <= stance.speed_mean * (1 + 1e-9)
        assert stance.speed_mean <= stance.speed_greatest * (1 + 1e-9)
        assert 0.0 <= stance.deviation <= math.hypot(stance.ground_covered, ground) + 1e-9
        assert 0.0 <= stance.minimax_deviation <= stance.deviation * (1 + 1e-9) + 1e-12
        middle = leg.solve((stance.start + stance.end) / 2)
        # A stance is within the band all along.
        assert middle.h[1] <= path.y_range[0] + ground + 1e-6
