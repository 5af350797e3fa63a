"""Each limit changes its check, and a file that holds none is one line."""

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
