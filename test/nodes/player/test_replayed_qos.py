"""With which quality of service a recorded topic is published."""

from klann_ros.log.qos import latched_count, Qos
from klann_ros.nodes.endpoints import DEPTH
from klann_ros.nodes.player.node import LATCHED_DEPTH, MAX_QUEUE_DEPTH, publishing_profile
import pytest
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

LATCHED = Qos(history='keep_last', depth=1, durability='transient_local')
UNKNOWN = Qos(durability='transient_local')
BEST_EFFORT = Qos(reliability='best_effort')


@pytest.mark.parametrize(
    ('offered', 'latched', 'depth'),
    [
        # A queue is as deep as it was, and a volatile one deep.
        ([Qos(depth=1)], 0, DEPTH),
        ([Qos(depth=5000)], 0, 5000),
        ([Qos(depth=2**40)], 0, MAX_QUEUE_DEPTH),
        # A latched topic keeps its publishers' depth.
        ([LATCHED], 1, 1),
        ([LATCHED, LATCHED], 2, 2),
        ([UNKNOWN], 1, LATCHED_DEPTH),
        ([UNKNOWN, UNKNOWN, Qos()], 2, LATCHED_DEPTH),
        ([Qos(history='keep_all', durability='transient_local')], 2000, 2000),
        ([Qos(depth=10**12, durability='transient_local')], 2000, 2000),
        ([BEST_EFFORT], 0, DEPTH),
        # Subscribers of any publisher receive the replay.
        ([BEST_EFFORT, LATCHED], 1, 1),
    ],
)
def test_a_replay_has_the_policies_of_all_publishers(
    offered: list[Qos], latched: int, depth: int
) -> None:
    profile = publishing_profile(offered)
    assert (latched_count(offered), profile.depth) == (latched, depth)
    assert (profile.durability == DurabilityPolicy.TRANSIENT_LOCAL) == (latched > 0)
    is_weak = offered == [BEST_EFFORT]
    assert (profile.reliability == ReliabilityPolicy.BEST_EFFORT) == is_weak


def test_durations_are_those_that_were_recorded() -> None:
    profile = publishing_profile(
        [Qos(deadline=10**8, lifespan=10**9, liveliness='manual_by_topic')]
    )
    assert profile.deadline.nanoseconds == 10**8
    assert profile.lifespan.nanoseconds == 10**9
    assert profile.liveliness.name == 'MANUAL_BY_TOPIC'
