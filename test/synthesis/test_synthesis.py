"""Synthesis finds the linkage that a task was taken from, and its defects are those of a trace."""

from collections.abc import Iterable
from itertools import pairwise
import math
from math import isclose, radians

from hypothesis import assume, given, settings, strategies as st
from klann_ros.kinematics import FourBar, FourBarGeometry, GeometryError
from klann_ros.synthesis import (
    burmester_curve,
    burmester_points,
    BurmesterPair,
    dyad_of_pin,
    dyad_of_pivot,
    dyad_of_rotations,
    dyads_of_rotation,
    function_generators,
    function_task,
    motion_generators,
    pins,
    place,
    PlacedFourBar,
    PlanePose,
    Position,
    precision_points,
    quick_returns,
    toggle_couplers,
)
import numpy as np
import pytest
from traced_four_bars import is_joined, is_traced, position_at, random_task, with_positions

Task = tuple[PlacedFourBar, list[float]]


def tasks(count: int) -> st.SearchStrategy[Task]:
    """Draw a four-bar and crank angles of one assembly mode, apart from each other."""
    return st.integers(0, 2**32).map(lambda seed: random_task(np.random.default_rng(seed), count))


def poses_of(linkage: PlacedFourBar, thetas: list[float]) -> list[PlanePose]:
    positions = [position_at(linkage, theta) for theta in thetas]
    return [PlanePose(p, float(np.angle(b - a))) for a, b, p in positions]


def contain(
    dyads: Iterable[BurmesterPair], pivot: complex, pin: complex, tolerance: float
) -> bool:
    return any(abs(d.pivot - pivot) + abs(d.pin - pin) < tolerance for d in dyads)


def check_bars(poses: list[PlanePose], dyads: Iterable[BurmesterPair]) -> None:
    """Check that each dyad's bar has one length in all poses."""
    for dyad in dyads:
        bars = np.abs(np.array(pins(poses, dyad.pin)) - dyad.pivot)
        assert np.ptp(bars) <= 1e-8 * (1.0 + bars[0])


def rocker_angles(linkage: PlacedFourBar, thetas: list[float]) -> np.ndarray:
    return np.array([np.angle(position_at(linkage, theta).b - linkage.o4) for theta in thetas])


def coupler_points(linkage: PlacedFourBar) -> list[complex]:
    return [position.p for position in linkage.positions]


def rotations(linkage: PlacedFourBar) -> np.ndarray:
    """Return e^(i beta) of the crank from the first position."""
    return np.exp(1j * (np.array(linkage.thetas) - linkage.thetas[0]))


def same(linkage: PlacedFourBar, generator: PlacedFourBar) -> bool:
    return bool(np.allclose(linkage.geometry.lengths, generator.geometry.lengths, rtol=1e-5))


@given(task=tasks(5))
def test_five_poses_have_the_dyads_of_the_linkage_they_come_from(task: Task) -> None:
    linkage, thetas = task
    poses = poses_of(linkage, thetas)
    dyads = burmester_points(poses)
    for pivot, pin in zip((linkage.o2, linkage.o4), linkage.positions[0][:2], strict=True):
        assert contain(dyads, pivot, pin, 1e-4)
    check_bars(poses, dyads)


@given(task=tasks(4))
def test_dyads_of_four_poses_are_bars_of_one_length(task: Task) -> None:
    poses = poses_of(*task)
    check_bars(poses, burmester_curve(poses, 36))
    linkage, (first, second, *_) = task
    dyads = dyads_of_rotation(poses, second - first)
    assert contain(dyads, linkage.o2, linkage.positions[0].a, 1e-6)


@given(task=tasks(3))
def test_three_poses_give_the_linkage_back_by_pivots_pins_or_rotations(task: Task) -> None:
    linkage, thetas = task
    a, b, _ = linkage.positions[0]
    poses = poses_of(linkage, thetas)
    psi = rocker_angles(linkage, thetas)
    turns = [np.array(angles[1:]) - angles[0] for angles in (thetas, psi)]
    try:
        by_pivots = [dyad_of_pivot(poses, pivot) for pivot in (linkage.o2, linkage.o4)]
        by_pins = [dyad_of_pin(poses, pin) for pin in (a, b)]
        by_rotations = [dyad_of_rotations(poses, angles_from_first) for angles_from_first in turns]
    except GeometryError:
        assume(False)
        raise
    for dyads in (by_pivots, by_pins, by_rotations):
        generator, reversed_one = motion_generators(poses, dyads)
        assert same(generator, linkage)
        assert reversed_one.o2 == generator.o4
        assert np.allclose(rotations(generator), np.exp(1j * (np.array(thetas) - thetas[0])))


@given(task=tasks(5))
def test_function_generators_of_three_to_five_points_contain_their_origin(task: Task) -> None:
    linkage, thetas = task
    ground = linkage.geometry.ground
    phi = np.array(thetas) - thetas[0]
    psi = rocker_angles(linkage, thetas)
    three = function_generators(
        phi[:3], psi[:3] - psi[0], input_start=thetas[0], output_start=psi[0], ground=ground
    )
    four = function_generators(phi[:4], psi[:4] - psi[0], input_start=thetas[0], ground=ground)
    five = function_generators(phi, psi - psi[0], ground=ground)
    for generators in (three, four, five):
        assert any(same(generator, linkage) for generator in generators)
        for generator in generators:
            assert np.allclose(rotations(generator), np.exp(1j * phi[: len(generator.positions)]))


@given(task=tasks(4), flip=st.sampled_from([None, 1, 2, 3]))
def test_it_is_sound_where_a_trace_meets_all_in_order(task: Task, flip: int | None) -> None:
    positioned = with_positions(*task, flip)
    assert positioned.defects.branch == (flip is not None)
    assert positioned.is_sound == is_traced(positioned)


@given(task=tasks(4))
def test_circuits_are_the_components_of_the_reachable_poses(task: Task) -> None:
    linkage, thetas = task
    positioned = with_positions(linkage, thetas)
    # In one assembly mode two poses are on one circuit where the crank leads between them.
    has_circuit_defect = not all(is_joined(linkage, a, b) for a, b in pairwise(thetas))
    assert positioned.defects.circuit == has_circuit_defect


@given(task=tasks(3))
def test_cognates_share_the_path_of_the_coupler_point(task: Task) -> None:
    linkage, thetas = task
    assume(min(abs(linkage.coupler_vector), abs(1.0 - linkage.coupler_vector)) > 0.05)
    positioned = with_positions(linkage, thetas)
    for cognate in positioned.cognates():
        # Its own constructor has checked that all positions fit its bars.
        assert coupler_points(cognate) == coupler_points(positioned)
    first, second = positioned.cognates()
    assert first.o4 == second.o2
    assert np.allclose(rotations(second), rotations(positioned))


@given(task=tasks(1))
def test_instant_centres_are_on_kennedys_lines_and_give_the_speed_ratio(task: Task) -> None:
    linkage, (theta,) = task
    centres = linkage.instant_centres()
    i_24 = centres['I24']
    assume(abs(i_24) < 1e6 and abs(centres['I13']) < 1e6)
    bar = FourBar(*linkage.geometry.lengths, linkage.geometry.assembly)
    motion = bar.velocity(bar.closed_form(theta), 1.0)
    # I24 has one velocity on crank and rocker: w2 |I24 O2| = w4 |I24 O4|.
    rocker_speed = motion.theta4 * (i_24.real - linkage.o4.real)
    assert isclose(i_24.real, rocker_speed, rel_tol=1e-7, abs_tol=1e-9)
    for names in (('I12', 'I23', 'I13'), ('I14', 'I34', 'I13'), ('I23', 'I34', 'I24')):
        a, b, c = map(centres.get, names)
        assert abs(((b - a).conjugate() * (c - a)).imag) <= 1e-9 * abs(b - a) * (1 + abs(c - a))


# Four hundred cranks are tried for each.
@pytest.mark.slow
@settings(max_examples=3)
@given(ratio=st.floats(1.02, 2.5), swing=st.floats(0.2, 2.4), rocker=st.floats(0.1, 10.0))
def test_quick_returns_have_ratio_and_swing(ratio: float, swing: float, rocker: float) -> None:
    for geometry in quick_returns(ratio, swing, rocker):
        limits = FourBar(*geometry.lengths).rocker_limits
        assert limits.time_ratio == pytest.approx(ratio, rel=1e-9)
        assert limits.swing == pytest.approx(swing, abs=1e-9)


@pytest.mark.slow
def test_a_quick_return_of_common_numbers_is_found() -> None:
    (geometry,) = quick_returns(1.25, radians(45.0))
    assert FourBar(*geometry.lengths).grashof.motion == 'crank-rocker'
    with pytest.raises(ValueError, match='above 1'):
        quick_returns(1.0, 1.0)
    with pytest.raises(ValueError, match='between 0 and pi'):
        quick_returns(1.5, 4.0)


@pytest.mark.slow
@pytest.mark.parametrize('excess', [2.0**-52, 1e-12, 1e-9, 1e-7])
def test_a_quick_return_that_is_hardly_one_is_a_crank_rocker(excess: float) -> None:
    for geometry in quick_returns(1.0 + excess, 1.0):
        assert FourBar(*geometry.lengths).rocker_limits.swing == pytest.approx(1.0, abs=1e-9)


@given(theta=st.floats(0.2, 3.0))
def test_toggle_couplers_make_the_crank_angle_a_dead_point(theta: float) -> None:
    for coupler, kind in toggle_couplers(1.0, 0.6, 0.9, theta):
        try:
            bar = FourBar(1.0, 0.6, coupler, 0.9)
        except GeometryError:
            continue
        points = [p for p in bar.dead_points() if p.kind == kind]
        assert any(isclose(abs(p.angle), theta, abs_tol=1e-6) for p in points)


def test_chebyshevs_spacing_of_three_points_from_1_to_2() -> None:
    expected = [1.5 - 3**0.5 / 4, 1.5, 1.5 + 3**0.5 / 4]
    assert np.allclose(precision_points(1.0, 2.0, 3), expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ('call', 'text'),
    [
        (lambda: function_generators([0, 1], [0, 1]), '2 and 2 rotations: 3 to 5'),
        (lambda: function_generators([0, 1, 2], [0, 1, 2]), 'need input_start and output_start'),
        (lambda: function_task(lambda _: 1.0, (0.0, 1.0), (1.0, 1.0)), 'finite and different'),
        (lambda: burmester_points([PlanePose(0j, 0.0)] * 3), '3 poses: 5 are needed'),
        (lambda: dyad_of_pin([PlanePose(complex(k), 0.0) for k in range(3)], 1j), 'on one line'),
        (lambda: dyad_of_pivot([PlanePose(complex(k), 0.0) for k in range(3)], 1j), 'on one line'),
        (lambda: place(FourBarGeometry(4, 1, 3, 3), math.nan), 'finite'),
        (lambda: PlacedFourBar(0j, 4 + 0j, (Position(-1, 5, 0j),)), 'shorter'),
        (lambda: PlacedFourBar(0j, 2, (Position(1j, 1 + 1j, math.nan),)), 'position 1 does not'),
    ],
)
def test_an_invalid_task_is_refused_in_one_line(call, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        call()
