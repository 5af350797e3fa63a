"""A page takes over: the other publishers yield, and resume where the crank is when it leaves."""

import asyncio
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
import json
from pathlib import Path
from typing import Any

import aiohttp
from crank_runs import make_messages, write_run
from geometry_msgs.msg import TwistStamped
from klann_ros.nodes.lease import Lease
from live_browser import address
from ros_world import Process, World
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

WALKER = str(Path(__file__).resolve().parents[3] / 'config' / 'walker6_two_motors.yaml')
CRANK = 'crank:/crank_angle'
# Of crank_node between two messages [rad].
STEP = 0.02


class Tab:
    """A page without a browser: it says that it is there, draws frames, and keeps the drive."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
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
                (d for d in frame.get('drives', ()) if d['what'] == CRANK), self.drive
            )
        return self.drive

    async def command(self, do: str, **values: float) -> None:
        self._number += 1
        await self._socket.send_json({'id': self._number, 'do': do, 'what': CRANK, **values})


def drive(ros: World, url: str, test: Callable[[Tab], Awaitable[None]]) -> None:
    """Run a page's side in another thread, while the probe spins."""

    async def opened() -> None:
        headers = {'Origin': url.partition('/?')[0]}
        async with aiohttp.ClientSession() as session:
            target = url.replace('/?', '/socket?')
            async with session.ws_connect(target, headers=headers) as socket:
                await asyncio.wait_for(test(Tab(socket)), 60.0)

    with ThreadPoolExecutor(1) as pool:
        done = pool.submit(asyncio.run, opened())
        ros.probe.until(done.done)
        done.result()


def started(ros: World) -> tuple[Process, str]:
    view = ros.start('view_node', '--port', '0')
    return view, address(view)


def assert_continuous(angles: list[Float64]) -> None:
    """Find one source at a time, each beginning where the one before ended."""
    steps = [b.data - a.data for a, b in pairwise(angles)]
    assert min(steps) >= 0.0
    # One page's first message may come before its pose of the crank's last angle.
    assert max(steps) <= STEP + 1e-9


def test_a_crank_yields_to_a_page_and_resumes_where_it_is_also_after_kill_9(ros: World) -> None:
    angles: list[Float64] = ros.probe.listen(Float64, 'crank_angle')
    ros.solver()
    crank = ros.start('crank_node', speed=2.0, rate=100.0)
    view, url = started(ros)
    ros.probe.until(lambda: angles)

    async def take(tab: Tab) -> None:
        before = await tab.until(lambda drive: drive['publishers'] and not drive['foreign'])
        assert (before['publishers'], before['owner']) == (['/crank_node'], None)
        await tab.command('take')
        taken = await tab.until(lambda drive: drive['owner'] and not drive['taking'])
        assert taken['yielded'] == ['/crank_node']

    async def turn(tab: Tab) -> None:
        await take(tab)
        begin = len(angles)
        await tab.until(lambda _: len(angles) > begin + 5)
        # Another speed than the crank's own, slow enough for a late message to be a small step.
        await tab.command('spin', value=0.01)
        here = angles[-1].data
        await tab.until(lambda _: angles[-1].data > here + 0.005)
        await tab.command('release')
        here = angles[-1].data
        await tab.until(lambda _: angles[-1].data > here + 50 * STEP)

    drive(ros, url, turn)
    assert 'yields to /view_node' in crank.errors

    async def stand(tab: Tab) -> None:
        await take(tab)
        begin = len(angles)
        await tab.until(lambda _: len(angles) > begin + 5)
        view.kill()

    drive(ros, url, stand)
    here = angles[-1].data
    ros.probe.until(lambda: angles[-1].data > here + 20 * STEP)
    assert_continuous(angles)


def test_what_cannot_yield_is_named_and_nothing_is_driven_beside_it(ros: World) -> None:
    ros.solver()
    _, url = started(ros)
    foreign = ros.probe.publisher(Float64, 'crank_angle', subscribers=2)
    timer = ros.probe.node.create_timer(0.05, lambda: foreign.publish(Float64(data=1.0)))

    async def take(tab: Tab) -> None:
        await tab.until(lambda drive: drive['foreign'] == ['/probe'])
        await tab.command('take')
        refused = await tab.until(lambda drive: drive['why'])
        assert refused['why'] == '/probe still publishes and does not yield'
        assert refused['owner'] is None
        timer.cancel()
        await tab.command('take')
        await tab.until(lambda drive: drive['owner'] and not drive['taking'])
        timer.reset()
        lost = await tab.until(lambda drive: drive['owner'] is None)
        assert lost['why'] == '/probe publishes /crank_angle as well and does not yield'

    drive(ros, url, take)


def test_a_player_and_the_walk_of_the_simulation_yield_to_a_driver(ros: World) -> None:
    run = write_run(ros.folder / 'run', [make_messages(200, period=10_000_000)])
    heard = {
        '/crank_angle': ros.probe.listen(Float64, 'crank_angle'),
        '/cmd_vel': ros.probe.listen(TwistStamped, 'cmd_vel'),
    }
    ros.probe.node.create_publisher(JointState, 'crank_command', 10)
    ros.start('player_node', str(run), '--loop')
    given = ('use_clock:=true', 'real_time_factor:=4.0', 'linear:=0.1')
    options = [word for value in given for word in ('-p', value)]
    ros.start_by([], 'sim_node', '--ros-args', '--params-file', WALKER, *options)
    for topic, messages in heard.items():
        yields(ros, topic, messages)


def yields(ros: World, topic: str, messages: list[Any]) -> None:
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
