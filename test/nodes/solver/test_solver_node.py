"""`solver_node`: answers, diagnostics and parameters; two tests run it as a process."""

from collections.abc import Sequence
import math
import time

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from klann_ros.kinematics import KlannGeometry, KlannLeg, UnreachableError
import numpy as np
import pytest
from ros_domain import Domain
from sensor_msgs.msg import JointState
from solver_conversation import Conversation
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

ROOT_60 = np.radians([10.659455241249857, 67.32948352084568, 34.46397311984116, 45.72293552846574])
H_60 = (0.7960057379415449, -0.3037627502892032)


def assert_right(poses: Sequence[JointState], geometry: KlannGeometry | None = None) -> None:
    """Hold every pose against the closed form at its own alpha."""
    leg = KlannLeg(geometry)
    for pose in poses:
        alpha, *angles = pose.position
        expected = leg.closed_form(alpha).x
        differences = [
            math.remainder(a - b, 2 * math.pi) for a, b in zip(angles, expected, strict=True)
        ]
        assert differences == pytest.approx([0] * 4, abs=1e-9)


def test_60_degrees_published_once_gives_the_root_and_the_foot(ros: Domain) -> None:
    talk = Conversation(ros)
    start_time = time.time()
    talk.turn(math.radians(60))
    (pose,) = talk.answers(1)
    assert list(pose.name) == ['alpha', 'gamma', 'beta', 'delta', 'theta']
    assert pose.position[0] == math.radians(60)
    np.testing.assert_allclose(pose.position[1:], ROOT_60, rtol=0, atol=1e-9)
    talk.assert_feet({'': H_60})
    assert list(pose.velocity) == list(pose.effort) == []
    stamp = pose.header.stamp.sec + pose.header.stamp.nanosec * 1e-9
    assert start_time - 1 <= stamp <= time.time() + 1
    assert talk.velocities == []


def test_a_state_is_answered_with_its_stamp_and_its_velocity(ros: Domain) -> None:
    talk = Conversation(ros, 'crank_state')
    stamp = Time(sec=123, nanosec=456)
    names = ['other', 'crank']
    talk.state(name=names, position=[9.0, 1.0], velocity=[9.0, 2.5], stamp=stamp)
    (pose,) = talk.answers(1)
    leg = KlannLeg()
    velocity = leg.velocity(leg.closed_form(1.0), 2.5)
    assert pose.header.stamp == talk.feet[0].header.stamp == stamp
    np.testing.assert_allclose(pose.velocity, velocity.joints, rtol=1e-12)
    talk.probe.until(lambda: talk.velocities)
    (twist,) = talk.velocities
    assert (twist.header.stamp, twist.header.frame_id) == (stamp, 'leg_plane')
    linear, angular = twist.twist.linear, twist.twist.angular
    assert (linear.x, linear.y) == pytest.approx(velocity.h, rel=1e-12)
    assert (linear.z, angular.x, angular.y, angular.z) == (0, 0, 0, 0)


def test_a_velocity_that_is_not_finite_is_unknown(ros: Domain) -> None:
    talk = Conversation(ros, 'crank_state')
    for velocity in ([], [math.nan], [math.inf]):
        talk.state(name=['crank'], position=[1.0], velocity=velocity)
    for pose in talk.answers(3):
        assert list(pose.velocity) == []
        # A zero stamp takes the middleware's source time.
        assert abs(pose.header.stamp.sec - time.time()) < 60
    assert talk.velocities == []


def test_bad_angles_are_rejected_and_leave_no_trace(
    ros: Domain, capfd: pytest.CaptureFixture[str]
) -> None:
    talk = Conversation(ros)
    talk.turn(math.nan, 1.0, math.inf, -math.inf, 1.1e6, 1e308, 2.0)
    poses = talk.answers(2)
    assert [pose.position[0] for pose in poses] == [1.0, 2.0]
    assert_right(poses)
    counts = talk.counts()
    assert (counts['solved'], counts['rejected'], counts['failed']) == ('2', '5', '0')
    errors = capfd.readouterr().err
    assert errors.count('[WARN]') == 1
    assert 'must be finite and within' in errors


def test_states_without_the_crank_are_rejected(ros: Domain) -> None:
    talk = Conversation(ros, 'crank_state', crank_joint='axle')
    talk.state(name=['crank'], position=[1.0])
    talk.state(name=['axle', 'crank'], position=[1.0])
    talk.state(name=['axle'], position=[math.nan])
    talk.state()
    talk.state(name=['axle'], position=[1.5])
    poses = talk.answers(1)
    assert poses[0].position[0] == 1.5
    assert talk.counts()['rejected'] == '4'


def test_nan_before_the_first_reading_is_no_warning(
    ros: Domain, capfd: pytest.CaptureFixture[str]
) -> None:
    talk = Conversation(ros, 'crank_state')
    for position in (math.nan, math.nan, 1.0):
        talk.state(name=['crank'], position=[position])
    talk.answers(1)
    assert talk.counts()['rejected'] == '2'
    assert '[WARN]' not in capfd.readouterr().err
    talk.state(name=['crank'], position=[math.nan])
    talk.state(name=['crank'], position=[2.0])
    talk.answers(2)
    assert talk.counts()['rejected'] == '3'
    assert capfd.readouterr().err.count('[WARN]') == 1


def test_jumps_and_gaps_keep_the_branch_and_failures_are_reported(ros: Domain) -> None:
    geometry = KlannGeometry(l_bc=0.33)
    talk = Conversation(ros, l_bc=0.33)
    alphas = [0.1, 2.3, 3.0, 3.5, -400.0, 2.9, 2.3, 3.45, 1000.0, 3.0]
    reachable = []
    for alpha in alphas:
        try:
            KlannLeg(geometry).closed_form(alpha)
        except UnreachableError as error:
            message = str(error)
        else:
            reachable.append(alpha)
    talk.turn(*alphas)
    failed = str(len(alphas) - len(reachable))
    values: dict[str, str] = {}
    # A report may come between the messages.
    while values.get('failed') != failed:
        status = talk.status(DiagnosticStatus.ERROR)
        values = {value.key: value.value for value in status.values}
    poses = talk.answers(len(reachable))
    assert [pose.position[0] for pose in poses] == reachable
    assert_right(poses, geometry)
    assert message in status.message
    assert 'dyad 1' in status.message
    assert '171.887 deg' in status.message
    assert 'cannot reach' in status.message
    # It recovers by itself.
    talk.turn(1.0)
    talk.status(DiagnosticStatus.OK)
    assert_right(talk.answers(len(reachable) + 1), geometry)


def test_silence_is_stale(ros: Domain) -> None:
    talk = Conversation(ros)
    talk.turn(1.0)
    assert talk.status(DiagnosticStatus.OK).name == 'solver_node: leg'
    assert 'no input for 2.' in talk.status(DiagnosticStatus.STALE).message


def test_a_nearly_singular_pose_is_a_warning(ros: Domain) -> None:
    talk = Conversation(ros, min_transmission_angle=0.5)
    singular = min(
        (KlannLeg().closed_form(math.radians(k)) for k in range(360)),
        key=lambda pose: math.sin(pose.transmission_angles[0]),
    )
    talk.turn(singular.alpha)
    status = talk.status(DiagnosticStatus.WARN)
    assert 'nearly singular' in status.message
    values = {value.key: value.value for value in status.values}
    assert list(values) == [
        *('solved', 'rejected', 'failed', 'lost', 'out_of_order', 'rate', 'iterations'),
        *('residual', 'condition', 'transmission_angle_1', 'transmission_angle_2', 'branch'),
    ]
    mu_1, mu_2 = singular.transmission_angles
    assert float(values['transmission_angle_1']) == pytest.approx(mu_1, abs=1e-6)
    assert float(values['transmission_angle_2']) == pytest.approx(mu_2, abs=1e-6)
    assert float(values['condition']) == pytest.approx(singular.condition, rel=1e-3)
    assert values['branch'] == '+1 +1'


def test_a_burst_is_solved_in_order(ros: Domain) -> None:
    talk = Conversation(ros)
    alphas = [0.01 * k for k in range(300)]
    talk.turn(*alphas)
    poses = talk.answers(len(alphas))
    assert [pose.position[0] for pose in poses] == alphas
    assert_right(poses)
    assert talk.counts()['lost'] == '0'


def test_losses_in_a_flood_are_counted_exactly(ros: Domain) -> None:
    talk = Conversation(ros, as_process=True)
    sent: list[float] = []

    def one_more_is_answered() -> bool:
        # It may be lost, as long as the solver is busy.
        sent.append(-1.0 - 1e-3 * len(sent))
        talk.turn(sent[-1])
        ros.probe.spin(0.5)
        return [pose.position[0] for pose in talk.poses[-1:]] == sent[-1:]

    # A gap shows between two messages, so one comes before the flood and one behind it.
    ros.probe.until(one_more_is_answered)
    count_before = len(sent)
    # Far more than any queue between the two processes holds.
    alphas = [0.001 * k for k in range(6000)]
    talk.turn(*alphas)
    ros.probe.spin(1.0)
    ros.probe.until(one_more_is_answered)
    counts = talk.counts()
    # It cannot know of losses before the first message that it received.
    unheard = sent.index(talk.poses[0].position[0])
    assert unheard < count_before
    assert int(counts['solved']) + int(counts['lost']) == len(sent) + len(alphas) - unheard
    answered = [pose.position[0] for pose in talk.poses if pose.position[0] >= 0]
    assert answered == sorted(answered)
    assert_right(talk.poses)


def test_late_stamps_are_answered_and_counted(ros: Domain) -> None:
    talk = Conversation(ros, 'crank_state')
    for second in (5, 3, 4, 4):
        talk.state(name=['crank'], position=[float(second)], stamp=Time(sec=second))
    assert [pose.header.stamp.sec for pose in talk.answers(4)] == [5, 3, 4, 4]
    assert talk.counts()['out_of_order'] == '1'


def test_a_best_effort_crank_is_received(ros: Domain) -> None:
    poses = ros.probe.listen(JointState, 'joint_states')
    ros.start('solver_node')
    crank = ros.probe.publisher(Float64, 'crank_angle', reliable=False)
    ros.probe.await_publishers('joint_states')

    def is_heard() -> bool:
        # Each of them may be lost.
        crank.publish(Float64(data=1.0))
        return bool(poses)

    ros.probe.until(is_heard)


def test_the_leg_changes_while_it_runs(ros: Domain) -> None:
    talk = Conversation(ros)
    talk.turn(1.0)
    talk.answers(1)
    patent = KlannGeometry.patent()
    assert talk.probe.set_parameters('solver_node', patent.as_dict(), atomic=True).successful
    talk.turn(1.0)
    assert_right(talk.answers(2)[1:], patent)


def test_an_invalid_leg_is_refused_while_it_runs(ros: Domain) -> None:
    talk = Conversation(ros)
    for change, reason in [
        ({'l_ab': -1.0}, 'l_ab = -1 m is refused: a length must be > 0'),
        ({'angle_bcg': 10.0}, 'angle_bcg = 10 rad is refused: a bend must be within +-2 pi rad'),
        ({'y_e': math.nan}, 'y_e = nan is refused: it must be a finite number'),
        ({'l_bc': 0.01}, 'at no crank angle do both dyads close'),
        ({'assembly': [1, 0]}, 'two signs'),
        ({'tolerance': 1.0}, 'read-only'),
    ]:
        result = talk.probe.set_parameters('solver_node', change, atomic=True)
        assert not result.successful
        assert reason in result.reason
    talk.turn(1.0)
    assert_right(talk.answers(1))


def test_reset_forgets_the_warm_start_and_nothing_else(ros: Domain) -> None:
    talk = Conversation(ros)
    talk.turn(1.0)
    talk.answers(1)
    assert ros.probe.call(Trigger, 'solver_node/reset', Trigger.Request()).success
    talk.turn(2.0)
    assert_right(talk.answers(2))
