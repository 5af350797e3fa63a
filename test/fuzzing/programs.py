"""The law of programs: of a hostile file all work is done, or a line says why it is refused."""

from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
import json
import os
from pathlib import Path
import random
import shutil
from typing import NamedTuple
from xml.etree.ElementTree import fromstring

from fuzzing.laws import hold
from fuzzing.readers import READERS
from fuzzing.user_files import write_hostile
from klann_ros.calibration.command import main as calibrate
from klann_ros.datasheet.command import main as describe
from klann_ros.exercises.command import main as exercise
from klann_ros.export.command import main as export

EXPORTS = ['--urdf=robot.urdf', '--mjcf=robot.xml', '--svg=plates.svg', '--assembly=sheet.svg']
CALIBRATE = ['--leg=sem104', '--json=built.json', '-o', 'built.yaml']


class Program(NamedTuple):
    """A program, and its arguments beside the hostile file."""

    # The reader of the file.
    reader: str
    main: Callable[[list[str]], int]
    arguments: list[str]


PROGRAMS = [
    Program('robot', describe, ['--json=sheet.json', '--html=sheet.html']),
    Program('linkage', describe, ['--json=sheet.json', '--html=sheet.html']),
    Program('motor', describe, ['jansen', '--motor']),
    Program('robot', export, EXPORTS),
    Program('linkage', export, EXPORTS),
    Program('robot', export, ['--bar-density=1', '--ros2-control=control']),
    Program('linkage', export, ['--loops-urdf=loops']),
    Program('track', calibrate, CALIBRATE),
    Program('prior', calibrate, ['track.csv', *CALIBRATE, '--prior']),
    Program('answers', exercise, ['mark', '--csv=marks.csv']),
    Program('form', exercise, ['mark', '--gradebook=grades.csv']),
]
for _form in ('html', 'moodle', 'prairielearn', 'notebook'):
    _arguments = ['make', '--kind=toggle', '-o', 'class', '--format', _form, '--students']
    PROGRAMS.append(Program('students', exercise, _arguments))


def check_program(_, seed, place):
    """Run a program with a file that is hostile in one place by a seed, and hold it to the law."""
    chance = random.Random(seed)  # noqa: S311 - no secret
    program = chance.choice(PROGRAMS)
    reader = READERS[program.reader]
    place.mkdir()
    (place / 'track.csv').write_text(READERS['track'].texts[0])
    path = place / f'file{reader.ending}'
    write_hostile(path, chance.choice(reader.texts), reader.change, chance)
    folder = Path.cwd()
    os.chdir(place)
    try:
        _run(program, path.name)
        for output in place.rglob('*'):
            _check_output(output)
    finally:
        os.chdir(folder)
        shutil.rmtree(place)


def _run(program, name):
    said = StringIO()
    with redirect_stdout(said), redirect_stderr(said):
        try:
            code = program.main([*program.arguments, name])
        except SystemExit as end:
            code = end.code
    case = f'{program.main.__module__} {program.arguments}: {code}'
    assert code in (0, 1, 2, 3), case
    hold(said.getvalue(), case)


def _check_output(path):
    """Hold a written file to its format."""
    if path.suffix in ('.xml', '.urdf', '.svg'):
        fromstring(path.read_bytes())  # noqa: S314 - our own
    elif path.suffix in ('.json', '.ipynb'):
        json.loads(path.read_text(), parse_constant=_refuse)
    elif path.name == 'marks.csv':
        hold(path.read_text('utf-8-sig'), path)


def _refuse(name):
    raise ValueError(f'{name} is no JSON')
