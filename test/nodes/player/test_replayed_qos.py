"""With which quality of service a recorded topic is published."""

from klann_ros.log.qos import latched_count, Qos
from klann_ros.nodes.endpoints import DEPTH
from klann_ros.nodes.player.node import LATCHED_DEPTH, MAX_DEPTH, publishing_profile
import pytest
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

LATCHED = Qos(history='keep_last', depth=1, durability='transient_local')
UNKNOWN = Qos(durability='transient_local')
BEST_EFFORT = Qos(reliability='best_effort')


@pytest.mark.parametrize(
    ('offered', 'count'),
    [
        ([Qos(depth=10)], 0),
        ([LATCHED], 1),
        ([LATCHED, LATCHED], 2),
        ([UNKNOWN, UNKNOWN, Qos()], 2),
        ([Qos(history='keep_all', durability='transient_local')], 2000),
        ([Qos(depth=10**12, durability='transient_local')], 2000),
    ],
)
def test_a_latched_topic_keeps_its_publishers_depth(offered: list[Qos], count: int) -> None:
    assert latched_count(offered) == count


@pytest.mark.parametrize(
    ('offered', 'depth'),
    [
        ([LATCHED], 1),
        ([LATCHED, LATCHED], 2),
        ([UNKNOWN], LATCHED_DEPTH),
        ([Qos(depth=1)], DEPTH),
        ([Qos(depth=5000)], 5000),
        ([Qos(depth=2**40)], MAX_DEPTH),
    ],
)
def test_a_queue_is_as_deep_as_it_was_and_a_volatile_one_deep(
    offered: list[Qos], depth: int
) -> None:
    assert publishing_profile(offered).depth == depth


def test_subscribers_of_any_publisher_receive_the_replay() -> None:
    both = publishing_profile([BEST_EFFORT, LATCHED])
    assert both.reliability == ReliabilityPolicy.RELIABLE
    assert both.durability == DurabilityPolicy.TRANSIENT_LOCAL
    one = publishing_profile([BEST_EFFORT])
    assert one.reliability == ReliabilityPolicy.BEST_EFFORT
    assert one.durability == DurabilityPolicy.VOLATILE


def test_durations_are_those_that_were_recorded() -> None:
    profile = publishing_profile(
        [Qos(deadline=10**8, lifespan=10**9, liveliness='manual_by_topic')]
    )
    assert profile.deadline.nanoseconds == 10**8
    assert profile.lifespan.nanoseconds == 10**9
    assert profile.liveliness.name == 'MANUAL_BY_TOPIC'
