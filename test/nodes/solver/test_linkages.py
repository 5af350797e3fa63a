"""`solver_node` with a linkage from a file: solved, recorded and reviewed like the Klann leg."""

from collections.abc import Sequence
from importlib import resources
import math
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus
from klann_ros.kinematics import LinkageLeg, shipped_linkage
from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import open_log
from klann_ros.log.run_parameters import LINKAGE_PARAMETER, solver_parameters
from klann_ros.review.command import main as review
import numpy as np
import pytest
from ros_domain import Domain, RecorderReports
from solver_conversation import Conversation

LINKAGES = Path(str(resources.files('klann_ros') / 'linkages'))
ANGLES = [0.0, 1.0, 1.1, -2.0, 9.0, 3.0]


@pytest.mark.parametrize('name', ['jansen', 'stephenson', 'quick_return'])
def test_its_joints_and_its_foot_are_published(ros: Domain, name: str) -> None:
    talk = Conversation(ros, linkage=LINKAGES / f'{name}.yaml')
    talk.turn(*ANGLES)
    leg = LinkageLeg(shipped_linkage(name))
    for number, pose in enumerate(talk.answers(len(ANGLES))):
        expected = leg.closed_form(ANGLES[number])
        assert tuple(pose.name) == leg.joint_names
        assert pose.position[0] == ANGLES[number]
        assert np.sin(np.subtract(pose.position[1:], expected.x)) == pytest.approx(0, abs=1e-12)
        talk.assert_feet({'': expected.h}, number)
        assert len(pose.velocity) == 0


def test_its_velocities_follow_the_cranks(ros: Domain) -> None:
    talk = Conversation(ros, 'crank_state', linkage=LINKAGES / 'jansen.yaml')
    talk.state(name=['crank'], position=[1.0], velocity=[2.0])
    ros.probe.until(lambda: talk.poses and talk.velocities)
    leg = LinkageLeg(shipped_linkage('jansen'))
    expected = leg.velocity(leg.closed_form(1.0), 2.0)
    assert talk.poses[0].velocity.tolist() == pytest.approx(expected.joints, abs=1e-12)
    linear = talk.velocities[0].twist.linear
    assert (linear.x, linear.y) == pytest.approx(expected.h, abs=1e-12)


def test_its_diagnostics_have_an_angle_for_each_dyad(ros: Domain) -> None:
    talk = Conversation(ros, linkage=LINKAGES / 'jansen.yaml')
    talk.turn(1.0)

    def solved() -> list[dict[str, str]]:
        values = [{v.key: v.value for v in r.status[0].values} for r in talk.reports]
        return [figures for figures in values if figures['iterations'] != '0']

    ros.probe.until(solved)
    values = solved()[0]
    pose = LinkageLeg(shipped_linkage('jansen')).closed_form(1.0)
    angles = [float(values[f'transmission_angle_{k}']) for k in (1, 2, 3)]
    assert angles == pytest.approx(pose.transmission_angles, abs=1e-6)
    assert float(values['condition']) == pytest.approx(pose.condition, rel=1e-3)
    assert values['branch'] == '-1 +1 -1'


def test_it_has_no_lengths_to_change(ros: Domain) -> None:
    file = LINKAGES / 'jansen.yaml'
    ros.solve(linkage=file)
    result = ros.probe.set_parameters('solver_node', {'l_gh': 0.5})
    assert not result.successful
    assert result.reason == f'l_gh cannot be changed: the leg is the linkage in {file}'


def test_its_run_explains_itself_and_is_reviewed(
    ros: Domain, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = LINKAGES / 'quick_return.yaml'
    reports = RecorderReports(ros.probe)
    ros.solver(linkage=file)
    recorder = ros.start('recorder_node', output=tmp_path / 'run')
    # The recorder has to listen to the solver, too, before the crank turns.
    for topic in ('joint_states', 'point_h'):
        ros.probe.until(lambda: ros.probe.node.count_subscribers(topic) >= 1)  # noqa: B023
    # Whom the solver has answered it knows.
    ros.probe.until(lambda: has_solver_record(tmp_path / 'run'))
    crank = ros.start('crank_node', rate=100.0, revolutions=1, min_subscribers=2)
    assert crank.wait() == 0
    topics = ('/crank_angle', '/joint_states', '/point_h')
    reports.until_received(dict.fromkeys(topics, 101))
    assert recorder.stop() == 0
    with open_log(tmp_path / 'run') as log:
        (record,) = log.metadata['klann_ros.solver']
    text = file.read_text(encoding='utf-8')
    assert solver_parameters(record).parameters[LINKAGE_PARAMETER] == text
    # Stalls of a busy machine do not count.
    limits = tmp_path / 'limits.yaml'
    limits.write_text('gap_time: 5.0\nlatency: 5.0\n', encoding='utf-8')
    patient = [tmp_path / 'run', '--limits', limits]
    code, output = reviewed(capsys, patient)
    assert (code, 'nothing found' in output) == (0, True), output

    # Held against a linkage of other lengths, every pose is wrong.
    longer = tmp_path / 'other.yaml'
    longer.write_text(text.replace('length: 150', 'length: 151'), encoding='utf-8')
    code, output = reviewed(capsys, [*patient, '--geometry', longer])
    assert code == 1
    assert 'do not close the loops (by up to 1 mm)' in output


def has_solver_record(run: Path) -> bool:
    try:
        with open_log(run) as log:
            return 'klann_ros.solver' in log.metadata
    except NotALogError:
        return False


def reviewed(capsys: pytest.CaptureFixture[str], arguments: Sequence[object]) -> tuple[int, str]:
    capsys.readouterr()
    code = review([str(argument) for argument in arguments])
    return code, capsys.readouterr().out


def test_an_unreachable_angle_is_reported_and_leaves_no_trace(ros: Domain, tmp_path: Path) -> None:
    """A four-bar whose crank does not turn fully."""
    file = tmp_path / 'four_bar.yaml'
    text = (LINKAGES / 'four_bar.yaml').read_text(encoding='utf-8')
    file.write_text(text.replace('O4: [180, 0]', 'O4: [300, 0]'), encoding='utf-8')
    talk = Conversation(ros, linkage=file)
    talk.turn(1.0, math.pi, 1.0)
    message = talk.status(DiagnosticStatus.ERROR).message
    talk.answers(2)
    assert 'dyad 1 does not close, A and O4 are 0.03 m further apart than AB + O4B' in message
    assert 'the crank does not turn fully, it cannot reach' in message
