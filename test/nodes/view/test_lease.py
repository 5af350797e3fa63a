"""A page takes over: the other publishers yield, and resume at its last angle when it leaves."""

import asyncio
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
import json
import signal
from time import sleep
from typing import Any

import aiohttp
from crank_motors import TWO_MOTORS
from crank_runs import make_messages, write_run
from geometry_msgs.msg import TwistStamped
from klann_ros.live.protocol import Command
from klann_ros.nodes.endpoints import LAST_MESSAGES
from klann_ros.nodes.lease import Lease
from klann_ros.nodes.service_calls import ServiceCalls
from klann_ros.nodes.view.drives import Drives, Offer
from live_browser import address
import pytest
from ros_domain import Domain, Process
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

CRANK = 'crank:/crank_angle'
WALK = 'walk:/cmd_vel'
# Of crank_node between two messages [rad].
STEP = 0.02


class Tab:
    """A page without a browser: it sends keep-alives, draws frames, and keeps the drive."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse, target: str) -> None:
        self._socket = socket
        self._target = target
        self._number = 0
        self.drive: dict[str, Any] = {}

    async def until(self, condition: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
        """Wait until the state of the drive is such."""
        while not (self.drive and condition(self.drive)):
            await self._socket.send_str('{}')
            try:
                message = await self._socket.receive(0.05)
            except asyncio.TimeoutError:
                continue
            frame = json.loads(message.data)
            await self._socket.send_json({'ack': frame['n']})
            self.drive = next(
                (d for d in frame.get('drives', ()) if d['target'] == self._target), self.drive
            )
        return self.drive

    async def command(self, do: str, **values: float) -> None:
        self._number += 1
        await self._socket.send_json(
            {'id': self._number, 'command': do, 'target': self._target, **values}
        )


def drive(
    ros: Domain, url: str, test: Callable[[Tab], Awaitable[None]], target: str = CRANK
) -> None:
    """Run a page's side in another thread, while the probe spins."""

    async def opened() -> None:
        headers = {'Origin': url.partition('/?')[0]}
        async with aiohttp.ClientSession() as session:
            socket_url = url.replace('/?', '/socket?')
            async with session.ws_connect(socket_url, headers=headers) as socket:
                await asyncio.wait_for(test(Tab(socket, target)), 60.0)

    with ThreadPoolExecutor(1) as pool:
        done = pool.submit(asyncio.run, opened())
        ros.probe.until(done.done)
        done.result()


def started(ros: Domain) -> tuple[Process, str]:
    view = ros.start('view_node', '--port', '0')
    return view, address(view)


def assert_continuous(angles: list[Float64]) -> None:
    """Find one source at a time, each beginning where the one before ended."""
    steps = [b.data - a.data for a, b in pairwise(angles)]
    assert min(steps) >= 0.0
    # One page's first message may come before its pose of the crank's last angle.
    assert max(steps) <= STEP + 1e-9


def test_a_crank_yields_to_a_page_and_resumes_where_it_is_also_after_kill_9(ros: Domain) -> None:
    angles: list[Float64] = ros.probe.listen(Float64, 'crank_angle')
    ros.solver()
    crank = ros.start('crank_node', speed=2.0, rate=100.0)
    view, url = started(ros)
    ros.probe.until(lambda: angles)

    async def take(tab: Tab) -> None:
        idle_drive = await tab.until(lambda drive: drive['publishers'] and not drive['foreign'])
        assert (idle_drive['publishers'], idle_drive['owner']) == (['/crank_node'], None)
        await tab.command('take')
        taken_drive = await tab.until(lambda drive: drive['owner'] and not drive['taking'])
        assert taken_drive['yielded'] == ['/crank_node']

    async def turn(tab: Tab) -> None:
        await take(tab)
        begin = len(angles)
        await tab.until(lambda _: len(angles) > begin + 5)
        # Another speed than the crank's own, slow enough for a late message to be a small step.
        await tab.command('spin', value=0.01)
        angle = angles[-1].data
        await tab.until(lambda _: angles[-1].data > angle + 0.005)
        await tab.command('release')
        angle = angles[-1].data
        await tab.until(lambda _: angles[-1].data > angle + 50 * STEP)

    drive(ros, url, turn)
    assert 'yields to /view_node' in crank.errors

    async def stand(tab: Tab) -> None:
        await take(tab)
        begin = len(angles)
        await tab.until(lambda _: len(angles) > begin + 5)
        view.kill()

    drive(ros, url, stand)
    angle = angles[-1].data
    ros.probe.until(lambda: angles[-1].data > angle + 20 * STEP)
    assert_continuous(angles)


def test_a_page_begins_at_the_angle_of_the_crank_where_the_solver_is_late(ros: Domain) -> None:
    angles: list[Float64] = ros.probe.listen(Float64, 'crank_angle')
    poses: list[JointState] = ros.probe.listen(JointState, 'joint_states')
    solver = ros.solver()
    ros.start('crank_node', speed=2.0, rate=100.0)
    _, url = started(ros)
    ros.probe.until(lambda: angles and poses)

    async def stand(tab: Tab) -> None:
        await tab.until(lambda drive: drive['publishers'] and not drive['foreign'])
        solver.popen.send_signal(signal.SIGSTOP)
        angle = angles[-1].data
        await tab.until(lambda _: angles[-1].data > angle + 50 * STEP)
        await tab.command('take')
        await tab.until(lambda drive: drive['owner'] and not drive['taking'])
        begin = len(angles)
        await tab.until(lambda _: len(angles) > begin + 5)

    drive(ros, url, stand)
    solver.popen.send_signal(signal.SIGCONT)
    assert_continuous(angles)


def test_a_publisher_that_cannot_yield_is_named_and_nothing_is_driven(ros: Domain) -> None:
    ros.solver()
    _, url = started(ros)
    foreign = ros.probe.publisher(Float64, 'crank_angle', subscribers=2)
    timer = ros.probe.node.create_timer(0.05, lambda: foreign.publish(Float64(data=1.0)))

    async def take(tab: Tab) -> None:
        await tab.until(lambda drive: drive['foreign'] == ['/probe'])
        await tab.command('take')
        refused = await tab.until(lambda drive: drive['reason'])
        assert refused['reason'] == '/probe still publishes and does not yield'
        assert refused['owner'] is None
        timer.cancel()
        await tab.command('take')
        await tab.until(lambda drive: drive['owner'] and not drive['taking'])
        timer.reset()
        lost = await tab.until(lambda drive: drive['owner'] is None)
        assert lost['reason'] == '/probe publishes /crank_angle as well and does not yield'

    drive(ros, url, take)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_a_walker_that_a_page_drives(ros: Domain, number: signal.Signals) -> None:
    commands: list[TwistStamped] = ros.probe.listen(TwistStamped, 'cmd_vel')
    view, url = started(ros)

    async def walk(tab: Tab) -> None:
        await tab.until(lambda drive: drive)
        await tab.command('take')
        await tab.until(lambda drive: drive['owner'] and not drive['taking'])
        await tab.command('walk', value=0.2, turn=0.1)
        await tab.until(lambda _: commands and commands[-1].twist.linear.x == 0.2)
        view.popen.send_signal(number)

    drive(ros, url, walk, WALK)
    ros.probe.until(lambda: view.popen.poll() is not None)
    assert view.wait() == 0
    ros.probe.spin(0.3)
    last = [command.twist for command in commands[-LAST_MESSAGES:]]
    assert [(twist.linear.x, twist.angular.z) for twist in last] == [(0.0, 0.0)] * LAST_MESSAGES


@pytest.mark.slow
def test_a_player_and_the_walk_of_the_simulation_yield_to_a_driver(ros: Domain) -> None:
    run = write_run(ros.folder / 'run', [make_messages(200, period=10_000_000)])
    received = {
        '/crank_angle': ros.probe.listen(Float64, 'crank_angle'),
        '/cmd_vel': ros.probe.listen(TwistStamped, 'cmd_vel'),
    }
    ros.probe.node.create_publisher(JointState, 'crank_command', 10)
    ros.start('player_node', str(run), '--loop')
    parameters = {'use_clock': True, 'real_time_factor': 4.0, 'linear': 0.1}
    ros.start('sim_node', '--ros-args', '--params-file', TWO_MOTORS, **parameters)
    for topic, messages in received.items():
        yields(ros, topic, messages)


def yields(ros: Domain, topic: str, messages: list[Any]) -> None:
    """Find that messages end while a driver holds the lease, and come again when it leaves."""
    ros.probe.until(lambda: len(messages) > 2)
    lease = Lease(ros.probe.node, topic)
    ros.probe.until(lambda: lease.announce() and lease.yielded)
    ros.probe.spin(0.1)
    messages.clear()
    for _ in range(10):
        lease.announce()
        ros.probe.spin(0.05)
    assert messages == []
    lease.release()
    ros.probe.until(lambda: messages)


def test_only_the_owner_of_a_drive_moves_it_and_only_while_it_is_there(ros: Domain) -> None:
    answers: list[tuple[bool, str]] = []
    probe = ros.probe
    angles = probe.listen(Float64, 'crank_angle')
    velocities = probe.listen(TwistStamped, 'cmd_vel')
    put = ServiceCalls(probe.node).put
    drives = Drives(probe.node, put, lambda: None, lambda _: 0.5, lambda _: None)
    topics = {'crank': '/crank_angle', 'walk': '/cmd_vel'}
    drives.offer([Offer(kind, topic, (topic,), (), ()) for kind, topic in topics.items()])

    def command(page: int, do: str, value: float = 0.0, target: str = CRANK) -> tuple[bool, str]:
        command = Command(1, do, target, value)
        drives.command(page, command, lambda *answer: answers.append(answer))
        return answers[-1]

    def is_driving() -> bool:
        drives.keep_alive(1)
        return bool(angles)

    def walks() -> bool:
        drives.keep_alive(1)
        command(1, 'take', target=WALK)
        command(1, 'walk', 0.2, WALK)
        return bool(velocities and velocities[-1].twist.linear.x)

    def stall() -> None:
        with drives._lock:
            for _ in range(12):
                drives.keep_alive(1)
                sleep(0.05)

    def stop_reason(action: Callable[[], object]) -> str:
        probe.until(walks)
        action()
        probe.until(lambda: not velocities[-1].twist.linear.x)
        return str(drives.state()[1]['reason'])

    def is_refused() -> bool:
        other.announce()
        is_taken = drives.state()[1]['reason'] == '/probe drives /cmd_vel'
        return is_taken or not command(1, 'take', target=WALK)[0]

    try:
        assert not command(1, 'turn', 1.0)[0]
        assert command(1, 'take')[0]
        probe.until(is_driving)
        refusal = 'this page does not drive it: take it over first'
        for do in ('turn', 'spin', 'release'):
            assert command(2, do, 1.0) == (False, refusal)
        assert command(1, 'turn', 0.75)[0]
        probe.until(lambda: is_driving() and angles[-1].data == 0.75)
        assert angles[0].data == 0.5
        other = Lease(probe.node, '/cmd_vel')
        probe.until(lambda: other.announce() and drives.state()[1]['elsewhere'])
        probe.until(is_refused)
        other.close()
        for reason, action in (
            ('the page fell silent', lambda: None),
            ('the page was closed', lambda: drives.disconnected(1)),
            ('view_node was stopped', stall),
        ):
            # On a busy machine the page may fall silent first.
            assert any(reason in stop_reason(action) for _ in range(5)), reason
        probe.until(walks)
    finally:
        drives.close()
    probe.until(lambda: not velocities[-1].twist.linear.x)
