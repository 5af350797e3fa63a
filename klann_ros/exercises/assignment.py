"""The assignment of a class: its tasks, students and secret, and the file that remembers it."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cache
import hmac
import json
import os
from pathlib import Path
from secrets import token_hex
from typing import Any

from klann_ros.cli import OutputError
from klann_ros.sanitize.files import read_regular
from klann_ros.sanitize.text import counted, MAX_LINE_LENGTH, parse_json, printable
from klann_ros.sanitize.yaml_text import parse_file

from .kinds import KINDS
from .variant import ExerciseError, LANGUAGES, look_up, make_variant, Question, Variant

# File of a folder that remembers its assignment.
ASSIGNMENT_FILE = 'exercise.json'
# Largest file [bytes], and points of a task; shortest secret [characters].
MAX_FILE, MAX_POINTS, MIN_SECRET = 20_000_000, 1000.0, 12


@cache
def class_texts() -> dict[str, Any]:
    """Return the headings of class tables, and the words of sheets and gradebooks."""
    content: dict[str, Any] = parse_file(Path(__file__).parent / 'static' / 'class_tables.yaml')
    return content


@dataclass(frozen=True)
class Assignment:
    """
    The tasks of a class: points by kind in their order, names by student number, the title.

    Without points any kind has a point a question; without students any student is marked. The
    secret's path is relative to the folder of the sheets; `room` is in ruled lines a task.
    """

    points: Mapping[str, float] = field(default_factory=dict)
    students: Mapping[str, str] = field(default_factory=dict)
    language: str = 'en'
    title: str = ''
    room: int = 0
    secret: str = ''
    secret_file: str = ''

    def variant(self, kind: str, student: str) -> Variant:
        """Return the task of a student; errors as `make_variant`."""
        return make_variant(KINDS[kind], student, self.students.get(student, ''), self.secret)

    def variants(self) -> list[list[Variant]]:
        """Return the tasks of each student."""
        return [[self.variant(kind, student) for kind in self.points] for student in self.students]

    def points_of(self, kind: str) -> float:
        """Return the points of a task."""
        return self.points.get(kind, float(len(KINDS[kind].questions)))

    def word(self, name: str, *numbers: float) -> str:
        """Return words of the class's tables and sheets, with numbers filled in."""
        template: str = class_texts()['texts'][name][self.language]
        return template.format(*[localised(f'{number:.4g}', self.language) for number in numbers])

    def points_text(self, points: float) -> str:
        """Return points with their noun."""
        is_single = points == 1.0 or (self.language == 'pt' and points < 2.0)
        return self.word('point' if is_single else 'points', points)

    def questions(self) -> list[tuple[str, Question]]:
        """Return the questions of all tasks, and their kinds."""
        return [(kind, question) for kind in self.points for question in KINDS[kind].questions]

    def summary(self) -> str:
        """Return the class, its tasks and its language in a few words."""
        tasks = ', '.join(f'{kind} {points:g}' for kind, points in self.points.items())
        secret = f', secret {printable(self.secret_file)}' if self.secret_file else ''
        students = counted(len(self.students), 'student')
        return f'{students}, points {tasks}, language {self.language}{secret}'

    def content(self) -> bytes:
        """Return the file that remembers the assignment, without its secret."""
        content = asdict(replace(self, secret=fingerprint(self.secret)))
        return f'{json.dumps(content, indent=1)}\n'.encode()

    def check_same(self, folder: Path) -> None:
        """Raise an OutputError if a folder remembers other tasks or another secret."""
        remembered = load_assignment(folder) or self
        secrets = {self.secret, fingerprint(self.secret)}
        if {*remembered.points} != {*self.points} or remembered.secret not in secrets:
            raise OutputError(
                f'-o {printable(folder)} has answers to other sheets: {remembered.summary()}; '
                'choose a new folder'
            )


def fingerprint(secret: str) -> str:
    """Return what tells one secret from another."""
    digest = hmac.new(secret.encode(), ASSIGNMENT_FILE.encode(), 'sha256').hexdigest()
    return digest[:16] if secret else ''


def load_assignment(folder: Path) -> Assignment | None:
    """
    Return the assignment that a folder remembers; the fingerprint stands for its secret.

    An ExerciseError means that the file is damaged.
    """
    path = folder / ASSIGNMENT_FILE
    if not path.exists():
        return None
    try:
        assignment = Assignment(**parse_json(read_regular(path, MAX_FILE)))
        look_up(assignment.language, dict.fromkeys(LANGUAGES), 'language')
        points = read_tasks(f'{kind}:{number}' for kind, number in assignment.points.items())
        # A TypeError unless all of them are texts.
        ''.join([*assignment.students.values(), assignment.secret, assignment.secret_file])
    except (OSError, ValueError, TypeError, AttributeError) as error:
        reason = f'{printable(path)} is damaged: {printable(error)}; run exercise make again'
        raise ExerciseError(reason) from error
    return replace(assignment, points=points)


def with_secret(assignment: Assignment, folder: Path, path: str | None) -> Assignment:
    """Return a remembered assignment with its secret; an ExerciseError if it is another one."""
    if not assignment.secret and not path:
        return assignment
    secret = read_secret(path or str(folder / assignment.secret_file))
    if assignment.points and fingerprint(secret) != assignment.secret:
        raise ExerciseError('the secret is not that of the sheets')
    return replace(assignment, secret=secret)


def read_secret(path: str | None, *, is_made: bool = False) -> str:
    """
    Return the secret in a file, if any; a new file is made, which only its owner can read.

    An ExerciseError means that the file is none, or that the secret can be guessed.
    """
    if not path:
        return ''
    try:
        if is_made and not os.path.lexists(path):
            with os.fdopen(
                os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), 'w'
            ) as file:
                file.write(f'{token_hex(16)}\n')
        secret = read_regular(path, MAX_LINE_LENGTH).strip()
    except (OSError, ValueError) as error:
        reason = printable(getattr(error, 'strerror', None) or error)
        raise ExerciseError(f'the secret {printable(path)} cannot be used: {reason}') from error
    if len(secret) < MIN_SECRET:
        reason = f'it must have {MIN_SECRET} characters; a new file gets a random one'
        raise ExerciseError(f'the secret {printable(path)} can be guessed: {reason}')
    return secret


def read_tasks(arguments: Iterable[str]) -> dict[str, float]:
    """Return the points by kind of texts KIND or KIND:POINTS; an ExerciseError for others."""
    points_of: dict[str, float] = {}
    for argument in arguments:
        kind, _, number = argument.partition(':')
        questions = look_up(kind, KINDS, 'kind').questions
        if kind in points_of:
            raise ExerciseError(f'kind {kind} is there twice: a sheet has one task of a kind')
        try:
            points = float(number.replace(',', '.') or len(questions))
        except ValueError:
            points = 0.0
        if not 0.0 < points <= MAX_POINTS:
            raise ExerciseError(
                f'{printable(argument)} is refused: its points must be a number > 0, such as '
                f'{kind}:1.5'
            )
        points_of[kind] = points
    return points_of


def localised(number: str, language: str) -> str:
    """Return a number with the language's decimal separator and a true minus."""
    text = number.replace('-', '\N{MINUS SIGN}')
    return text.replace('.', ',') if language == 'pt' else text
