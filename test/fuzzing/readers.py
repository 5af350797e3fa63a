"""The law of users' files: each is read, or its reader refuses it with a reason in one line."""

from collections.abc import Callable
import json
from pathlib import Path
import random
import shutil
from typing import Any, NamedTuple

from fuzzing.user_files import (
    hostile_json,
    hostile_table,
    hostile_text,
    hostile_yaml,
    write_hostile,
)
from klann_ros.calibration.command import deviations_by_name
from klann_ros.calibration.measurements import MeasurementError
from klann_ros.calibration.tables import load_table, TableOptions
from klann_ros.datasheet import motor_from_file, MotorFileError
from klann_ros.design import requirements_from, requirements_from_file, RequirementsError, State
from klann_ros.design.search import StateError
from klann_ros.exercises import ExerciseError
from klann_ros.exercises.answers import AnswerTable, read_students
from klann_ros.exercises.assignment import Assignment, load_assignment
from klann_ros.kinematics import linkage_from_file, LinkageFileError
from klann_ros.live.protocol import parse_message, ProtocolError
from klann_ros.log import open_log
from klann_ros.log.errors import LogError, MalformedQosError, NotALogError
from klann_ros.log.qos import qos_from_yaml
from klann_ros.log.run_parameters import (
    described_solver,
    recorded_finding,
    recorded_pause,
    replayed_solvers,
    solver_parameters,
    topic_counts,
)
from klann_ros.review.fleet.judging import expectations_from_file
from klann_ros.review.fleet.rows import rows_from_table
from klann_ros.review.load.geometry import klann_legs_in_urdf
from klann_ros.review.model.limits import limits_from_file
from klann_ros.robot import robot_from_file, robot_from_parameters, robot_of, RobotFileError
from klann_ros.sanitize.text import parse_json
from klann_ros.sanitize.yaml_text import content_of_file
from mcap.writer import Writer
import numpy as np
import yaml

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = yaml.safe_load(Path(__file__).with_name('user_files.yaml').read_text())
ROBOTS = [
    SAMPLES['description'],
    *((ROOT / f'config/{name}.yaml').read_text() for name in ('sem104', 'walker6_two_motors')),
]
LINKAGES = [path.read_text() for path in sorted((ROOT / 'klann_ros/linkages').glob('*.yaml'))]
MAX_REASON = 4000


class Reader(NamedTuple):
    """A reader of a file: texts that it takes, how one is changed, and how it refuses."""

    texts: list[str]
    ending: str
    change: Callable[[str, random.Random], str]
    read: Callable[[Path], object]
    refusals: Any = ()


def _of_text(read):
    """Return a reader of a file for one of a text from a log or a network."""

    def read_file(path):
        if path.is_file() and not path.is_symlink():
            read(path.read_bytes().decode(errors='replace'))

    return read_file


def _of_record(read):
    """Return a reader of a file for one of a log's record, whose values are texts."""

    def read_text(text):
        content = parse_json(text)
        if isinstance(content, dict):
            texts = {}
            for key, value in content.items():
                texts[key] = value if isinstance(value, str) else json.dumps(value)
            read(texts)

    return _of_text(read_text)


def _of_name(read, *arguments):
    return lambda path: read(str(path), *arguments)


def _read_state(text):
    State.of(parse_json(text)).check(SEARCHED, 'key')


def _read_prior(path):
    content_of_file(str(path), deviations_by_name, 'standard deviations', MeasurementError)


def _read_path(path):
    requirements_from({'linkage': 'klann', 'path': {'file': path.name}}, path.parent)


def _read_metadata(path):
    folder = path.parent / 'run'
    folder.mkdir()
    if path.is_symlink() or path.exists():
        path.rename(folder / 'metadata.yaml')
    with (folder / 'run_0.mcap').open('wb') as file:
        writer = Writer(file)
        writer.start('ros2')
        writer.finish()
    with open_log(folder) as log:
        list(log.messages())


def _read_assignment(path):
    if path.is_symlink() or path.exists():
        path.rename(path.parent / 'exercise.json')
    load_assignment(path.parent)


def _read_description(text):
    robot_from_parameters(described_solver(text, 0).without_files)


def _sample(name, ending, change, read, *refusals):
    return Reader([SAMPLES[name]], ending, change, read, refusals)


SEARCHED = requirements_from({
    'linkage': 'klann',
    'figures': {'stride': 'maximize', 'lift': 'maximize'},
})  # fmt: skip
POPULATION = np.full((3, len(SEARCHED.space(0).names)), 0.5)
POPULATIONS = (POPULATION, None, np.empty((0, 0)), POPULATION)
STATE = State('key', 1, 960, POPULATIONS, (0.0, 0.5), ((0.0, 1.0), (0.1, 0.2)))
SAMPLES['state'] = json.dumps(STATE.content())
CLASS = Assignment({'toggle': 1.0, 'limits': 2.0}, {'0011': 'Ana', '0012': ''})
LEG = robot_of('sem104').legs[0]
READERS = {
    'robot': Reader(ROBOTS, '.yaml', hostile_yaml, robot_from_file, RobotFileError),
    'linkage': Reader(LINKAGES, '.yaml', hostile_yaml, linkage_from_file, LinkageFileError),
    'requirements': Reader(
        [SAMPLES['requirements'], SAMPLES['grown']],
        '.yaml',
        hostile_yaml,
        requirements_from_file,
        RequirementsError,
    ),
    'motor': _sample('motor', '.yaml', hostile_yaml, motor_from_file, MotorFileError),
    'limits': _sample('limits', '.yaml', hostile_yaml, limits_from_file, LogError),
    'expectations': _sample(
        'expectations', '.yaml', hostile_yaml, expectations_from_file, LogError
    ),
    'prior': _sample('prior', '.yaml', hostile_yaml, _read_prior, MeasurementError),
    'metadata': _sample('metadata', '.yaml', hostile_yaml, _read_metadata, NotALogError),
    'students': _sample(
        'students', '.csv', hostile_table, _of_name(read_students, {}), ExerciseError
    ),
    'answers': _sample(
        'answers', '.csv', hostile_table, _of_name(AnswerTable, Assignment(), {}), ExerciseError
    ),
    'form': _sample(
        'form', '.csv', hostile_table, _of_name(AnswerTable, CLASS, {}), ExerciseError
    ),
    'assignment': _sample('assignment', '.json', hostile_json, _read_assignment, ExerciseError),
    'track': _sample(
        'track',
        '.csv',
        hostile_table,
        _of_name(load_table, LEG, (), TableOptions()),
        MeasurementError,
    ),
    'path': _sample('path', '.csv', hostile_table, _read_path, RequirementsError),
    'svg': _sample('svg', '.svg', hostile_text, _read_path, RequirementsError),
    'rows': _sample('rows', '.csv', hostile_table, _of_name(rows_from_table), LogError, OSError),
    'state': _sample(
        'state', '.json', hostile_json, _of_text(_read_state), StateError, ValueError
    ),
    'description': _sample(
        'description', '.yaml', hostile_yaml, _of_text(_read_description), ValueError, TypeError
    ),
    'urdf': _sample('urdf', '.urdf', hostile_text, _of_text(klann_legs_in_urdf)),
    'solver': _sample('solver', '.json', hostile_json, _of_record(solver_parameters), ValueError),
    'counts': _sample('counts', '.json', hostile_json, _of_record(topic_counts), ValueError),
    'pause': _sample('pause', '.json', hostile_json, _of_record(recorded_pause), ValueError),
    'finding': _sample('finding', '.json', hostile_json, _of_record(recorded_finding), ValueError),
    'replayed': _sample('replayed', '.json', hostile_json, _of_text(replayed_solvers)),
    'qos': _sample('qos', '.yaml', hostile_yaml, _of_text(qos_from_yaml), MalformedQosError),
    'command': _sample('command', '.json', hostile_json, _of_text(parse_message), ProtocolError),
}


def check_file(_, seed, place):
    """Write a file that is hostile in one place by a seed, and hold its reader to the law."""
    chance = random.Random(seed)  # noqa: S311 - no secret
    name = chance.choice([*READERS])
    reader = READERS[name]
    place.mkdir()
    path = place / f'file{reader.ending}'
    write_hostile(path, chance.choice(reader.texts), reader.change, chance)
    try:
        reader.read(path)
    except reader.refusals as error:
        reason = str(error)
        assert 0 < len(reason) < MAX_REASON, f'{name}: {len(reason)} characters'
        assert '\n' not in reason, f'{name}: {reason}'
    except Exception as error:
        raise AssertionError(f'{name}: {type(error).__name__}: {error}'[:300]) from error
    finally:
        shutil.rmtree(place)
