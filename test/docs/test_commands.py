"""The commands that pages print: `drive` runs them, and what needs more than pip says so."""

from collections.abc import Iterator
from pathlib import Path
import re
import shlex
from typing import Any

from domain import own_domain
from geometry_msgs.msg import TwistStamped
from klann_ros.nodes.drive.node import DriveNode, read_options
from klann_ros.nodes.endpoints import LATCHED
import pytest
from ros_domain import Domain, open_domain
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Float64, Int32, String
from std_srvs.srv import Trigger

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / 'README.md', ROOT / 'SECURITY.md', *sorted((ROOT / 'docs').glob('*.md'))]
# Types of topics in namespaces of their own, by the last part of their names.
TYPES = {'crank_angle': Float64, 'crank_command': JointState, 'cmd_vel': TwistStamped}
TYPES |= {'joint_states': JointState, 'crank_state': JointState, 'joy': Joy}


def commands() -> list[str]:
    """Return the commands of `drive` that the pages print, without comments and redirections."""
    names = 'list|echo|hz|crank|walk|pub|call'
    pattern = re.compile(rf'^(?:.*?`)?drive ((?:{names})\b[^`#>|\n]*)', re.MULTILINE)
    printed = []
    for page in PAGES:
        printed += pattern.findall(page.read_text(encoding='utf-8'))
    return sorted({command.strip() for command in printed})


def succeed(_: Any, response: Any) -> Any:
    response.success = True
    return response


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[Domain]:
    with own_domain() as domain, open_domain(domain, tmp_path) as ros:
        yield ros


def test_every_printed_command_of_drive_runs(ros: Domain) -> None:
    printed = commands()
    assert len(printed) > 12
    node = ros.probe.node
    codes: dict[str, int] = {}
    running = []
    for number, command in enumerate(printed):
        name, *words = shlex.split(command)
        namespace = f'/number{number}'
        options = read_options(['drive', name, *words])
        if name in {'crank', 'walk', 'pub'}:
            # The topics that it could send to; each has what it needs.
            for topic, kind in TYPES.items():
                received = Int32 if 'data' in command and topic == 'crank_state' else kind
                node.create_subscription(received, f'{namespace}/{topic}', lambda _: None, 10)
            options.duration = 0.2
        elif name in {'echo', 'hz'}:
            topic = words[0] if words[0].startswith('/') else f'{namespace}/{words[0]}'
            kind = TYPES.get(words[0], String)
            node.create_publisher(kind, topic, LATCHED).publish(kind())
            options.once = name == 'echo'
        elif name == 'call':
            node.create_service(Trigger, f'{namespace}/{words[0]}', succeed)

        def finish(code: int = 0, command: str = command) -> None:
            codes.setdefault(command, code)

        drive = ros.probe.add(DriveNode, options, finish, namespace=namespace)
        if name == 'hz':
            running.append(drive)
    ros.probe.until(lambda: len(codes) >= len(printed) - len(running))
    assert {command for command, code in codes.items() if code} == set()


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_what_needs_more_than_pip_says_so(page: Path) -> None:
    in_block = re.compile(r'^(?:\w+=\S+ |\w+=\$\()?(?:ros2|rviz2|rosdep|colcon) .*', re.MULTILINE)
    inline = re.compile(r'`(ros2 (?:topic|service|node|param|lifecycle|launch)\b[^`]*)`')
    for section in re.split(r'(?m)^#+ ', page.read_text(encoding='utf-8')):
        blocks = re.findall(r'(?ms)^```sh\n(.*?)^```', section)
        needs = in_block.findall('\n'.join(blocks)) + inline.findall(section)
        is_labelled = re.search('ROS 2 (machine|installation|Jazzy)|colcon', section)
        assert is_labelled or not needs, needs
