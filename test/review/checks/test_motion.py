"""How the crank and the foot move: jumps, standstill and drift, each found as such."""

import math

from findings import checks
from klann_ros.review.reviewing import review_run
import pytest


@pytest.mark.parametrize(
    'angle',
    [lambda n: math.sin(n * math.tau / 8.0), lambda n: 0.1 * n + 0.4 * (n % 2)],
    ids=['a sine', 'a step of 0.5 rad and one back of 0.3 rad'],
)
def test_a_fast_crank_that_rocks_is_turned_by_one(make_script, make_run, angle) -> None:
    script = make_script()
    for n in range(400):
        script.move(n, angle(n))
    assert checks(review_run(make_run(script))) == []


@pytest.mark.parametrize(('turns', 'is_path'), [(2.0, True), (1.0, True), (0.9, False)])
def test_less_than_a_turn_has_no_stride(make_script, make_run, turns, is_path) -> None:
    (leg,) = review_run(make_run(make_script(turns=turns))).legs
    assert math.isnan(leg.figures.stride) is not is_path
    assert math.isnan(leg.figures.lift) is not is_path
    assert not math.isnan(leg.figures.duty_factor)
