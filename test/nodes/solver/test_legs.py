"""Several legs in one node, each with its own crank, phase and direction; and their markers."""

import math
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from klann_ros.kinematics import foot_path, KlannGeometry, KlannLeg
from klann_ros.nodes.endpoints import LATCHED
from klann_ros.robot import robot_from_file
import numpy as np
import pytest
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_domain import Domain
from sensor_msgs.msg import JointState
from solver_conversation import Conversation
from std_msgs.msg import Float64, String
from visualization_msgs.msg import Marker, MarkerArray
import yaml

CONFIG = Path(__file__).resolve().parents[3] / 'config'
JOINTS = ['alpha', 'gamma', 'beta', 'delta', 'theta']
LEGS = ('left', 'right')
TWO = {'left.phase': 0.5, 'right.direction': -1, 'right.l_gh': 0.5}


def test_each_leg_is_driven_by_its_direction_and_phase(ros: Domain) -> None:
    talk = Conversation(ros, legs=LEGS, **TWO)
    talk.turn(1.25)
    (pose,) = talk.answers(1)
    assert list(pose.name) == [f'{leg}/{joint}' for leg in LEGS for joint in JOINTS]
    expected = {
        'left': KlannLeg().closed_form(1.75),
        'right': KlannLeg(KlannGeometry(l_gh=0.5)).closed_form(-1.25),
    }
    assert pose.position.tolist() == pytest.approx(
        [*expected['left'].joints, *expected['right'].joints], abs=1e-12
    )
    talk.assert_feet({name: pose.h for name, pose in expected.items()})


def test_the_legs_are_described_as_a_file_that_every_program_takes(
    ros: Domain, tmp_path: Path
) -> None:
    node = ros.solve(legs='[left, right]', **TWO)
    late = ros.probe.listen(String, 'leg_description', LATCHED)
    ros.probe.until(lambda: late)
    node.set_parameters([Parameter('left.l_ab', value=0.125)])
    ros.probe.until(lambda: len(late) == 2)
    for text, length in zip([message.data for message in late], (0.12, 0.125), strict=True):
        file = tmp_path / 'leg.yaml'
        file.write_text(text, encoding='utf-8')
        left, right = robot_from_file(file).legs
        assert (left.name, left.phase, left.direction) == ('left', 0.5, 1)
        assert (right.name, right.phase, right.direction) == ('right', 0.0, -1)
        assert left.linkage.dimensions['l_ab'] == length
        assert right.linkage.dimensions['l_gh'] == 0.5


def test_legs_with_cranks_of_their_own_follow_them(ros: Domain) -> None:
    parameters = {'right.crank_joint': 'other', 'right.direction': -1}
    talk = Conversation(ros, 'crank_state', legs=LEGS, **parameters)
    poses, velocities = talk.poses, talk.velocities_of['right']
    talk.state(name=['other'], position=[2.0], velocity=[3.0])
    ros.probe.until(lambda: poses and velocities)
    talk.state(name=['crank', 'other'], position=[1.0, 2.0])
    ros.probe.until(lambda: len(poses) == 2)
    assert [name.partition('/')[0] for name in poses[0].name] == ['right'] * 5
    leg = KlannLeg()
    expected = leg.velocity(leg.solve(-2.0), -3.0)
    assert poses[0].velocity.tolist() == pytest.approx(expected.joints, abs=1e-12)
    assert velocities[0].twist.linear.x == pytest.approx(expected.h[0], abs=1e-12)
    assert len(poses[1].name) == 10
    assert len(poses[1].velocity) == 0


def test_one_unnamed_leg_has_an_encoders_zero_and_sign(ros: Domain) -> None:
    talk = Conversation(ros, phase=0.25, direction=-1)
    talk.turn(1.0)
    expected = KlannLeg().closed_form(-0.75).joints
    assert talk.answers(1)[0].position.tolist() == pytest.approx(expected, abs=1e-12)


def test_every_leg_has_its_own_status_and_fails_alone(ros: Domain) -> None:
    talk = Conversation(ros, legs=LEGS, **{'right.l_bc': 0.33})
    talk.turn(math.radians(165.6))

    def failed() -> list[Any]:
        return [r for r in talk.reports if any(s.level == b'\x02' for s in r.status)]

    ros.probe.until(lambda: talk.poses and failed())
    assert [name.partition('/')[0] for name in talk.poses[0].name] == ['left'] * 5
    left, right = failed()[0].status
    assert (left.name, right.name) == ('solver_node: left', 'solver_node: right')
    assert left.level != b'\x02'
    assert 'dyad 1 does not close, B and D are' in right.message


def test_a_legs_length_is_changed_by_its_own_parameter(ros: Domain) -> None:
    talk = Conversation(ros, legs=LEGS)
    refused = ros.probe.set_parameters('solver_node', {'l_ef': 0.28}, atomic=True)
    assert not refused.successful
    assert refused.reason == 'l_ef: each leg has its own, which can be changed: left.l_ef'
    assert ros.probe.set_parameters('solver_node', {'right.l_ef': 0.28}, atomic=True).successful
    talk.turn(1.0)
    left, right = KlannLeg(), KlannLeg(KlannGeometry(l_ef=0.28))
    expected = [*left.closed_form(1.0).joints, *right.closed_form(1.0).joints]
    assert talk.answers(1)[0].position.tolist() == pytest.approx(expected, abs=1e-12)


def test_several_sources_are_reported_while_they_send_at_once(ros: Domain) -> None:
    reports = ros.probe.listen(DiagnosticArray, '/diagnostics')
    ros.solver(diagnostics_period=0.3)
    angle = ros.probe.publisher(Float64, 'crank_angle')
    silent = ros.probe.publisher(Float64, 'crank_angle')
    state = ros.probe.publisher(JointState, 'crank_state')

    def reported(*publishers: Any) -> str:
        for publisher in publishers:
            is_state = publisher is state
            message = JointState(name=['crank'], position=[1.0]) if is_state else Float64(data=1.0)
            publisher.publish(message)
        return str(reports[-1].status[0].message) if reports else ''

    begin = 'the crank is turned by more than one:'
    message = f'{begin} /crank_angle (1) and /crank_state (1)'
    ros.probe.until(lambda: reported(angle, state) == message)
    ros.probe.until(lambda: reported(angle, silent) == f'{begin} /crank_angle (2)')
    # Beside one that is silent, as a node that yields to a driver.
    ros.probe.until(lambda: reported(angle) == 'solving')


@pytest.mark.parametrize('name', ['', 'left'])
def test_bars_end_where_the_poses_points_are(ros: Domain, name: str) -> None:
    ros.solve(**({'legs': f'[{name}]'} if name else {}))
    crank = ros.probe.publisher(Float64, 'crank_angle')
    latched = QoSProfile(depth=50, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    arrays = ros.probe.listen(MarkerArray, 'markers', latched)
    seen: dict[int, Marker] = {}

    def all_seen() -> bool:
        crank.publish(Float64(data=1.0))
        seen.update({marker.id: marker for array in arrays for marker in array.markers})
        return set(seen) == set(range(8))

    ros.probe.until(all_seen)
    leg = KlannLeg()
    points = dict(zip('ABCDEFGH', leg.closed_form(1.0).points, strict=True))
    bars = {3: 'AB', 4: 'BCCG', 5: 'DC', 6: 'EF', 7: 'FGGH'}
    for number, letters in bars.items():
        drawn = np.array([(p.x, p.y, p.z) for p in seen[number].points])
        expected = [(*points[letter], 0.0) for letter in letters]
        np.testing.assert_allclose(drawn, expected, rtol=0, atol=1e-12)
        assert seen[number].type == Marker.LINE_LIST
    path = np.array([(p.x, p.y) for p in seen[0].points])
    np.testing.assert_allclose(path[:-1], foot_path(leg).h, rtol=0, atol=1e-12)
    prefix = f'{name}/' if name else ''
    assert {marker.header.frame_id for marker in seen.values()} == {f'{prefix}leg_plane'}
    assert {marker.ns for marker in seen.values()} == {name or 'leg'}


@pytest.mark.parametrize('walker', [4, 6])
def test_a_shipped_walkers_feet_are_where_its_legs_put_them(ros: Domain, walker: int) -> None:
    file = CONFIG / f'walker{walker}.yaml'
    legs = yaml.safe_load(file.read_text(encoding='utf-8'))['/**']['ros__parameters']
    names = legs['legs']
    assert len(names) == walker
    talk = Conversation(ros, 'crank_angle', '--params-file', str(file), legs=names)
    talk.turn(0.75)
    talk.answers(1)
    alphas = {name: legs[name]['direction'] * 0.75 + legs[name]['phase'] for name in names}
    talk.assert_feet({name: KlannLeg().closed_form(alpha).h for name, alpha in alphas.items()})


@pytest.mark.slow
def test_24_legs_at_200_hz_have_their_feet_where_the_closed_form_has_them(ros: Domain) -> None:
    names = [f'leg{k}' for k in range(24)]
    phases = {f'{name}.phase': k * math.pi / 12 for k, name in enumerate(names)}
    feet = {name: ros.probe.listen(PointStamped, f'{name}/point_h') for name in names}
    ros.solver(legs=f'[{", ".join(names)}]', **phases)
    for name in names:
        ros.probe.await_publishers(f'{name}/point_h')
    crank = ros.start('crank_node', rate=200.0, revolutions=1, min_subscribers=1)
    assert crank.wait() == 0
    ros.probe.until(lambda: all(len(received) == 201 for received in feet.values()))
    leg = KlannLeg()
    for name in names:
        expected = [
            leg.closed_form(2 * math.pi * n / 200 + phases[f'{name}.phase']).h for n in range(201)
        ]
        positions = [(foot.point.x, foot.point.y) for foot in feet[name]]
        np.testing.assert_allclose(positions, expected, rtol=0, atol=1e-12)
