"""What a message says about the crank: angle, rate, stamp; or why it says nothing."""

from math import isfinite
from typing import NamedTuple

from builtin_interfaces.msg import Time
from klann_ros.kinematics import KinematicsError
from sensor_msgs.msg import JointState


class BadMessageError(KinematicsError):
    """A message that holds no crank angle; the text says why."""


class Crank(NamedTuple):
    """
    The crank at a moment.

    Attributes
    ----------
    alpha : float
        Crank angle [rad].
    rate : float or None
        Its rate [rad/s]; None where it is not known.
    stamp : builtin_interfaces.msg.Time or None
        When it was measured; None where the message does not say.

    """

    alpha: float
    rate: float | None
    stamp: Time | None


def from_joint_state(message: JointState, joint: str) -> Crank:
    """
    Return what a JointState says about the joint that turns the crank.

    A zero stamp says nothing, nor does a velocity that is not finite or does not belong to every
    name.

    Raises
    ------
    BadMessageError
        The joint is not in it, or names and positions differ in number.

    """
    names, positions, velocities = message.name, message.position, message.velocity
    if len(names) != len(positions):
        msg = f'crank_state has {len(names)} names and {len(positions)} positions: as many of each'
        raise BadMessageError(msg)
    if joint not in names:
        msg = f'crank_state has no joint {joint!r} (parameter crank_joint); it has {list(names)}'
        raise BadMessageError(msg)
    index = names.index(joint)
    rate = velocities[index] if len(velocities) == len(names) else None
    stamp = message.header.stamp
    return Crank(
        positions[index],
        rate if rate is not None and isfinite(rate) else None,
        stamp if stamp.sec or stamp.nanosec else None,
    )
