"""Both sides of a lease, by a clock of their own; `view/test_lease.py` has them over DDS."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from diagnostic_msgs.msg import KeyValue
from klann_ros.nodes import lease
from klann_ros.nodes.lease import HELD, Lease, leased_topic, LeaseListener, RELEASED
import pytest

TOPIC = '/left/crank_angle'


class StandIn:
    """A node whose messages, subscriptions and timer are the test's; it begins at 100 s."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        self.sent: list[tuple[str, str, str]] = []
        self.is_timer_active = True
        self._callbacks: dict[str, Callable[[KeyValue], None]] = {}
        monkeypatch.setattr(lease, 'monotonic', lambda: self.now)
        monkeypatch.setattr(lease, 'create_steady_timer', self._create_timer)

    def get_fully_qualified_name(self) -> str:
        return '/node'

    def create_publisher(self, _: type, topic: str, __: object) -> Any:
        def publish(message: KeyValue) -> None:
            self.sent.append((topic, message.key, message.value))

        return SimpleNamespace(publish=publish)

    def create_subscription(
        self, _: type, topic: str, callback: Callable[[KeyValue], None], __: object
    ) -> None:
        self._callbacks[topic] = callback

    def _create_timer(self, _: object, __: float, callback: Callable[[], None]) -> Any:
        self._on_timer = callback

        def switch(*, is_active: bool) -> None:
            self.is_timer_active = is_active

        return SimpleNamespace(
            cancel=lambda: switch(is_active=False), reset=lambda: switch(is_active=True)
        )

    def check(self) -> None:
        if self.is_timer_active:
            self._on_timer()

    @property
    def subscribed(self) -> list[str]:
        return [*self._callbacks]

    def receive(self, name: str, key: str, value: str) -> None:
        self._callbacks[f'{TOPIC}/{name}'](KeyValue(key=key, value=value))


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> StandIn:
    return StandIn(monkeypatch)


@pytest.mark.parametrize(
    ('topic', 'leased'),
    [
        ('/left/crank_state', TOPIC),
        (TOPIC, TOPIC),
        ('/cmd_vel', '/cmd_vel'),
        ('/odom', ''),
        ('/motor_crank_angle', ''),
    ],
)
def test_both_topics_of_a_crank_have_one_lease_and_others_none(topic: str, leased: str) -> None:
    assert leased_topic(topic) == leased


def test_a_topic_without_a_lease_has_no_driver(node: StandIn) -> None:
    publisher = LeaseListener(node, '/odom', print)
    assert (publisher.topic, publisher.holder) == ('', '')
    assert not node.subscribed


def listener(node: StandIn) -> tuple[LeaseListener, list[str]]:
    """Return a publisher's side that yields to /a, and its changes from now on."""
    changes: list[str] = []
    listener = LeaseListener(node, '/left/crank_state', changes.append)
    node.receive('lease', '/a#1', HELD)
    assert changes == [listener.holder] == ['/a']
    assert node.is_timer_active
    changes.clear()
    assert node.sent == [(f'{TOPIC}/yielded', '/node', '/a#1')]
    return listener, changes


def test_the_first_driver_holds_a_lease_until_it_falls_silent(node: StandIn) -> None:
    publisher, changes = listener(node)
    for value in (HELD, RELEASED):
        node.receive('lease', '/b#2', value)
    for now in (100.9, 101.8):
        node.now = now
        node.check()
        node.receive('lease', '/a#1', HELD)
    assert len(node.sent) == 3
    node.now = 102.75
    node.check()
    assert (publisher.holder, changes) == ('/a', [])
    node.now = 102.85
    node.check()
    assert (publisher.holder, publisher.last_holder, changes) == ('', '/a', [''])
    assert not node.is_timer_active
    node.receive('lease', '/b#2', HELD)
    assert publisher.holder == '/b'


def test_a_released_topic_is_free_when_the_last_angle_has_arrived(node: StandIn) -> None:
    publisher, changes = listener(node)
    node.receive('lease', '/a#1', RELEASED)
    node.now += 0.05
    node.check()
    assert (publisher.holder, changes) == ('/a', [])
    node.now += 0.1
    node.check()
    assert (publisher.holder, changes) == ('', [''])


def test_names_that_no_node_has_take_nothing(node: StandIn) -> None:
    changes: list[str] = []
    LeaseListener(node, TOPIC, changes.append)
    for key in ('', 'x' * 301):
        node.receive('lease', key, HELD)
    node.receive('lease', '/a#1', 'maybe')
    assert node.sent == changes == []
    node.receive('lease', '/\x1b#1', HELD)
    assert changes == ['/\\x1b']


def driver(node: StandIn) -> tuple[Lease, str]:
    """Return a driver's side that holds the lease, and its key."""
    driver = Lease(node, TOPIC)
    assert driver.announce()
    ((topic, key, value),) = node.sent
    assert (topic, key.partition('#')[0], value) == (f'{TOPIC}/lease', '/node', HELD)
    return driver, key


def test_a_driver_announces_itself_in_time_and_knows_when_it_did_not(node: StandIn) -> None:
    holder, key = driver(node)
    for now, count in ((100.04, 1), (100.06, 2), (100.1, 2), (100.5, 3)):
        node.now = now
        assert holder.announce()
        assert len(node.sent) == count
    node.now = 101.1
    assert not holder.announce()
    holder.release()
    holder.release()
    assert node.sent[-2:] == [(f'{TOPIC}/lease', key, HELD), (f'{TOPIC}/lease', key, RELEASED)]
    for now in (101.11, 110.0):
        node.now = now
        assert holder.announce()
        assert node.sent[-1] == (f'{TOPIC}/lease', key, HELD)
        holder.release()


def test_publishers_yield_as_long_as_they_confirm_it(node: StandIn) -> None:
    holder, key = driver(node)
    node.receive('yielded', '/late', key)
    node.receive('yielded', '/of_another', '/a#1')
    node.now += 0.5
    node.receive('yielded', '/crank', key)
    assert holder.yielded == ['/crank', '/late']
    node.now += 0.75
    assert holder.yielded == ['/crank']
    holder.release()
    assert holder.yielded == []
    node.receive('yielded', '/crank', key)
    assert holder.yielded == []
    holder.announce()
    for number in range(100):
        node.receive('yielded', f'/flood_{number:02}', key)
    node.now += 0.75
    node.receive('yielded', '/flood_07', key)
    node.now += 0.5
    assert holder.yielded == ['/flood_07']
    assert len(holder._yielded) == 64


def test_another_driver_is_named_while_it_holds_the_lease(node: StandIn) -> None:
    holder, key = driver(node)
    node.receive('lease', key, HELD)
    assert holder.other == ''
    node.receive('lease', '/node#2', HELD)
    node.now += 0.9
    assert holder.other == '/node'
    node.now += 0.2
    assert holder.other == ''
    for value, other in ((HELD, '/a'), (RELEASED, '')):
        node.receive('lease', '/a#1', value)
        assert holder.other == other
