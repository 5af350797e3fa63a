"""What colcon and pip installed is whole, and its solver_node solves, as a process on DDS."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
import math
import os
from pathlib import Path
import runpy
import signal
import subprocess
import sys
import time

from domain import own_domain
import pytest

ROOT = Path(__file__).resolve().parents[2]
VERSION = runpy.run_path(str(ROOT / 'klann_ros' / '__init__.py'))['__version__']

NODES = {
    'solver_node', 'crank_node', 'recorder_node', 'player_node', 'view_node', 'walker_node',
    'sim_node', 'watchdog_node', 'commission_node',
}  # fmt: skip
EXECUTABLES = {
    *NODES, 'drive', 'review', 'recover', 'export', 'describe', 'calibrate', 'exercise', 'design',
    'import_linkage',
}  # fmt: skip

# The root at a crank angle of 60 deg: gamma, beta, delta, theta [deg], and H [m].
ROOT_60 = (10.659455241249857, 67.32948352084568, 34.46397311984116, 45.72293552846574)
H_60 = (0.7960057379415449, -0.3037627502892032)


@dataclass(frozen=True)
class Installation:
    """A prefix with lib/klann_ros/NAME in it, and what a user sources before running that."""

    prefix: Path
    setup: Path | None = None

    def command(self, name: str, *arguments: str) -> list[str]:
        program = [str(self.prefix / 'lib' / 'klann_ros' / name), *arguments]
        if self.setup is None:
            return program
        return ['sh', '-c', '. "$0" && exec "$@"', str(self.setup), *program]

    def modules(self) -> Path:
        (folder,) = self.prefix.glob('lib/python*/site-packages/klann_ros')
        return folder


@pytest.fixture(scope='session')
def pip_installation() -> Installation:
    prefix = Path(sys.prefix)
    # scripts/test names colcon's prefix; under it nothing may be skipped.
    if 'KLANN_ROS_COLCON_PREFIX' not in os.environ and not (prefix / 'lib/klann_ros').exists():
        pytest.skip(f'klann_ros is not installed in {prefix}: pip install .')
    return Installation(prefix)


@pytest.fixture(scope='session')
def colcon_installation(tmp_path_factory: pytest.TempPathFactory) -> Installation:
    given = os.environ.get('KLANN_ROS_COLCON_PREFIX')
    base = Path(given) if given else colcon_build(tmp_path_factory.mktemp('colcon'))
    return Installation(base / 'klann_ros', base / 'setup.sh')


@pytest.fixture(scope='session', params=['pip', 'colcon'])
def installation(request: pytest.FixtureRequest) -> Installation:
    return request.getfixturevalue(f'{request.param}_installation')


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    with own_domain() as number:
        monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
        monkeypatch.setenv('ROS_DOMAIN_ID', str(number))
        yield number


def colcon_build(folder: Path, *options: str) -> Path:
    """Build outside the checkout, as `scripts/test` does; return the install folder."""
    pytest.importorskip('colcon_core')
    subprocess.run(
        [
            *(sys.executable, '-m', 'colcon', '--log-base', 'log', 'build', '--paths', ROOT),
            *('--build-base', 'build', '--install-base', 'install', *options),
        ],
        cwd=folder,
        check=True,
    )
    return folder / 'install'


@pytest.mark.slow
def test_a_build_of_links_works_too(tmp_path: Path) -> None:
    base = colcon_build(tmp_path, '--symlink-install')
    linked = Installation(base / 'klann_ros', base / 'setup.sh')
    done = subprocess.run(
        linked.command('review', '--version'), capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith('review ')
    share = base / 'klann_ros' / 'share/klann_ros'
    for folder in ('config', 'foxglove', 'launch', 'plotjuggler', 'rviz', 'urdf'):
        assert files(share / folder) == files(ROOT / folder)
    assert files(share / 'requirements') == files(ROOT / 'examples' / 'requirements')


def test_the_package_is_in_the_ament_index(
    installation: Installation, monkeypatch: pytest.MonkeyPatch
) -> None:
    packages = pytest.importorskip('ament_index_python.packages')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(installation.prefix))
    assert packages.get_package_prefix('klann_ros') == str(installation.prefix)
    assert Path(packages.get_package_share_directory('klann_ros'), 'package.xml').is_file()


def test_every_executable_answers(installation: Installation) -> None:
    programs = [*(installation.prefix / 'lib/klann_ros').iterdir()]
    assert {program.name for program in programs} == EXECUTABLES
    if installation.setup is None:
        programs += [installation.prefix / 'bin' / name for name in EXECUTABLES]
    # They are of one form; test/nodes/test_processes.py starts each entry point.
    forms = {program.read_text().replace(program.name, 'NAME') for program in programs}
    assert len(forms) == len(programs) // len(EXECUTABLES)
    names = {'solver_node', 'review', 'design'}
    processes = {
        name: subprocess.Popen(
            installation.command(name, '--version'),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        for name in sorted(names)
    }
    answers = {name: process.communicate(timeout=60)[0] for name, process in processes.items()}
    assert {process.returncode for process in processes.values()} == {0}
    assert answers == {name: f'{name} {VERSION}\n' for name in names}


def test_the_modules_are_those_of_the_checkout(installation: Installation) -> None:
    assert files(installation.modules()) == files(ROOT / 'klann_ros')


def test_both_share_the_same_files(
    pip_installation: Installation, colcon_installation: Installation
) -> None:
    ours = files(pip_installation.prefix / 'share/klann_ros')
    colcons = files(colcon_installation.prefix / 'share/klann_ros')
    assert ours <= colcons
    # What colcon itself adds: scripts to source.
    assert {f for f in colcons - ours if not f.startswith(('package.', 'hook/'))} == set()


def test_the_lab_is_shared(installation: Installation) -> None:
    shared = installation.prefix / 'share/klann_ros/lab.html'
    assert shared.read_bytes() == (ROOT / 'klann_ros/web/lab/lab.html').read_bytes()


def test_solver_node_solves(installation: Installation, domain: int) -> None:
    pytest.importorskip('rclpy')
    from geometry_msgs.msg import PointStamped
    from ros_domain import Probe
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64

    with running(installation.command('solver_node')), closing(Probe(domain)) as probe:
        found = probe.listen(JointState, 'joint_states'), probe.listen(PointStamped, 'point_h')
        crank = probe.publisher(Float64, 'crank_angle')
        for topic in ('joint_states', 'point_h'):
            probe.await_publishers(topic)
        crank.publish(Float64(data=math.radians(60)))
        probe.until(lambda: all(found))
    (joints,), (point,) = found
    assert list(joints.name) == ['alpha', 'gamma', 'beta', 'delta', 'theta']
    expected = [math.radians(60), *map(math.radians, ROOT_60)]
    assert list(joints.position) == pytest.approx(expected, rel=0, abs=1e-9)
    assert (point.point.x, point.point.y) == pytest.approx(H_60, rel=0, abs=1e-9)
    assert point.point.z == 0
    assert point.header.frame_id == 'leg_plane'
    assert point.header.stamp == joints.header.stamp
    assert abs(joints.header.stamp.sec - time.time()) < 60


@contextmanager
def running(command: list[str]) -> Iterator[subprocess.Popen]:
    """Run a node for the length of a test; Ctrl-C ends it with exit code 0 and no traceback."""
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=os.environ
    )
    try:
        yield process
        assert process.poll() is None, process.stdout.read()
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=20)[0]
        assert process.returncode == 0, output
        assert 'Traceback' not in output
    finally:
        process.kill()
        process.wait()


def files(folder: Path) -> set[str]:
    """Return the files below a folder, without what Python caches."""
    return {
        str(path.relative_to(folder))
        for path in folder.rglob('*')
        if path.is_file() and '__pycache__' not in path.parts
    }
