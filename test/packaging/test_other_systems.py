"""Every program that is no node, on Windows and macOS: played on Linux, else the real one."""

import ast
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
import importlib.util
import json
import os
from pathlib import Path
import subprocess
import sys
from typing import NamedTuple

import klann_ros
from klann_ros.kinematics import KlannLeg
from leg_runs import LegRun
from measured_robots import Robot
import numpy as np
import pytest

PROGRAMS = Path(__file__).resolve().parents[1] / 'support' / 'other_system'
PACKAGE = Path(klann_ros.__file__).resolve().parents[1]
GEOMETRY = {**KlannLeg().linkage.dimensions, 'assembly': [1, 1]}
# With the line ends, the mark and the letters of Windows' editors and spreadsheets.
REQUIREMENTS = """\
linkage: klann
vary: 10
figures: {stride: maximize, lift: maximize, transmission_angle: {at_least: 0.3}}
count: 2
"""
STUDENTS = 'student,name\n11223344,João Ångström\n'
# The systems that are tried here.
IS_LINUX = sys.platform == 'linux'
PLATFORMS = (
    ('win32', pytest.param('darwin', marks=pytest.mark.slow)) if IS_LINUX else (sys.platform,)
)
# The commands, and what each returns.
COMMANDS = {
    ('describe', 'ψ_leg.yaml', '--html', 'leg.html', '--json', 'leg.json'): 0,
    ('export', 'klann', '--svg', 'plates.svg', '--urdf', 'leg.urdf', '--mjcf', 'leg.xml'): 0,
    ('design', 'toy.yaml', '-o', 'legs', '--evaluations', '480', '--jobs', '1'): 0,
    ('calibrate', 'points.csv', '--leg', 'sem104', '-o', 'built.yaml', '--html', 'built.html'): 0,
    ('exercise', 'make', '--kind', 'grashof', '--students', 'class.csv', '-o', 'exam'): 0,
    ('exercise', 'mark', 'exam/answers.csv', '--csv', 'marks.csv'): 0,
    ('review', 'runs/good', '--html', 'run.html', '--csv', 'run.csv', '--annotate', 'judged'): 0,
    (
        'review',
        '--each',
        'runs',
        '--table',
        'runs.csv',
        '--html',
        'runs.html',
        '--junit',
        'j.xml',
    ): 1,
    ('import_linkage', 'A,0,0,ground a\nB,1,3,a b\nC,7,6,b c\nD,9,0,c ground', '-o', 'f.yaml'): 0,
    ('recover', 'runs/cut', '-o', 'recovered'): 0,
    ('review', 'recovered', '--json', 'recovered.json'): 0,
    ('lab',): 0,
    ('dying_worker',): 0,
}
# Files that exist already are replaced, locked or refused.
SECOND = {
    ('export', 'klann', '--svg', 'plates.svg', '--stl', 'parts'): 0,
    ('design', 'toy.yaml', '-o', 'legs', '--evaluations', '480', '--jobs', '1', '--resume'): 0,
    ('solver_node',): 1,
}


class Outcome(NamedTuple):
    """What a program returned and printed."""

    code: int
    output: str
    errors: str


def _holds(condition: ast.expr, platform: str) -> bool:
    """Return whether a condition of a stub holds on a platform, for the newest Python."""
    text = ast.unparse(condition)
    names = {'sys': type('sys', (), {'platform': platform, 'version_info': (99,)})}
    return bool(eval(text, names))  # noqa: S307 - a condition of mypy's stubs


def _names(statements: list[ast.stmt], platform: str) -> set[str]:
    """Return the names that a stub defines on a platform."""
    names: set[str] = set()
    for statement in statements:
        match statement:
            case ast.If(test=condition, body=body, orelse=otherwise):
                branch = body if _holds(condition, platform) else otherwise
                names |= _names(branch, platform)
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                names.add(name)
            case ast.AnnAssign(target=ast.Name(id=name)):
                names.add(name)
            case ast.Assign(targets=targets):
                names |= {target.id for target in targets if isinstance(target, ast.Name)}
            case ast.ImportFrom(names=aliases):
                names |= {alias.asname for alias in aliases if alias.asname}
    return names


@cache
def _stubs() -> Mapping[str, list[ast.stmt]]:
    """Return the stubs of the standard library that tell platforms apart, by their modules."""
    spec = importlib.util.find_spec('mypy')
    if spec is None or not spec.submodule_search_locations:
        pytest.skip('the names of other systems are in mypy, which is not installed')
    folder = Path(spec.submodule_search_locations[0]) / 'typeshed' / 'stdlib'
    stubs = {}
    for path in folder.rglob('*.pyi'):
        text = path.read_text(encoding='utf-8')
        name = '.'.join(path.relative_to(folder).with_suffix('').parts).removesuffix('.__init__')
        if 'sys.platform' in text and not name.startswith(('asyncio', 'distutils', 'tkinter')):
            stubs[name] = ast.parse(text).body
    return stubs


def _absent(platform: str) -> tuple[list[str], dict[str, list[str]]]:
    """Return Linux's modules, and names of others, that a platform lacks."""
    modules = []
    absent = {}
    for module, statements in _stubs().items():
        here = _names(statements, 'linux')
        there = _names(statements, platform)
        if len(there) < 0.1 * len(here):
            modules.append(module)
        elif here - there:
            absent[module] = sorted(here - there)
    return modules, absent


@pytest.fixture(scope='session')
def inputs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return the files of every program, by their paths."""
    folder = tmp_path_factory.mktemp('inputs')
    LegRun(parameters=GEOMETRY).write(folder / 'good')
    files = {}
    for path in folder.rglob('*'):
        if path.is_file():
            files[f'runs/{path.relative_to(folder).as_posix()}'] = path.read_bytes()
    files['runs/cut/cut_0.mcap'] = (folder / 'good' / 'good_0.mcap').read_bytes()[:-9_000]
    robot = Robot(count=100, period=0.05)
    rows = np.column_stack([robot.times, robot.crank, robot.seen('H'), robot.seen('G')])
    lines = ['time;crank;H.x;H.y;G.x;G.y', *(';'.join(map(repr, row)) for row in rows.tolist())]
    config = Path(klann_ros.__file__).parent / 'linkages' / 'klann.yaml'
    texts = {
        'points.csv': '\n'.join(lines).replace('.', ',').replace('H,', 'H.').replace('G,', 'G.'),
        'toy.yaml': REQUIREMENTS,
        'class.csv': STUDENTS,
        'ψ_leg.yaml': config.read_text(encoding='utf-8'),
    }
    for name, text in texts.items():
        files[name] = text.replace('\n', '\r\n').encode('utf-8-sig')
    return files


def run_programs(
    platform: str, folder: Path, inputs: Mapping[str, bytes], commands: Iterable[Sequence[str]]
) -> list[Outcome]:
    """Run all commands in a new folder, on a platform."""
    work = folder / 'work'
    for name, content in inputs.items():
        (work / name).parent.mkdir(parents=True, exist_ok=True)
        (work / name).write_bytes(content)
    system = {}
    if platform != sys.platform:
        modules, absent = _absent(platform)
        content = {'platform': platform, 'modules': modules, 'absent': absent}
        (folder / 'system.json').write_text(json.dumps(content))
        system['KLANN_ROS_SYSTEM'] = str(folder / 'system.json')
    (folder / 'commands.json').write_text(json.dumps([*commands]))
    (folder / 'temporary').mkdir()
    command = [sys.executable, '-X', 'warn_default_encoding', str(PROGRAMS / 'run_programs.py')]
    variables = {
        'PYTHONPATH': os.pathsep.join([str(PROGRAMS), str(PACKAGE), *filter(None, sys.path)]),
        **system,
        **dict.fromkeys(('TMPDIR', 'TEMP', 'TMP'), str(folder / 'temporary')),
    }
    files = [str(folder / 'commands.json'), str(folder / 'outcomes.json')]
    subprocess.run(
        [*command, *files], check=True, timeout=300, cwd=work, env={**os.environ, **variables}
    )
    assert [*(folder / 'temporary').iterdir()] == []
    return [Outcome(*fields) for fields in json.loads((folder / 'outcomes.json').read_text())]


@pytest.mark.parametrize('platform', PLATFORMS)
def test_every_program_runs_on_another_system(
    platform: str,
    tmp_path: Path,
    inputs: dict[str, bytes],
) -> None:
    commands = {**COMMANDS, **(SECOND if platform == 'win32' else {})}
    outcomes = run_programs(platform, tmp_path, inputs, commands)
    for (command, code), outcome in zip(commands.items(), outcomes, strict=True):
        assert 'Traceback' not in outcome.errors, (command, outcome)
        assert outcome.code == code, (command, outcome)
    dying_worker = outcomes[[*commands].index(('dying_worker',))]
    assert 'its worker died while it worked on it, 2 times' in dying_worker.output
    work = tmp_path / 'work'
    for path in work.rglob('*'):
        is_text = path.suffix in {'.html', '.json', '.svg', '.urdf', '.xml', '.yaml'}
        if is_text and path.relative_to(work).as_posix() not in inputs:
            assert b'\r\n' not in path.read_bytes(), path
