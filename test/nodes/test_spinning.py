"""Spinning for days: nothing piles up, and what one callback raises ends nothing."""

from functools import partial
from threading import Thread
import time

from klann_ros.nodes.process import error_and_place, spin_on
from klann_ros.nodes.raw_executor import RawCallbackGroup, RawMessageExecutor
import pytest
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from ros_world import World
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

STEADY = Clock(clock_type=ClockType.STEADY_TIME)
TURNS = 50


class Ticking(Node):
    """Count turns, ask for the end after some, and raise at every third."""

    def __init__(self, ros: World, done: Future) -> None:
        self.own_context = Context()
        self.own_context.init(domain_id=ros.domain)
        super().__init__('ticking', context=self.own_context)
        self.ticks = 0
        self.callbacks: list[int] = []
        self.done = done
        self.trouble: type[Exception] | None = None
        self.create_timer(0.005, self._tick, clock=STEADY)

    def _tick(self) -> None:
        self.ticks += 1
        self.callbacks.append(len(self.done._callbacks))
        if self.ticks == TURNS:
            self.done.set_result(0)
        elif self.trouble is not None and self.ticks % 3 == 0:
            raise self.trouble('a message\nof a stranger')

    def close(self) -> None:
        self.destroy_node()
        self.own_context.try_shutdown()


@pytest.mark.parametrize('plain', [False, True], ids=['lean', 'plain'])
@pytest.mark.parametrize('trouble', [None, ValueError], ids=['calm', 'troubled'])
def test_a_turn_leaves_nothing_behind(
    ros: World, plain: bool, trouble: type[Exception] | None
) -> None:
    done = Future()
    node = Ticking(ros, done)
    node.trouble = trouble
    executor = SingleThreadedExecutor(context=node.own_context)
    executor.add_node(node)
    loop = RawMessageExecutor(executor, plain=plain)
    spin_on(partial(loop.spin_until_future_complete, done), node)
    assert node.ticks == TURNS
    assert set(node.callbacks) == {1}
    executor.shutdown()
    node.close()


def test_the_end_of_the_context_is_no_failure_to_go_on_after(ros: World) -> None:
    node = Ticking(ros, Future())

    def spin() -> None:
        raise ExternalShutdownException

    with pytest.raises(ExternalShutdownException):
        spin_on(spin, node)
    node.close()


def test_an_error_is_one_line_with_its_place() -> None:
    with pytest.raises(ValueError, match='two') as raised:
        raise ValueError('two\nlines \x1b[2J' + 'x' * 1000)
    text = error_and_place(raised.value)
    assert text.isprintable()
    assert text.startswith('ValueError: two\\nlines \\x1b[2Jxxx')
    assert 'test_spinning.py:' in text
    assert len(text) < 400


class Choking(Node):
    """Raise for every message, and answer a service."""

    def __init__(self, ros: World) -> None:
        self.own_context = Context()
        self.own_context.init(domain_id=ros.domain)
        super().__init__('choking', context=self.own_context)
        self.choked = 0
        group = RawCallbackGroup()
        self.create_subscription(
            Float64, 'there', self._take, 2000, raw=True, callback_group=group
        )
        self.create_service(Trigger, 'choking/call', lambda _, response: response)

    def _take(self, *_: object) -> None:
        self.choked += 1
        # Meanwhile the service is asked, and waits for its turn.
        time.sleep(0.02)
        raise ValueError('whatever comes')


@pytest.mark.parametrize('plain', [False, True], ids=['lean', 'plain'])
def test_who_asks_while_a_message_fails_is_answered(ros: World, plain: bool) -> None:
    node, done = Choking(ros), Future()
    executor = SingleThreadedExecutor(context=node.own_context)
    executor.add_node(node)
    loop = RawMessageExecutor(executor, plain=plain)
    spin = partial(spin_on, partial(loop.spin_until_future_complete, done), node)
    thread = Thread(target=spin)
    thread.start()
    there = ros.probe.publisher(Float64, 'there')
    client = ros.probe.node.create_client(Trigger, 'choking/call')
    ros.probe.until(client.service_is_ready)
    ros.probe.until_knows('choking')
    for _ in range(20):
        there.publish(Float64())
        answer = client.call_async(Trigger.Request())
        ros.probe.until(answer.done)
    ros.probe.until(lambda: node.choked == 20)
    done.set_result(0)
    thread.join()
    executor.shutdown()
    node.destroy_node()
    node.own_context.try_shutdown()
