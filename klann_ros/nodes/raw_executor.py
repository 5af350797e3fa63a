"""
A loop that takes raw messages itself, and leaves all else to rclpy's executor.

For every message an executor builds a wait set of all entities of a node, and wraps the callback
in a coroutine and a task, which costs more than most callbacks. Here two threads share the work:

- The *loop*, in the caller's thread, waits for the subscriptions and timers of RawCallbackGroups
  and for one guard condition. It takes the queued messages and calls the callbacks.
- The *watch* lets the executor wait for all else: services, clients, simulated time, events, other
  subscriptions and timers, new entities, the end. It hands ready entities to the loop, and pauses
  until they are done.

So all callbacks run in the caller's thread, one after the other, as in a SingleThreadedExecutor,
and every feature of rclpy keeps working, because rclpy does it.

The plain path is the executor alone, which calls the same callbacks with the same arguments: on
request, and where rclpy lacks the internals used here.
"""

from collections.abc import Callable
from contextlib import ExitStack, suppress
from itertools import chain
import os
from threading import Semaphore, Thread
from time import sleep
from types import SimpleNamespace
from typing import Any, TYPE_CHECKING

from rclpy import executors
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.timer import Timer

if TYPE_CHECKING:
    from typing_extensions import Self

# Where this environment variable is set and not empty, every loop is a plain one.
PLAIN = 'KLANN_ROS_PLAIN_LOOP'
# Messages of a topic taken in a row, so that a flood starves nothing else.
BURST = 64
# The middleware's data about a message.
Info = dict[str, Any]


class RawCallbackGroup(MutuallyExclusiveCallbackGroup):
    """
    Subscriptions and timers that a RawMessageExecutor serves while there is one.

    Subscriptions are made with `raw=True` and a callback that takes bytes and Info, no coroutine.
    Their events are the loop's too: Fast DDS signals both by one condition, so a thread that waits
    for the events wakes up for every message. Timers have a callback without arguments, and no
    coroutine either. Put nothing else into the group.

    Without `wakes` its messages are taken at the next wake-up of the loop, in the order in which
    subscriptions were made: for an input that only matters with another one. A wake-up costs more
    than most callbacks. They have no events, which would wake the loop with each message.
    """

    def __init__(self, *, wakes: bool = True) -> None:
        super().__init__()
        self.wakes = wakes
        # Whether a loop serves the group, and the executor must not.
        self.has_loop = False

    def can_execute(self, entity: Any) -> bool:
        """Return whether the executor may wait for an entity, and take its messages."""
        return not self.has_loop and bool(super().can_execute(entity))


class RawMessageExecutor:
    """
    Run the callbacks of an executor's nodes; nothing else may spin it meanwhile.

    With `plain` the executor does everything. `batch_period` is a delay after the queues are
    drained [s]: the next wake-up serves all messages of this time. It suits nodes that need no
    immediate answer and have deep queues.
    """

    def __init__(self, executor: Any, *, plain: bool = False, batch_period: float = 0.0) -> None:
        self._executor = executor
        self._batch_period = batch_period
        self._plain = plain or bool(os.environ.get(PLAIN)) or not _is_possible(executor)
        # The subscriptions and timers of the groups.
        self._raw_entities: tuple[list[Subscription], list[Timer]] = ([], [])
        self._groups: set[RawCallbackGroup] = set()
        self._context_ended = False
        # Querying the context at each message costs four locks; the watch may be too late.
        executor.context.on_shutdown(self._end_context)

    def spin_until_future_complete(self, future: Future) -> None:
        """
        Run callbacks until a future is done, or the executor is shut down.

        Errors of callbacks are raised, and ExternalShutdownException when the context ends.
        """
        if self._plain:
            _spin_plain(self._executor, future)
            return
        # A callback may have failed for that reason.
        if not self._executor.context.ok():
            raise executors.ExternalShutdownException
        self._ended = False
        self._guard = GuardCondition(None, None, context=self._executor.context)
        future.add_done_callback(self._end)
        self._adopt()  # before the executor waits for the first time
        try:
            with _ExecutorWatch(self._executor, self._guard.trigger, self._has_changed) as watch:
                while not self._ended:
                    self._take_until_ready(watch)
                    # A delay for each of them would hold up a burst of parameter events.
                    watch.run(BURST if self._batch_period else 1)
        except executors.ShutdownException:
            pass
        finally:
            future.remove_done_callback(self._end)
            for group in self._groups:
                group.has_loop = False
            self._guard.destroy()

    def _end(self, _: Future) -> None:
        self._ended = True
        with suppress(InvalidHandle):
            self._guard.trigger()

    def _end_context(self) -> None:
        self._context_ended = True

    def _has_changed(self) -> bool:
        return self._find_raw_entities() != self._raw_entities

    def _find_raw_entities(self) -> tuple[list[Subscription], list[Timer]]:
        subscriptions: list[Subscription] = []
        timers: list[Timer] = []
        for node in self._executor.get_nodes():
            subscriptions += filter(_is_raw, node.subscriptions)
            timers += filter(_is_raw, node.timers)
        return subscriptions, timers

    def _adopt(self) -> None:
        self._raw_entities = self._find_raw_entities()
        for entity in chain(*self._raw_entities):
            self._groups.add(entity.callback_group)
            entity.callback_group.has_loop = True

    def _take_until_ready(self, watch: '_ExecutorWatch') -> None:
        """Take messages until the watch has a ready entity, or the loop ends."""
        context = self._executor.context.handle
        guard = self._guard.handle
        with ExitStack() as stack:
            handles, events, takes, timers = self._hold(stack)
            stack.enter_context(context)
            wait_set = rclpy_implementation.WaitSet(
                len(handles), 1, len(timers), 0, 0, len(events), context
            )
            while True:
                try:
                    _fill(wait_set, guard, handles, timers, events)
                except InvalidHandle:
                    # Another thread has destroyed one of them: start again without it.
                    return
                wait_set.wait(-1)
                if self._context_ended:
                    raise executors.ExternalShutdownException
                self._serve(takes, events, wait_set)
                _call(timers, wait_set)
                # Last, so that messages have a turn between any two other callbacks.
                if watch.is_ready or self._ended:
                    return

    def _serve(self, takes: list[Any], events: list[Any], wait_set: Any) -> None:
        """Take messages, and run events, whose query is expensive."""
        if not self._batch_period:
            if not _take(takes, wait_set):
                _run_events(events, wait_set)
            return
        # Publishers must be known before their messages; after a batching delay there are always
        # messages, which must not delay the events.
        _run_events(events, wait_set)
        if _take(takes, wait_set) < BURST:
            sleep(self._batch_period)

    def _hold(self, stack: ExitStack) -> tuple[list[Any], list[Any], list[Any], list[Any]]:
        """Return subscriptions' handles and events, their take calls, and timers, all held."""
        self._adopt()
        handles: list[Any] = []
        events: list[Any] = []
        takes: list[Any] = []
        timers: list[Any] = []
        raw_subscriptions, raw_timers = self._raw_entities
        for timer in raw_timers:
            with suppress(InvalidHandle):  # another thread has just destroyed it
                stack.enter_context(timer.handle)
                timers.append((timer.handle, timer.callback))
        for subscription in raw_subscriptions:
            handle = subscription.handle
            with suppress(InvalidHandle):  # another thread has just destroyed it
                stack.enter_context(handle)
                # Place in the wait set.
                index = len(handles) if subscription.callback_group.wakes else None
                if index is not None:
                    handles.append(handle)
                take = handle.take_message
                takes.append((index, take, subscription.msg_type, subscription.callback))
                for event in subscription.event_handlers:
                    stack.enter_context(event)
                    events.append(event)
        return handles, events, takes, timers


class _ExecutorWatch:
    """
    Wait as an executor does, and hand ready entities to another thread, one at a time.

    The executor's own `wait_for_ready_callbacks` waits, as in a MultiThreadedExecutor. It pauses
    until the found entity was run. `wake` is called, by this thread, whenever `is_ready` becomes
    true; `condition` makes it true with nothing to run, and is checked at each wake-up of the
    executor, so also when entities come or go.
    """

    def __init__(
        self, executor: Any, wake: Callable[[], object], condition: Callable[[], bool]
    ) -> None:
        # Whether `run` has something to do.
        self.is_ready = False
        self._executor = executor
        self._wake = wake
        self._condition = condition
        self._stopped = False
        self._task: Any = None
        self._go_on = Semaphore(0)
        self._thread = Thread(target=self._watch, name='watch', daemon=True)

    def __enter__(self) -> 'Self':
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._stopped = True
        self._go_on.release()
        self._executor.wake()
        self._thread.join()
        # The executor does not find ready entities again.
        if kind is None and not isinstance(self._task, Exception):
            self.run()

    def run(self, limit: int = 1) -> None:
        """Run this many ready callbacks at most; raise the error of one, or of a shutdown."""
        if not self.is_ready:
            return
        task = self._task
        self._task = None
        self.is_ready = False
        if isinstance(task, Exception):
            raise task
        if task is not None:
            _run(task)
        # The watch still pauses, so this thread may use the executor.
        _run_ready(self._executor, limit - 1)
        self._go_on.release()

    def _watch(self) -> None:
        """Wait for ready entities in a thread, and let the loop handle each before the next."""

        def is_over() -> bool:
            return self._stopped or self._condition()

        while not self._stopped:
            try:
                # With other arguments the executor would forget the other ready entities, and
                # find the first one again: a busy subscription would starve what comes later.
                self._task, *_ = self._executor.wait_for_ready_callbacks(None, None, is_over)
            except executors.ConditionReachedException:
                self._task = None
            except Exception as error:  # raised by the other thread
                self._task = error
            self.is_ready = True
            self._wake()
            self._go_on.acquire()


def _run(task: Any) -> None:
    """Run a callback of the executor; raise its error."""
    task()
    task.result()


def _run_ready(executor: Any, limit: int) -> None:
    """Run this many ready callbacks of an executor at most, without waiting for any."""
    count = last_count = 0
    while count < limit:
        try:
            task, *_ = executor.wait_for_ready_callbacks(0.0)
        except executors.TimeoutException:  # noqa: PERF203, RUF100 - after the ready ones
            if count == last_count:
                return
            last_count = count
        else:
            _run(task)
            count += 1


def _spin_plain(executor: Any, future: Future) -> None:
    """Let an executor run callbacks until a future is done, or the executor is shut down."""

    def wake(_: Future) -> None:
        executor.wake()

    # rclpy adds a callback to the future at each wake-up, and keeps them all: 264 bytes each, 2 GB
    # a day at 100 Hz. Here `wake` alone is one.
    polled = SimpleNamespace(
        done=future.done, cancelled=future.cancelled, add_done_callback=lambda _: None
    )
    future.add_done_callback(wake)
    try:
        executor.spin_until_future_complete(polled)
    finally:
        future.remove_done_callback(wake)


def _is_raw(entity: Any) -> bool:
    return isinstance(entity.callback_group, RawCallbackGroup)


def _fill(
    wait_set: Any, guard: Any, handles: list[Any], timers: list[Any], events: list[Any]
) -> None:
    wait_set.clear_entities()
    wait_set.add_guard_condition(guard)
    for timer, _ in timers:
        wait_set.add_timer(timer)
    for handle in handles:
        wait_set.add_subscription(handle)
    for event in events:
        event.add_to_wait_set(wait_set)


def _take(takes: list[Any], wait_set: Any) -> int:
    """Take queued messages; return the count of the most frequent topic."""
    max_count = 0
    for index, take, kind, callback in takes:
        # A take without a message costs more than this query.
        if index is not None and not wait_set.is_ready('subscription', index):
            continue
        count = 0
        while count < BURST and (message := take(kind, True)) is not None:  # raw
            callback(*message)
            count += 1
        max_count = max(max_count, count)
    return max_count


def _call(timers: list[Any], wait_set: Any) -> None:
    for index, (timer, callback) in enumerate(timers):
        # One of the callbacks before may have cancelled it.
        if wait_set.is_ready('timer', index) and timer.is_timer_ready():
            timer.call_timer()
            callback()


def _run_events(events: list[Any], wait_set: Any) -> None:
    for event in events:
        if event.is_ready(wait_set):
            status = None
            with suppress(InvalidHandle):  # another thread has just destroyed it
                status = event.take_data()
            if status is not None:
                event.callback(status)


def _is_possible(executor: Any) -> bool:
    return (
        hasattr(executor, 'wait_for_ready_callbacks')
        and hasattr(executors, 'ConditionReachedException')
        and hasattr(rclpy_implementation, 'WaitSet')
        and hasattr(rclpy_implementation.Subscription, 'take_message')
        and hasattr(rclpy_implementation.Timer, 'call_timer')
    )
