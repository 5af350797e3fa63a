"""Two solvers on one topic are one finding; stamps that many messages share are none."""

from dataclasses import replace
import re

from findings import checks, found
from klann_ros.kinematics import KlannGeometry
from klann_ros.log.qos import Qos, qos_to_yaml
from klann_ros.review.model.review import Severity
from klann_ros.review.reviewing import review_run
import pytest

MS = 1_000_000
TWO = qos_to_yaml([Qos(), Qos()])


def test_two_solvers_of_different_legs_are_one_finding(healthy, make_run) -> None:
    other = {'l_gh': 0.44, 'l_ef': 0.272}
    healthy.add_solver(healthy.answers[0].stamp + MS, KlannGeometry(**other), '/second')
    healthy.second(**other)
    review = review_run(make_run(healthy))
    assert checks(review) == ['solvers']
    (finding,) = review.findings
    assert finding.severity == Severity.ERROR
    who, _, rest = finding.text.partition(' answer on ')
    assert who == 'two solvers (/second, /solver_node)'
    # The first answers were before the second leg was recorded, and are not judged.
    assert rest.startswith('/joint_states: 798 answers to 399 crank angles, up to ')
    assert re.search(r', up to 0\.0\S+ rad and 0\.0\S+ m apart$', rest)


@pytest.fixture
def simulated(healthy):
    """Return a run under a simulated clock, of which ten poses share a stamp."""
    healthy.simulate()
    return healthy


def test_other_joints_on_the_same_topic_are_not_a_second_solver(healthy, make_run) -> None:
    healthy.second()
    (arm,) = healthy.others
    arm.prefix, arm.feet = 'arm/', replace(arm.feet, name='/arm/tip')
    assert found(make_run(healthy)) == []


def test_legs_of_two_nodes_in_one_namespace_are_all_judged(make_script, make_run) -> None:
    first, second = make_script(), make_script(KlannGeometry(l_gh=0.44))
    for script, name in ((first, 'left'), (second, 'right')):
        script.prefix = f'{name}/'
        script.parameters['legs'] = [name]
        script.feet = replace(script.feet, name=f'/{name}/point_h')
    # Both answer the same questions, under names of their own.
    second.crank, second.geometry = replace(second.crank, name='/other'), None
    shank = KlannGeometry(l_gh=0.44)
    first.add_solver(first.answers[0].stamp + MS, shank, '/second', legs=['right'])
    first.poses = replace(first.poses, qos=TWO)
    second.poses = first.poses
    first.others.append(second)
    review = review_run(make_run(first))
    assert checks(review) == []
    evaluated = {leg.recording.title: len(leg.evaluated.poses) for leg in review.legs}
    assert evaluated == {'left': 400, 'right': 400}


def test_an_input_with_a_stamp_of_its_own_is_matched(simulated, printed) -> None:
    simulated.by_crank_state()
    inside = simulated.answers[200]
    simulated.unanswered = [(inside.header_stamp + 7, inside.alpha)]
    assert 'WARNING answers: 1 of 401 crank angles' in printed(simulated, code=1)


def test_an_input_with_a_zero_stamp_is_not_matched(simulated, printed) -> None:
    simulated.by_crank_state()
    simulated.ask_unstamped(200)
    for n, answer in enumerate(simulated.answers):
        simulated.change(n, header_stamp=answer.header_stamp - 50 * MS)
    printed(simulated)
