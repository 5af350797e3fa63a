"""What RViz and Foxglove load: files that parse and name topics that are published."""

from collections.abc import Iterator
import json
from pathlib import Path

from klann_ros.kinematics import KlannGeometry, KlannLeg
import yaml

ROOT = Path(__file__).resolve().parents[2]
LAYOUT = json.loads((ROOT / 'foxglove' / 'klann.json').read_text())
TOPICS = {
    '/joint_states': 'position',
    '/point_h': 'point',
    '/markers': 'markers',
    '/diagnostics': 'status',
    '/robot_description': 'data',
}


def strings(value: object) -> Iterator[str]:
    """Yield every text in a document, keys included."""
    if isinstance(value, dict):
        yield from value
        value = list(value.values())
    if isinstance(value, list):
        for item in value:
            yield from strings(item)
    elif isinstance(value, str):
        yield value


def test_rviz_shows_topics_that_there_are() -> None:
    manager = yaml.safe_load((ROOT / 'rviz' / 'klann.rviz').read_text())['Visualization Manager']
    displays = {display['Class'].split('/')[1]: display for display in manager['Displays']}
    assert {'RobotModel', 'TF', 'MarkerArray'} <= set(displays)
    assert displays['RobotModel']['Description Topic']['Value'] == '/robot_description'
    assert displays['MarkerArray']['Topic']['Value'] == '/markers'
    named = {text for text in strings(manager) if text.startswith('/')}
    assert named <= set(TOPICS)
    assert manager['Global Options']['Fixed Frame'] == 'base_link'


def test_foxglove_shows_topics_that_there_are() -> None:
    paths = {text for text in strings(LAYOUT) if text.startswith('/')}
    assert {path.split('.')[0] for path in paths} == set(TOPICS)
    for path in paths:
        topic, *fields = path.split('.')
        assert not fields or fields[0].split('[')[0] == TOPICS[topic]


def test_foxglove_names_the_angles_as_they_are_published() -> None:
    names = KlannLeg(KlannGeometry.sem104()).joint_names
    labels = {
        path['value']: path['label'] for path in LAYOUT['configById']['Plot!angles']['paths']
    }
    # The crank's own angle grows with every turn.
    assert labels == {f'/joint_states.position[{i}]': names[i] for i in range(1, 5)}


def test_foxglove_lays_out_every_panel_once() -> None:
    panels = [text for text in strings(LAYOUT['layout']) if '!' in text]
    assert sorted(panels) == sorted(LAYOUT['configById'])
