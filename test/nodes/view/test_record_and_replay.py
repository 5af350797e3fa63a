"""A real recorder and a real player by the live page's buttons, and what is drawn of a run."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from browser import find
from domain import own_domain
from klann_ros.kinematics import AnyLeg, KlannGeometry, KlannLeg, LinkageLeg, shipped_linkage
from klann_ros.kinematics.linkage.file import SHIPPED
from klann_ros.log import open_log
from live_browser import address, Live
import numpy as np
import pytest
from ros_domain import open_domain
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

pytest.importorskip('playwright')
if find() is None:
    pytest.skip('no Chromium: apt-get install chromium', allow_module_level=True)

NEAR = 1e-6
GEOMETRY = KlannGeometry(**{**KlannGeometry.sem104().as_dict(), 'l_gh': 0.61})
# By the topics of their poses: what is solved, recorded and played.
LEGS: dict[str, AnyLeg] = {
    '/joint_states': KlannLeg(GEOMETRY),
    '/other/joint_states': LinkageLeg(shipped_linkage('jansen')),
}
ANGLES = np.linspace(0.5, 2.0, 31)


class Machine:
    """A card of the page: a recorder or a player."""

    def __init__(self, live: Live, kind: str) -> None:
        self.live = live
        self.card = live.page.locator('#machines .card').filter(has_text=kind)
        live.ros.probe.until(self.card.count)

    def await_text(self, text: str) -> None:
        self.live.ros.probe.until(lambda: text in self.card.text_content())

    def press(self, name: str) -> None:
        self.card.get_by_role('button', name=name, exact=True).click()


@pytest.fixture(scope='module')
def live(tmp_path_factory: pytest.TempPathFactory, browser: Any) -> Iterator[Live]:
    folder = tmp_path_factory.mktemp('replay')
    with own_domain() as domain, open_domain(domain, folder) as ros:
        page = Live(ros, address(ros.start('view_node', '--port', '0')), browser)
        yield page
        page.page.close()


@pytest.fixture(scope='module')
def recorded_run(live: Live) -> Path:
    """Return a run of two legs, made by the page's buttons."""
    ros = live.ros
    path = ros.folder / 'run'
    linkage = ros.folder / 'jansen.yaml'
    linkage.write_text((SHIPPED / 'jansen.yaml').read_text())
    solvers = [
        ros.start('solver_node', l_gh=0.61),
        ros.start('solver_node', '--ros-args', '-r', '__ns:=/other', '-p', f'linkage:={linkage}'),
    ]
    topics = '[joint_states, other/joint_states, crank_angle, motor/joint_states]'
    recorder = ros.start('recorder_node', output=path, topics=topics)
    cranks = [
        ros.probe.publisher(Float64, name, subscribers=count)
        for name, count in (('crank_angle', 3), ('other/crank_angle', 2))
    ]

    # Joint states without a leg, as of the cranks of a walker.
    motor = ros.probe.publisher(JointState, 'motor/joint_states')

    def turn() -> bool:
        motor.publish(JointState(name=['motor'], position=[0.0]))
        for crank in cranks:
            for angle in ANGLES:
                crank.publish(Float64(data=float(angle)))
        ros.probe.spin(0.1)
        return False

    card = Machine(live, 'Recorder /recorder_node')
    ros.probe.until(lambda: turn() or 'messages written, 0 lost' in card.card.text_content())
    ros.probe.until(lambda: turn() or written(card) > 0)
    card.press('Pause')
    card.await_text('Paused: ')
    paused = written(card)
    turn()
    card.press('New file')
    card.await_text('run_1.mcap')
    assert written(card) == paused
    card.press('Resume')
    card.await_text('Recording: ')
    ros.probe.until(lambda: turn() or written(card) > paused)
    for process in (recorder, *solvers):
        assert process.stop() == 0
    for publisher in (*cranks, motor):
        ros.probe.node.destroy_publisher(publisher)
    return path


def written(card: Machine) -> int:
    """Return how many messages a recorder has written, as the page shows."""
    words = str(card.card.text_content()).split(' messages written')[0]
    return int(words.rpartition(' ')[2].replace(',', ''))


@pytest.mark.slow
def test_the_buttons_of_a_recorder_make_a_run(live: Live, recorded_run: Path) -> None:
    names = {path.name for path in recorded_run.glob('*.mcap')}
    assert names == {'run_0.mcap', 'run_1.mcap'}
    with open_log(recorded_run) as log:
        assert {topic.name for topic in log.topics} >= set(LEGS)
    assert live.errors == []


def test_a_replay_is_played_by_its_buttons_and_drawn_with_its_own_lengths(
    live: Live, recorded_run: Path
) -> None:
    ros, page = live.ros, live.page
    player = ros.start(
        'player_node', str(recorded_run), '--start-paused', '--loop', '--delay', '0'
    )
    card = Machine(live, 'Player /player_node')
    # The recorder has ended, and offers nothing any more.
    ros.probe.until(lambda: page.locator('#machines .card').count() == 1)
    live.until(
        'live.legs.length > 1 && live.legs.every((leg) => leg.solver.does === "replayed by")'
    )
    card.await_text(' s long')
    page.locator('#machines input').evaluate(
        "(node) => { node.value = node.max / 2; node.dispatchEvent(new Event('change')); }"
    )
    card.await_text('Done.')
    ros.probe.until(lambda: shown_position(card) > 0.0)
    first_position = shown_position(card)
    card.press('One message on')
    card.await_text('one message on, at')
    ros.probe.until(lambda: shown_position(card) > first_position)
    card.press('Resume')
    card.await_text('playing from')
    live.until('live.legs.length === 2')
    live.until('live.tracks.every((track) => track.points)')
    card.press('Pause')
    card.await_text('paused at')
    assert page.locator('#legs button').all_text_contents() == list(LEGS)
    for topic, leg in LEGS.items():
        page.evaluate(
            f'live.choose(live.legs.find((leg) => leg.solver.topics.includes("{topic}")).key)'
        )
        assert f'replayed by /player_node on {topic}' in live.text('#subtitle')
        assert page.locator('#picture-note').is_hidden()
        live.until(
            "document.getElementById('picture').dataset.x === live.trackOf(live.leg).x.join(' ')"
        )
        x, points = live.drawn()
        assert np.abs(ANGLES - x[0]).min() < NEAR
        assert np.abs(points - leg.solve(x[0]).points).max() < NEAR
    assert page.locator('#take').is_disabled()
    assert player.stop() == 0
    live.until("document.getElementById('subtitle').textContent.startsWith('No node publishes')")
    assert page.locator('#picture.old').count() == 1
    assert live.errors == []


def shown_position(card: Machine) -> float:
    """Return where a player is, as the page shows [s]."""
    words = str(card.card.text_content()).partition('last known position ')[2]
    return float(words.split()[0]) if words and words[0].isdigit() else -1.0
