"""`exercise`: exercises of both courses for a class, their keys, and the marking of answers."""

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
import re
from typing import Any, BinaryIO

from klann_ros.cli import (
    ArgumentParser,
    harmless,
    NOT_READ,
    NOT_WRITTEN,
    Output,
    output_errors,
    output_files,
    OutputError,
    path,
    read_table,
    save_all,
    TableRow,
    write_table,
)
from klann_ros.sanitize.text import counted, listed, MAX_LINE_LENGTH, printable
from klann_ros.web import print_page, PrintError

from .kinds import KINDS
from .marking import mark, Marks, statistics
from .platforms import Files, moodle, notebooks, prairielearn
from .sheet import answer_text, key, sheets, unit_sign, with_unit
from .variant import ExerciseError, Kind, LANGUAGES, look_up, make_variant, texts, unit_of, Variant

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
    width = max(map(len, KINDS))
    for name in KINDS:
        print(f'{name:{width}}  {words[name][options.language]["title"]}')
    return 0


def _make(options: argparse.Namespace) -> int:
    """Write the variants of a class, and the table for its answers; return the exit code."""
    kind = look_up(options.kind, KINDS, 'kind')
    students = read_students(options.students)
    variants = [make_variant(kind, *student) for student in students.items()]
    files = FORMATS[options.format](variants, options.language)
    folder = Path(options.output)
    places = [Output('-o', str(folder / name)) for name in files]
    template = Output('-o', str(folder / f'{kind.name}_answers.csv'))
    for place in (*places, template):
        with output_errors('-o', options.output):
            _check_parents(Path(place.path).relative_to(folder), folder)
            Path(place.path).parent.mkdir(parents=True, exist_ok=True)
        place.check([options.students])
    is_filled = has_answers(template.path)
    for place, content in zip(places, files.values(), strict=True):
        place.write(content)
    if not is_filled:
        template.save(partial(save_template, kind, students))
    print(f'{counted(len(students), "variant")} of {kind.name} in {printable(folder)}:')
    print('\n'.join(f'  {name}' for name in [*files][:10]))
    if len(files) > 10:
        print(f'  ... and {len(files) - 10} more')
    note = 'kept: it has answers' if is_filled else 'to be filled in for exercise mark'
    print(f'  {kind.name}_answers.csv  ({note})')
    return 0


def _check_parents(name: Path, folder: Path) -> None:
    """Raise an OutputError if a file's path in the folder leads through a link."""
    for parent in name.parents:
        if parent.name and (folder / parent).is_symlink():
            raise OutputError(f'{printable(parent)} in it is a link, which is not followed')


def _mark(options: argparse.Namespace) -> int:
    """Print the marks and the statistics of a class; return the exit code."""
    files = output_files(options, ('csv',), (options.answers,))
    class_marks, refused = mark_answers(options.answers, KINDS)
    for (student, kind), marks in class_marks.items():
        points = sum(answer_mark.points for answer_mark in marks)
        print(f'{printable(student)}  {kind}  {points:g} of {len(marks)}')
        for answer_mark in marks:
            if answer_mark.points < 1.0:
                answer = printable(answer_mark.given, 40) or '-'
                reason = answer_mark.reason(options.language)
                print(f'    {answer_mark.question} = {answer}: {answer_mark.points:g}, {reason}')
    for kind, counts in statistics(class_marks).items():
        students = counted(int(counts.pop('students')), 'student')
        share = 100.0 * counts.pop('part')
        slips = ', '.join(f'{slip} {count:g}' for slip, count in counts.items())
        print(f'{kind}: {students}, {share:.0f} %; {slips}')
    for line in refused:
        print(f'refused: {line}')
    save_all(files, {'--csv': partial(save_marks, class_marks, options.language)})
    return ROWS_REFUSED if refused else 0


def _key(options: argparse.Namespace) -> int:
    variant = make_variant(look_up(options.kind, KINDS, 'kind'), options.student)
    language = options.language
    for name, number in variant.givens.items():
        print(f'{name} = {with_unit(number, unit_of(name), language)}')
    print()
    for step in variant.steps:
        print(f'{step.symbol} = {with_unit(step.value, step.unit, language)}    {step.formula}')
    print()
    for question in variant.kind.questions:
        answer = answer_text(variant, question, variant.answers[question.name], language)
        print(f'{question.name} = {answer} {unit_sign(question.unit)}'.rstrip())
    return 0


def _html(variants: Sequence[Variant], language: str) -> Files:
    pages = {'': sheets, '_key': key}
    return {
        f'{variants[0].kind.name}{name}.html': page(variants, language).encode()
        for name, page in pages.items()
    }


def _pdf(variants: Sequence[Variant], language: str) -> Files:
    pages = _html(variants, language)
    return {name.replace('.html', '.pdf'): print_page(page) for name, page in pages.items()}


FORMATS: dict[str, Format] = {
    'html': _html,
    'pdf': _pdf,
    'moodle': moodle,
    'prairielearn': prairielearn,
    'notebook': notebooks,
}


def _parser() -> ArgumentParser:
    parser = ArgumentParser('exercise', CLASS_PURPOSE, EXIT_CODES)
    commands = parser.add_subparsers(metavar='COMMAND', required=True)

    def command(name: str, run: Callable[[argparse.Namespace], int], text: str) -> Any:
        added: Any = commands.add_parser(
            name, help=text, description=f'{text}.', epilog=EXIT_CODES
        )
        added.set_defaults(command=run)
        added.add_argument(
            '--language', choices=LANGUAGES, default='en', help='of the texts (default: en)'
        )
        return added.add_argument

    command('list', _list, 'List the kinds of exercises')
    add = command('make', _make, 'Make the exercises of a class')
    add('--kind', metavar='KIND', required=True, help='see exercise list')
    students = 'the class: a column student, and optional name'
    add('--students', metavar='FILE.csv', type=path, required=True, help=students)
    add('--format', choices=[*FORMATS], default='html', help='(default: html)')
    add('-o', '--output', metavar='FOLDER', type=path, required=True, help='for the files')
    add = command('mark', _mark, 'Mark the answers of a class')
    answers = 'columns student, kind, question, answer'
    add('answers', metavar='ANSWERS.csv', type=path, help=answers)
    add('--csv', metavar='OUT', help='the marks with their reasons, a row an answer')
    add = command('key', _key, "Print a student's key with all steps")
    add('--kind', metavar='KIND', required=True, help='see exercise list')
    add('--student', metavar='ID', required=True, help='the student number')
    return parser


# Largest table [bytes], and students of one.
MAX_TABLE, MAX_STUDENTS = 20_000_000, 5000
ANSWER_COLUMNS = ('student', 'kind', 'question', 'answer')
MARK_COLUMNS = (*ANSWER_COLUMNS, 'points', 'reason')
# A long student number as a spreadsheet writes it.
SCIENTIFIC = re.compile(r'\d(?:[.,]\d+)?[Ee]\+?\d+')


def read_students(path: str) -> dict[str, str]:
    """
    Return the names of a class by student number: the columns name, if any, and student.

    Raises
    ------
    ExerciseError
        The file cannot be read, is no such table, has a student twice, or a row without one.

    """
    names: dict[str, str] = {}
    repeated = []
    for place, _, cells in _rows(path, 'student'):
        number = _number(cells, place)
        if number in names:
            repeated.append(number)
        columns = [column for column in cells if column.casefold() == 'name']
        names[number] = printable(cells[columns[0]].strip()) if columns else ''
    if not 0 < len(names) <= MAX_STUDENTS:
        raise ExerciseError(
            f'{printable(path)} has {len(names)} students: 1 to {MAX_STUDENTS} are possible'
        )
    if repeated:
        raise ExerciseError(f'{printable(path)} has students twice: {listed(repeated, 5)}')
    return names


def _rows(path: str, *columns: str) -> list[TableRow]:
    """Return the rows of a table; a short one ends with empty cells."""
    rows = read_table(path, columns, ExerciseError, MAX_TABLE)
    return [row._replace(cells=dict.fromkeys(columns, '') | row.cells) for row in rows]


def _number(cells: Mapping[str, str], place: str) -> str:
    """Return the student number of a row."""
    number = cells['student'].strip()
    if not number:
        raise ExerciseError(f'{place}: no student number')
    if SCIENTIFIC.fullmatch(number):
        raise ExerciseError(
            f'{place}: student {number} is a number that a spreadsheet has rounded; give the '
            'column the format text'
        )
    return number


def has_answers(path: str) -> bool:
    """Return whether a file is a table of answers with one at least; errors as `mark_answers`."""
    table = _rows(path, *ANSWER_COLUMNS) if Path(path).is_file() else ()
    return any(row.cells['answer'].strip() for row in table)


def mark_answers(path: str, kinds: Mapping[str, Kind]) -> tuple[Marks, list[str]]:
    """
    Return the marks of a table of answers, and the rows that are refused, with their reasons.

    Raises
    ------
    ExerciseError
        The file cannot be read, or is no table of answers.

    """
    answers: dict[tuple[str, str], dict[str, str]] = {}
    refused = []
    for _, line, cells in _rows(path, *ANSWER_COLUMNS):
        kind = cells['kind'].strip()
        question = cells['question'].strip()
        try:
            student = _number(cells, f'line {line}')
            questions = look_up(kind, kinds, f'line {line}: kind').questions
            names = {question.name for question in questions}
            look_up(question, dict.fromkeys(names), f'line {line}: question of {kind}')
        except ExerciseError as error:
            refused.append(str(error))
            continue
        if question in answers.setdefault((student, kind), {}):
            refused.append(f'line {line}: {printable(student)} answers {question} twice')
        else:
            answers[student, kind][question] = cells['answer']
    if not answers and not refused:
        raise ExerciseError(f'{printable(path)} has no answers')
    class_marks = {}
    for (student, kind), student_answers in answers.items():
        try:
            variant = make_variant(kinds[kind], student)
            class_marks[student, kind] = mark(variant, student_answers)
        except ExerciseError as error:  # noqa: PERF203, RUF100 - of each student
            refused.append(str(error))
    return class_marks, refused


def save_template(kind: Kind, students: Iterable[str], file: BinaryIO) -> None:
    """Write an empty table of answers."""
    lines = []
    for student in students:
        lines += [(student, kind.name, question.name, '') for question in kind.questions]
    _save(ANSWER_COLUMNS, lines, file)


def save_marks(class_marks: Marks, language: str, file: BinaryIO) -> None:
    """Write the marks, a row an answer."""
    lines = []
    for (student, kind), marks in class_marks.items():
        for answer_mark in marks:
            answer = (student, kind, answer_mark.question, answer_mark.given)
            points = f'{answer_mark.points:g}'
            lines.append((*answer, points, answer_mark.reason(language)))
    _save(MARK_COLUMNS, lines, file)


def _save(heads: Sequence[str], lines: Iterable[Sequence[str]], file: BinaryIO) -> None:
    cells = [list(map(_cell, line)) for line in lines]
    # With the mark by which spreadsheets know UTF-8.
    write_table((heads, *cells), file, encoding='utf-8-sig')


def _cell(text: str) -> str:
    """Return a cell without control characters; a number with a sign is no formula."""
    if re.fullmatch(r'[+-]?\d+(?:[.,]\d+)?', text, re.ASCII):
        return text
    return harmless(printable(text, MAX_LINE_LENGTH))
