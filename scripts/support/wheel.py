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

import demo
from domain import own_world
from processes import Command, CommandError, last_lines, run
import source

MINORS = range(10, 15)
# Its tests of a pip installation import of the checkout what is beside them, and `domain`.
TESTS = source.ROOT / 'test' / 'packaging' / 'test_installed.py'
PYTEST = ['-q', '--noconftest', '-p', 'no:cacheprovider', '-c', os.devnull, '-k', 'pip']
# Every module imports, with all that the extra `all` installs.
IMPORTS = """\
from importlib import import_module
from pkgutil import walk_packages
import klann_ros
for module in walk_packages(klann_ros.__path__, 'klann_ros.'):
    import_module(module.name)
"""
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
    if (source.ROOT / '.git').exists():
        git = shutil.which('git') or 'git'
        tracked = subprocess.check_output([git, 'ls-files', '-z'], cwd=source.ROOT, text=True)
        junk |= shipped - {*tracked.split('\0')}
    missing = {name for name in shipped if name.startswith('klann_ros/')} - {*wheel_names}
    data_names = {Path(name).name for name in wheel_names if '.data/data/' in name}
    data_folders = tuple(f'{folder}/' for folder in source.FOLDERS if folder != 'klann_ros')
    for name in shipped:
        if name.startswith(data_folders) and Path(name).name not in data_names:
            missing.add(name)
    if junk or missing:
        raise CommandError(f'junk: {sorted(junk)}; missing: {sorted(missing)}')
    return len(sdist_names) + len(wheel_names)


def _try(python: str, wheel: Path, venv: Path, variables: dict[str, str]) -> str:
    """Install the wheel alone and try it; return the end of the output of what failed."""
    variables = variables | {'VIRTUAL_ENV': str(venv), 'AMENT_PREFIX_PATH': str(venv)}
    variables |= {'PATH': f'{venv}/bin:{variables["PATH"]}', 'PYTHONNOUSERSITE': '1'}
    output = venv.with_suffix('.txt')
    folders = [Path(__file__).parent, TESTS.parents[1] / 'support']
    test_variables = variables | {'PYTHONPATH': os.pathsep.join(map(str, folders))}
    programs = venv / 'bin'
    pip = [programs / 'python', '-m', 'pip', 'install', '-q']
    steps: list[Command] = [
        [python, '-m', 'venv', '--clear', venv],
        [*pip, f'{wheel}[all]', 'pytest'],
        [programs / 'python', '-m', 'pytest', *PYTEST, TESTS],
        [programs / 'python', '-I', '-c', IMPORTS],
        [programs / 'describe', 'sem104', '--html', venv / 'leg.html'],
        [programs / 'export', 'klann', '--urdf', venv / 'leg.urdf', '--stl', venv / 'parts'],
    ]
    for step in steps:
        if run(step, test_variables if TESTS in step else variables, output) != 0:
            return last_lines(output, 15)
    try:
        demo.record_turns(venv / 'run', programs, variables, venv)
        demo.review_page(venv / 'run', programs, variables, venv)
    except CommandError as error:
        return str(error)
    return ''


def _run_step(command: Command, variables: dict[str, str], work: Path) -> None:
    if run(command, variables, work / 'log') != 0:
        raise CommandError(f'the build failed:\n{last_lines(work / "log", 15)}')
