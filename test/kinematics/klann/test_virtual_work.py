"""Crank torque and foot force: no small motion does work."""

import math
import pickle

from hypothesis import strategies as st
from klann_ros.kinematics import (
    ImmobileDirectionError,
    KlannLeg,
)
import numpy as np
import pytest

newtons = st.floats(-1e3, 1e3)
forces = st.tuples(newtons, newtons)


def test_over_a_turn_a_constant_force_takes_no_work() -> None:
    leg = KlannLeg()
    torques = [leg.crank_torque(leg.solve(k * math.pi / 360), (3.0, 20.0)) for k in range(720)]
    assert np.mean(torques) == pytest.approx(0.0, abs=1e-13)
    assert max(torques) > 1.0


def test_a_weight_on_the_foot_of_the_textbook_leg_at_60_degrees() -> None:
    leg = KlannLeg()
    pose = leg.solve(math.radians(60.0))
    step = 1e-6
    rise = (leg.solve(pose.alpha + step).h[1] - leg.solve(pose.alpha - step).h[1]) / (2 * step)
    # The ground bears the foot with 10 N; the foot is rising, so the crank must hold it back.
    assert leg.crank_torque(pose, (0.0, 10.0)) == pytest.approx(-10.0 * rise, abs=1e-8)
    assert leg.crank_torque(pose, (0.0, 10.0)) < 0.0


def test_across_its_path_the_foot_balances_any_force() -> None:
    leg = KlannLeg()
    pose = leg.solve(1.0)
    x_1, y_1 = leg.velocity(pose, 1.0).h
    with pytest.raises(ImmobileDirectionError, match=r'dH/dalpha = \(.*\) m/rad') as caught:
        leg.foot_force(pose, 1.0, (-1e300 * y_1, 1e300 * x_1))
    assert caught.value.h_1 == (x_1, y_1)
    assert math.hypot(*caught.value.direction) == pytest.approx(1.0)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)  # noqa: S301


@pytest.mark.parametrize('force', [(math.nan, 0.0), (0.0, math.inf), (1.0,), (1.0, 2.0, 3.0), 'x'])
def test_a_force_that_is_none_is_refused(force: object) -> None:
    leg = KlannLeg()
    with pytest.raises(ValueError, match=r'force = .* must be two finite numbers'):
        leg.crank_torque(leg.solve(1.0), force)


def test_a_torque_or_direction_that_is_none_is_refused() -> None:
    leg = KlannLeg()
    pose = leg.solve(1.0)
    with pytest.raises(ValueError, match='torque = nan is refused'):
        leg.foot_force(pose, math.nan, (1.0, 0.0))
    with pytest.raises(ValueError, match='it has no length'):
        leg.foot_force(pose, 1.0, (0.0, 0.0))
    with pytest.raises(ValueError, match='direction = None'):
        leg.foot_force(pose, 1.0, None)
