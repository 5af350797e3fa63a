"""`solver_node` passes change points along the tangent; its run is reviewed without an error."""

from pathlib import Path

from change_point_linkages import change_point_file
from klann_ros.review.model.review import Severity
from klann_ros.review.reviewing import review_run
import numpy as np
import pytest
from ros_domain import Domain, RecorderReports
from solver_conversation import Conversation


def test_the_rocker_of_a_parallelogram_follows_its_crank(ros: Domain) -> None:
    """Cold at 268 deg; then warm, through both change points, back, and with wrapped angles."""
    angles = np.radians([268, 268.5, 300, 359.9, 0, 1, 90, 179.9, 180, 180.1, 268, 100, -92, 3600])
    talk = Conversation(ros, linkage=change_point_file('parallelogram'))
    talk.turn(*angles.tolist())
    for alpha, pose in zip(angles, talk.answers(len(angles)), strict=True):
        assert list(pose.name) == ['crank', 'coupler', 'rocker']
        assert np.exp(1j * pose.position[2]) == pytest.approx(np.exp(1j * alpha), abs=1e-9)
        assert pose.position[1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('name', ['parallelogram', 'two_turns'])
def test_a_recorded_run_with_wrapped_angles_has_no_error(
    ros: Domain, tmp_path: Path, name: str
) -> None:
    reports = RecorderReports(ros.probe)
    recorder = ros.start('recorder_node', output=tmp_path / 'run')
    # The solver is in this process, so what the probe has discovered it has, too.
    talk = Conversation(ros, linkage=change_point_file(name))
    for topic in ('joint_states', 'point_h'):
        ros.probe.until(lambda: ros.probe.node.count_subscribers(topic) >= 2)  # noqa: B023
    # The recorder has to know the crank as well.
    ros.probe.await_subscribers(talk.crank, 2)
    alphas = np.remainder(np.linspace(0.5, 0.5 + 4.5 * np.pi, 150), 2.0 * np.pi)
    talk.turn(*alphas.tolist())
    talk.answers(len(alphas))
    topics = ('/crank_angle', '/joint_states', '/point_h')
    reports.until_received(dict.fromkeys(topics, len(alphas)))
    assert recorder.stop() == 0
    findings = review_run(tmp_path / 'run').findings
    assert [finding.text for finding in findings if finding.severity is Severity.ERROR] == []
