"""Each limit changes its check, and a file that holds none is one line."""

from math import pi

from klann_ros.review.checks.poses import WrongPoses
from klann_ros.review.command import main
from klann_ros.review.model.limits import Limits, limits_from_file, LimitsFileError
from klann_ros.review.model.poses import PoseErrors
import numpy as np
import pytest


def test_a_nearly_singular_dyad_may_be_off_by_more() -> None:
    """Its angle follows the rounding of the loop, by the sine of its transmission angle."""
    angle_errors = np.full(2, 5e-9)
    errors = PoseErrors(angle_errors, np.zeros(2), np.zeros(2), np.array([[pi / 2.0], [0.1]]))
    assert WrongPoses.of(errors, Limits()).flipped.tolist() == [True, False]


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


def test_a_number_beyond_all_is_refused(tmp_path) -> None:
    file = tmp_path / 'limits.yaml'
    file.write_text(f'gap_time: 1{"0" * 400}\n')
    with pytest.raises(LimitsFileError, match=r'no whole number within \+-1\.8e308'):
        limits_from_file(str(file))
