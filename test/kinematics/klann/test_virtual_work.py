"""Crank torque and foot force: no small motion does work."""

import math
import pickle

from hypothesis import assume, given, settings, strategies as st
from klann_ros.kinematics import (
    ImmobileDirectionError,
    KlannGeometry,
    KlannLeg,
    KlannPose,
    SingularPoseError,
    UnreachableError,
    virtual_work,
)
import numpy as np
import pytest
from strategies import crank_angles, legs

newtons = st.floats(-1e3, 1e3)
forces = st.tuples(newtons, newtons)


def solved(geometry: KlannGeometry, alpha: float) -> KlannPose:
    """Return a pose that is not close to singular, or drop the example."""
    try:
        pose = KlannLeg(geometry).solve(alpha)
    except UnreachableError:
        assume(False)
    assume(min(pose.sines) > 0.05)
    return pose


@given(geometry=legs(), alpha=crank_angles, force=forces, rate=st.floats(-10.0, 10.0))
def test_crank_and_foot_together_do_no_work(
    geometry: KlannGeometry, alpha: float, force: tuple[float, float], rate: float
) -> None:
    leg, pose = KlannLeg(geometry), solved(geometry, alpha)
    torque = leg.crank_torque(pose, force)
    velocity = leg.velocity(pose, rate).h
    power = np.dot(force, velocity)
    scale = 1e-12 * (1.0 + np.linalg.norm(force) * np.linalg.norm(velocity))
    assert torque * rate + power == pytest.approx(0.0, abs=scale)


def test_over_a_turn_a_constant_force_takes_no_work() -> None:
    leg = KlannLeg()
    torques = [leg.crank_torque(leg.solve(k * math.pi / 360), (3.0, 20.0)) for k in range(720)]
    assert np.mean(torques) == pytest.approx(0.0, abs=1e-13)
    assert max(torques) > 1.0


@settings(max_examples=60)
@given(geometry=legs(), alpha=crank_angles, force=newtons, direction=st.floats(-math.pi, math.pi))
def test_the_force_that_a_torque_balances_takes_that_torque(
    geometry: KlannGeometry, alpha: float, force: float, direction: float
) -> None:
    leg, pose = KlannLeg(geometry), solved(geometry, alpha)
    u = math.cos(direction), math.sin(direction)
    h_1 = leg.velocity(pose, 1.0).h
    assume(abs(np.dot(u, h_1)) > 1e-3 * np.linalg.norm(h_1))
    torque = leg.crank_torque(pose, (force * u[0], force * u[1]))
    assert leg.foot_force(pose, torque, u) == pytest.approx(force, rel=1e-9, abs=1e-9)
    assert leg.foot_force(pose, torque, (-7 * u[0], -7 * u[1])) == pytest.approx(
        -force, rel=1e-9, abs=1e-9
    )


def test_a_weight_on_the_foot_of_the_textbook_leg_at_60_degrees() -> None:
    leg = KlannLeg()
    pose = leg.solve(math.radians(60.0))
    step = 1e-6
    rise = (leg.solve(pose.alpha + step).h[1] - leg.solve(pose.alpha - step).h[1]) / (2 * step)
    # The ground bears the foot with 10 N; the foot is rising, so the crank must hold it back.
    assert leg.crank_torque(pose, (0.0, 10.0)) == pytest.approx(-10.0 * rise, abs=1e-8)
    assert leg.crank_torque(pose, (0.0, 10.0)) < 0.0


@pytest.mark.parametrize('direction', [(0.0, 1.0), (0.0, -1e-300), (1e-17, 1e300)])
def test_where_the_foot_does_not_move_any_force_is_balanced(
    direction: tuple[float, float],
) -> None:
    with pytest.raises(ImmobileDirectionError, match=r'dH/dalpha = \(0.5, 0\) m/rad') as caught:
        virtual_work.foot_force((0.5, 0.0), 1.0, direction)
    assert caught.value.h_1 == (0.5, 0.0)
    assert math.hypot(*caught.value.direction) == pytest.approx(1.0)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)  # noqa: S301


def test_a_foot_at_rest_balances_every_force() -> None:
    assert math.copysign(1.0, virtual_work.crank_torque((0.0, 0.0), (1.0, 2.0))) == 1.0
    with pytest.raises(ImmobileDirectionError):
        virtual_work.foot_force((0.0, 0.0), 0.0, (1.0, 0.0))


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


def test_a_singular_pose_transmits_no_known_torque() -> None:
    leg = KlannLeg(KlannGeometry(l_bc=0.12 + math.hypot(0.35, 0.09) - 0.14 + 1e-16))
    pose = leg.closed_form(math.atan2(-0.09, 0.35) + math.pi + 1e-9)
    with pytest.raises(SingularPoseError):
        leg.crank_torque(pose, (1.0, 0.0))
    with pytest.raises(SingularPoseError):
        leg.foot_force(pose, 1.0, (1.0, 0.0))
