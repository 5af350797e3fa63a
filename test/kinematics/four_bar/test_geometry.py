"""What is no four-bar is refused, with the reason."""

from dataclasses import FrozenInstanceError
import math

from four_bars import COURSE, NAMES
from klann_ros import kinematics
from klann_ros.kinematics import FourBar, GeometryError
import pytest


def with_length(name: str, value: object) -> FourBar:
    return FourBar(**dict(zip(NAMES, COURSE, strict=True)) | {name: value})


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('value', [math.nan, math.inf, 'long', '0.12', b'0.12', None, 10**400])
def test_a_length_that_is_not_finite_is_refused(name: str, value: object) -> None:
    with pytest.raises(GeometryError, match=f'{name} = .* must be a finite number'):
        with_length(name, value)


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('value', [0.0, -0.1])
def test_a_length_must_be_positive(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f'{name} = .* a length must be > 0'):
        with_length(name, value)


@pytest.mark.parametrize('factor', [1e-81, 1e160])
def test_lengths_beyond_all_measure_are_refused(factor: float) -> None:
    with pytest.raises(GeometryError, match=r'must be within 1e-60 \.\. 1e\+60 m'):
        FourBar(*(factor * length for length in COURSE))


@pytest.mark.parametrize('assembly', [0, 2, None, '+', (1,), [1, -1], math.nan])
def test_an_assembly_is_a_sign(assembly: object) -> None:
    with pytest.raises(GeometryError, match=r'assembly = .* must be \+1 or -1'):
        FourBar(*COURSE, assembly)


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('length', [3.0, 3.1])
def test_a_link_as_long_as_the_others_together_is_refused(name: str, length: float) -> None:
    lengths = dict.fromkeys(NAMES, 1.0) | {name: length}
    with pytest.raises(GeometryError, match=f'at no crank angle .* {name} = .* not shorter than'):
        FourBar(**lengths)


def test_a_link_that_is_a_little_shorter_is_taken() -> None:
    (start, end), *_ = FourBar(2.999, 1.0, 1.0, 1.0).reachable_arcs()
    assert 0.0 < end - start < 0.2


@pytest.mark.parametrize('name', ['tolerance', 'max_crank_step'])
@pytest.mark.parametrize('value', [0.0, -1.0, math.nan, math.inf])
def test_settings_that_make_no_sense_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f'{name} = .* must be finite, > 0'):
        FourBar(*COURSE, **{name: value})


def test_a_tolerance_that_would_answer_unreachable_angles_is_refused() -> None:
    with pytest.raises(ValueError, match=r'at most 0\.001 rad'):
        FourBar(*COURSE, tolerance=0.1)


def test_the_geometry_is_frozen_and_compares_by_value() -> None:
    geometry = FourBar(*COURSE).geometry
    with pytest.raises(FrozenInstanceError):
        geometry.crank = 1.0
    assert geometry == FourBar(*COURSE).geometry
    assert geometry != FourBar(*COURSE, -1).geometry
    assert hash(geometry) == hash(FourBar(*COURSE, True).geometry)


def test_the_classes_of_all_results_are_exported() -> None:
    bar = FourBar(0.180, 0.080, 0.200, 0.150)
    velocity = bar.velocity(bar.solve(1.0), 1.0)
    results = [
        bar.geometry,
        bar.grashof,
        bar.rocker_limits,
        *bar.dead_points('rocker'),
        bar.transmission_extremes,
        velocity,
        bar.acceleration(velocity.pose, 1.0, 0.0),
    ]
    for result in results:
        assert getattr(kinematics, type(result).__name__) is type(result)
        assert type(result).__name__ in kinematics.__all__
