"""What RViz, Foxglove and PlotJuggler load: files that parse and name published topics."""

from collections.abc import Iterator
import json
from pathlib import Path
from xml.etree import ElementTree as ET

from klann_ros.kinematics import KlannGeometry, KlannLeg
import pytest
from rosbags.typesys import get_typestore, Stores
import yaml
from yaml_tables import read_table

ROOT = Path(__file__).resolve().parents[2]
LAYOUTS = {
    path.stem: json.loads(path.read_text(encoding='utf-8'))
    for path in sorted((ROOT / 'foxglove').glob('*.json'))
}
KNOWN = read_table(Path(__file__).with_name('viewers.yaml'))
TYPES = KNOWN['types']
STORE = get_typestore(Stores.ROS2_JAZZY)


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


def test_rviz_shows_existing_topics() -> None:
    manager = yaml.safe_load((ROOT / 'rviz' / 'klann.rviz').read_text())['Visualization Manager']
    displays = {display['Class'].split('/')[1]: display for display in manager['Displays']}
    assert {'RobotModel', 'TF', 'MarkerArray'} <= set(displays)
    assert displays['RobotModel']['Description Topic']['Value'] == '/robot_description'
    assert displays['MarkerArray']['Topic']['Value'] == '/markers'
    named = {text for text in strings(manager) if text.startswith('/')}
    assert named <= TYPES.keys()
    assert manager['Global Options']['Fixed Frame'] == 'base_link'


def type_at(path: str, separator: str) -> str:
    """Return the type of a field of a topic, such as `/odom.pose.pose`; KeyError for none."""
    topic = max((t for t in TYPES if path.startswith(t)), key=len)
    kind = TYPES[topic]
    for part in path.removeprefix(topic).split(separator)[1:]:
        name, index, _ = part.partition('[')
        fields = dict(STORE.fielddefs[kind][1])
        node, detail = fields[name]
        # 3 and 4 are the kinds of arrays.
        if index:
            assert node in (3, 4)
            node, detail = detail[0]
        kind = detail if isinstance(detail, str) else detail[0]
    return str(kind)


@pytest.mark.parametrize('name', LAYOUTS)
def test_foxglove_shows_existing_fields(name: str) -> None:
    paths = {text for text in strings(LAYOUTS[name]) if text.startswith('/')}
    for path in paths:
        type_at(path, '.')
    of_leg = {'/joint_states', '/point_h', '/review/joint_states', '/review/point_h'}
    topics = {path.split('.')[0] for path in paths}
    assert (of_leg <= topics) is (name == 'klann')
    assert {'/markers', '/diagnostics', '/review/findings', '/robot_description'} <= topics


@pytest.mark.parametrize('name', LAYOUTS)
def test_foxglove_panels_are_configured_as_they_can_be(name: str) -> None:
    for panel, config in LAYOUTS[name]['configById'].items():
        keys = {kind: {*names} for kind, names in KNOWN['panels'][panel.partition('!')[0]].items()}
        assert keys['required'] <= config.keys() <= keys['required'] | keys['optional']
        for path in [*config.get('paths', ()), *filter(None, [config.get('xAxisPath')])]:
            assert path.keys() <= {*KNOWN['path']}
            assert path['timestampMethod'] in ('receiveTime', 'headerStamp')


def test_foxglove_names_the_angles_as_they_are_published() -> None:
    names = KlannLeg(KlannGeometry.sem104()).joint_names
    paths = LAYOUTS['klann']['configById']['Plot!angles']['paths']
    # The crank's own angle grows with every turn.
    assert {path['value']: path['label'] for path in paths} == {
        f'{topic}.position[{i}]': f'{names[i]}{end}'
        for topic, end in (('/joint_states', ''), ('/review/joint_states', ', right'))
        for i in range(1, 5)
    }


@pytest.mark.parametrize('name', LAYOUTS)
def test_foxglove_lays_out_every_panel_once(name: str) -> None:
    panels = [text for text in strings(LAYOUTS[name]['layout']) if '!' in text]
    assert sorted(panels) == sorted(LAYOUTS[name]['configById'])


def test_plotjuggler_plots_existing_fields() -> None:
    root = ET.parse(ROOT / 'plotjuggler' / 'klann.xml').getroot()  # noqa: S314 - our own
    curves = [str(curve.get('name')) for curve in root.iter('curve')]
    assert len(curves) == len(set(curves)) > 10
    joints = {*KlannLeg().joint_names, 'left_crank', 'right_crank'}
    for curve in curves:
        *topic, name, field = curve.split('/')
        if TYPES.get('/'.join(topic)) == 'sensor_msgs/msg/JointState':
            # PlotJuggler names its series by the joints.
            assert name in joints
            assert field in {'position', 'velocity', 'effort'}
        else:
            assert type_at(curve, '/') == 'float64'
    for split in root.iter('DockSplitter'):
        sizes = [float(size) for size in str(split.get('sizes')).split(';')]
        assert len(sizes) == len(split) == int(str(split.get('count')))
