"""Each limit changes its check, and a file that holds none is one line."""

from dataclasses import fields
from functools import partial
from math import pi

from findings import checks
from klann_ros.kinematics import KlannGeometry
from klann_ros.review.checks.poses import WrongPoses
from klann_ros.review.command import main
from klann_ros.review.model.compare import compare
from klann_ros.review.model.limits import Limits, limits_from_file
from klann_ros.review.model.poses import PoseErrors
from klann_ros.review.reviewing import review_run
import numpy as np
import pytest

MS = 1_000_000


def silent(run, count: int = 100, by: int = 300) -> None:
    run.delay(400 - count, by * MS)


def ended(run) -> None:
    last = run.answers[-1]
    run.unanswered = [(last.stamp + n * 5 * MS, last.alpha + n / 100) for n in range(420)]


def turned(run) -> None:
    for n in range(400):
        # Both cranks of the first dyad by so little that its loop is closed within the limit.
        run.answers[n].pose[2] += 4e-9


def shifted(run) -> None:
    x, y = run.answers[9].foot
    run.change(9, foot=(x + 1e-6, y))


def jumped(run) -> None:
    for n in range(200, 400):
        run.move(n, run.answers[n].alpha + 1.0)


def drifted(run) -> None:
    run.geometry = None
    for n in range(300, 400):
        x, y = run.answers[n].foot
        run.change(n, foot=(x, y + 2e-3))


# What is done to a run, the check that finds it, and the limits that let it pass.
CASES = {
    'gap_periods': (silent, 'gap', {'gap_periods': 70.0}),
    'gap_time': (silent, 'gap', {'gap_time': 0.4}),
    # 45 ms after the first message.
    'start_time': (partial(silent, count=390), 'gap', {'start_time': 0.1}),
    'stale_time': (ended, 'stale', {'stale_time': 2.2}),
    'latency': (lambda run: setattr(run, 'latency', 120 * MS), 'latency', {'latency': 0.13}),
    'clock_offset': (
        lambda run: run.by_crank_state().shift_header_stamps(-600 * MS),
        'clock',
        {'clock_offset': 0.7},
    ),
    'closure': (
        lambda run: setattr(run, 'geometry', KlannGeometry(l_ef=0.27 + 1e-6)),
        'closure',
        {'closure': 1e-5, 'angle': 1e-4},
    ),
    'angle': (turned, 'branch', {'angle': 1e-7}),
    'foot': (shifted, 'foot', {'foot': 1e-5}),
    'crank_jump': (jumped, 'jump', {'crank_jump': 1.2}),
    'path_drift': (drifted, 'drift', {'path_drift': 5e-3}),
}


@pytest.mark.parametrize('name', CASES)
def test_each_limit_changes_its_check(make_script, make_run, tmp_path, name) -> None:
    change, check, limits = CASES[name]
    script = make_script(turns=8.0)
    change(script)
    run = make_run(script)
    sharp = Limits(start_time=0.0)
    assert check in checks(review_run(run, limits=sharp))
    file = tmp_path / 'limits.yaml'
    file.write_text(''.join(f'{key}: {value}\n' for key, value in limits.items()))
    assert check not in checks(review_run(run, limits=limits_from_file(str(file))))


def test_a_nearly_singular_dyad_may_be_off_by_more() -> None:
    """Its angle follows the rounding of the loop, by the sine of its transmission angle."""
    off, none = np.full(2, 5e-9), np.zeros(2)
    errors = PoseErrors(off, none, none, np.array([[pi / 2.0], [0.1]]))
    assert WrongPoses.of(errors, Limits()).flipped.tolist() == [True, False]


@pytest.mark.parametrize(
    ('name', 'what'),
    [('compare_path', 'path'), ('compare_angle', 'angles'), ('compare_length', 'l_bc')],
)
def test_each_limit_of_a_comparison_changes_it(make_script, make_run, name, what) -> None:
    one = make_run(make_script())
    other = make_run(make_script(KlannGeometry(l_bc=0.351)), 'other')
    found = compare(review_run(one), review_run(other)).differences
    assert what in [difference.what for difference in found]
    limits = Limits(**{name: 0.1})
    found = compare(review_run(one, limits=limits), review_run(other)).differences
    assert what not in [difference.what for difference in found]


def test_every_limit_has_its_test() -> None:
    # The torque's is in test_torques.py, which has the efforts, those of walks in test_walking.py.
    elsewhere = {'torque', 'crank_lag', 'phase', 'odometry'}
    tested = {*CASES, 'compare_path', 'compare_angle', 'compare_length', *elsewhere}
    assert tested == {field.name for field in fields(Limits)}


@pytest.mark.parametrize(
    ('content', 'reason'),
    [
        ('', 'it must be a mapping'),
        ('gap: 1', 'gap: no such limit; there are gap_periods, gap_time'),
        ('gap_time: -1', 'gap_time = -1 is refused: it must be a number >= 0'),
        ('gap_time: .inf', 'gap_time: inf'),
        ('gap_time: yes', 'it must be a number >= 0'),
        ('gap_time: soon', "gap_time = 'soon' is refused"),
    ],
)
def test_a_file_without_limits_is_refused_in_a_line(tmp_path, capsys, content, reason) -> None:
    file = tmp_path / 'limits.yaml'
    file.write_text(content)
    assert main(['run', '--limits', str(file)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f'review: {file} holds no limits: ')
    assert reason in error
    assert error.count('\n') == 1


def test_a_limit_that_half_of_the_intervals_exceed_is_still_one(healthy, make_run) -> None:
    for n in range(0, 400, 2):
        healthy.change(n, stamp=healthy.answers[n].stamp + MS)
    found = review_run(make_run(healthy), limits=Limits(gap_periods=1.1, gap_time=0.0))
    assert checks(found) == ['gap']


def test_a_number_beyond_all_is_a_limit(tmp_path) -> None:
    file = tmp_path / 'limits.yaml'
    file.write_text(f'gap_time: 1{"0" * 400}\n')
    assert limits_from_file(str(file)).gap_time > 1e300
