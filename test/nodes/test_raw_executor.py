"""The raw message executor over real DDS, and the ends and errors of its plain path."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
import threading
import time
from typing import Any

from klann_ros.nodes import raw_executor
from klann_ros.nodes.process import spin_through_errors
from klann_ros.nodes.raw_executor import RawCallbackGroup, RawMessageExecutor
import pytest
from rclpy import executors
from rclpy.clock import Clock as RosClock, ClockType
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from ros_domain import Domain, PATIENCE
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
from typing_extensions import Self

STEADY = RosClock(clock_type=ClockType.STEADY_TIME)
LOOPS = pytest.mark.parametrize('plain', [False, True], ids=['lean', 'plain'])


class Echo(Node):
    """Send back what comes, and have one of everything that an executor serves."""

    def __init__(self, context: Context, **options: Any) -> None:
        super().__init__('echo', context=context, **options)
        self.group = RawCallbackGroup()
        self.taken: list[tuple[bytes, dict[str, Any]]] = []
        self.threads: set[str] = set()
        # Of timers on the steady clock and on ROS's, in the executor and in the loop.
        self.ticks: Counter[str] = Counter()
        self.matches = self.calls = self.failures = 0
        self.pause = 0.0
        self.trouble: type[Exception] | None = None
        self.back = self.create_publisher(Float64, 'back', 2000)
        options: dict[str, Any] = {'raw': True, 'callback_group': RawCallbackGroup(wakes=False)}
        options['event_callbacks'] = SubscriptionEventCallbacks(use_default_callbacks=False)
        self.create_subscription(Float64, 'quiet', self._take, 2000, **options)
        self.there = self.listen('there')
        self.typed: list[float] = []
        self.create_subscription(Float64, 'typed', self._take_typed, 2000)
        self.create_timer(0.02, partial(self._tick, 'steady'), clock=STEADY)
        self.create_timer(1.0, partial(self._tick, 'ros'))
        lean_tick = partial(self._tick, 'lean steady')
        self.lean_timer = self.create_timer(0.02, lean_tick, self.group, STEADY)
        self.create_timer(1.0, partial(self._tick, 'lean ros'), self.group)
        self.create_service(Trigger, 'echo/call', self._call)
        self.declare_parameter('value', 0.0)

    def listen(self, topic: str) -> Any:
        def matched(status: Any) -> None:
            # On a busy machine rclpy may tell of nothing new a second time.
            self.matches += status.current_count_change != 0

        return self.create_subscription(
            Float64,
            topic,
            self._take,
            2000,
            raw=True,
            callback_group=self.group,
            event_callbacks=SubscriptionEventCallbacks(matched=matched),
        )

    def _take(self, data: bytes, info: dict[str, Any]) -> None:
        self.threads.add(threading.current_thread().name)
        time.sleep(self.pause)
        if self.trouble is not None:
            self.failures += 1
            raise self.trouble
        self.taken.append((data, info))
        self.back.publish(data)

    def _take_typed(self, message: Float64) -> None:
        time.sleep(self.pause)
        self.typed.append(message.data)

    def _tick(self, timer: str) -> None:
        self.threads.add(threading.current_thread().name)
        self.ticks[timer] += 1

    def _call(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.threads.add(threading.current_thread().name)
        self.calls += 1
        response.success = True
        return response

    def numbers(self) -> list[float]:
        return [number_in(data) for data, _ in self.taken]


def number_in(data: bytes) -> float:
    return float(memoryview(data)[4:12].cast('d')[0])


class Running:
    """An echo whose loop runs in a thread of its own, until the context ends."""

    def __init__(
        self,
        ros: Domain,
        *,
        plain: bool = False,
        batch_period: float = 0.0,
        spin: Callable[..., None] = lambda run, _: run(),
        **options: Any,
    ) -> None:
        self.context = Context()
        self.context.init(domain_id=ros.domain)
        self.echo = Echo(self.context, **options)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.echo)
        self.done = Future()
        self.loop = RawMessageExecutor(self.executor, plain=plain, batch_period=batch_period)
        self.error: Exception | None = None
        self._spin = spin
        self.start()

    def start(self) -> None:
        self.thread = threading.Thread(target=self._run, name='loop')
        self.thread.start()

    def _run(self) -> None:
        try:
            run = partial(self.loop.spin_until_future_complete, self.done)
            self._spin(run, self.echo)
        except Exception as error:
            self.error = error

    def ends(self) -> None:
        self.thread.join(PATIENCE)
        assert not self.thread.is_alive()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if not self.done.done():
            self.done.set_result(0)
        self.ends()
        self.executor.shutdown()
        self.echo.destroy_node()
        self.context.try_shutdown()


@contextmanager
def load(ros: Domain, rate: float = 1000.0) -> Iterator[list[float]]:
    """Publish number after number until the block ends; yield them."""
    publisher = ros.probe.publisher(Float64, 'there')
    sent: list[float] = []
    stop = threading.Event()

    def publish() -> None:
        while not stop.wait(1.0 / rate):
            publisher.publish(Float64(data=float(len(sent))))
            sent.append(float(len(sent)))

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        yield sent
    finally:
        stop.set()
        thread.join()


def test_a_burst_is_taken_in_order_with_message_info(ros: Domain) -> None:
    back: list[bytes] = []
    ros.probe.node.create_subscription(Float64, 'back', back.append, 2000, raw=True)
    with Running(ros) as run:
        ros.probe.await_publishers('back')
        publisher = ros.probe.publisher(Float64, 'there')
        numbers = [float(k) for k in range(700)]
        start_time = time.time_ns()
        for number in numbers:
            publisher.publish(Float64(data=number))
        ros.probe.until(lambda: len(back) == len(numbers))
        assert run.echo.numbers() == numbers
        assert [data for data, _ in run.echo.taken] == back
        infos = [info for _, info in run.echo.taken]
        sequences = [info['publication_sequence_number'] for info in infos]
        assert sequences == list(range(1, len(numbers) + 1))
        for info in infos:
            assert start_time <= info['source_timestamp'] <= info['received_timestamp']
        assert len(back[0]) == 12


def test_all_else_is_served_in_one_thread_with_and_without_load(ros: Domain) -> None:
    with Running(ros) as run:
        typed = ros.probe.publisher(Float64, 'typed')

        def serve() -> None:
            run.echo.typed.clear()
            ticks = run.echo.ticks.copy()
            for k in range(10):
                assert ros.probe.call(Trigger, 'echo/call', Trigger.Request()).success
                assert ros.probe.set_parameters('echo', {'value': float(k)}).successful
                typed.publish(Float64(data=float(k)))
            timers = ('steady', 'lean steady')
            ros.probe.until(lambda: all(run.echo.ticks[t] > ticks[t] for t in timers))
            ros.probe.until(lambda: len(run.echo.typed) == 10)
            assert run.echo.get_parameter('value').value == 9.0

        serve()
        with load(ros) as sent:
            serve()
            count = len(sent)
            ros.probe.until(lambda: len(run.echo.taken) > count)
        assert run.echo.threads == {'loop'}
    numbers = run.echo.numbers()
    assert numbers == [float(k) for k in range(len(numbers))]


def test_simulated_time_moves_clock_and_timers(ros: Domain) -> None:
    options = {'parameter_overrides': [Parameter('use_sim_time', value=True)]}
    with Running(ros, **options) as run, load(ros, 100.0):
        clock = ros.probe.publisher(Clock, '/clock', reliable=False)
        for second in (10, 20, 30):
            message = Clock()
            message.clock.sec = second

            def has_moved(to: int = second, message: Clock = message) -> bool:
                # A clock is best effort.
                clock.publish(message)
                return bool(run.echo.get_clock().now().nanoseconds == to * 10**9)

            ros.probe.until(has_moved)
        ros.probe.until(lambda: min(run.echo.ticks[t] for t in ('ros', 'lean ros')) >= 2)


@pytest.fixture
def waits(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the names of threads that wait, once for each time."""
    names: list[str] = []

    class Counting(raw_executor.rclpy_implementation.WaitSet):  # type: ignore[misc, name-defined]
        """A wait set that records the waiting threads."""

        def wait(self, timeout: int) -> None:
            names.append(threading.current_thread().name)
            super().wait(timeout)

    monkeypatch.setattr(raw_executor.rclpy_implementation, 'WaitSet', Counting)
    return names


def calm(ros: Domain, run: Running, waits: list[str]) -> None:
    """Cancel the timers, and wait until discovery wakes no thread."""
    for timer in run.echo.timers:
        timer.cancel()

    def is_quiet() -> bool:
        waits.clear()
        time.sleep(0.5)
        return waits == []

    ros.probe.until(is_quiet)


def test_threads_wake_up_only_for_messages(ros: Domain, waits: list[str]) -> None:
    with Running(ros) as run:
        publisher = ros.probe.publisher(Float64, 'there')
        calm(ros, run, waits)
        for k in range(100):
            publisher.publish(Float64(data=float(k)))
            ros.probe.spin(0.01)
        ros.probe.until(lambda: len(run.echo.taken) == 100)
        # One for each message; the executor's thread sleeps.
        assert waits.count('loop') <= 110
        assert waits.count('watch') <= 3


def test_messages_that_wake_no_loop_come_first_with_those_that_do(
    ros: Domain, waits: list[str]
) -> None:
    with Running(ros) as run:
        quiet = ros.probe.publisher(Float64, 'quiet')
        publisher = ros.probe.publisher(Float64, 'there')

        def is_published_without_a_wake_up() -> bool:
            """Publish; take what is left where something else has woken the loop meanwhile."""
            calm(ros, run, waits)
            run.echo.taken.clear()
            for k in range(100):
                quiet.publish(Float64(data=float(k)))
            time.sleep(0.5)
            if waits == []:
                return True
            for _ in range(2):
                publisher.publish(Float64(data=102.0))
            ros.probe.until(lambda: run.echo.numbers().count(102.0) == 2)
            return False

        ros.probe.until(is_published_without_a_wake_up)
        assert run.echo.taken == []
        publisher.publish(Float64(data=100.0))
        ros.probe.until(lambda: run.echo.numbers()[-1:] == [100.0])
        # A burst is limited, and what is left has the next turn.
        publisher.publish(Float64(data=101.0))
        ros.probe.until(lambda: len(run.echo.taken) == 102)
        numbers = run.echo.numbers()
        assert numbers[:65] == [*map(float, range(64)), 100.0]
        assert [number for number in numbers if number < 100.0] == [*map(float, range(100))]


def test_on_the_plain_path_all_messages_wake_the_executor(ros: Domain) -> None:
    with Running(ros, plain=True) as run:
        ros.probe.publisher(Float64, 'quiet').publish(Float64(data=1.0))
        ros.probe.until(lambda: run.echo.numbers() == [1.0])


@pytest.mark.parametrize('caller', ['outside', 'executor', 'loop'])
def test_a_late_subscription_is_served(ros: Domain, caller: str) -> None:
    late = ros.probe.publisher(Float64, 'late', subscribers=0)
    timers: list[Any] = []
    with Running(ros) as run:

        def listen() -> None:
            run.echo.listen('late')
            for timer in timers:
                timer.cancel()

        if caller == 'outside':
            listen()
        else:
            group = run.echo.group if caller == 'loop' else None
            timers.append(run.echo.create_timer(0.05, listen, group, STEADY))
        ros.probe.await_subscribers(late)
        late.publish(Float64(data=2.0))
        ros.probe.until(lambda: 2.0 in run.echo.numbers())


def test_a_lean_timer_can_be_cancelled_reset_and_destroyed(ros: Domain) -> None:
    def ticks_within(seconds: float) -> int:
        first_ticks = run.echo.ticks['lean steady']
        ros.probe.spin(seconds)
        return run.echo.ticks['lean steady'] - first_ticks

    with Running(ros) as run:
        ros.probe.until(lambda: run.echo.ticks['lean steady'] > 0)
        run.echo.lean_timer.cancel()
        # It may be running just now.
        ros.probe.until(lambda: ticks_within(0.1) == 0)
        run.echo.lean_timer.reset()
        ros.probe.until(lambda: ticks_within(0.1) > 0)
        late: list[int] = []
        run.echo.create_timer(0.01, lambda: late.append(1), run.echo.group, STEADY)
        ros.probe.until(lambda: len(late) > 3)
        run.echo.destroy_timer(run.echo.lean_timer)
        ros.probe.until(lambda: ticks_within(0.1) == 0)
        count = len(late)
        ros.probe.until(lambda: len(late) > count)


def test_a_loop_whose_future_is_done_ends_and_the_next_takes_what_came_before(ros: Domain) -> None:
    with Running(ros) as run:
        publisher = ros.probe.publisher(Float64, 'there')
        run.done.set_result(0)
        run.ends()
        run.start()
        run.ends()
        publisher.publish(Float64(data=1.0))
        ros.probe.spin(0.3)
        run.done = Future()
        run.start()
        ros.probe.until(lambda: run.echo.numbers() == [1.0])


def test_events_of_a_subscription_are_reported(ros: Domain) -> None:
    with Running(ros) as run, load(ros, 200.0):
        ros.probe.until(lambda: run.echo.matches == 1)
        second = ros.probe.publisher(Float64, 'there')
        ros.probe.until(lambda: run.echo.matches == 2)
        ros.probe.node.destroy_publisher(second)
        ros.probe.until(lambda: run.echo.matches == 3)
        # A subscription that goes leaves the others.
        subscription = run.echo.listen('other')
        ros.probe.publisher(Float64, 'other')
        ros.probe.call(Trigger, 'echo/call', Trigger.Request())
        run.echo.destroy_subscription(subscription)
        ros.probe.until(lambda: ros.probe.node.count_subscribers('other') == 0)
        count = len(run.echo.taken)
        ros.probe.until(lambda: len(run.echo.taken) > count + 50)


def test_a_batching_delay_is_not_one_for_each_message_of_the_executor(ros: Domain) -> None:
    with Running(ros, batch_period=0.1) as run:
        typed = ros.probe.publisher(Float64, 'typed')
        numbers = [float(k) for k in range(int(1.2 * PATIENCE / 0.1))]
        for number in numbers:
            typed.publish(Float64(data=number))
        # One by one they would last longer than the probe waits.
        ros.probe.until(lambda: run.echo.typed == numbers)


@pytest.mark.parametrize('topic', ['there', 'typed'])
def test_a_flood_does_not_starve_a_service(ros: Domain, topic: str) -> None:
    with Running(ros) as run:
        run.echo.pause = 0.005
        publisher = ros.probe.publisher(Float64, topic)
        client = ros.probe.node.create_client(Trigger, 'echo/call')
        ros.probe.until(client.service_is_ready)
        ros.probe.await_discovery('echo')
        for number in range(1500):
            publisher.publish(Float64(data=float(number)))
        answer = client.call_async(Trigger.Request())
        ros.probe.until(answer.done)
        # It was served although messages waited all the time.
        assert len(run.echo.taken) + len(run.echo.typed) < 1400


def test_a_busy_executor_does_not_starve_messages(ros: Domain) -> None:
    with Running(ros) as run:
        publisher = ros.probe.publisher(Float64, 'there')

        def work() -> None:
            run.echo.ticks['busy'] += 1
            time.sleep(0.001)

        run.echo.create_timer(0.0, work, clock=STEADY)
        ros.probe.until(lambda: run.echo.ticks['busy'] > 3)
        for k in range(20):
            publisher.publish(Float64(data=float(k)))
        ros.probe.until(lambda: len(run.echo.taken) == 20)


@LOOPS
@pytest.mark.parametrize('end', ['future', 'executor', 'context'])
def test_it_ends_under_load_with_its_threads(ros: Domain, plain: bool, end: str) -> None:
    thread_count = threading.active_count()
    with Running(ros, plain=plain, spin=spin_through_errors) as run, load(ros):
        ros.probe.until(lambda: run.echo.taken)
        if end == 'future':
            run.done.set_result(0)
        elif end == 'executor':
            run.echo.create_timer(0.01, run.executor.shutdown, clock=STEADY)
        else:
            run.context.shutdown()
        run.ends()
        if end != 'context':
            assert run.error is None
        # rclpy's loop may see the end first, and raise nothing.
        elif not plain:
            assert isinstance(run.error, ExternalShutdownException)
        assert threading.active_count() <= thread_count + 3
    assert not [thread for thread in threading.enumerate() if thread.name == 'watch']


@LOOPS
def test_errors_of_callbacks_are_raised(ros: Domain, plain: bool) -> None:
    with Running(ros, plain=plain) as run:
        publisher = ros.probe.publisher(Float64, 'there')
        run.echo.trouble = ZeroDivisionError
        publisher.publish(Float64())
        run.ends()
        assert isinstance(run.error, ZeroDivisionError)
        # Afterwards the executor serves the group.
        run.echo.trouble = None
        publisher.publish(Float64(data=2.0))
        ros.probe.spin(0.2)
        end = time.monotonic() + PATIENCE
        while not run.echo.taken and time.monotonic() < end:
            run.executor.spin_once(timeout_sec=0.1)
        assert run.echo.numbers() == [2.0]
        for group in (run.echo.group, None):
            run.error = None
            timer = run.echo.create_timer(0.01, lambda: 1 // 0, group, STEADY)
            run.start()
            run.ends()
            assert isinstance(run.error, ZeroDivisionError)
            run.echo.destroy_timer(timer)


@LOOPS
def test_spinning_continues_after_errors_and_a_request_meanwhile_is_answered(
    ros: Domain, plain: bool
) -> None:
    with Running(ros, plain=plain, spin=spin_through_errors) as run:
        publisher = ros.probe.publisher(Float64, 'there')
        client = ros.probe.node.create_client(Trigger, 'echo/call')
        ros.probe.until(client.service_is_ready)
        ros.probe.await_discovery('echo')
        # Meanwhile the request waits for its turn.
        run.echo.pause = 0.02
        run.echo.trouble = ValueError
        for _ in range(20):
            publisher.publish(Float64())
            answer = client.call_async(Trigger.Request())
            ros.probe.until(answer.done)
        ros.probe.until(lambda: run.echo.failures == 20)
        # rclpy would add a callback to the future at each wake-up.
        assert len(run.done._callbacks) == 1
        assert run.error is None


def test_another_rclpy_gets_the_plain_path(ros: Domain, monkeypatch: pytest.MonkeyPatch) -> None:
    executor = SingleThreadedExecutor(context=ros.probe.context)
    assert not RawMessageExecutor(executor)._plain
    assert RawMessageExecutor(executor, plain=True)._plain
    with monkeypatch.context() as patch:
        patch.setenv(raw_executor.PLAIN, '1')
        assert RawMessageExecutor(executor)._plain
    for place, name in [
        (executors, 'ConditionReachedException'),
        (raw_executor.rclpy_implementation, 'WaitSet'),
        (executors.Executor, 'wait_for_ready_callbacks'),
    ]:
        with monkeypatch.context() as patch:
            patch.delattr(place, name)
            assert RawMessageExecutor(executor)._plain
    executor.shutdown()
