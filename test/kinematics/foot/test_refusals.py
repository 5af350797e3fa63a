"""Invalid arguments of a foot path are refused in one line that names them."""

import math
from typing import Any

from klann_ros.kinematics import foot_path, GeometryError, KlannGeometry, KlannLeg
import pytest

NO_POINT = "must be a point's name, or body, u, v"


@pytest.mark.parametrize('samples', [31, 0, -5, 100.5, '100', None])
def test_too_few_samples(samples: Any) -> None:
    with pytest.raises(ValueError, match=f'samples = {samples!r} is refused'):
        foot_path(KlannLeg(), samples=samples)


@pytest.mark.parametrize('leg', [KlannGeometry(), None, 'jansen'])
def test_anything_but_a_leg(leg: Any) -> None:
    with pytest.raises(TypeError, match=r'leg = .* is refused: it must be a leg'):
        foot_path(leg)


@pytest.mark.parametrize(
    ('point', 'reason'),
    [
        ('A', 'the foot A is a pivot and does not move'),
        ('h', 'the foot h is none of the points: .*; did you mean H'),
        (('gama', 0.1, 0.0), 'gama: no such body; there are .*; did you mean gamma'),
        (('gamma', math.nan, 0.0), 'u = nan is refused'),
        (('gamma', 0.1, '1'), "v = '1' is refused"),
        (('gamma', 0.1), NO_POINT),
        (3, NO_POINT),
    ],
)
def test_an_unknown_or_fixed_point(point: Any, reason: str) -> None:
    with pytest.raises(ValueError, match=reason) as caught:
        foot_path(KlannLeg(), point=point)
    assert isinstance(caught.value, GeometryError) != (reason == NO_POINT)


@pytest.mark.parametrize('value', [math.nan, math.inf, None, 'a'])
def test_a_coordinate_that_is_not_finite(value: Any) -> None:
    path = foot_path(KlannLeg())
    for ask, argument, reason in (
        (path.crank_angles_at_x, value, f'x = {value!r} is refused'),
        (path.crank_angles_at_height, value, f'y = {value!r} is refused'),
        (path.nearest_crank_angle, (0.0, value), 'two finite numbers'),
        (path.nearest_crank_angle, (0.0,), 'two finite numbers'),
    ):
        with pytest.raises(ValueError, match=reason):
            ask(argument)


@pytest.mark.parametrize('ground', [0.0, -0.01, 1e-15, math.nan, math.inf, 'a'])
def test_a_band_without_height(ground: Any) -> None:
    with pytest.raises(ValueError, match=r'ground = .* is refused'):
        foot_path(KlannLeg()).stance(ground)
