"""What goes over the wire is what a typed message would be."""

from math import cos, inf, nan, pi, sin
import struct

from geometry_msgs.msg import Twist, TwistStamped
from klann_ros.nodes.walker.messages import (
    ImuReader,
    odometry_template,
    read_twist,
    transform_template,
)
from leg_runs import STORE
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Imu


@pytest.mark.parametrize('frame', ['odom', 'a', 'map/of_the_hall'])
def test_odometry_is_filled_in_where_its_numbers_are(frame: str) -> None:
    numbers = [float(k) for k in range(1, 29)]
    odometry = odometry_template(frame, 'base_link').fill(5, 7, *numbers)
    read = deserialize_message(odometry, Odometry)
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (5, 7)
    assert (read.header.frame_id, read.child_frame_id) == (frame, 'base_link')
    place, rotation = read.pose.pose.position, read.pose.pose.orientation
    assert [place.x, place.y, place.z] == [1.0, 2.0, 3.0]
    assert [rotation.x, rotation.y, rotation.z, rotation.w] == [4.0, 5.0, 6.0, 7.0]
    x, y, z, roll, pitch, yaw = read.pose.covariance.reshape(6, 6).tolist()
    assert (x, y) == ([8, 9, 0, 0, 0, 10], [11, 12, 0, 0, 0, 13])
    assert (z, roll, pitch) == ([0, 0, 14, 0, 0, 0], [0, 0, 0, 15, 0, 0], [0, 0, 0, 0, 16, 0])
    assert yaw == [17, 18, 0, 0, 0, 19]
    linear, angular = read.twist.twist.linear, read.twist.twist.angular
    assert [linear.x, linear.y, linear.z] == [20.0, 21.0, 0.0]
    assert [angular.x, angular.y, angular.z] == [0.0, 0.0, 22.0]
    assert np.diag(read.twist.covariance.reshape(6, 6)).tolist() == [23, 24, 25, 26, 27, 28]
    assert np.count_nonzero(read.twist.covariance) == 6


def test_a_transform_is_filled_in_where_its_numbers_are() -> None:
    data = transform_template('odom', 'base_link').fill(5, 7, 1.0, 2, 3, 4, 5, 6, 7)
    (read,) = STORE.deserialize_cdr(data, 'tf2_msgs/msg/TFMessage').transforms
    assert read.header.frame_id == 'odom'
    assert read.header.stamp.sec == 5
    assert read.child_frame_id == 'base_link'
    assert read.transform.translation.x == 1.0
    assert read.transform.rotation.w == 7.0


def test_a_twist_is_read_with_and_without_a_stamp() -> None:
    stamped = TwistStamped()
    stamped.header.frame_id = 'base_link'
    stamped.header.stamp.sec = 9
    stamped.twist.linear.x, stamped.twist.angular.z = 0.25, -0.5
    assert read_twist(serialize_message(stamped), stamped=True) == (0.25, -0.5, 9, 0)
    plain: Twist = stamped.twist
    assert read_twist(serialize_message(plain), stamped=False) == (0.25, -0.5, 0, 0)


@pytest.mark.parametrize('size', [0, 3, 4, 20, 40])
def test_short_messages_are_refused(size: int) -> None:
    data = bytes(serialize_message(TwistStamped()))[:size]
    with pytest.raises(ValueError, match=r'ends too early|begins'):
        read_twist(data, stamped=True)
    with pytest.raises(ValueError, match=r'ends too early|begins'):
        ImuReader().read(data)


def test_an_imu_without_orientation_or_accelerometer_is_recognised() -> None:
    imu = Imu()
    imu.angular_velocity.z, imu.linear_acceleration.z = 0.5, 9.5
    imu.orientation_covariance[0] = imu.linear_acceleration_covariance[0] = -1.0
    read = ImuReader().read(serialize_message(imu))
    assert (read.orientation, read.angular, read.force) == (None, (0.0, 0.0, 0.5), None)
    imu.orientation_covariance[0] = imu.orientation_covariance[8] = 0.01
    imu.linear_acceleration_covariance[0] = 0.0
    read = ImuReader().read(serialize_message(imu))
    assert (read.orientation, read.force) == ((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 9.5))
    assert read.variance == 0.01
    # An empty orientation is none, and so is the default of the message.
    imu.orientation.w = 0.0
    assert ImuReader().read(serialize_message(imu)).orientation is None
    assert ImuReader().read(serialize_message(Imu())).orientation is None


def test_the_orientation_of_a_fallen_body_is_read() -> None:
    for tilt in (0.3, 1.1, pi):
        imu = Imu()
        imu.orientation.x, imu.orientation.w = sin(tilt / 2.0), cos(tilt / 2.0)
        read = ImuReader().read(serialize_message(imu)).orientation
        assert read == (imu.orientation.x, 0.0, 0.0, imu.orientation.w)


@pytest.mark.parametrize(
    ('sent', 'read'),
    [(inf, pi**2), (1e300, pi**2), (1e-4, 1e-4), (0.0, 0.0), (-2.0, 0.0), (nan, 0.0)],
)
def test_a_yaw_is_as_uncertain_as_any_direction_at_most(sent: float, read: float) -> None:
    imu = Imu()
    imu.orientation_covariance[8] = sent
    assert ImuReader().read(serialize_message(imu)).variance == read


@pytest.mark.parametrize('rate', [float('nan'), float('inf'), -100.5])
def test_an_imu_that_turns_at_no_rate_is_refused(rate: float) -> None:
    imu = Imu()
    imu.angular_velocity.x = rate
    with pytest.raises(ValueError, match='not finite, or beyond'):
        ImuReader().read(serialize_message(imu))


def test_messages_of_other_frames_and_byte_orders_follow_each_other() -> None:
    reader = ImuReader()
    for frame in ('imu', 'imu_link', '', 'imu', 'the/back/of/it'):
        imu = Imu()
        imu.header.frame_id = frame
        imu.header.stamp.sec = len(frame)
        imu.orientation.w, imu.orientation_covariance[8] = 1.0, 0.25
        imu.angular_velocity.x, imu.angular_velocity.z = 0.5, -0.5
        imu.linear_acceleration.z = 9.5
        read = reader.read(serialize_message(imu))
        force = (0.0, 0.0, 9.5)
        assert read == ((0.0, 0.0, 0.0, 1.0), 0.25, (0.5, 0.0, -0.5), force, len(frame), 0)
    with pytest.raises(ValueError, match='ends too early'):
        reader.read(bytes(serialize_message(imu))[:-120])
    big = b'\0\0\0\0' + struct.pack('>iII4x', 7, 8, 1)
    numbers = 0, 0, 0, 1, 0.1, *[0] * 8, 1, 2, 3, *[0] * 9, 4, 5, 6, *[0] * 9
    big += struct.pack('>37d', *numbers)
    read = reader.read(big)
    assert read == ((0.0, 0.0, 0.0, 1.0), 0.0, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), 7, 8)
