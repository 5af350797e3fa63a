"""`review`: a healthy run has no finding, and each fault exactly its own."""

import math
from pathlib import Path
import re

from findings import moments
from klann_ros.review.command import main
from klann_ros.review.reviewing import review_run
import pytest

ROOT = Path(__file__).resolve().parents[2]
MS = 1_000_000


def test_a_healthy_run_has_no_finding(healthy, printed) -> None:
    output = printed(healthy)
    assert output.endswith('nothing found: every pose is the right one for its crank angle\n')
    assert re.search(r'turns of the crank +2\.000', output)
    assert re.search(r'stride +0\.4910 m', output)
    assert re.search(r'lift +0\.3001 m', output)
    assert re.search(r'worst transmission angle +23\.8\d deg', output)
    assert re.search(r'/joint_states +400 +200\.0 +5\.0 +0\.20 +0\.20 +0', output)
    worst = float(re.search(r'worst angle, solved again +(\S+)', output)[1])
    assert 0 < worst < 1e-13


def test_a_foot_that_is_not_finite_is_found(healthy, make_run) -> None:
    healthy.change(7, foot=(math.nan, 0.0))
    review = review_run(make_run(healthy))
    assert moments(review) == [('nan', 0.035)]
    assert review.legs[0].figures.stride == pytest.approx(0.4910, abs=1e-4)


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        (['nothing.mcap'], 'nothing.mcap is not a readable log'),
        (['text.mcap'], 'text.mcap is not a readable log'),
        (['nothing.mcap', '--geometry', 'text.mcap'], 'text.mcap holds no robot: '),
    ],
)
def test_an_unreadable_input_is_exit_code_2(
    arguments, reason, tmp_path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    Path('text.mcap').write_text('no log')
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith(f'review: {reason}')
    assert error.count('\n') == 1
