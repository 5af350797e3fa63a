"""The report of a run in the terminal, its figures, and inputs that are none."""

import math
from pathlib import Path
import re

from klann_ros.kinematics import foot_path, KlannLeg
from klann_ros.review.command import main
from klann_ros.review.reviewing import review_run
from leg_runs import LegRun
import pytest
from review_findings import moments


def test_a_healthy_run_has_no_finding(healthy, printed) -> None:
    output = printed(healthy, '--details')
    assert 'at least' not in output
    assert output.endswith('nothing found: every pose is the right one for its crank angle\n')
    assert re.search(r'turns of the crank +2\.000', output)
    assert re.search(r'stride +491\.0 mm', output)
    assert re.search(r'lift +300\.1 mm', output)
    assert re.search(r'smallest transmission angle +23\.8\d deg', output)
    assert re.search(r'/joint_states +400 +200\.0 +5\.0 +0\.20 +0\.20 +0', output)
    worst = float(re.search(r'worst angle, solved again +(\S+)', output)[1])
    assert 0 < worst < 1e-11


def test_a_foot_that_is_not_finite_is_found(healthy, make_run) -> None:
    healthy.change(7, foot=(math.nan, 0.0))
    review = review_run(make_run(healthy))
    assert moments(review) == [('nan', 0.035)]
    assert review.legs[0].figures.stride == pytest.approx(0.4910, abs=1e-4)


@pytest.mark.parametrize(('turns', 'is_path'), [(2.0, True), (1.0, True), (0.9, False)])
def test_less_than_a_turn_has_no_stride(make_script, make_run, turns, is_path) -> None:
    (leg,) = review_run(make_run(make_script(turns=turns))).legs
    assert math.isnan(leg.figures.stride) is not is_path
    assert math.isnan(leg.figures.lift) is not is_path
    assert not math.isnan(leg.figures.duty_factor)


def test_a_foot_at_the_end_of_its_stance_is_on_the_ground(tmp_path) -> None:
    leg = KlannLeg()
    run = LegRun({'': leg}, parameters=leg.geometry.as_dict(), turns=0.0, count=20)
    run.start = foot_path(leg).stance().end
    (reviewed,) = review_run(run.write(tmp_path / 'run')).legs
    assert reviewed.figures.duty_factor == 1.0


def test_a_lower_bound_of_losses_is_explained(healthy, printed) -> None:
    healthy.add_counts({'/crank_angle': {'received': 400, 'written': 400, 'departed': 1}})
    output = printed(healthy)
    assert re.search(r'^/crank_angle .* at least 0$', output, re.MULTILINE)
    assert 'at least: what a publisher lost just before it ended is not known\n' in output


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
