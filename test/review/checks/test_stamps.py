"""Stamps of a simulated clock: many messages share one, and it is not the clock of the log."""

from klann_ros.review.command import main
import pytest

# One stamp for ten poses, near zero as a simulation starts there.
TOGETHER, TICK = 10, 50_000_000


@pytest.fixture
def simulated(healthy):
    """Return a healthy run under a simulated clock; its input has no stamp."""
    healthy.parameters['use_sim_time'] = True
    for n in range(len(healthy.answers)):
        healthy.change(n, header_stamp=TICK * (1 + n // TOGETHER))
    return healthy


def test_a_healthy_simulated_run_has_no_finding(simulated, make_run, capsys) -> None:
    code = main([str(make_run(simulated))])
    assert (code, 'WARNING' in capsys.readouterr().out) == (0, False)


def test_the_foot_of_a_pose_is_found_among_those_of_its_stamp(simulated, printed) -> None:
    simulated.change(104, foot=simulated.answers[105].foot)
    output = printed(simulated, code=1)
    # By the clock of the log, which began at 1.7e18 ns and not at 0.
    assert output.count('ERROR ') == 1
    assert 'ERROR foot: 1 of 400 feet (point_h)' in output
    assert '(first at 0.520 s)' in output


def test_feet_are_not_judged_where_one_of_their_stamp_is_missing(simulated, printed) -> None:
    # A foot of tick 10 comes with the stamp of tick 11: nine feet for ten poses, and eleven.
    simulated.change(104, foot_stamp=simulated.answers[110].header_stamp)
    printed(simulated)


def test_an_input_with_a_stamp_of_its_own_is_matched(simulated, printed) -> None:
    simulated.by_crank_state()
    inside = simulated.answers[200]
    simulated.unanswered = [(inside.header_stamp + 7, inside.alpha)]
    assert 'WARNING answers: 1 of 401 crank angles' in printed(simulated, code=1)


def test_an_input_with_a_zero_stamp_is_not_matched(simulated, printed) -> None:
    simulated.by_crank_state()
    simulated.ask_unstamped(200)
    for n in range(len(simulated.answers)):
        simulated.change(n, header_stamp=simulated.answers[n].header_stamp - TICK)
    printed(simulated)
