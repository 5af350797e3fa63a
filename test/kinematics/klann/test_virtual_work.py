"""Crank torque and foot force: a direction without motion, and invalid forces."""

import math
import pickle

from klann_ros.kinematics import (
    ImmobileDirectionError,
    KlannLeg,
)
import pytest


def test_across_its_path_the_foot_balances_any_force() -> None:
    leg = KlannLeg()
    pose = leg.solve(1.0)
    x_1, y_1 = leg.velocity(pose, 1.0).h
    with pytest.raises(ImmobileDirectionError, match=r'dH/dalpha = \(.*\) m/rad') as caught:
        leg.foot_force(pose, 1.0, (-1e300 * y_1, 1e300 * x_1))
    assert caught.value.h_1 == (x_1, y_1)
    assert math.hypot(*caught.value.direction) == pytest.approx(1.0)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)  # noqa: S301


@pytest.mark.parametrize(
    ('method', 'arguments', 'text'),
    [
        *(
            ('crank_torque', (force,), 'force = .* must be two finite numbers')
            for force in ((math.nan, 0.0), (0.0, math.inf), (1.0,), (1.0, 2.0, 3.0), 'x')
        ),
        ('foot_force', (math.nan, (1.0, 0.0)), 'torque = nan is refused'),
        ('foot_force', (1.0, (0.0, 0.0)), 'it has no length'),
        ('foot_force', (1.0, None), 'direction = None'),
    ],
)
def test_invalid_forces_are_refused(method: str, arguments: tuple[object, ...], text: str) -> None:
    leg = KlannLeg()
    with pytest.raises(ValueError, match=text):
        getattr(leg, method)(leg.solve(1.0), *arguments)
