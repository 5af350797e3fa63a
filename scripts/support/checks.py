"""Every check of the project, one line each, with the output of failed checks."""

import argparse
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median
import tempfile
import time

import browser
from domain import own_world
from environment import DISTRIBUTIONS, Environment, environment
from processes import Command, last_lines, run
from source import ROOT

NAMES = ('colcon', 'collection', 'mypy', 'docs', 'ruff', 'format', 'pytest')
# Run where they are asked for: `slow` is what costs much and rarely breaks (pytest.mark.slow);
# ROS's linters take 40 s, and ruff with test/style refuses the same in one; pyodide fetches 90 MB;
# mypy for other systems finds names that they lack.
PLATFORMS = {'mypy_windows': 'win32', 'mypy_macos': 'darwin'}
EXTRA = ('slow', 'ament_flake8', 'ament_pep257', 'pyodide', *PLATFORMS)
FILES = ('setup.py', 'klann_ros', 'launch', 'scripts', 'test', 'benchmarks', 'examples', 'docs')
# Computing tests run beside tests that wait for processes; see test/conftest.py. Each worker costs
# ten seconds of CPU: it collects the tests, imports ROS, and opens a browser.
WORKERS = ('-n', '4')
# The tests of real nodes, slow ones too, for the other distributions of ROS.
ROS_TESTS = (
    *('test/nodes', 'test/examples/test_hardware_driver.py', 'test/review/test_real_run.py'),
    *('-m', ''),
)
# What the tests need: an installation, and their compiled files.
FIRST = ('colcon', 'collection')
# They need a browser as well.
TESTS = ('pytest', 'slow', 'pyodide')
# The others run beside all of these and take only what they leave of a core.
IN_BACKGROUND = ('nice', '-n', '19')
# A hanging check is interrupted, so that CI shows its output: pytest then names what failed [s].
TIMEOUT = 840.0
# Time of `_slowness` where nothing else runs, and the largest factor of the limits [s].
REFERENCE_TIME = 0.015
MAX_SLOWNESS = 6.0
# Up to this number of failed tests run again, one after the other: a busy machine may starve a
# real process. They are listed in any case.
MAX_RERUNS = 5


def main(arguments: list[str]) -> int:
    """Run the checks; return 0 if all of them passed."""
    names, ros, pytest_arguments = _parse(arguments)
    command = 'test slow' if 'slow' in names else 'test'
    failed = []
    summary = ''
    with (
        environment('test --ros' if ros else command, ros) as env,
        tempfile.TemporaryDirectory(prefix='klann_ros-') as folder,
        own_world(Path(folder)) as world,
    ):
        work = Path(folder)
        variables = env.variables | world
        # All processes of the tests share the compiled files.
        variables.pop('PYTHONDONTWRITEBYTECODE', None)
        slowness = _slowness()
        variables['KLANN_ROS_SLOWNESS'] = f'{slowness:.2f}'
        if 'colcon' in names:
            # Without it the tests build the package themselves.
            variables['KLANN_ROS_COLCON_PREFIX'] = f'{work}/install'
        commands = _commands(env, work, pytest_arguments)
        requested = [name for name in commands if name in names]
        first = [name for name in requested if name in FIRST]
        tests = [name for name in requested if name in TESTS]
        background = [name for name in requested if name not in FIRST + TESTS]

        def passes(name: str) -> bool:
            prefix = IN_BACKGROUND if name in background else ()
            return _passes(name, [*prefix, *commands[name]], variables, work, slowness * TIMEOUT)

        with ThreadPoolExecutor() as first_pool, ThreadPoolExecutor(2) as background_pool:
            provided = first_pool.submit(browser.provide, env, work) if tests else None
            first_verdicts = first_pool.map(passes, first)
            background_verdicts = background_pool.map(passes, background)
            verdicts = dict(zip(first, first_verdicts, strict=True))
            if provided and (advice := provided.result()):
                print(f'{"browser":14}FAILED    {advice}')
                failed.append('browser')
            for name in tests:
                verdicts[name] = passes(name)
            if verdicts.get('pytest') is False and _is_rare(work):
                verdicts['pytest'] = passes('alone')
            verdicts |= zip(background, background_verdicts, strict=True)
        failed += [name for name, is_passed in verdicts.items() if not is_passed]
        if 'pytest' in names:
            # The number of passed tests and the time.
            summary = last_lines(work / 'pytest.txt').strip('= ')
    if failed:
        print(f'failed: {", ".join(failed)}')
    if summary:
        print(summary)
    return 1 if failed else 0


def _parse(arguments: list[str]) -> tuple[list[str], str, list[str]]:
    """Return the names of checks, the distribution of ROS ('' for any), pytest's arguments."""
    end = arguments.index('--') if '--' in arguments else len(arguments)
    pytest_arguments = arguments[end:][1:]
    parser = argparse.ArgumentParser(
        prog='scripts/test',
        description='Run the checks of klann_ros, each in the environment made for them.',
        epilog='What follows -- is for pytest: scripts/test pytest -- -k branch',
    )
    help_text = f'one or more of {", ".join(NAMES)}; default: all of them; also {", ".join(EXTRA)}'
    parser.add_argument('check', nargs='*', metavar='CHECK', help=help_text)
    help_text = 'pytest alone, on real nodes, with this distribution of ROS 2'
    parser.add_argument('--ros', choices=DISTRIBUTIONS, default='', help=help_text)
    options = parser.parse_args(arguments[:end])
    names = options.check
    unknown = [name for name in names if name not in NAMES + EXTRA]
    if unknown:
        parser.error(f'no such check: {", ".join(unknown)}')
    if options.ros:
        if names not in ([], ['pytest']):
            parser.error('--ros runs pytest alone')
        return ['pytest'], options.ros, pytest_arguments or [*ROS_TESTS]
    return names or list(NAMES), '', pytest_arguments


def _commands(env: Environment, work: Path, pytest_arguments: list[str]) -> dict[str, Command]:
    """Return the command of each check; it exits with 0 on success."""
    colcon = [env.python, '-m', 'colcon', '--log-base', work / 'log', 'build', '--paths', ROOT]
    colcon += ['--build-base', work / 'build', '--install-base', work / 'install']
    ruff = env.tool('ruff')
    return {
        'ament_flake8': [env.python, '-m', 'ament_flake8.main', *FILES],
        'ament_pep257': [env.python, '-m', 'ament_pep257.main', *FILES],
        # The longest first: two run side by side.
        'colcon': colcon,
        # It compiles the tests once for all workers.
        'collection': [*env.tool('pytest'), '--collect-only', '--quiet', '-rN'],
        'mypy': env.tool('mypy'),
        'docs': [env.python, 'docs/build.py', work / 'docs'],
        'ruff': [*ruff, 'check', '--quiet', '--output-format=concise', *FILES],
        'format': [*ruff, 'format', '--check', '--diff', '--quiet', *FILES],
        **{name: _portable_mypy(env, PLATFORMS[name]) for name in PLATFORMS},
        'pyodide': [env.python, 'scripts/support/pyodide.py', work / 'pyodide'],
        'pytest': [*env.tool('pytest'), *WORKERS, *pytest_arguments],
        'slow': [*env.tool('pytest'), *WORKERS, '-m', 'slow', *pytest_arguments],
        'alone': [*env.tool('pytest'), '--last-failed', '--last-failed-no-failures=none'],
    }


def _portable_mypy(env: Environment, platform: str) -> Command:
    """Return the command that checks all but the nodes, as on another system."""
    command = [*env.tool('mypy'), '--platform', platform, '--cache-dir', f'.mypy_cache/{platform}']
    command += ['-m', 'klann_ros.executables', '-m', 'klann_ros.engines']
    for face in sorted(ROOT.glob('klann_ros/*/__init__.py')):
        if face.parent.name != 'nodes':
            command += ['-p', f'klann_ros.{face.parent.name}']
    return command


def _is_rare(work: Path) -> bool:
    """Return whether pytest ran to its end, and few tests failed."""
    lines = (work / 'pytest.txt').read_text(encoding='utf-8', errors='replace').splitlines()
    failed = sum(line.startswith(('FAILED ', 'ERROR ')) for line in lines)
    return 0 < failed <= MAX_RERUNS and ' passed' in lines[-1]


def _slowness() -> float:
    """Return how many times longer than usual this machine computes now: 1 to MAX_SLOWNESS."""
    durations = []
    for _ in range(7):
        begin = time.perf_counter()
        sum(number * number for number in range(200_000))
        durations.append(time.perf_counter() - begin)
    return min(max(median(durations) / REFERENCE_TIME, 1.0), MAX_SLOWNESS)


def _passes(
    name: str, command: Command, variables: dict[str, str], work: Path, timeout: float
) -> bool:
    begin = time.monotonic()
    output = work / f'{name}.txt'
    code = run(command, variables, output, timeout)
    verdict = {0: 'ok', None: 'TIMED OUT'}.get(code, 'FAILED')
    report = [f'{name:14}{verdict:10}{time.monotonic() - begin:6.1f} s']
    text = output.read_text(encoding='utf-8', errors='replace')
    if code == 0:
        # A skipped test proves nothing, so it is listed.
        lines = [line for line in text.splitlines() if line.startswith(('SKIPPED', 'MEASURED'))]
        report += [f'    {line}' for line in lines]
    else:
        report.append(text)
    # In one piece: another check may end at the same time.
    print('\n'.join(report) + '\n', end='')
    return code == 0
