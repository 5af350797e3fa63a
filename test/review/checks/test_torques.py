"""Efforts of a crank are held against the torque that the masses of its legs take."""

from collections.abc import Callable
from dataclasses import replace
from itertools import count
import math
import re
from typing import Any

from findings import checks
from klann_ros.dynamics import Dynamics, rods
from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.review.checks.built_leg import crank_motion, torques
from klann_ros.review.command import main
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.recording import Drive, LegRecording, LegSolver
from klann_ros.review.model.review import Severity
from klann_ros.review.model.times import no_series, Series
from klann_ros.review.reviewing import review_run
from klann_ros.robot import robot_of
import numpy as np
import pytest

PERIOD, COUNT = 0.005, 400
TIMES = PERIOD * np.arange(COUNT)
# A crank whose speed swings: its angle, rate and acceleration.
SWING = 0.3 + 6.0 * TIMES + 0.4 * np.sin(5.0 * TIMES)
RATE = 6.0 + 2.0 * np.cos(5.0 * TIMES)
CHANGE = -10.0 * np.sin(5.0 * TIMES)
WEIGHED = {'bar_density': 1.0, 'foot_mass': 0.2}
DYNAMICS = Dynamics(KlannGeometry(), rods(KlannGeometry(), 1.0, foot_mass=0.2))
TORQUE = DYNAMICS.crank_torque(SWING, RATE, CHANGE)


@pytest.fixture
def run(make_script, make_run) -> Callable[..., Any]:
    """Return what makes a run whose crank or whose legs have these efforts."""
    names = count()

    def write(efforts: Any, angles: Any = SWING, pose_efforts: Any = (), **parameters: Any) -> Any:
        script = make_script(count=COUNT).by_crank_state()
        script.parameters = {**WEIGHED, **parameters}
        script.crank_efforts, script.pose_efforts = efforts, pose_efforts
        leg = KlannLeg()
        sense, phase = parameters.get('direction', 1), parameters.get('phase', 0.0)
        for n in range(COUNT):
            pose = leg.solve(sense * angles[n] + phase)
            script.change(n, alpha=angles[n], pose=list(pose.joints), foot=pose.h)
        return make_run(script, f'run {next(names)}')

    return write


def test_efforts_equal_to_the_model_give_no_finding(run) -> None:
    assert checks(review_run(run(TORQUE))) == []
    # And what is found is known to some percent of its peak.
    assert checks(review_run(run(TORQUE), limits=Limits(torque=0.01))) == []


def test_a_fifth_more_is_found_where_it_is_worst(run) -> None:
    review = review_run(run(1.2 * TORQUE))
    (finding,) = review.findings
    assert (finding.check, finding.severity) == ('effort', Severity.WARNING)
    inside = slice(10, COUNT - 10)
    worst = 10 + int(np.argmax(np.abs(TORQUE[inside])))
    assert finding.time == pytest.approx(worst * PERIOD, abs=2 * PERIOD)
    recorded, expected = map(
        float, re.findall(r'recorded (\S+), expected (\S+) ', finding.text)[0]
    )
    assert recorded == pytest.approx(1.2 * TORQUE[worst], rel=0.01)
    assert expected == pytest.approx(TORQUE[worst], rel=0.01)
    assert finding.meaning.startswith('it is 1.20 times as large')
    assert checks(review_run(run(1.2 * TORQUE), limits=Limits(torque=0.25))) == []


def test_the_wrong_sign_is_named(run) -> None:
    (finding,) = review_run(run(-TORQUE)).findings
    assert finding.meaning.startswith('it has the opposite sign')


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_friction_is_neither(run, sign: float) -> None:
    (finding,) = review_run(run(sign * TORQUE + 3.0 * np.sign(RATE))).findings
    assert finding.check == 'effort'
    assert 'friction' in finding.meaning


def test_a_crank_that_counts_backwards_feels_the_opposite_torque(run) -> None:
    joint = 0.7 - SWING
    assert checks(review_run(run(-TORQUE, joint, direction=-1, phase=0.7))) == []
    assert checks(review_run(run(TORQUE, joint, direction=-1, phase=0.7))) == ['effort']


def test_non_finite_efforts_are_counted_and_left_out(run) -> None:
    efforts = TORQUE.copy()
    efforts[[3, 50, 51]] = math.nan, math.inf, -math.inf
    (finding,) = review_run(run(efforts)).findings
    assert finding.severity == Severity.NOTE
    assert finding.text.startswith('3 of 400 efforts of crank')


GLITCH = np.where(np.arange(COUNT) == 200, 50.0, TORQUE)


@pytest.mark.parametrize(
    'efforts',
    [np.full(COUNT, np.nan), np.zeros(COUNT), (), GLITCH],
    ids=['nan', 'zeros', 'none', 'a glitch'],
)
def test_zero_efforts_and_a_single_glitch_give_no_finding(run, efforts) -> None:
    assert checks(review_run(run(efforts))) == []


def test_a_coarse_encoder_gives_no_finding(run) -> None:
    step = math.tau / 4096
    coarse = step * np.round(SWING / step)
    assert checks(review_run(run(TORQUE, coarse))) == []
    assert checks(review_run(run(1.5 * TORQUE, coarse))) == ['effort']


def test_without_masses_a_note_names_them(run, tmp_path, capsys) -> None:
    path = run(1.2 * TORQUE, bar_density='no number')
    (finding,) = review_run(path).findings
    assert finding.severity == Severity.NOTE
    assert '--geometry FILE' in finding.meaning
    file = tmp_path / 'leg.yaml'
    numbers = {**KlannGeometry().as_dict(), **WEIGHED, 'assembly': [1, 1]}
    file.write_text('\n'.join(f'{name}: {value}' for name, value in numbers.items()))
    (finding,) = review_run(path, robot=robot_of(str(file))).findings
    assert finding.severity == Severity.WARNING
    assert main([str(path), '--geometry', str(file)]) == 1
    assert 'N m: recorded' in capsys.readouterr().out


def test_a_run_opens_no_file_that_it_names(run, tmp_path, monkeypatch) -> None:
    opened: list[Any] = []
    monkeypatch.setattr('klann_ros.robot.file.linkage_text', opened.append)
    checks(review_run(run(TORQUE, linkage=str(tmp_path / 'secret.yaml'))))
    assert opened == []


def test_legs_on_one_joint_are_weighed_together() -> None:
    names = ('left', 'right')
    solvers = [
        LegSolver(leg=KlannLeg(), direction=sense, phase=phase, dynamics=DYNAMICS)
        for sense, phase in ((1, 0.0), (-1, 2.0))
    ]
    legs = [
        LegRecording('', name, solver, *[frozenset()] * 2, *[no_series(1)] * 2, no_series(2))
        for name, solver in zip(names, solvers, strict=True)
    ]
    both = TORQUE - DYNAMICS.crank_torque(2.0 - SWING, -RATE, -CHANGE)
    times = (TIMES * 1e9).astype(np.int64) + 1
    efforts = Series(times, times.copy(), np.column_stack([SWING, both]))
    found = torques(Drive('crank', (0, 1), is_input=True, efforts=efforts), legs)
    assert found is not None
    assert len(found.times) > 0.9 * COUNT
    assert np.abs(found.recorded - found.expected).max() < 0.01 * np.abs(both).max()
    legs[1] = replace(legs[1], solver=replace(solvers[1], direction=1e300, phase=1e308))
    with np.errstate(over='ignore', invalid='ignore'):
        nothing = torques(Drive('crank', (0, 1), is_input=True, efforts=efforts), legs)
    assert nothing is not None
    assert len(nothing.times) == 0


@pytest.mark.parametrize('factor', [1.0, 1.2])
def test_efforts_of_joint_states_are_those_of_the_legs_own_angle(run, factor: float) -> None:
    path = run((), pose_efforts=factor * TORQUE)
    assert checks(review_run(path)) == ['effort'] * (factor > 1.0)


def test_rate_and_acceleration_have_honest_errors() -> None:
    random = np.random.default_rng(1)
    noisy = SWING + 1e-4 * random.standard_normal(COUNT)
    found = crank_motion(TIMES, noisy)
    assert len(found.rows) > 0.9 * COUNT
    rate = (found.rate - RATE[found.rows]) / found.rate_error
    change = (found.acceleration - CHANGE[found.rows]) / found.acceleration_error
    # Of a normal error 0.3 % are beyond three sigma; the estimate is not too large either.
    assert np.mean(np.abs(rate) > 3.5) < 0.03
    assert np.mean(np.abs(change) > 3.5) < 0.03
    assert 0.5 < np.sqrt(np.mean(change**2)) < 2.0
    # The estimate is useful.
    assert np.median(found.acceleration_error) < 0.1 * np.abs(CHANGE).max()


def test_samples_that_jump_back_or_pause_make_no_motion() -> None:
    times = np.concatenate([TIMES, TIMES[:5] - 1.0, TIMES + 10.0])
    angles = np.concatenate([SWING, np.zeros(5), SWING])
    found = crank_motion(times, angles)
    assert np.abs(found.rate).max() < 9.0
    assert not set(range(COUNT, COUNT + 5)) & set(found.rows.tolist())
    assert len(crank_motion(TIMES[:5], SWING[:5]).rows) == 0
    assert len(crank_motion(np.zeros(50), SWING[:50]).rows) == 0
