"""Every check of the project, one line each; the output only of those that fail."""

import argparse
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
import re
import tempfile
import time

import browser
from domain import own_domain
from environment import Environment, environment
import processes
from source import ROOT

NAMES = ('ruff', 'format', 'ament_flake8', 'ament_pep257', 'mypy', 'colcon', 'pytest')
PYTHON_FILES = (
    'setup.py',
    'klann_ros',
    'launch',
    'scripts',
    'test',
    'benchmarks',
    'examples',
    'docs',
)
# Tests that compute beside those that wait for processes; see test/conftest.py.
WORKERS = ('-n', '3', '--dist', 'loadgroup')
# A check that hangs is ended, so that CI still gets to see its output.
TIMEOUT = 840.0
SUMMARY = re.compile(r'\bin \d+\.\d+s')


@dataclass(frozen=True)
class Check:
    """A name, and the command that ends with 0 when all is well."""

    name: str
    command: Sequence[str | Path]


def main(arguments: list[str]) -> int:
    """Run the checks; return 0 if all of them passed."""
    names, pytest_arguments = _parse(arguments)
    failed, summary = [], ''
    with (
        environment('test') as env,
        tempfile.TemporaryDirectory(prefix='klann_ros-') as work,
        own_domain() as domain,
    ):
        variables = env.variables | {
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_DOMAIN_ID': str(domain),
            'ROS_LOG_DIR': f'{work}/ros-log',
        }
        if 'colcon' in names:
            # Without it the tests build the package themselves.
            variables['KLANN_ROS_COLCON_PREFIX'] = f'{work}/install'
        if 'pytest' in names:
            browser.provide(Path(work))
        for check in _checks(env, Path(work), pytest_arguments):
            if check.name not in names:
                continue
            output = Path(work, f'{check.name}.txt')
            if not _run(check, output, variables):
                failed.append(check.name)
            if check.name == 'pytest':
                summary = _summary(output)
    if failed:
        print(f'failed: {", ".join(failed)}')
    if summary:
        print(summary)
    return 1 if failed else 0


def _checks(env: Environment, work: Path, pytest_arguments: list[str]) -> list[Check]:
    colcon: list[str | Path] = ['--log-base', work / 'log', 'build', '--paths', ROOT]
    colcon += ['--build-base', work / 'build', '--install-base', work / 'install']
    files = [name for name in PYTHON_FILES if _has_python(ROOT / name)]
    ruff = env.tool('ruff')
    return [
        Check('ruff', [*ruff, 'check', '--quiet', '--output-format=concise', *files]),
        Check('format', [*ruff, 'format', '--check', '--diff', '--quiet', *files]),
        Check('ament_flake8', [env.python, '-m', 'ament_flake8.main', *files]),
        Check('ament_pep257', [env.python, '-m', 'ament_pep257.main', *files]),
        Check('mypy', env.tool('mypy')),
        Check('colcon', [env.python, '-m', 'colcon', *colcon]),
        Check('pytest', [*env.tool('pytest'), *WORKERS, *pytest_arguments]),
    ]


def _has_python(path: Path) -> bool:
    # The linters take a folder without Python files for a mistake.
    return path.is_file() or any(path.rglob('*.py'))


def _parse(arguments: list[str]) -> tuple[list[str], list[str]]:
    pytest_arguments: list[str] = []
    if '--' in arguments:
        at = arguments.index('--')
        arguments, pytest_arguments = arguments[:at], arguments[at:][1:]
    parser = argparse.ArgumentParser(
        prog='scripts/test',
        description='Run the checks of klann_ros, each in the environment made for them.',
        epilog='What follows -- is for pytest: scripts/test pytest -- -k branch',
    )
    help_text = f'one or more of {", ".join(NAMES)}; default: all'
    parser.add_argument('check', nargs='*', metavar='CHECK', help=help_text)
    chosen = parser.parse_args(arguments).check
    unknown = [name for name in chosen if name not in NAMES]
    if unknown:
        parser.error(f'no such check: {", ".join(unknown)}')
    return chosen or list(NAMES), pytest_arguments


def _run(check: Check, output: Path, variables: dict[str, str]) -> bool:
    print(f'{check.name:14}', end='', flush=True)
    begin = time.monotonic()
    code = processes.run(check.command, output, variables, ROOT, TIMEOUT)
    result = {0: 'ok', None: 'TIMED OUT'}.get(code, 'FAILED')
    print(f'{result:10}{time.monotonic() - begin:6.1f} s')
    text = output.read_text(encoding='utf-8', errors='replace')
    if code != 0:
        print(text)
    else:
        # A skipped test proves nothing, so it is named.
        for line in text.splitlines():
            if line.startswith('SKIPPED'):
                print(f'    {line}')
    return code == 0


def _summary(output: Path) -> str:
    """Return pytest's closing line: so many passed, in so many seconds."""
    with suppress(OSError):
        for line in reversed(output.read_text(encoding='utf-8', errors='replace').splitlines()):
            if SUMMARY.search(line):
                return line.strip('= ')
    return 'pytest gave no summary'
