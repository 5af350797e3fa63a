"""`CrankMotion`: the angle is a function of time alone, and the rate is its derivative."""

import math

from hypothesis import given, strategies as st
from klann_ros.nodes.crank.motion import CrankMotion, CrankMotionError, MODES
import pytest

numbers = st.floats(-10.0, 10.0)
positive = st.floats(0.1, 10.0)
times = st.floats(0.0, 100.0)


@st.composite
def motions(draw: st.DrawFn) -> CrankMotion:
    return CrankMotion(
        mode=draw(st.sampled_from(MODES)),
        speed=draw(positive) * draw(st.sampled_from([-1, 1])),
        start=draw(numbers),
        amplitude=draw(positive) * draw(st.sampled_from([-1, 1])),
        frequency=draw(positive),
    )


@given(motion=motions(), t=times)
def test_the_rate_is_the_derivative_of_the_angle(motion: CrankMotion, t: float) -> None:
    step = 1e-5
    # A corner of a sweep or a jump has no derivative.
    corner = motion.period / (2 if motion.mode == 'sweep' else 1)
    if motion.mode in ('sweep', 'step') and t % corner > corner - 3 * step:
        return
    angle, rate = motion.at(t)
    later_angle, _ = motion.at(t + step)
    # A forward difference is off by half a step of the second derivative, that of a sine.
    curvature = abs(motion.amplitude) * (2 * math.pi * motion.frequency) ** 2
    assert (later_angle - angle) / step == pytest.approx(rate, abs=1e-6 + step * curvature)


@given(motion=motions(), t=times)
def test_a_period_brings_it_back(motion: CrankMotion, t: float) -> None:
    angle, _ = motion.at(t)
    later, _ = motion.at(t + motion.period)
    if motion.mode == 'constant':
        assert later - angle == pytest.approx(math.copysign(2 * math.pi, motion.speed), abs=1e-9)
    elif motion.mode != 'step':
        assert later == pytest.approx(angle, abs=1e-6)


@given(motion=motions(), t=times)
def test_each_mode_keeps_its_bounds(motion: CrankMotion, t: float) -> None:
    share = (motion.at(t)[0] - motion.start) / motion.amplitude
    if motion.mode == 'sine':
        assert -1 - 1e-9 <= share <= 1 + 1e-9
    elif motion.mode == 'sweep':
        assert -1e-9 <= share <= 1 + 1e-9
    elif motion.mode == 'step':
        assert share == pytest.approx(round(share), abs=1e-9)


def test_it_begins_at_the_start() -> None:
    for mode in MODES:
        assert CrankMotion(mode=mode, start=0.3).at(0.0)[0] == 0.3


@pytest.mark.parametrize('frequency', [0.1, 0.3, 0.7, 1.0, 3.0, 100.0])
def test_every_jump_comes_with_the_message_that_is_due(frequency: float) -> None:
    motion = CrankMotion(mode='step', amplitude=1.0, frequency=frequency)
    assert [motion.at(k / frequency)[0] for k in range(1000)] == [float(k) for k in range(1000)]


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        ({'mode': 'zigzag'}, 'must be one of constant, sine, sweep, step'),
        ({'speed': math.nan}, 'speed = nan'),
        ({'start': math.inf}, 'start = inf'),
        ({'speed': 'fast'}, "speed = 'fast'"),
        ({'mode': 'sine', 'frequency': 1e308}, 'a period of .* is refused'),
        ({'mode': 'step', 'frequency': 1e-320}, 'a period of inf s is refused'),
        ({'mode': 'sweep', 'amplitude': 1e-320, 'speed': 1e10}, 'a period of 0 s is refused'),
        ({'mode': 'sine', 'frequency': 0.0}, 'frequency = 0 Hz is refused: it must be > 0'),
        ({'mode': 'step', 'frequency': -1.0}, 'frequency = -1 Hz'),
        ({'mode': 'sweep', 'speed': 0.0}, 'both must be other than 0'),
        ({'mode': 'sweep', 'amplitude': 0.0}, 'both must be other than 0'),
    ],
)
def test_invalid_motions_are_refused(change: dict[str, object], reason: str) -> None:
    with pytest.raises(CrankMotionError, match=reason):
        CrankMotion(**change)


def test_a_crank_that_stands_still_has_no_period() -> None:
    assert CrankMotion(speed=0.0, frequency=0.0).period == math.inf
