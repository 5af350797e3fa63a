"""Torques of legs on one joint, rates of cranks, and masses that a file gives."""

from dataclasses import replace
from typing import Any

from klann_ros.dynamics import Dynamics, rods
from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.review.checks.built_leg import crank_motion, drive_torques
from klann_ros.review.model.recording import Drive, LegRecording, LegSolver
from klann_ros.review.model.times import no_series, Series
from klann_ros.review.reviewing import review_run
import numpy as np
import yaml

PERIOD, COUNT = 0.005, 400
TIMES = PERIOD * np.arange(COUNT)
# A crank whose speed swings: its angle, rate and acceleration.
SWING = 0.3 + 6.0 * TIMES + 0.4 * np.sin(5.0 * TIMES)
RATE = 6.0 + 2.0 * np.cos(5.0 * TIMES)
CHANGE = -10.0 * np.sin(5.0 * TIMES)
DYNAMICS = Dynamics(KlannGeometry(), rods(KlannGeometry(), 1.0, foot_mass=0.2))
TORQUE = DYNAMICS.crank_torque(SWING, RATE, CHANGE)


def test_masses_are_given_in_a_file(healthy, printed, tmp_path) -> None:
    healthy.swing(1.2, bar_density='no number')
    file = tmp_path / 'leg.yaml'
    numbers = {**KlannGeometry().as_dict(), 'bar_density': 1.0, 'foot_mass': 0.2}
    file.write_text(yaml.safe_dump(numbers))
    assert 'N m: recorded' in printed(healthy, '--geometry', str(file), code=1)


def test_a_run_opens_no_file_that_it_names(healthy, make_run, tmp_path, monkeypatch) -> None:
    opened: list[Any] = []
    monkeypatch.setattr('klann_ros.robot.file.linkage_text', opened.append)
    healthy.swing(linkage=str(tmp_path / 'secret.yaml'))
    review_run(make_run(healthy))
    assert opened == []


def test_legs_on_one_joint_are_weighed_together() -> None:
    legs = []
    for name, sense, phase in (('left', 1, 0.0), ('right', -1, 2.0)):
        solver = LegSolver(leg=KlannLeg(), direction=sense, phase=phase, dynamics=DYNAMICS)
        series = *[no_series(1)] * 2, no_series(2)
        legs.append(LegRecording('', name, solver, frozenset(), frozenset(), *series))
    both = TORQUE - DYNAMICS.crank_torque(2.0 - SWING, -RATE, -CHANGE)
    times = (TIMES * 1e9).astype(np.int64) + 1
    efforts = Series(times, times.copy(), np.column_stack([SWING, both]))
    drive = Drive('crank', (0, 1), is_input=True, efforts=efforts)
    compared = drive_torques(drive, legs)
    assert len(compared.times) > 0.9 * COUNT
    assert np.abs(compared.recorded - compared.expected).max() < 0.01 * np.abs(both).max()
    legs[1] = replace(legs[1], solver=replace(solver, direction=1e300, phase=1e308))
    with np.errstate(over='ignore', invalid='ignore'):
        assert len(drive_torques(drive, legs).times) == 0


def test_rate_and_acceleration_have_honest_errors() -> None:
    random = np.random.default_rng(1)
    noisy = SWING + 1e-4 * random.standard_normal(COUNT)
    motion = crank_motion(TIMES, noisy)
    assert len(motion.rows) > 0.9 * COUNT
    rate = (motion.rate - RATE[motion.rows]) / motion.rate_error
    change = (motion.acceleration - CHANGE[motion.rows]) / motion.acceleration_error
    # Of a normal error 0.3 % are beyond three sigma; the estimate is not too large either.
    assert np.mean(np.abs(rate) > 3.5) < 0.03
    assert np.mean(np.abs(change) > 3.5) < 0.03
    assert 0.5 < np.sqrt(np.mean(change**2)) < 2.0
    # The estimate is useful.
    assert np.median(motion.acceleration_error) < 0.1 * np.abs(CHANGE).max()


def test_samples_that_jump_back_or_pause_make_no_motion() -> None:
    times = np.concatenate([TIMES, TIMES[:5] - 1.0, TIMES + 10.0])
    angles = np.concatenate([SWING, np.zeros(5), SWING])
    motion = crank_motion(times, angles)
    assert np.abs(motion.rate).max() < 9.0
    assert not set(range(COUNT, COUNT + 5)) & set(motion.rows.tolist())
    assert len(crank_motion(TIMES[:5], SWING[:5]).rows) == 0
    assert len(crank_motion(np.zeros(50), SWING[:50]).rows) == 0
