"""The environment of the commands: a folder `.venv-X.Y` in the checkout, made on demand."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
import fcntl
import hashlib
from importlib.util import find_spec
from itertools import count
import os
from pathlib import Path
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
from urllib.request import urlopen

from processes import Command, CommandError, last_lines, pause, run
import source

VERSION = '.'.join(platform.python_version_tuple()[:2])
# Requirements of each command: extras of setup.py, and a requirements file.
NEEDS = {
    # The same for its leg and its walker: a second one starts at once beside a first one.
    'demo': ('plot,sim,view', None),
    'demo --calibrate': ('calibration,sim,view', None),
    'test': ('fast,plot,test', Path(__file__).with_name('checks.txt')),
    'test slow': ('cluster,fast,plot,test', Path(__file__).with_name('slow.txt')),
    'test --ros': ('fast,plot,test', None),
    'benchmark': ('design,fast,plot,sim,view', Path(__file__).with_name('benchmarks.txt')),
}
# The distributions of ROS 2 that have wheels, and the extra of setup.py with these.
DISTRIBUTIONS = {'jazzy': 'ros', 'kilted': 'ros-kilted'}
# 70.1: the first that makes wheels by itself; colcon-core wants one below 80.
BUILD = 'setuptools>=70.1,<80'
# For a Python with a venv module without pip, such as Debian's.
PIP = (
    'https://files.pythonhosted.org/packages/44/3c/d717024885424591d5376220b5e836c2d5293ce201'
    '1523c9de23ff7bf068/pip-25.3-py3-none-any.whl'
)
PIP_SHA256 = '9655943313a94722b7774661c21049070f6bbb0a1516bf02f7c8d5d9201514cd'
NEEDED = 'a network, and Python 3.10 to 3.14 on x86-64 Linux or a sourced ROS 2'
# Versions and hashes for CI, on the system of the wheels; see lock.py.
LOCK = Path(__file__).with_name('lock.txt')
LOCKED_SYSTEM = ('Linux', 'x86_64')
LOCKED_PACKAGE = re.compile(r'^\S+==.*(?:\n    .*)*', re.MULTILINE)
LOCKED_BUILD = ('pip==', 'setuptools==')
# Processes of pip that install locked packages side by side: each unpacks by one core.
LOCKED_PARTS = 2
STAMP = 'klann_ros.txt'
# The output of pip, for the progress; those beside it have others.
PIP_LOG = 'pip.txt'
# Period of lines about the progress [s].
PROGRESS_PERIOD = 15.0
# Variables that redirect an installation, or that the wheels of ROS set for child processes.
FOREIGN = {'PIP_USER', 'PIP_TARGET', 'PIP_PREFIX', 'PIP_CONSTRAINT', 'PYTHONHOME'}
FOREIGN |= {'_ROS_WHEELS_BOOTSTRAP_COMPLETE'}
OF_ROS = {'PYTHONPATH', 'AMENT_PREFIX_PATH', 'LD_LIBRARY_PATH', 'COLCON_PREFIX_PATH'}
OF_ROS |= {'RMW_IMPLEMENTATION', 'ROS_DISTRO'}


class PipError(CommandError):
    """Pip or venv failed."""


@dataclass(frozen=True)
class Environment:
    """An environment: its folder, pip's constraints, the NumPy of a sourced ROS, and which ROS."""

    folder: Path
    constraints: str
    numpy: str
    ros: str = 'jazzy'

    @property
    def python(self) -> Path:
        """Return the interpreter."""
        return self.folder / 'bin' / 'python'

    @property
    def is_locked(self) -> bool:
        """Return whether it gets the versions of the lock file, as in CI."""
        is_standard = self.ros == 'jazzy' and not self.numpy and not self.constraints
        system = (platform.system(), platform.machine())
        return is_standard and system == LOCKED_SYSTEM and os.environ.get('CI') == 'true'

    def has_locked(self, command: str) -> bool:
        """Return whether the lock file has all that a command needs."""
        return self.is_locked and command == 'test'

    @property
    def variables(self) -> dict[str, str]:
        """Return the variables for its programs."""
        # With wheels, nothing from a ROS sourced for another Python.
        foreign = FOREIGN if self.numpy else FOREIGN | OF_ROS
        variables = {key: value for key, value in os.environ.items() if key not in foreign}
        # A NumPy in ~/.local must not shadow the one that ROS was built for.
        variables |= {'VIRTUAL_ENV': str(self.folder), 'PYTHONNOUSERSITE': '1'}
        # As in the programs: see klann_ros/executables.py.
        variables['OPENBLAS_NUM_THREADS'] = '1'
        first_paths = {'PATH': self.folder / 'bin', 'AMENT_PREFIX_PATH': self.folder}
        if self.numpy:
            # A sourced workspace may hold another klann_ros: the installed one comes before it.
            first_paths['PYTHONPATH'] = self.folder / 'lib' / f'python{VERSION}' / 'site-packages'
        for name, path in first_paths.items():
            variables[name] = os.pathsep.join(filter(None, [str(path), variables.get(name)]))
        return variables

    def tool(self, name: str) -> Command:
        """Return the command of a Python tool, also one of a sourced ROS's Python."""
        script = self.folder / 'bin' / name
        # -P: the checkout is the working folder, but the installed klann_ros is tested.
        return [script] if script.exists() else [self.python, '-P', '-m', name]


@contextmanager
def environment(command: str, ros: str = '') -> Iterator[Environment]:
    """
    Make the environment of `command` if needed, and lock it while in use.

    Without a name of a distribution, `ros` is the sourced one, else Jazzy. What running programs
    use is not changed: where it lacks something, a spare one is made.
    """
    names = os.environ.get('PIP_CONSTRAINT', '').split()
    constraints = '\n'.join(Path(name).read_text(encoding='utf-8') for name in names)
    sourced = os.environ.get('ROS_DISTRO', '')
    ros = ros or (sourced if sourced in DISTRIBUTIONS else 'jazzy')
    numpy = _numpy_of_sourced_ros(ros)
    folder = f'.venv-{VERSION}' + ('' if ros == 'jazzy' else f'-{ros}') + ('-ros' if numpy else '')
    if constraints:
        folder += '-' + hashlib.sha256(constraints.encode()).hexdigest()[:6]
    for number in count(1):
        suffix = f'-{number}' if number > 1 else ''
        env = Environment(source.ROOT / f'{folder}{suffix}', constraints, numpy, ros)
        env.folder.mkdir(exist_ok=True)
        # Users share a lock on the folder; the maker holds it exclusively.
        lock = os.open(env.folder, os.O_RDONLY)
        try:
            if _is_provided(lock, env, command):
                yield env
                return
        finally:
            os.close(lock)


def _is_provided(lock: int, env: Environment, command: str) -> bool:
    """Complete an environment and share its lock; return False if programs use it without that."""
    _await_maker(lock, env)
    while not _is_complete(env, command):
        if _acquires(lock, fcntl.LOCK_EX):
            # Another command may have had the lock in between.
            if not _is_complete(env, command):
                _make_environment(env, command)
        elif _acquires(lock, fcntl.LOCK_SH):
            print(f'{_users(env)} runs in {env.folder.name}, which lacks what is needed here.')
            return False
        _await_maker(lock, env)
    return True


def _await_maker(lock: int, env: Environment) -> None:
    """Share the lock of an environment, as soon as nobody installs into it."""
    progress = None
    while not _acquires(lock, fcntl.LOCK_SH):
        if progress is None:
            print(f'Waiting for {_users(env)}, which installs into {env.folder.name} ...')
            progress = Progress(env)
        progress.show()
        pause(0.2)


def _acquires(lock: int, kind: int) -> bool:
    """Return whether a lock is free and was taken; what was held of it before is lost."""
    with suppress(BlockingIOError):
        fcntl.flock(lock, kind | fcntl.LOCK_NB)
        return True
    return False


def _users(env: Environment) -> str:
    """Return the other commands in an environment, such as `scripts/demo --view (process 7)`."""
    users = []
    for path in Path('/proc').glob('[0-9]*/fd/*'):
        process = path.parent.parent
        # Processes end meanwhile, and those of other users are closed.
        with suppress(OSError):
            if process.name != str(os.getpid()) and path.readlink() == env.folder:
                _, _, command = (process / 'cmdline').read_text().partition('/main.py\0')
                words = ''.join(c if c.isprintable() else ' ' for c in command)
                users.append(f'scripts/{words.strip()} (process {process.name})')
    return ', '.join(users) or 'another program'


class Progress:
    """Lines of progress, now and then: the time, and what pip does."""

    def __init__(self, env: Environment) -> None:
        self.env = env
        self._log = env.folder / PIP_LOG
        self._begin = time.monotonic()
        self._shown_at = self._begin

    def show(self) -> None:
        """Print a line if one is due."""
        now = time.monotonic()
        if now - self._shown_at >= PROGRESS_PERIOD:
            self._shown_at = now
            step = last_lines(self._log) if self._log.exists() else ''
            print(f'... {now - self._begin:.0f} s  {" ".join(step.split())[:70]}'.rstrip())


def _numpy_of_sourced_ros(ros: str) -> str:
    """Return the NumPy that goes with this ROS 2 where the shell has it; else ''."""
    distro = os.environ.get('ROS_DISTRO')
    if not distro:
        return ''
    reason = f'this needs {ros}'
    if distro == ros:
        probe = [sys.executable, '-c', 'import rclpy, numpy; print(numpy.__version__)']
        answer = subprocess.run(probe, capture_output=True, check=False, text=True)
        if answer.returncode == 0:
            return answer.stdout.strip()
        reason = (answer.stderr.strip() or 'no rclpy').splitlines()[-1]
    print(f'ROS 2 {distro} is sourced, but wheels are used: {reason}')
    return ''


def _stamp_lines(env: Environment, command: str) -> tuple[str, str, str]:
    """Return the stamp's lines of a complete environment: its Python, sources and packages."""
    extras, requirements = NEEDS[command]
    if env.has_locked(command):
        requirements = LOCK
    packages = _text_with_included(requirements) if requirements else ''
    inputs = [env.constraints, env.numpy, extras, packages]
    installed = hashlib.sha256('\0'.join(inputs).encode()).hexdigest()
    python_line = f'{env.folder} {Path(sys.executable).resolve()}'
    return python_line, f'sources {source.digest()}', f'{command} {installed}'


def _text_with_included(requirements: Path) -> str:
    """Return a requirements file with those that it includes."""
    text = requirements.read_text('utf-8')
    for name in re.findall(r'^-r (.+)', text, re.MULTILINE):
        text += _text_with_included(requirements.parent / name)
    return text


def _is_complete(env: Environment, command: str) -> bool:
    return _installed(env).issuperset(_stamp_lines(env, command))


def _installed(env: Environment) -> set[str]:
    stamp = env.folder / STAMP
    # The interpreter may be gone since.
    is_complete = stamp.exists() and env.python.exists()
    return set(stamp.read_text('utf-8').splitlines()) if is_complete else set()


def _make_environment(env: Environment, command: str) -> None:
    begin = time.monotonic()
    kind = f'{"the sourced" if env.numpy else "wheels of"} ROS 2 {env.ros.title()}'
    print(
        f'Installing klann_ros and what scripts/{command} needs into {env.folder.name} '
        f'(Python {platform.python_version()}, {kind}) ...'
    )
    lines = _stamp_lines(env, command)
    installed = _installed(env)
    is_made = lines[0] in installed
    # Without a stamp it is rebuilt from scratch, as after an interruption from here on.
    (env.folder / STAMP).unlink(missing_ok=True)
    try:
        _install(env, command, is_made)
    except BaseException as error:
        if is_made and isinstance(error, PipError) and not env.has_locked(command):
            # pip fetches and builds before it changes anything: the old environment still works.
            # Of several side by side, one may have changed it.
            _write_stamp(env, installed)
        else:
            # An incomplete environment would fail later.
            _empty(env)
        raise
    # Of other sources the other commands' packages may not be sufficient.
    others = installed if {*lines[:2]} <= installed else set()
    _write_stamp(env, {*others, *lines})
    print(f'... done in {time.monotonic() - begin:.0f} s')


def _empty(env: Environment) -> None:
    """Remove what is in the folder of an environment; the folder itself is the lock."""
    for path in env.folder.iterdir():
        shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


def _write_stamp(env: Environment, lines: set[str]) -> None:
    (env.folder / STAMP).write_text('\n'.join(lines), encoding='utf-8')


def _install(env: Environment, command: str, is_made: bool) -> None:
    progress = Progress(env)
    with tempfile.TemporaryDirectory(prefix='klann_ros-') as folder:
        work = Path(folder)
        # Python compiles modules at their first import.
        pip = [env.python, '-m', 'pip', 'install', '--progress-bar=off', '--no-input']
        pip += ['--no-compile']
        if not is_made:
            _make_venv(progress, work)
            # Today's pip takes a quarter of the time of one that is two years old.
            build_packages = ['pip', BUILD]
            if env.is_locked:
                packages = [text for text in _locked_packages() if text.startswith(LOCKED_BUILD)]
                build_packages = _locked(packages, work / 'build.txt')
            _run(progress, [*pip, '--upgrade', *build_packages])
        # The message types of a sourced ROS were compiled for its very NumPy.
        numpy = f'\nnumpy=={env.numpy}' if env.numpy else ''
        (work / 'constraints.txt').write_text(env.constraints + numpy, encoding='utf-8')
        source.copy(work / 'source')
        options = ['--no-build-isolation', '--constraint', work / 'constraints.txt']
        extras, requirements = NEEDS[command]
        if env.has_locked(command):
            pip += [*options, '--no-deps']
            packages = [text for text in _locked_packages() if not text.startswith(LOCKED_BUILD)]
            parts = [
                _locked(packages[part::LOCKED_PARTS], work / f'part_{part}.txt')
                for part in range(LOCKED_PARTS)
            ]
            _run(progress, *([*pip, *part] for part in parts), [*pip, work / 'source'])
            return
        packages = [f'{work}/source[{extras}{"" if env.numpy else f",{DISTRIBUTIONS[env.ros]}"}]']
        if requirements:
            packages += ['--requirement', str(requirements)]
        _run(progress, [*pip, *options, *packages])


def _locked_packages() -> list[str]:
    """Return the entries of the lock file: a version and its hashes each."""
    return LOCKED_PACKAGE.findall(LOCK.read_text('utf-8'))


def _locked(packages: list[str], file: Path) -> list[str]:
    """Return the options of pip that install these entries, through a requirements file."""
    file.write_text('\n'.join(packages), encoding='utf-8')
    return ['--require-hashes', '--requirement', str(file)]


def _make_venv(progress: Progress, work: Path) -> None:
    """Make an empty environment with pip, also by a Python that brings none (Debian's)."""
    if find_spec('venv') is None:
        raise CommandError(f'{sys.executable} has no venv: apt install python3-venv')
    # The processes of a set-up that was killed end a moment after it.
    pause(0.5)
    env = progress.env
    _empty(env)
    options = ['--system-site-packages'] if env.numpy else []
    _run(progress, [sys.executable, '-m', 'venv', '--without-pip', *options, env.folder])
    # As ensurepip does, but in a process that ends with this one.
    wheel = _bundled_pip() or _fetch_pip(work)
    _run(progress, [env.python, wheel / 'pip', 'install', '--no-index', wheel])


def _bundled_pip() -> Path | None:
    """Return the wheel of pip that comes with this Python; None without one."""
    folders = [sysconfig.get_config_var('WHEEL_PKG_DIR')]
    spec = find_spec('ensurepip')
    if spec is not None and spec.origin:
        folders.append(str(Path(spec.origin).with_name('_bundled')))
    for folder in filter(None, folders):
        for wheel in Path(folder).glob('pip-*.whl'):
            return wheel
    return None


def _fetch_pip(work: Path) -> Path:
    with urlopen(PIP, timeout=20) as answer:
        content = answer.read()
    if hashlib.sha256(content).hexdigest() != PIP_SHA256:
        raise CommandError(f'{PIP} is not what it was: apt install python3-venv')
    wheel = work / Path(PIP).name
    wheel.write_bytes(content)
    return wheel


def _run(progress: Progress, *commands: Command) -> None:
    """Run a step of a set-up, its commands side by side; a PipError has a reason in one line."""
    folder = progress.env.folder
    logs = [folder / PIP_LOG]
    for number in range(2, len(commands) + 1):
        logs.append(folder / f'pip_{number}.txt')

    def step(command: Command, log: Path) -> int | None:
        return run(command, progress.env.variables, log, on_pause=progress.show)

    with ThreadPoolExecutor() as pool:
        codes = [*pool.map(step, commands, logs)]
    for code, log in zip(codes, logs, strict=True):
        if code != 0:
            raise PipError(f'set-up of {folder.name} failed: {_failure(log)}')


def _failure(log: Path) -> str:
    """Return why pip failed, in one line, and what may help."""
    lines = log.read_text('utf-8', 'replace').splitlines()
    if any('Retrying (' in line or 'timed out' in line for line in lines):
        return (
            'the package index does not answer. Check the network; pip takes a proxy in '
            'PIP_PROXY, another index in PIP_INDEX_URL'
        )
    errors = [line.removeprefix('ERROR: ') for line in lines if line.startswith('ERROR: ')]
    return f'{errors[0] if errors else last_lines(log)}; it needs {NEEDED}'
