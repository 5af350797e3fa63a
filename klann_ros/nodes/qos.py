"""Quality of service of this package's topics, and of recorded ones."""

from collections.abc import Sequence

from klann_ros.log.qos import latched_count, Qos
from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)

# Bursts overwrite a shallow queue before anyone can take them.
DEPTH = 2000
# A log may be damaged; nobody keeps more.
MOST_DEPTH = 100_000
# Where a log does not tell how many messages a latched topic kept; most keep 1.
LATCHED_DEPTH = 10

INPUT = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
OUTPUT = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE)


def recorded(profile: QoSProfile) -> Qos:
    """Return a profile as a log holds it."""
    return Qos(
        history=profile.history.name.lower(),
        depth=profile.depth,
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
        deadline=profile.deadline.nanoseconds,
        lifespan=profile.lifespan.nanoseconds,
        liveliness=profile.liveliness.name.lower(),
        liveliness_lease_duration=profile.liveliness_lease_duration.nanoseconds,
        avoid_ros_namespace_conventions=profile.avoid_ros_namespace_conventions,
    )


def to_receive(profiles: Sequence[QoSProfile]) -> QoSProfile:
    """
    Return the profile that receives the most from publishers with these profiles.

    A reliable or latched subscription gets nothing from a publisher that is not, so it asks for
    either only where every publisher offers it.
    """
    reliable = all(p.reliability == ReliabilityPolicy.RELIABLE for p in profiles)
    latched = all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in profiles)
    return QoSProfile(
        depth=DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def to_publish(offered: Sequence[Qos]) -> QoSProfile:
    """
    Return the profile that everybody hears who heard one of the recorded publishers.

    It is reliable or latched where one of them was; durations and liveliness are the first's.
    Discovery does not tell a publisher's history and depth, so most logs do not know them.
    """
    if not offered:
        return OUTPUT
    first = offered[0]
    latched = latched_count(offered)
    known = any(profile.depth or profile.history == 'keep_all' for profile in offered)
    # Who comes late to a latched topic shall not hear more than there was; the others' queues
    # are as deep as this package's own at least.
    least = (1 if known else LATCHED_DEPTH) if latched else DEPTH
    depth = min(max(latched or first.depth, least), MOST_DEPTH)
    words = {
        _policy(ReliabilityPolicy, p.reliability, ReliabilityPolicy.RELIABLE) for p in offered
    }
    reliable = ReliabilityPolicy.RELIABLE in words
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        deadline=Duration(nanoseconds=first.deadline),
        lifespan=Duration(nanoseconds=first.lifespan),
        liveliness=_policy(LivelinessPolicy, first.liveliness, LivelinessPolicy.AUTOMATIC),
        liveliness_lease_duration=Duration(nanoseconds=first.liveliness_lease_duration),
        avoid_ros_namespace_conventions=first.avoid_ros_namespace_conventions,
    )


def _policy(policies: type, word: str, otherwise: object) -> object:
    """Return the policy of a recorded word; what a publisher cannot offer becomes `otherwise`."""
    if word in ('unknown', 'system_default', 'best_available'):
        return otherwise
    return policies.__members__.get(word.upper(), otherwise)  # type: ignore[attr-defined]
