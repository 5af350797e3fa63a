"""`exercise`: exercises of both courses for a class, their keys, and the marking of answers."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
import os
from pathlib import Path
from typing import Any

from klann_ros.cli import (
    ArgumentParser,
    NOT_READ,
    NOT_WRITTEN,
    number_type,
    Output,
    output_errors,
    output_files,
    OutputError,
    path,
    save_all,
    UsageError,
)
from klann_ros.sanitize.text import listed, printable
from klann_ros.web import print_page, PrintError

from .answers import AnswerTable, has_answers, read_students
from .assignment import (
    Assignment,
    ASSIGNMENT_FILE,
    load_assignment,
    read_secret,
    read_tasks,
    with_secret,
)
from .gradebook import class_summary, grades, save_gradebook, save_marks, save_template
from .kinds import KINDS
from .platforms import Files, moodle, notebooks, prairielearn
from .sheet import answer_text, key, sheets, unit_sign, with_unit
from .variant import ExerciseError, LANGUAGES, look_up, make_variant, texts, unit_of, Variant

LINES = number_type(lambda n: 0 <= n <= 200, 'a whole number of lines, 0 to 200', int)
# File of a folder for the answers.
ANSWERS_FILE = 'answers.csv'
ROWS_REFUSED = 1
CODES_OF_ERRORS = {ExerciseError: NOT_READ, PrintError: NOT_WRITTEN}
CLASS_PURPOSE = """\
Exercises of both courses: every student gets numbers of their own, drawn from
the student number and the kind alone, with a figure; the key and the marking
know the usual slips."""
EXIT_CODES = """\
Exit code: 0 done, 1 rows of ANSWERS are refused (listed), 2 an input or an
argument is refused, 3 an OUT cannot be written."""
Format = Callable[[Sequence[Variant], str], Files]


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; return the exit code."""
    return _parser().run(lambda options: int(options.command(options)), CODES_OF_ERRORS, argv)


def _list(options: argparse.Namespace) -> int:
    words = texts()['kinds']
    language = options.language or LANGUAGES[0]
    width = max(map(len, KINDS))
    for name in KINDS:
        print(f'{name:{width}}  {words[name][language]["title"]}')
    return 0


def _make(options: argparse.Namespace) -> int:
    """Write the sheets of a class, and the table for its answers; return the exit code."""
    _check_platform(options)
    folder = Path(options.output)
    students, notes = read_students(options.students, dict(options.column or ()))
    points = read_tasks(options.kind)
    secret = read_secret(options.secret, is_made=True)
    secret_file = os.path.relpath(options.secret, folder) if secret else ''
    language = options.language or LANGUAGES[0]
    layout = (language, options.title, options.room)
    assignment = Assignment(points, students, *layout, secret, secret_file)
    files = _files(assignment, options)
    places = [Output('-o', str(folder / name)) for name in files]
    template = Output('-o', str(folder / ANSWERS_FILE))
    for place in (*places, template):
        with output_errors('-o', options.output):
            _check_parents(Path(place.path).relative_to(folder), folder)
            Path(place.path).parent.mkdir(parents=True, exist_ok=True)
        place.check([options.students, *filter(None, [options.secret])])
    is_filled = has_answers(template.path)
    if is_filled:
        assignment.check_same(folder)
    if secret:
        notes.append(f'keep {printable(options.secret)}: marking needs it')
    for place, content in zip(places, files.values(), strict=True):
        place.write(content)
    if not is_filled:
        template.save(partial(save_template, assignment, options.wide))
    print('\n'.join([*notes, f'{assignment.summary()}; in {printable(folder)}:']))
    print('\n'.join(f'  {name}' for name in [*files][:10]))
    if len(files) > 10:
        print(f'  ... and {len(files) - 10} more')
    note = 'kept: it has answers' if is_filled else 'to be filled in for exercise mark'
    print(f'  {ANSWERS_FILE}  ({note})')
    return 0


def _files(assignment: Assignment, options: argparse.Namespace) -> Files:
    """Return the files of a format, and the one that remembers the assignment."""
    students = assignment.variants()
    files: Files = {}
    if platform := PLATFORMS.get(options.format):
        for variants in zip(*students, strict=True):
            files |= platform(variants, assignment.language)
    else:
        answer_key = key(assignment, students, has_steps=options.steps)
        for name, page in (('sheets', sheets(assignment, students)), ('key', answer_key)):
            files[f'{name}.{options.format}'] = PAGES[options.format](page.encode())
    return {**files, ASSIGNMENT_FILE: assignment.content()}


def _check_platform(options: argparse.Namespace) -> None:
    """Raise a UsageError for options that are for paper, or need a secret on a platform."""
    names = ['title', 'room', 'steps'] + ['secret'] * (options.format != 'moodle')
    refused = [f'--{name}' for name in names if getattr(options, name)]
    refused += ['points'] * (':' in ''.join(options.kind))
    if refused and options.format in PLATFORMS:
        raise UsageError(f'--format {options.format} takes no {listed(refused)}: html and pdf do')


def _check_parents(name: Path, folder: Path) -> None:
    """Raise an OutputError if a file's path in the folder leads through a link."""
    for parent in name.parents:
        if parent.name and (folder / parent).is_symlink():
            raise OutputError(f'{printable(parent)} in it is a link, which is not followed')


def _mark(options: argparse.Namespace) -> int:
    """Print the marks and the statistics of a class; return the exit code."""
    folder = Path(options.folder or Path(options.answers).parent)
    remembered = load_assignment(folder)
    if options.folder and remembered is None:
        raise ExerciseError(f'{printable(folder)} has no {ASSIGNMENT_FILE} of exercise make')
    inputs = (options.answers, str(folder / ASSIGNMENT_FILE))
    files = output_files(options, ('csv', 'gradebook'), inputs)
    assignment = with_secret(remembered or Assignment(), folder, options.secret)
    assignment = replace(assignment, language=options.language or assignment.language)
    if remembered:
        print(f'{printable(inputs[1])}: {assignment.summary()}')
    answers = AnswerTable(options.answers, assignment, dict(options.column or ()))
    class_marks = answers.marks()
    class_grades = grades(class_marks, assignment)
    for (student, kind), grade in class_grades.items():
        print(f'{printable(student)}  {kind}  {grade.points:g} of {assignment.points_of(kind):g}')
        for reason in grade.reasons:
            print(f'    {reason}')
    notes = [f'note: {note}' for note in answers.notes]
    refusals = [f'refused: {line}' for line in answers.refused]
    summary = class_summary(class_marks, class_grades, assignment)
    print('\n'.join([*summary, *notes, *refusals]))
    savers = {
        '--csv': partial(save_marks, class_marks, assignment),
        '--gradebook': partial(save_gradebook, class_grades, assignment),
    }
    save_all(files, savers)
    return ROWS_REFUSED if refusals else 0


def _key(options: argparse.Namespace) -> int:
    secret = read_secret(options.secret)
    kind = look_up(options.kind, KINDS, 'kind')
    variant = make_variant(kind, options.student, secret=secret)
    language = options.language or LANGUAGES[0]
    for name, number in variant.givens.items():
        print(f'{name} = {with_unit(number, unit_of(name), language)}')
    print(f'\n{kind.note(language)}'.rstrip())
    for step in variant.steps:
        print(f'{step.symbol} = {with_unit(step.value, step.unit, language)}    {step.formula}')
    print()
    for question in variant.kind.questions:
        answer = answer_text(variant, question, language)
        print(f'{question.name} = {answer} {unit_sign(question.unit)}'.rstrip())
    return 0


PAGES: dict[str, Callable[[bytes], bytes]] = {'html': bytes, 'pdf': print_page}
PLATFORMS: dict[str, Format] = {
    'moodle': moodle,
    'prairielearn': prairielearn,
    'notebook': notebooks,
}


def _heading(text: str) -> tuple[str, str]:
    """Return the column and the heading of `COLUMN=HEADING`."""
    column, sign, heading = text.partition('=')
    if not (sign and heading.strip()):
        raise argparse.ArgumentTypeError(f'{printable(text)} must be such as student=Codigo')
    return column, heading


def _parser() -> ArgumentParser:
    parser = ArgumentParser('exercise', CLASS_PURPOSE, EXIT_CODES)
    commands = parser.add_subparsers(metavar='COMMAND', required=True)

    def command(name: str, run: Callable[[argparse.Namespace], int], text: str) -> Any:
        added: Any = commands.add_parser(
            name, help=text, description=f'{text}.', epilog=EXIT_CODES
        )
        added.set_defaults(command=run)
        added.add_argument(
            '--language', choices=LANGUAGES, help='of the texts (default: en; mark: as made)'
        )
        return added.add_argument

    def add_columns() -> None:
        text = 'the heading of a column, such as student=Codigo; may be repeated'
        add('--column', metavar='COLUMN=HEADING', type=_heading, action='append', help=text)

    def add_secret(text: str) -> None:
        add('--secret', metavar='FILE', type=path, help=text)

    command('list', _list, 'List the kinds of exercises')
    add = command('make', _make, 'Make the sheets of a class')
    kind = 'a task, see exercise list, and its points (default: 1 a question); may be repeated'
    add('--kind', metavar='KIND[:POINTS]', action='append', required=True, help=kind)
    students = 'the class, as universities export it: a student number, and optional names'
    add('--students', metavar='FILE.csv', type=path, required=True, help=students)
    add_columns()
    add('--format', choices=[*PAGES, *PLATFORMS], default='html', help='(default: html)')
    add('--title', default='', help='of the sheets')
    add('--room', metavar='LINES', type=LINES, default=0, help='ruled lines a task, on paper only')
    add('--steps', action='store_true', help='the steps of every student after the key')
    add('--wide', action='store_true', help='a row a student in the table for answers')
    add_secret(
        'a text, made if there is none: without it no one can compute a sheet or a key from a '
        'student number'
    )
    add('-o', '--output', metavar='FOLDER', type=path, required=True, help='for the files')
    add = command('mark', _mark, 'Mark the answers of a class')
    answers = 'a row an answer (student, kind, question, answer), or a column a question'
    add('answers', metavar='ANSWERS.csv', type=path, help=answers)
    add_columns()
    add('--folder', type=path, help='of exercise make (default: that of ANSWERS.csv)')
    add_secret('the secret of make, if it is no longer where it was')
    add('--csv', metavar='OUT', help='the marks with their reasons, a row an answer')
    add('--gradebook', metavar='OUT', help='the points of each task, a row a student')
    add = command('key', _key, "Print a student's key with all steps")
    add('--kind', metavar='KIND', required=True, help='see exercise list')
    add('--student', metavar='ID', required=True, help='the student number')
    add_secret('the secret of make')
    return parser
