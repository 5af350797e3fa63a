"""The sdist and the wheel: built, checked for junk, and tried on every Python found here."""

import argparse
from collections.abc import Iterator
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
from zipfile import ZipFile

from domain import own_world
from processes import Command, CommandError, last_lines, run
import source

MINORS = range(10, 15)
# Its tests of a pip installation import nothing of the checkout but `domain`.
TESTS = source.ROOT / 'test' / 'packaging' / 'test_installed.py'
PYTEST = ['-q', '--noconftest', '-p', 'no:cacheprovider', '-c', os.devnull, '-k', 'pip']
# What a build adds to the shipped files.
_OF_SDIST = ('PKG-INFO', 'setup.cfg', 'MANIFEST.in', 'klann_ros.egg-info/')
_OF_WHEEL = ('.dist-info/', '.data/data/')


def main(arguments: list[str]) -> int:
    """Build and try the wheel; return 0 if it passes on every Python."""
    parser = argparse.ArgumentParser(
        prog='scripts/wheel',
        description='Build the sdist and the wheel, and try the wheel alone on every Python.',
    )
    parser.add_argument('-o', '--output', type=Path, help='keep both files in this folder')
    parser.add_argument('python', nargs='*', help='interpreters; default: all of 3.10 to 3.14')
    options = parser.parse_args(arguments)
    pythons = options.python or list(_pythons())
    failed: list[str] = []
    with (
        tempfile.TemporaryDirectory(prefix='klann_ros-') as folder,
        own_world(Path(folder)) as world,
    ):
        work = Path(folder)
        variables = _without_ros(os.environ) | world
        sdist, wheel = _build(work, variables)
        print(f'{sdist.name} and {wheel.name}: {_check_files(sdist, wheel)} files, no junk')
        for python in pythons:
            begin = time.monotonic()
            error = _try(python, wheel, work / f'venv{len(failed)}', variables)
            verdict = f'FAILED\n{error}' if error else 'ok'
            print(f'{python:20} {time.monotonic() - begin:6.1f} s  {verdict}')
            if error:
                failed.append(python)
        if options.output:
            options.output.mkdir(parents=True, exist_ok=True)
            for file in (sdist, wheel):
                print(shutil.copy(file, options.output))
    return 1 if failed else 0


def _without_ros(variables: os._Environ[str]) -> dict[str, str]:
    """Return the variables without a sourced ROS: the wheel brings its own."""
    ros = ('PYTHON', 'AMENT', 'COLCON', 'ROS_', 'RMW_', 'LD_LIBRARY', '_ROS', 'VIRTUAL_ENV')
    return {k: v for k, v in variables.items() if not k.startswith(ros)}


def _pythons() -> Iterator[str]:
    """Yield an interpreter of each supported version, from PATH or pyenv."""
    pyenv = Path(os.environ.get('PYENV_ROOT', Path.home() / '.pyenv'), 'versions')
    for minor in MINORS:
        names = [f'python3.{minor}', *map(str, sorted(pyenv.glob(f'3.{minor}.*/bin/python')))]
        working = [name for name in names if shutil.which(name) and _version(name) == (3, minor)]
        if working:
            yield working[-1]
        else:
            print(f'python3.{minor}: not here, not tried')


def _version(python: str) -> tuple[int, int]:
    """Return an interpreter's version; (0, 0) for one that does not run, as a pyenv shim."""
    code = 'import sys; print(*sys.version_info[:2])'
    answer = subprocess.run([python, '-ESc', code], capture_output=True, check=False, text=True)
    major, minor = map(int, answer.stdout.split() or (0, 0))
    return major, minor


def _build(work: Path, variables: dict[str, str]) -> tuple[Path, Path]:
    """Build both from a copy of the shipped files, the wheel from the sdist, as an index does."""
    source.copy(work / 'source')
    shutil.copy(source.ROOT / 'MANIFEST.in', work / 'source')
    _run_step([sys.executable, '-m', 'venv', work / 'build'], variables, work)
    python = work / 'build' / 'bin' / 'python'
    _run_step([python, '-m', 'pip', 'install', '--quiet', 'build'], variables, work)
    _run_step([python, '-m', 'build', '--outdir', work / 'dist', work / 'source'], variables, work)
    (sdist,) = (work / 'dist').glob('*.tar.gz')
    (wheel,) = (work / 'dist').glob('*.whl')
    return sdist, wheel


def _check_files(sdist: Path, wheel: Path) -> int:
    """Return the number of files of both; raise CommandError for one that is not shipped."""
    shipped = {str(file) for file in source.files()}
    with tarfile.open(sdist) as archive:
        members = [member.name for member in archive.getmembers() if member.isfile()]
    sdist_names = [name.partition('/')[2] for name in members]
    wheel_names = ZipFile(wheel).namelist()
    junk = {name for name in sdist_names if not name.startswith(_OF_SDIST)}
    junk |= {name for name in wheel_names if not any(text in name for text in _OF_WHEEL)}
    junk -= shipped
    missing = {name for name in shipped if name.startswith('klann_ros/')} - {*wheel_names}
    if junk or missing:
        raise CommandError(f'junk: {sorted(junk)}; missing: {sorted(missing)}')
    return len(sdist_names) + len(wheel_names)


def _try(python: str, wheel: Path, venv: Path, variables: dict[str, str]) -> str:
    """Install the wheel alone and try it; return the end of the output of what failed."""
    variables = variables | {'VIRTUAL_ENV': str(venv), 'AMENT_PREFIX_PATH': str(venv)}
    variables |= {'PATH': f'{venv}/bin:{variables["PATH"]}', 'PYTHONNOUSERSITE': '1'}
    variables |= {'PYTHONPATH': str(Path(__file__).parent)}
    output = venv.with_suffix('.txt')
    steps: list[Command] = [
        [python, '-m', 'venv', '--clear', venv],
        [venv / 'bin/python', '-m', 'pip', 'install', '-q', f'{wheel}[ros,view,sim]', 'pytest'],
        [venv / 'bin/python', '-m', 'pytest', *PYTEST, TESTS],
    ]
    failed = any(run(step, variables, output) != 0 for step in steps)
    return last_lines(output, 15) if failed else ''


def _run_step(command: Command, variables: dict[str, str], work: Path) -> None:
    if run(command, variables, work / 'log') != 0:
        raise CommandError(f'the build failed:\n{last_lines(work / "log", 15)}')
