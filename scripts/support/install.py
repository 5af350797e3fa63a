"""Make an environment, or bring it up to date."""

import json
from pathlib import Path
import platform
import re
import tempfile
import time

from command_error import CommandError
from environment import Environment, REQUIREMENTS, STAMP
import processes
import source

# 70.1: the first that makes wheels by itself; colcon-core wants one below 80.
BUILD = 'setuptools>=70.1,<80'
UNREACHABLE = re.compile(
    r'NewConnection|NameResolution|ConnectTimeout|Max retries|ProxyError|getaddrinfo|unreachable'
)


class Installation:
    """One making of an environment; `command` is what it is made for."""

    def __init__(self, environment: Environment, command: str, work: Path) -> None:
        self._environment = environment
        self._command = command
        self._work = work
        self._log = work / 'log'
        # pip leaves its temporary folders behind when it is interrupted; not in here.
        (work / 'tmp').mkdir()
        self._variables = environment.variables | {'TMPDIR': str(work / 'tmp')}
        self._constraints = work / 'constraints.txt'
        pins = [environment.constraints]
        if environment.sourced:
            # The message types of a sourced ROS were compiled for this very NumPy.
            pins.append(f'numpy=={environment.sourced.numpy}')
        self._constraints.write_text('\n'.join(pins) + '\n', encoding='utf-8')

    def make(self) -> dict[str, object]:
        """Do what is missing; return the stamp that says what there is now."""
        environment, command = self._environment, self._command
        copy = self._work / 'source'
        source.copy(copy)
        stamp = environment.stamp()
        # Without a stamp it is made from nothing: so ends what is interrupted from here on.
        (environment.folder / STAMP).unlink(missing_ok=True)
        if not stamp:
            self._venv()
            stamp['identity'] = environment.identity
        if stamp.get(command) != environment.requirements(command):
            wanted: list[str | Path] = [f'{copy}[{",".join(environment.extras(command))}]']
            if command in REQUIREMENTS:
                wanted += ['-r', REQUIREMENTS[command]]
            self._pip(BUILD)
            self._pip(*wanted)
            # What the checks need includes what the demo needs.
            for name in {'test': ('demo', 'test')}.get(command, (command,)):
                stamp[name] = environment.requirements(name)
        else:
            self._pip('--no-deps', '--force-reinstall', copy)
        stamp['source'] = source.digest(copy)
        return stamp

    def _venv(self) -> None:
        options = ['--system-site-packages'] if self._environment.sourced else []
        folder = self._environment.folder
        self._run(self._environment.base_python, '-m', 'venv', '--clear', *options, folder)

    def _pip(self, *wanted: str | Path) -> None:
        self._run(
            *(self._environment.python, '-m', 'pip', 'install', '--quiet', '--no-input'),
            *('--disable-pip-version-check', '--no-build-isolation'),
            *('--constraint', self._constraints, *wanted),
        )

    def _run(self, *arguments: str | Path) -> None:
        self._log.write_bytes(b'')
        code = processes.run(arguments, self._log, self._variables, self._work)
        if code:
            text = self._log.read_text(encoding='utf-8', errors='replace')
            raise CommandError(
                f'set-up of {self._environment.folder.name} failed: {explain(text)}'
            )


def install(environment: Environment, command: str) -> None:
    """Make an environment fit for a command, or bring it up to date."""
    name, begin = environment.folder.name, time.monotonic()
    if environment.stamp().get(command) == environment.requirements(command):
        print(f'The sources have changed: installing them into {name} ...')
    else:
        kind = 'the sourced ROS 2' if environment.sourced else 'ROS 2 from wheels'
        python = platform.python_version()
        print(f'Setting up {name} for scripts/{command}, once: Python {python}, {kind} ...')
    with tempfile.TemporaryDirectory(prefix='klann_ros-') as work:
        try:
            stamp = Installation(environment, command, Path(work)).make()
            (environment.folder / STAMP).write_text(json.dumps(stamp, indent=1), encoding='utf-8')
        except OSError as error:
            raise CommandError(f'set-up of {name} failed: {error}') from error
    print(f'... done in {time.monotonic() - begin:.0f} s')


def explain(output: str) -> str:
    """Say in one line what a failed installer said last, and what can be done."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    errors = [line for line in lines if re.match(r'(\w*Error|error|ERROR): (?!Resolution)', line)]
    last = (errors or lines or ['no output'])[-1]
    if UNREACHABLE.search(output):
        return f'{last} (no network? it is needed once; then run this command again)'
    if 'ros-jazzy' in last:
        machine = f'this is Python {platform.python_version()} on {platform.machine()}'
        return (
            f'{last} (ROS 2 wheels: Python 3.10 to 3.14 on x86-64 Linux; {machine}; '
            'otherwise source a ROS 2 Jazzy)'
        )
    return last
