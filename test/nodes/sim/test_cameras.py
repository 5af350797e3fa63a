"""A maker without hardware: a simulated leg with errors, its cameras, a run, its calibration."""

import json
from pathlib import Path

from crank_motors import CONFIG
from geometry_msgs.msg import PointStamped
from klann_ros.calibration.command import main
from klann_ros.robot import robot_of
import pytest
from ros_domain import Domain, RecorderReports
from sensor_msgs.msg import JointState

BUILT = CONFIG / 'sem104_built.yaml'
SEM104 = ['--ros-args', '--params-file', str(CONFIG / 'sem104.yaml')]


@pytest.mark.slow
def test_the_leg_as_built_is_found_in_a_run_of_its_cameras(ros: Domain, tmp_path: Path) -> None:
    probe = ros.probe
    states: list[JointState] = probe.listen(JointState, 'crank_state')
    feet: list[PointStamped] = probe.listen(PointStamped, 'camera/h')
    parameters = {'built': BUILT, 'cameras': True, 'camera_outliers': 0.02, 'seed': 5}
    ros.start('sim_node', *SEM104, **parameters, rate=200.0)
    run = tmp_path / 'run'
    reports = RecorderReports(probe)
    recorder = ros.start('recorder_node', output=run, all_topics=True)
    # A late discovery would leave a part of the turn only.
    reports.until_received(dict.fromkeys(('/crank_state', '/camera/g', '/camera/h'), 1))
    commands = probe.publisher(JointState, 'crank_command')

    def turned() -> bool:
        commands.publish(JointState(name=['crank'], velocity=[3.0]))
        return bool(states) and states[-1].position[0] > 7.0

    probe.until(turned)
    assert feet[-1].header.frame_id == 'leg_plane'
    assert recorder.stop() == 0
    numbers, built = tmp_path / 'c.json', tmp_path / 'built.yaml'
    arguments = [str(run), '--leg', 'sem104', '--point', 'H=/camera/h', '--point', 'G=/camera/g']
    assert main([*arguments, '--json', str(numbers), '-o', str(built)]) == 0
    calibration = json.loads(numbers.read_text())
    true_leg = robot_of(str(BUILT)).legs[0]
    for name, estimate in calibration['dimensions'].items():
        error = abs(estimate['value'] - true_leg.linkage.dimensions[name])
        assert error < 5.0 * estimate['standard_error']
    assert calibration['phase']['value'] == pytest.approx(true_leg.phase, abs=1e-3)
    assert calibration['points']['H']['rejected'] > 0
