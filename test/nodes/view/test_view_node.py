"""The live page in a real browser with a real solver: it shows the leg, and drives on request."""

from collections.abc import Callable, Iterator
import math
import socket
from typing import Any

from browser import find
from browser_page import ALL_RULES
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fake_live_state import EVIL
from geometry_msgs.msg import TwistStamped
from klann_ros.kinematics import KlannLeg
from live_browser import address, DRAWN, Live, MAX_WAIT
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters
from ros_domain import Domain
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

pytest.importorskip('playwright')
if find() is None:
    pytest.skip('no Chromium: apt-get install chromium', allow_module_level=True)

NEAR = 1e-6


@pytest.fixture(scope='module')
def url(module_ros: Domain) -> str:
    module_ros.solver()
    return address(module_ros.start('view_node', '--port', '0'))


@pytest.fixture(scope='module')
def turn(module_ros: Domain, url: str) -> Iterator[Callable[[float], None]]:
    """Return what turns the crank, from elsewhere; a solver and a page are there."""
    assert url
    publisher = module_ros.probe.publisher(Float64, 'crank_angle', subscribers=2)
    yield lambda alpha: publisher.publish(Float64(data=alpha))
    module_ros.probe.node.destroy_publisher(publisher)


@pytest.fixture
def live(module_ros: Domain, url: str, browser: Any) -> Iterator[Live]:
    live = Live(module_ros, url, browser)
    yield live
    live.page.close()


@pytest.fixture
def moving(live: Live, turn: Callable[[float], None]) -> Live:
    """Return a page that has drawn a pose."""
    turn(0.1)

    def is_drawn() -> bool:
        if live.page.evaluate("document.getElementById('picture').dataset.x === undefined"):
            turn(0.1)
            return False
        return True

    live.ros.probe.until(is_drawn)
    return live


def test_the_leg_is_drawn_where_it_was_published(
    moving: Live, turn: Callable[[float], None]
) -> None:
    states = moving.ros.probe.listen(JointState, 'joint_states')
    moving.ros.probe.await_publishers('joint_states')
    # The next page begins where the last one ends.
    for alpha in (1.0, 2.5, -3.0, 700.0, 0.1):
        states.clear()
        turn(alpha)
        moving.ros.probe.until(lambda: states)
        position = list(states[-1].position)
        moving.until(f"document.getElementById('picture').dataset.x === {as_drawn(position)!r}")
        _, points = moving.drawn()
        assert np.abs(points - KlannLeg().solve(alpha).points).max() < NEAR
    assert moving.errors == []


def as_drawn(numbers: list[float]) -> str:
    """Return numbers as JavaScript writes them."""
    return ' '.join(repr(number).removesuffix('.0') for number in numbers)


def is_publishing(ros: Domain) -> bool:
    infos = ros.probe.node.get_publishers_info_by_topic('/crank_angle')
    return any(info.node_name == 'view_node' for info in infos)


def test_the_page_drives_on_request_and_stops_when_closed(moving: Live) -> None:
    ros, page = moving.ros, moving.page
    assert not is_publishing(ros)
    assert '/probe cannot yield' in moving.text('#crank-state')
    assert page.locator('#angle').is_disabled()

    def has_begun() -> bool:
        text = moving.text('#crank-state')
        return (
            'This page drives /crank_angle' in text
            and '/probe cannot yield, but is silent' in text
            and page.locator('#angle').is_enabled()
            and is_publishing(ros)
        )

    def is_true(expression: str) -> Callable[[], bool]:
        return lambda: bool(page.evaluate(expression))

    def set_speed() -> None:
        page.locator('#speed').fill('345', timeout=MAX_WAIT)

    moving.press('#take')
    moving.drive(lambda: None, has_begun)
    moving.drive(
        lambda: page.locator('#angle').fill('60', timeout=MAX_WAIT),
        is_true('Math.abs(live.trackOf(live.leg).x[0] - Math.PI / 3) < 1e-9'),
    )
    moving.drive(set_speed, is_true('live.trackOf(live.leg).x[0] > 3'))
    moving.drive(set_speed, lambda: moving.text('#turning').startswith('34'))
    assert moving.text('#speed-text') == '345°/s'
    # On a phone the leg stays in sight while its crank is driven.
    page.set_viewport_size({'width': 390, 'height': 844})

    def is_in_sight() -> bool:
        box = page.locator('#picture').bounding_box()
        return bool(box['y'] >= 0 and box['y'] + box['height'] <= 844)

    moving.drive(
        lambda: page.locator('#halt').evaluate("(node) => node.scrollIntoView({block: 'start'})"),
        is_in_sight,
    )
    moving.drive(
        lambda: page.locator('#halt').evaluate('(node) => node.click()'),
        is_true("document.getElementById('speed').value === '0'"),
    )
    moving.take(back=True)
    ros.probe.until(lambda: not is_publishing(ros))
    moving.drive(set_speed, lambda: is_publishing(ros))
    page.close()
    ros.probe.until(lambda: not is_publishing(ros))
    assert moving.errors == []


def test_nothing_is_offered_where_nobody_yields(
    moving: Live, turn: Callable[[float], None]
) -> None:
    def is_refused() -> bool:
        turn(0.1)
        text = moving.text('#crank-state')
        return 'while it sends' in text and moving.page.locator('#take').is_disabled()

    moving.ros.probe.until(is_refused)
    moving.until(
        "document.getElementById('take').textContent === 'Drive' && !live.crank.button.disabled"
    )
    assert 'cannot yield, but is silent' in moving.text('#crank-state')
    assert moving.text('#speed-text') == 'none'
    moving.until(
        "/leg_description\\s*latched/.test(document.getElementById('topics').textContent)"
    )


def test_a_second_page_that_takes_over_is_announced_in_the_first_only(
    moving: Live, url: str, browser: Any
) -> None:
    second, spectator = (Live(moving.ros, url, browser) for _ in range(2))
    moving.drive(
        lambda: None, lambda: second.text('#crank-state').startswith('Another page drives')
    )

    def is_announced() -> bool:
        text = moving.text('#crank-state')
        # One of them may have lost the drive before.
        if not second.has() or text.startswith('Another page drives'):
            moving.take()
            second.take()
        return text.startswith('Another page has taken')

    moving.ros.probe.until(is_announced)
    second.page.close()
    for page in (moving, spectator):
        page.until('live.crank.report.owner === null')
        assert page.text('#crank-state').startswith('Published by /probe')
    spectator.page.close()
    assert moving.errors == []


def test_a_silent_page_loses_its_drive(moving: Live) -> None:
    moving.drive(lambda: None, lambda: is_publishing(moving.ros))
    # As when its machine sleeps: the socket stays, and nothing comes.
    moving.page.evaluate('live.connection.send = () => {}')
    moving.ros.probe.until(lambda: not is_publishing(moving.ros))


def test_lengths_are_set_or_refused_with_the_reason(moving: Live) -> None:
    field = moving.page.get_by_label('l_ab [mm]')
    field.fill('5000')
    field.blur()
    moving.until("document.getElementById('lengths-state').textContent.startsWith('Refused')")
    assert 'no crank angle' in moving.text('#lengths-state')
    assert field.input_value() == '120'
    fields = (('l_gh [mm]', '450.7'), ('l_gh [mm]', '430'), ('angle_fgh [°]', '35'))
    for label, number in (*fields, ('x_d [mm]', '')):
        shown_field = moving.page.get_by_label(label)
        shown_field.fill(number)
        shown_field.blur()
        told = number or 'a number is missing'
        moving.until(f"document.getElementById('lengths-state').textContent.includes('{told}')")
        assert 'l_ab' not in moving.text('#lengths-state')
    names = ['l_ab', 'l_gh', 'x_d', 'angle_fgh']
    response = moving.ros.probe.call(
        GetParameters, '/solver_node/get_parameters', GetParameters.Request(names=names)
    )
    values = [value.double_value for value in response.values]
    assert values == [0.12, 0.43, 0.35, math.radians(35.0)]
    # What is drawn is of the lengths that are.
    moving.until('live.leg.solver.lengths.find((one) => one.name === "l_gh").value === 0.43')
    assert moving.errors == []


def test_foreign_texts_are_never_markup(moving: Live) -> None:
    probe = moving.ros.probe
    diagnostics = probe.node.create_publisher(DiagnosticArray, '/diagnostics', 10)
    states = probe.node.create_publisher(JointState, 'others/joint_states', 10)
    status = DiagnosticStatus(level=b'\x02', name=EVIL, message=EVIL)
    names = [f'{EVIL}/{joint}' for joint in KlannLeg().joint_names]
    pose = KlannLeg().solve(1.0)
    state = JointState(name=names, position=[float(x) for x in pose.joints])

    def is_shown() -> bool:
        diagnostics.publish(DiagnosticArray(status=[status]))
        states.publish(state)
        text = moving.text('main')
        return text.count('<img') >= 3

    probe.until(is_shown)
    assert moving.page.locator('img').count() == 0
    moving.press('#legs button:last-child')
    moving.until("document.getElementById('picture-text').textContent.includes('<img')")
    assert 'publishes no lengths' in moving.text('#picture-note')
    assert moving.errors == []
    probe.node.destroy_publisher(diagnostics)
    probe.node.destroy_publisher(states)


def test_a_walker_is_steered_by_keys_and_stops_when_the_page_closes(moving: Live) -> None:
    commands: list[TwistStamped] = moving.ros.probe.listen(TwistStamped, 'cmd_vel')
    moving.until("!document.getElementById('walk-card').hidden")
    page = moving.page
    keys = ('ArrowUp', 'a')
    moving.drive(lambda: None, lambda: commands, 'walk')
    assert commands[-1].twist.linear.x == 0.0

    def press() -> None:
        page.locator('#walk-state').click(timeout=MAX_WAIT)
        for key in keys:
            # The browser repeats a key that is down already.
            page.keyboard.up(key)
            page.keyboard.down(key)

    def is_steered() -> bool:
        twist = commands[-1].twist
        down = [label.strip() for label in page.locator('.keys .down').all_text_contents()]
        return (twist.linear.x, twist.angular.z, down) == (0.25, 0.8, ['↑W', '←A'])

    moving.drive(press, is_steered, 'walk')
    moving.page.close()
    moving.ros.probe.until(
        lambda: (commands[-1].twist.linear.x, commands[-1].twist.angular.z) == (0.0, 0.0)
    )


def test_a_recorder_and_a_player_have_buttons(moving: Live) -> None:
    called: list[str] = []
    recorder, player = (
        moving.ros.probe.add_node(n) for n in ('made_up_recorder', 'made_up_player')
    )

    def offer(node: Any, name: str, *, is_done: bool = True) -> None:
        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            called.append(f'{node.get_name()} {name}')
            response.success = is_done
            response.message = f'said by {name} {EVIL}'
            return response

        node.create_service(Trigger, f'~/{name}', answer)

    for name in ('pause', 'resume', 'split'):
        offer(recorder, name, is_done=name != 'split')
    for name in ('pause', 'resume', 'step'):
        offer(player, name)
    for name, value in {'length': 9.0, 'position': 1.5, 'rate': 2.0}.items():
        player.declare_parameter(name, value)
    moving.until("document.querySelectorAll('#machines .card').length === 2")
    cards = moving.page.locator('#machines .card')
    card_of = {
        'recorder': cards.filter(has_text='Recorder'),
        'player': cards.filter(has_text='Player'),
    }
    card_of['recorder'].get_by_role('button', name='Pause').click()
    moving.ros.probe.until(lambda: 'made_up_recorder pause' in called)
    card_of['recorder'].get_by_role('button', name='New file').click()
    moving.ros.probe.until(lambda: 'Refused: said by split' in card_of['recorder'].text_content())
    card_of['player'].get_by_role('button', name='One message on').click()
    moving.ros.probe.until(lambda: 'made_up_player step' in called)
    moving.ros.probe.until(lambda: '1.50 s' in card_of['player'].text_content())
    card_of['player'].locator('input').evaluate(
        "(node) => { node.value = 4; node.dispatchEvent(new Event('change')); }"
    )
    moving.ros.probe.until(lambda: player.get_parameter('position').value == 4.0)
    assert moving.page.locator('img').count() == 0
    assert moving.errors == []


def test_a_walker_is_seen_from_the_side_and_from_above(moving: Live) -> None:
    probe = moving.ros.probe
    mounts = {f'{leg}.mount_xyz': [0.0, y, 0.3] for leg, y in (('left', 0.2), ('right', -0.2))}
    phases = {'left.phase': 1.0, 'right.phase': 4.0}
    moving.ros.solve('-r', '__ns:=/walker', legs='[left, right]', **mounts, **phases)
    crank = probe.publisher(Float64, 'walker/crank_angle')
    poses = [KlannLeg().solve(alpha) for alpha in phases.values()]

    def is_shown() -> bool:
        crank.publish(Float64(data=0.0))
        return bool(
            moving.page.evaluate(
                "document.getElementById('view-flat').click();"
                "!document.querySelector('[data-of=walker]').hidden && "
                "[...document.querySelectorAll('#above circle.joint')]"
                ".every((node) => node.getAttribute('cx'))"
            )
        )

    probe.until(is_shown)
    odometry = probe.node.create_publisher(Odometry, 'walker/odom', 10)
    grounds = "[...document.querySelectorAll('.ground')].map((line) => line.getAttribute('d'))"

    def is_at(x: float) -> bool:
        message = Odometry()
        message.pose.pose.position.x, message.pose.pose.orientation.w = x, 1.0
        odometry.publish(message)
        crank.publish(Float64(data=0.0))
        return f'x {x:.2f} m' in moving.text('#odometry')

    probe.until(lambda: is_at(0.0))
    first_grounds = moving.page.evaluate(grounds)
    probe.until(lambda: is_at(0.03))
    # Seen from both sides the ground has moved back under the body.
    assert all(a != b for a, b in zip(first_grounds, moving.page.evaluate(grounds), strict=True))
    box = moving.page.locator('#above').bounding_box()
    assert box['y'] + box['height'] <= 900
    probe.node.destroy_publisher(odometry)
    drawn = {
        view: moving.page.eval_on_selector(
            f'#{view}', DRAWN.replace("svg.dataset.x.split(' ').map(Number)", '0')
        )['points']
        for view in ('side', 'above')
    }
    expected = np.array([point for pose in poses for point in pose.points])
    ys = np.repeat([0.2, -0.2], 8)
    side = np.column_stack([expected[:, 0], expected[:, 1] + 0.3])
    assert np.abs(np.array(drawn['side']) - side).max() < NEAR
    assert np.abs(np.array(drawn['above']) - np.column_stack([expected[:, 0], ys])).max() < NEAR
    assert moving.errors == []


@pytest.mark.parametrize(
    ('scheme', 'width'),
    [pytest.param('light', 1280, marks=pytest.mark.slow), ('dark', 390)],
)
def test_axe_finds_no_barrier(moving: Live, scheme: str, width: int) -> None:
    axe = pytest.importorskip('axe_playwright_python.sync_playwright')
    moving.ros.probe.listen(TwistStamped, 'cmd_vel')
    moving.until("!document.getElementById('walk-card').hidden")
    moving.page.emulate_media(color_scheme=scheme)
    moving.page.set_viewport_size({'width': width, 'height': 800})
    violations = axe.Axe().run(moving.page, options=ALL_RULES).response['violations']
    assert [violation['id'] for violation in violations] == []
    assert moving.page.evaluate('document.documentElement.scrollWidth <= innerWidth')
    assert moving.page.eval_on_selector('.scrolls', 'node => node.scrollWidth <= node.clientWidth')


def test_read_only_drives_nothing_and_ends_orderly_with_open_pages(
    module_ros: Domain, browser: Any
) -> None:
    process = module_ros.start_by(
        [], 'view_node', *('--port', '0', '--read-only', '--ros-args', '-r', '__node:=looker')
    )
    url = address(process)
    page = browser.new_page()
    page.goto(url)
    probe = module_ros.probe
    probe.until(lambda: page.locator('#state-title').text_content() != 'Connecting')
    assert page.locator('#take').is_disabled()
    probe.until(lambda: 'looker' in probe.node.get_node_names())
    topics = dict(probe.node.get_publisher_names_and_types_by_node('looker', '/'))
    # What every node of rclpy has, which speaks of its own parameters.
    assert set(topics) == {'/parameter_events'}
    assert process.stop() == 0
    assert 'Traceback' not in process.errors
    probe.until(lambda: str(page.locator('#state-title').text_content()) == 'No connection')
    page.close()


def test_a_refused_start_is_one_line(module_ros: Domain) -> None:
    with socket.socket() as listener:
        listener.bind(('127.0.0.1', 0))
        listener.listen()
        port = listener.getsockname()[1]
        refusals: dict[tuple[str, ...], tuple[int, str]] = {
            ('--port', str(port)): (1, f'port {port}'),
            ('--runs', '/nowhere', '--port', '0'): (1, '--runs /nowhere is no folder'),
            ('--port', '70000'): (2, 'within 0 .. 65535'),
        }
        started = {
            arguments: module_ros.start_by([], 'view_node', *arguments) for arguments in refusals
        }
        # Its address cannot be printed.
        to_full_disk = ['sh', '-c', 'exec "$0" "$@" > /dev/full']
        started['full',] = module_ros.start_by(to_full_disk, 'view_node', '--port', '0')
        refusals['full',] = (1, 'view_node: [Errno 28] No space left on device')
        for arguments, (code, reason) in refusals.items():
            process = started[arguments]
            assert process.wait() == code
            last = process.errors.strip().splitlines()[-1]
            assert reason in last
            assert 'Traceback' not in process.errors
