"""Laws of the limits of a walker's motion: whatever is commanded, whenever."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import inf

from hypothesis import given, strategies as st
from klann_ros.gait import Rates, Twist2D
from klann_ros.walker import MotionLimits
from klann_ros.walker.limits import MIN_DECELERATION, MotionLimiter
import numpy as np
import pytest

DT = 0.01
STANDS = Twist2D(0.0, 0.0)
speeds = st.floats(-1.0, 1.0).map(lambda speed: round(speed, 3))
twists = st.builds(Twist2D, speeds, speeds)
rates_of_change = st.floats(0.01, 5.0)
jerks = st.one_of(st.just(inf), st.floats(0.1, 50.0))
limits = st.builds(
    MotionLimits,
    max_linear_acceleration=rates_of_change,
    max_angular_acceleration=rates_of_change,
    max_linear_deceleration=rates_of_change,
    max_angular_deceleration=rates_of_change,
    max_linear_jerk=jerks,
    max_angular_jerk=jerks,
)
commands = st.lists(st.tuples(twists, st.integers(1, 40)), min_size=1, max_size=5)


def driven(limits: MotionLimits, commands: Sequence[tuple[Twist2D, int]]) -> list[Twist2D]:
    """Return the motions at all steps of commands, each for a number of steps."""
    limiter = MotionLimiter(limits)
    motions = [STANDS]
    for wanted, count in commands:
        for _ in range(count):
            motions.append(limiter.approach(motions[-1], wanted, DT))
    return motions


def steps_to(limits: MotionLimits, start: Twist2D, target: Twist2D) -> list[Twist2D]:
    """Return the motions from a start, which is not accelerated, to a target."""
    limiter = MotionLimiter(limits)
    motions = [start]
    while motions[-1] != target:
        motions.append(limiter.approach(motions[-1], target, DT))
        assert len(motions) < 100_000
    return motions


@given(limits, commands)
def test_no_change_is_faster_than_its_limit(
    limits: MotionLimits, commands: Sequence[tuple[Twist2D, int]]
) -> None:
    motions = driven(limits, commands)
    for axis, speeds in zip(limits.axes, zip(*motions, strict=True), strict=True):
        acceleration = 0.0
        for last_speed, speed in pairwise(speeds):
            growth = (abs(speed) - abs(last_speed)) / DT
            assert last_speed * speed >= 0.0
            assert -axis.deceleration - 1e-9 <= growth <= axis.acceleration + 1e-9
            assert growth <= acceleration + axis.jerk * DT + 1e-6
            acceleration = max(0.0, growth)


@given(limits, commands)
def test_no_step_overshoots_or_goes_away_from_the_command(
    limits: MotionLimits, commands: Sequence[tuple[Twist2D, int]]
) -> None:
    limiter = MotionLimiter(limits)
    motion = STANDS
    for wanted, count in commands:
        for _ in range(count):
            last_motion = motion
            motion = limiter.approach(motion, wanted, DT)
            for last_speed, speed, target in zip(last_motion, motion, wanted, strict=True):
                lower, upper = sorted((last_speed, target))
                assert lower - 1e-12 <= speed <= upper + 1e-12


@given(limits, commands, st.sampled_from([(-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]))
def test_mirrored_commands_give_mirrored_motions(
    limits: MotionLimits, commands: Sequence[tuple[Twist2D, int]], signs: tuple[float, float]
) -> None:
    def mirrored(twist: Twist2D) -> Twist2D:
        return Twist2D(signs[0] * twist.linear, signs[1] * twist.angular)

    mirrored_commands = [(mirrored(wanted), count) for wanted, count in commands]
    assert driven(limits, mirrored_commands) == [
        mirrored(motion) for motion in driven(limits, commands)
    ]


@given(limits, twists)
def test_a_stop_takes_the_time_of_its_deceleration_whatever_the_acceleration_and_jerk(
    limits: MotionLimits, motion: Twist2D
) -> None:
    stop = steps_to(limits, motion, STANDS)
    linear, angular = limits.axes
    stop_time = max(
        abs(motion.linear) / linear.deceleration, abs(motion.angular) / angular.deceleration
    )
    assert len(stop) - 1 <= stop_time / DT + 1.0 + 1e-6
    # On the same path.
    for linear, angular in stop:
        assert linear * motion.angular == pytest.approx(angular * motion.linear, abs=1e-9)


@given(limits, commands)
def test_a_stop_while_it_accelerates_is_not_delayed_either(
    limits: MotionLimits, commands: Sequence[tuple[Twist2D, int]]
) -> None:
    motion = driven(limits, commands)[-1]
    stop = driven(limits, [*commands, (STANDS, 1)])[-1]
    assert stop == steps_to(limits, motion, STANDS)[:2][-1]


@given(limits, speeds, speeds)
def test_what_decreases_does_not_wait_for_what_grows(
    limits: MotionLimits, speed: float, turn: float
) -> None:
    limiter = MotionLimiter(limits)
    motion = Twist2D(0.0, turn)
    for turn_alone in steps_to(limits, motion, STANDS):
        assert motion.angular == turn_alone.angular
        motion = limiter.approach(motion, Twist2D(speed, 0.0), DT)


@given(st.floats(0.05, 2.0), st.floats(0.1, 50.0), st.floats(0.05, 1.0))
def test_an_acceleration_by_jerk_is_a_smooth_ramp_that_arrives(
    acceleration: float, jerk: float, speed: float
) -> None:
    limits = MotionLimits(max_linear_acceleration=acceleration, max_linear_jerk=jerk)
    motions = steps_to(limits, STANDS, Twist2D(speed, 0.0))
    accelerations = np.diff([motion.linear for motion in motions]) / DT
    changes = np.diff([0.0, *accelerations, 0.0])
    assert max(changes) <= jerk * DT + 1e-6
    # The last step is what is left.
    assert min(changes) >= -2.0 * jerk * DT - 1e-6
    # The time of the ramp without steps, and those that it is rounded up to.
    ramp_time = speed / acceleration + acceleration / jerk
    if speed < acceleration**2 / jerk:
        ramp_time = 2.0 * (speed / jerk) ** 0.5
    assert len(motions) - 1 <= ramp_time / DT + 4.0


@given(twists, st.floats(0.0, 0.5), st.floats(0.0, 0.5), st.floats(0.0, 0.5), st.floats(0.0, 0.5))
def test_each_direction_has_its_limit_and_the_path_stays(
    wanted: Twist2D, forwards: float, backwards: float, left: float, right: float
) -> None:
    limits = MotionLimits(
        max_linear=forwards,
        max_linear_backward=backwards,
        max_angular=left,
        max_angular_right=right,
    )
    (linear, angular), hit = limits.motion(wanted, lambda _: Rates(0.0, 0.0))
    assert -backwards - 1e-12 <= linear <= forwards + 1e-12
    assert -right - 1e-12 <= angular <= left + 1e-12
    assert linear * wanted.angular == pytest.approx(angular * wanted.linear, abs=1e-12)
    is_allowed = -backwards <= wanted.linear <= forwards and -right <= wanted.angular <= left
    assert (hit == []) == is_allowed
    assert not is_allowed or (linear, angular) == wanted


def test_without_limits_of_their_own_both_directions_and_both_changes_are_alike() -> None:
    linear, angular = MotionLimits(
        max_linear=0.2, max_angular=0.4, max_linear_acceleration=0.5, max_angular_acceleration=0.7
    ).axes
    assert linear[:4] == (0.2, 0.2, 0.5, 0.5)
    assert angular[:4] == (0.4, 0.4, 0.7, 0.7)


def test_a_walker_that_may_not_reverse_stands_and_none_is_without_deceleration() -> None:
    one_way = MotionLimits(max_linear_backward=0.0)
    assert one_way.motion(Twist2D(-0.1, 0.0), lambda _: Rates(0.0, 0.0))[0] == STANDS
    never = replace(one_way, max_linear_deceleration=MIN_DECELERATION / 2.0)
    assert never.axes[0].deceleration == one_way.max_linear_acceleration


def test_a_motion_that_was_set_by_others_begins_without_acceleration() -> None:
    limits = MotionLimits(max_linear_acceleration=1.0, max_linear_jerk=1.0)
    limiter = MotionLimiter(limits)
    wanted = Twist2D(1.0, 0.0)
    motion = STANDS
    for _ in range(20):
        motion = limiter.approach(motion, wanted, DT)
    first = limiter.approach(STANDS, wanted, DT)
    assert first.linear == pytest.approx(1.0 * DT**2)
    assert limiter.approach(first, wanted, 0.0) == first
