"""The launch files under the real launch, in a prefix that has only what a test puts there."""

from collections.abc import Iterator
import json
import os
from pathlib import Path
import shlex
import signal
import subprocess
import sys
import time

import klann_ros
from patience import PATIENCE
import yaml

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = str(Path(klann_ros.__file__).resolve().parents[1])
NODES = (
    'crank_node', 'player_node', 'recorder_node', 'sim_node', 'solver_node', 'view_node',
    'walker_node', 'watchdog_node',
)  # fmt: skip
# The programs of others, which a launch file only starts and ends.
OTHERS = (
    ('joint_state_publisher_gui', 'joint_state_publisher_gui'),
    ('robot_state_publisher', 'robot_state_publisher'),
    ('rviz2', 'rviz2'),
    ('robot_localization', 'ekf_node'),
    ('controller_manager', 'ros2_control_node'),
    ('controller_manager', 'spawner'),
    ('mujoco_ros2_control', 'ros2_control_node'),
)
# The packages of others that a launch file only looks for.
PLUGINS = (
    'joint_state_broadcaster',
    'joint_state_topic_hardware_interface',
    'velocity_controllers',
)
# As `ros2 launch` does it: an included file, its arguments, the service's code. Here for many
# lists of arguments, one after the other; each code goes into the list of what was started.
DRIVER = """
import json, sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
file, started, runs = sys.argv[1:]
for arguments in json.loads(runs):
    service = LaunchService(argv=arguments, noninteractive=True)
    service.include_launch_description(LaunchDescription([IncludeLaunchDescription(
        PythonLaunchDescriptionSource(file),
        launch_arguments=[argument.split(':=', 1) for argument in arguments],
    )]))
    code = service.run()
    with open(started, 'a') as log:
        print('code', code, file=log)
sys.exit(code)
"""
# A player's end ends its launch: not before the publisher of the frames has been started as well.
AFTER_ANOTHER = """
last=code
while [ "$last" = code ]; do
    sleep 0.02
    while read -r word _; do last=$word; done < {started}
done
"""
ARGUMENTS = """
import sys
from launch.launch_description_sources import get_launch_description_from_python_launch_file
description = get_launch_description_from_python_launch_file(sys.argv[1])
print(*(argument.name for argument in description.get_launch_arguments()))
"""


class Prefix:
    """
    A prefix with this checkout's launch files and nodes, and programs in place of others'.

    Parameters
    ----------
    folder
        Where it is made, and where the launches run.
    domain
        The ROS domain of their nodes.
    brief
        Whether every program ends at once; else our nodes are real, and the others' sleep.
    without
        Packages that are not there.

    """

    def __init__(
        self, folder: Path, domain: int, *, brief: bool = False, without: tuple[str, ...] = ()
    ) -> None:
        self.folder = folder
        self._started = folder / 'started'
        self._launches: list[subprocess.Popen[str]] = []
        share = folder / 'share' / 'klann_ros'
        share.mkdir(parents=True)
        self._started.touch()
        for name in ('config', 'launch', 'rviz', 'urdf'):
            (share / name).symlink_to(ROOT / name)
        for name in NODES:
            code = f'import sys; from klann_ros.executables import {name}; sys.exit({name}())'
            self._install('klann_ros', name, '' if brief else _python(code))
        if brief:
            before = AFTER_ANOTHER.format(started=shlex.quote(str(self._started)))
            self._install('klann_ros', 'player_node', '', before)
        for package, name in OTHERS:
            if package not in without:
                self._install(package, name, '' if brief else 'exec sleep 1000')
        for package in set(PLUGINS) - set(without):
            self._index(package)
        (folder / 'bin').mkdir()
        (folder / 'bin' / 'sleep').symlink_to('/bin/sleep')
        self._variables = {
            **os.environ,
            'AMENT_PREFIX_PATH': str(folder),
            'PATH': str(folder / 'bin'),
            'PYTHONPATH': os.pathsep.join([PACKAGE, os.environ.get('PYTHONPATH', '')]),
            'ROS_DISTRO': 'jazzy',
            'ROS_DOMAIN_ID': str(domain),
            'ROS_LOG_DIR': str(folder / 'log'),
            'TMPDIR': str(folder),
        }

    def add_share(self, package: Path) -> None:
        (self.folder / 'share' / package.name).symlink_to(package)
        index = self.folder / 'share' / 'ament_index' / 'resource_index' / 'packages'
        (index / package.name).touch()

    def launch(self, name: str | Path, *runs: list[str]) -> subprocess.Popen[str]:
        """Launch a file of ours or of a user, once for each list of arguments."""
        file = name if isinstance(name, Path) else ROOT / 'launch' / f'{name}.launch.py'
        return self._run(DRIVER, file, self._started, json.dumps(runs))

    def arguments(self, name: str) -> list[str]:
        """Return the arguments of a launch file, as `--show-args` finds them."""
        asked = self._run(ARGUMENTS, ROOT / 'launch' / f'{name}.launch.py')
        return asked.communicate(timeout=PATIENCE)[0].splitlines()[-1].split()

    def started(self) -> Iterator[tuple[set[str], int]]:
        """Yield what each launch has started, and its exit code."""
        names: set[str] = set()
        for line in self._started.read_text().splitlines():
            word, number = line.split()
            if word == 'code':
                yield names, int(number)
                names = set()
            else:
                names.add(word)

    def wait_for_a_recording(self, run: str) -> None:
        """Wait until a run is being written: then all nodes are up, and launch is at rest."""
        end = time.monotonic() + PATIENCE
        while sum(path.stat().st_size for path in self.folder.glob(f'{run}/*.mcap')) < 20_000:
            assert time.monotonic() < end, f'{run} is not being recorded'
            time.sleep(0.05)

    def given(self, name: str) -> list[str]:
        """Return the path and the arguments that a program was last started with."""
        return (self.folder / name).read_text().splitlines()

    def parameters(self, name: str) -> dict[str, object]:
        """Return the parameters that launch wrote for a node last."""
        *_, file = (word for word in self.given(name) if 'launch_params_' in word)
        written = yaml.safe_load(Path(file).read_text())
        (node,) = written.values()
        return dict(node['ros__parameters'])

    def descriptions(self) -> list[str]:
        """Return the robot descriptions that launch wrote for nodes."""
        files = [path.read_text() for path in sorted(self.folder.glob('launch_params_*'))]
        nodes = [
            each['ros__parameters'] for file in files for each in yaml.safe_load(file).values()
        ]
        return [node['robot_description'] for node in nodes if 'robot_description' in node]

    def processes(self) -> list[tuple[str, int]]:
        """Return the names and numbers of the processes that were started."""
        lines = [line.split() for line in self._started.read_text().splitlines()]
        return [(name, int(pid)) for name, pid in lines if name != 'code']

    def left(self) -> list[str]:
        return [name for name, pid in self.processes() if Path('/proc', str(pid)).exists()]

    def close(self) -> None:
        for launch in self._launches:
            launch.kill()
            launch.communicate()
        for line in self._started.read_text().splitlines():
            name, pid = line.split()
            if name != 'code' and Path('/proc', pid).exists():
                os.kill(int(pid), signal.SIGKILL)

    def _run(self, code: str, *arguments: object) -> subprocess.Popen[str]:
        launch = subprocess.Popen(
            [sys.executable, '-c', code, *map(str, arguments)],
            cwd=self.folder,
            env=self._variables,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._launches.append(launch)
        return launch

    def _index(self, package: str) -> None:
        index = self.folder / 'share' / 'ament_index' / 'resource_index' / 'packages'
        index.mkdir(parents=True, exist_ok=True)
        (index / package).touch()

    def _install(self, package: str, name: str, script: str, before: str = '') -> None:
        self._index(package)
        program = self.folder / 'lib' / package / name
        program.parent.mkdir(parents=True, exist_ok=True)
        log, arguments = (shlex.quote(str(p)) for p in (self._started, self.folder / name))
        program.write_text(
            f'#!/bin/sh\n{before}\nprintf "%s\\n" "$0" "$@" > {arguments}\n'
            f'echo {name} $$ >> {log}\n{script}\n'
        )
        program.chmod(0o755)


def _python(code: str) -> str:
    """Return the line of a shell that becomes a node, with the prefixes that its ROS needs."""
    prefixes = shlex.quote(os.environ.get('AMENT_PREFIX_PATH', ''))
    command = shlex.join([sys.executable, '-c', code])
    return f'AMENT_PREFIX_PATH={prefixes} exec {command} "$@"'
