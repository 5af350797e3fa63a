"""What a message says about the crank: angle, rate, stamp; or why it says nothing."""

from collections.abc import Collection
from math import isfinite
from typing import NamedTuple

from builtin_interfaces.msg import Time
from klann_ros.kinematics import KinematicsError
from sensor_msgs.msg import JointState


class BadMessageError(KinematicsError):
    """A message that holds no crank angle; the text says why."""


class Crank(NamedTuple):
    """
    A crank at a moment.

    Attributes
    ----------
    alpha : float
        Crank angle [rad].
    rate : float or None
        Its rate [rad/s]; None where it is not known.

    """

    alpha: float
    rate: float | None


def cranks(message: JointState, joints: Collection[str]) -> dict[str, Crank]:
    """
    Return what a JointState says about the joints that turn cranks, those that are in it.

    A velocity that is not finite, or does not belong to every name, says nothing.

    Raises
    ------
    BadMessageError
        None of the joints is in it, or names and positions differ in number.

    """
    names, positions, velocities = message.name, message.position, message.velocity
    if len(names) != len(positions):
        msg = f'crank_state has {len(names)} names and {len(positions)} positions: as many of each'
        raise BadMessageError(msg)
    known = len(velocities) == len(names)
    found = {}
    for joint in joints:
        if joint in names:
            index = names.index(joint)
            rate = velocities[index] if known else None
            finite = rate is not None and isfinite(rate)
            found[joint] = Crank(positions[index], rate if finite else None)
    if not found:
        wanted = ', '.join(map(repr, joints))
        msg = f'crank_state has no joint {wanted} (parameter crank_joint); it has {list(names)}'
        raise BadMessageError(msg)
    return found


def stamp_of(message: JointState) -> Time | None:
    """Return when it was measured; None for a zero stamp, which says nothing."""
    stamp = message.header.stamp
    return stamp if stamp.sec or stamp.nanosec else None
