"""walker_node: the limited motion, the scale of odom, and odom that goes on elsewhere."""

from math import cos, nan, sin
from typing import Any

from crank_motors import Motors, TWO_MOTORS
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped
import pytest
from ros_domain import Domain, Process
from std_srvs.srv import Trigger

FILE = ['--ros-args', '--params-file', TWO_MOTORS]


@pytest.fixture(scope='module')
def ros(module_ros: Domain) -> Domain:
    return module_ros


@pytest.fixture(scope='module')
def walker(ros: Domain) -> Process:
    parameters = {'diagnostics_period': 0.1, 'publish_limited_velocity': True}
    limits = {'max_linear': 0.1, 'max_linear_backward': 0.05}
    return ros.start('walker_node', *FILE, **parameters, **limits)


@pytest.fixture(scope='module')
def motors(ros: Domain, walker: Process) -> Motors:  # noqa: ARG001 - it is there first
    return Motors(ros)


def test_the_limited_motion_is_published(ros: Domain, motors: Motors) -> None:
    limited = ros.probe.listen(TwistStamped, 'cmd_vel_out')
    motors.twist = (0.2, 0.1)
    ros.probe.until(lambda: limited and limited[-1].twist.linear.x == 0.1)
    assert limited[-1].twist.angular.z == pytest.approx(0.05)
    assert limited[-1].header.frame_id == 'base_link'
    motors.twist = (-0.2, 0.0)
    ros.probe.until(lambda: limited[-1].twist.linear.x == -0.05)
    motors.twist = None
    motors.until_stopped()


def pose(x: float, y: float, yaw: float, frame: str = 'odom') -> PoseWithCovarianceStamped:
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.w = cos(yaw / 2.0)
    message.pose.pose.orientation.z = sin(yaw / 2.0)
    message.pose.covariance[0] = 0.25
    message.pose.covariance[35] = 0.04
    return message


def planar(odom: Any) -> tuple[float, float, float]:
    place, turn = odom.pose.pose.position, odom.pose.pose.orientation
    return place.x, place.y, 2.0 * turn.w * turn.z


def until_rejected(
    ros: Domain, set_pose: Any, message: PoseWithCovarianceStamped, walker: Process, reason: str
) -> None:
    def is_rejected() -> bool:
        set_pose.publish(message)
        return reason in walker.errors

    ros.probe.until(is_rejected)


@pytest.mark.slow
def test_odom_goes_on_at_a_set_pose_and_begins_again(
    ros: Domain, walker: Process, motors: Motors
) -> None:
    set_pose = ros.probe.publisher(PoseWithCovarianceStamped, 'set_pose')
    set_pose.publish(pose(3.0, -2.0, 0.5))
    ros.probe.until(lambda: motors.odom and motors.odom[-1].pose.pose.position.x > 2.9)
    assert planar(motors.odom[-1]) == pytest.approx((3.0, -2.0, sin(0.5)), abs=0.01)
    covariance = motors.odom[-1].pose.covariance
    assert (covariance[0], covariance[7], covariance[35]) == pytest.approx(
        (0.25, 0.0, 0.04), abs=0.01
    )

    unnormalised = pose(1.0, 1.0, 0.0)
    unnormalised.pose.pose.orientation.w = 0.0
    negative = pose(1.0, 1.0, 0.0)
    negative.pose.covariance[0] = -1.0
    for message, reason in (
        (pose(1.0, 1.0, 0.0, 'map'), 'its frame is map, not odom'),
        (pose(nan, 1.0, 0.0), 'its position is not finite'),
        (unnormalised, 'no unit quaternion'),
        (negative, 'its covariance is not finite, or not positive'),
    ):
        # Repeated warnings are left out of the log for a while.
        until_rejected(ros, set_pose, message, walker, reason)
    assert planar(motors.odom[-1])[0] == pytest.approx(3.0, abs=0.05)

    answer = ros.probe.call(Trigger, 'walker_node/reset_odometry', Trigger.Request())
    assert answer.success
    ros.probe.until(lambda: motors.odom[-1].pose.pose.position.x < 0.1)
    assert planar(motors.odom[-1]) == pytest.approx((0.0, 0.0, 0.0), abs=0.01)
    # Its own covariance, without that of the set pose.
    assert motors.odom[-1].pose.covariance[0] < 0.01


@pytest.mark.slow
def test_the_scale_of_odom_is_that_of_the_calibration(ros: Domain) -> None:
    walks = []
    for name, factor in (('one', 1.0), ('two', 1.2)):
        words = [*FILE, '-r', f'__ns:=/{name}']
        ros.start('walker_node', *words, linear_scale=factor, motion_gain=0.0)
        motors = Motors(ros, f'/{name}/')
        motors.factors = [1.0, 1.0]
        walks.append(motors)
    for motors in walks:
        motors.twist = (0.15, 0.0)
    ros.probe.until(lambda: all(motors.odom and motors.positions[0] > 6.0 for motors in walks))
    # Both have walked as far: what they lose at the start and the end is the same.
    for motors in walks:
        motors.twist = None
    paths = []
    for motors in walks:
        motors.until_stopped()
        paths.append(motors.odom[-1].pose.pose.position.x / motors.positions[0])
    assert paths[1] / paths[0] == pytest.approx(1.2, rel=0.05)
