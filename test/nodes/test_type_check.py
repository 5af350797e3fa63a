"""A publisher of another type is one warning with both types, from every node, over real DDS."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Twist, TwistStamped
from klann_ros.nodes import endpoints
from klann_ros.nodes.endpoints import TypeCheck
import pytest
from raw_publishers import Stranger
from ros_domain import Domain, Process
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32, Float64, Float64MultiArray, Int32

WALKER = Path(__file__).parents[2] / 'config' / 'walker6.yaml'
TWIST = 'geometry_msgs/msg/Twist'
STAMPED = 'geometry_msgs/msg/TwistStamped'
JOINTS = 'sensor_msgs/msg/JointState'


# Nodes, the topics that have publishers of another type, and both types with the remedy.
MISMATCHES = [
    ('walker_node WALKER', 'cmd_vel', Twist, f'{TWIST}, {STAMPED}, stamped_cmd_vel:=false'),
    (
        'walker_node WALKER -p stamped_cmd_vel:=false',
        'cmd_vel',
        TwistStamped,
        f'{STAMPED}, {TWIST}, stamped_cmd_vel:=true',
    ),
    (
        'walker_node WALKER -r crank_state:=motor',
        'motor',
        Int32,
        f'std_msgs/msg/Int32, {JOINTS}, crank_state_type:=ticks and counts_per_turn',
    ),
    (
        'solver_node --ros-args',
        'crank_angle',
        Float32,
        'std_msgs/msg/Float32, std_msgs/msg/Float64, crank_angle_type:=float32',
    ),
    (
        'solver_node --ros-args -p crank_angle_type:=float32',
        'crank_angle',
        Float64,
        'std_msgs/msg/Float64, std_msgs/msg/Float32, crank_angle_type:=float64',
    ),
    (
        'solver_node --ros-args -p crank_state_type:=ticks -p counts_per_turn:=600',
        'crank_state',
        JointState,
        f'{JOINTS}, std_msgs/msg/Int32, crank_state_type:=joint_state',
    ),
    (
        'watchdog_node --ros-args -p joints:=[crank]',
        'crank_command',
        JointState,
        f'{JOINTS}, std_msgs/msg/Float64MultiArray, command_type:=velocities of walker_node',
    ),
    (
        'sim_node WALKER',
        'crank_command',
        Float64MultiArray,
        f'std_msgs/msg/Float64MultiArray, {JOINTS}, command_type:=joint_state of walker_node',
    ),
]
# Reports in 1.5 s, in which a node looks for publishers again.
REPORTS = 15


class Warned(NamedTuple):
    """A node with a publisher of another type, and its warning."""

    node: Process
    text: str


@pytest.fixture(scope='module')
def reports(module_ros: Domain) -> list[DiagnosticArray]:
    return module_ros.probe.listen(DiagnosticArray, '/diagnostics')


@pytest.fixture(scope='module')
def warned(module_ros: Domain, reports: list[DiagnosticArray]) -> list[Warned]:
    """Start a node of each mismatch, in a namespace of its own; `reports` are those afterwards."""
    driver = module_ros.other_node()
    warned: list[Warned] = []
    for index, (command, topic, kind, types) in enumerate(MISMATCHES):
        space = f'/case_{index}'
        driver.create_publisher(kind, f'{space}/{topic}', 1)
        name, *words = command.replace('WALKER', f'--ros-args --params-file {WALKER}').split()
        words += ['-p', 'diagnostics_period:=0.1', '-r', f'__ns:={space}']
        published, expected, remedy = types.split(', ')
        text = f'/probe publishes {published}, this node takes {expected}: set {remedy}'
        warned.append(Warned(module_ros.start(name, *words), f'{space}/{topic}: {text}'))
    module_ros.probe.until(lambda: all(text in node.errors for node, text in warned))
    reports.clear()
    module_ros.probe.until(lambda: all(len(told(reports, text)) >= REPORTS for _, text in warned))
    return warned


def told(reports: list[DiagnosticArray], text: str) -> list[DiagnosticStatus]:
    return [status for report in reports for status in report.status if text in status.message]


@pytest.mark.parametrize('index', range(len(MISMATCHES)))
def test_both_types_and_the_remedy_are_said_once(
    warned: list[Warned], reports: list[DiagnosticArray], index: int
) -> None:
    node, text = warned[index]
    assert all(status.level != DiagnosticStatus.OK for status in told(reports, text))
    assert node.errors.count(text) == 1


def test_a_live_page_says_so_too(ros: Domain) -> None:
    publisher = ros.probe.node.create_publisher(TwistStamped, 'cmd_vel', 1)
    other_node = ros.other_node()
    other_node.create_publisher(Twist, 'cmd_vel', 1)
    view = ros.start('view_node', '--port', '0')
    text = f'publishes {TWIST}, this node takes {STAMPED}'
    ros.probe.until(lambda: text in view.errors)
    ros.probe.spin(1.5)
    assert view.errors.count(text) == 1
    ros.probe.node.destroy_publisher(publisher)


@pytest.mark.parametrize(
    ('kind', 'text'),
    [
        (b'x/msg/\x1b[31mRed', r'/probe publishes x/msg/\x1b[31mRed, this node takes '),
        (b'y/msg/\xff', 'a publisher publishes a type that is no text, this node takes '),
    ],
)
def test_untrusted_types_are_printable_and_the_text_goes_with_their_publisher(
    ros: Domain, kind: bytes, text: str
) -> None:
    reports: list[DiagnosticArray] = ros.probe.listen(DiagnosticArray, '/diagnostics')
    solver = ros.start('solver_node', diagnostics_period=0.1)
    stranger = Stranger(ros.other_node(), b'/crank_angle', kind)
    ros.probe.until(lambda: reports and text in reports[-1].status[0].message)
    ros.probe.until(lambda: text in solver.errors)
    assert all(line.isprintable() for line in solver.errors.split('\n'))
    stranger.close()
    ros.probe.until(lambda: text not in reports[-1].status[0].message)
    # A right type is no news.
    ros.probe.publisher(Float64, 'crank_angle')
    ros.probe.spin(1.5)
    assert solver.errors.count('this node takes') == 1


class StandIn:
    """A node whose subscriptions have publishers of other types, and its log."""

    def __init__(self, topics: int) -> None:
        self.subscriptions = [
            SimpleNamespace(msg_type=Float64, topic_name=f'/topic_{n}') for n in range(topics)
        ]
        # Nodes of the publishers of each topic; discovery knows a publisher before its node.
        self.nodes = ['_NODE_NAME_UNKNOWN_']
        self.lines: list[str] = []

    def get_publishers_info_by_topic(self, _: str) -> list[Any]:
        kind = 'std_msgs/msg/Float32'
        return [
            SimpleNamespace(topic_type=kind, node_namespace='/', node_name=name)
            for name in self.nodes
        ]

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=self.lines.append)


@pytest.fixture
def every_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let each check look for publishers."""
    monkeypatch.setattr(endpoints, '_TYPE_CHECK_PERIOD', 0.0)


@pytest.mark.usefixtures('every_time')
def test_a_publisher_is_logged_when_its_node_is_known_or_stays_unknown() -> None:
    named, unnamed = StandIn(1), StandIn(1)
    checks = [TypeCheck(named), TypeCheck(unnamed)]
    text = 'publishes std_msgs/msg/Float32, this node takes std_msgs/msg/Float64'
    for _ in range(2):
        assert [check.check() for check in checks] == [f'/topic_0: a publisher {text}'] * 2
        assert named.lines == unnamed.lines == []
    named.nodes = ['motor']
    for _ in range(4):
        for check in checks:
            check.check()
    assert named.lines == [f'/topic_0: /motor {text}']
    assert unnamed.lines == [f'/topic_0: a publisher {text}']
    named.nodes = ['motor', 'servo', '_NODE_NAME_UNKNOWN_']
    assert checks[0].check().startswith('/topic_0: /motor, /servo publish std_msgs')


@pytest.mark.usefixtures('every_time')
def test_many_topics_of_other_types_fill_neither_a_status_nor_the_log() -> None:
    node = StandIn(120)
    node.nodes = ['flood']
    check = TypeCheck(node)
    for level in (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR):
        higher_level, message = check.add_to(level, 'text')
        assert higher_level == max(level, DiagnosticStatus.WARN)
        assert message.count('publishes') == 3
        assert len(node.lines) == 100
    node.nodes = []
    assert check.add_to(DiagnosticStatus.OK, 'text') == (DiagnosticStatus.OK, 'text')
