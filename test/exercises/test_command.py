"""`exercise` as a professor uses it: a class list in, sheets and key out, answers marked."""

import csv
from dataclasses import replace
from pathlib import Path
import re

from klann_ros.exercises import KINDS, make_variant
from klann_ros.exercises.answers import read_students
from klann_ros.exercises.command import main
from klann_ros.exercises.sheet import picture, with_unit
import pytest

Capture = pytest.CaptureFixture[str]

CLASS = 'student;name\n0011;João\n0012;<b>Eve</b>\n=cmd;x\n'


@pytest.fixture
def students(tmp_path: Path) -> Path:
    path = tmp_path / 'class.csv'
    # As a spreadsheet in Brazil writes it.
    path.write_bytes(CLASS.encode('cp1252'))
    return path


def make(students: Path, folder: Path, kind: str, *more: str) -> int:
    place = ['--students', str(students), '-o', str(folder)]
    return main(['make', '--kind', kind, *place, *more])


def read_csv(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text('utf-8-sig').splitlines()))


def code_of(*arguments: str) -> int:
    with pytest.raises(SystemExit) as end:
        main([*arguments])
    return int(end.value.code or 0)


@pytest.mark.parametrize('language', ['en', 'pt'])
def test_sheets_and_key_are_for_a_class(students: Path, tmp_path: Path, language: str) -> None:
    assert make(students, tmp_path / 'out', 'limits', '--language', language, '--steps') == 0
    sheets = (tmp_path / 'out/sheets.html').read_text()
    key = (tmp_path / 'out/key.html').read_text()
    assert sheets.count('<section>') == key.count('<section>') == 3
    assert sheets.count('<svg') == 3
    assert 'João' in sheets
    assert '<b>Eve</b>' not in sheets
    assert '<script' not in sheets + key
    swing = make_variant(KINDS['limits'], '0011').answers['swing']
    shown = f'{swing:.2f}'.replace('.', ',' if language == 'pt' else '.')
    assert key.count(shown) == 3  # in the table, the answers and the steps
    assert shown not in sheets


def test_the_template_filled_in_is_marked(students: Path, tmp_path: Path, capsys: Capture) -> None:
    make(students, tmp_path, 'toggle')
    template = read_csv(tmp_path / 'answers.csv')
    assert [line['student'] for line in template] == ['0011'] * 3 + ['0012'] * 3 + ["'=cmd"] * 3
    key = make_variant(KINDS['toggle'], '0011').answers
    lines = ['student,kind,question,answer']
    lines += [f'0011,toggle,{name},"{length:.5g} mm"' for name, length in key.items()]
    lines += ["'=cmd,toggle,Z,x", '0012,toggle,Z,-1', '0012,toggle,Y,1', '0012,jump,Z,1']
    lines += ['0011,toggle,Z,1', '1.1E+07,toggle,Z,1']
    (tmp_path / 'exercise.json').unlink()
    answers = tmp_path / 'answers.csv'
    answers.write_text('\n'.join(lines))
    capsys.readouterr()
    assert main(['mark', str(answers), '--csv', str(tmp_path / 'marks.csv')]) == 1
    shown = capsys.readouterr().out
    assert re.findall(r'^(\S+)  toggle  (\d) of 3$', shown, re.MULTILINE) == [
        ('0011', '2'),
        ('=cmd', '0'),
        ('0012', '0'),
    ]
    assert shown.count('refused: line ') == 3
    assert 'note: lines 2 and 9 are both of 0011: the last counts' in shown
    assert 'toggle: 3 students, 22 %; empty 4, ' in shown
    marks = read_csv(tmp_path / 'marks.csv')
    assert [line['points'] for line in marks] == ['0', '1', '1'] + ['0'] * 6
    assert "'=cmd" in {line['student'] for line in marks}
    # A number with a sign is no formula.
    assert '-1' in {line['answer'] for line in marks}


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        (
            'Turma\n1\n',
            'such as matricula, student id, ra; its columns are Turma; name it by --column',
        ),
        ('student\n', 'has 0 students'),
        ('student\n1\n1\n', 'has students twice: 1'),
        ('student\n1,2\n', '2 cells for 1 columns'),
        ('student,name\n1,A\n,Ana\n', 'line 3: no student number'),
        (
            'student,name\n1.1E+07,A\n',
            'a spreadsheet has rounded; give the column the format text',
        ),
        ('student,student\n1,2\n', 'has the column student twice'),
        ('student,name\n1,"A\n2,B\n', 'line 3: unexpected end of data'),
        ('student\n1\x1b[31m\n', "student '1\\\\x1b[31m' is refused"),
        (f'student\n{"9" * 300}\n', '(300 characters)'),
    ],
)
def test_an_invalid_class_list_is_refused(
    tmp_path: Path, capsys: Capture, content: str, message: str
) -> None:
    path = tmp_path / 'class.csv'
    path.write_text(content)
    assert make(path, tmp_path / 'out', 'toggle') == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count('\n') == 1
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize(
    'content',
    [
        'student;name\n1;João, "o outro"\n2;=cmd|x\n'.encode('utf-16'),
        b'\xef\xbb\xbf Student , NAME \r\n1,"Jo\xc3\xa3o, ""o outro"""\r\n\r\n,,\r\n2,=cmd|x\r\n',
        'sep=;\nstudent;name\n1;"João, ""o outro"""\n2;=cmd|x\n'.encode('latin-1'),
        b'student\tname\r1\t"Jo\xe3o, ""o outro"""\r2\t=cmd|x\r',
    ],
)
def test_a_class_list_of_any_spreadsheet_is_read(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / 'class.csv'
    path.write_bytes(content)
    students, _ = read_students(str(path), {})
    assert students == {'1': 'João, "o outro"', '2': '=cmd|x'}


UNREADABLE = dict.fromkeys(['none.csv', '.', 'a\0b'], 'cannot be read: ')
UNREADABLE |= {'page.xls': 'is a workbook: save it as CSV'}
UNREADABLE |= {'class.xlsx': 'is a workbook: save it as CSV', 'empty.csv': 'has no answers'}


@pytest.mark.parametrize(('name', 'message'), UNREADABLE.items())
def test_unreadable_answers_are_refused(
    tmp_path: Path, capsys: Capture, name: str, message: str
) -> None:
    (tmp_path / 'class.xlsx').write_bytes(b'PK\x03\x04\x14')
    (tmp_path / 'page.xls').write_text('\ufeff\n<html><table>')
    (tmp_path / 'empty.csv').write_text('student,kind,question,answer\n')
    assert main(['mark', f'{tmp_path}/{name}']) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count('\n') == 1


def test_hostile_answers_are_marked_and_harmless(tmp_path: Path, capsys: Capture) -> None:
    hostile = [
        '=1+1',
        '@SUM(A1)',
        '\x1b[31m7',
        '9' * 300,
        'nan',
        'inf',
        '1e400',
        '1;2',
        '\u202e12',
        '\uff1d1+1',
        '\n=1+1',
        '+1+1',
    ]
    path = tmp_path / 'answers.csv'
    marks = tmp_path / 'marks.csv'
    with path.open('w', encoding='utf-8', newline='') as file:
        writer = csv.writer(file)
        writer.writerow(['student', 'kind', 'question', 'answer'])
        for k, answer in enumerate(hostile):
            writer.writerow([f's{k}', 'toggle', 'Z', answer])
    assert main(['mark', str(path), '--csv', str(marks)]) == 0
    shown = capsys.readouterr().out
    assert '\x1b' not in shown
    assert '\u202e' not in shown
    assert max(map(len, shown.splitlines())) < 150
    first = [line for line in read_csv(marks) if line['question'] == 'Z']
    assert [line['points'] for line in first] == ['0'] * len(hostile)
    assert not any(line['answer'].startswith(('=', '@', '+1+', '\uff1d')) for line in first)
    assert not set('\x1b\u202e\x00') & set(marks.read_text('utf-8'))


@pytest.mark.parametrize('kind', ['prairielearn', 'notebook'])
def test_nothing_is_written_through_a_link(
    students: Path, tmp_path: Path, kind: str, capsys: Capture
) -> None:
    elsewhere = tmp_path / 'elsewhere'
    elsewhere.mkdir()
    out = tmp_path / 'out'
    out.mkdir()
    (out / 'toggle').symlink_to(elsewhere)
    assert make(students, out, 'toggle', '--format', kind) == 3
    assert 'toggle in it is a link' in capsys.readouterr().err
    assert not any(elsewhere.iterdir())


@pytest.mark.parametrize('encoding', ['utf-8-sig', 'utf-16', 'cp1252'])
@pytest.mark.parametrize('delimiter', [';', '\t', ','])
def test_answers_with_decimal_commas_are_read_from_any_spreadsheet(
    tmp_path: Path, encoding: str, delimiter: str, capsys: Capture
) -> None:
    key = make_variant(KINDS['toggle'], '0011').answers
    path = tmp_path / 'answers.csv'
    with path.open('w', encoding=encoding, newline='') as file:
        writer = csv.writer(file, delimiter=delimiter)
        writer.writerow(['Student', 'Kind', 'Question', 'Answer', 'Observação'])
        for name, length in key.items():
            writer.writerow(['0011', 'toggle', name, f'{length:.2f} mm'.replace('.', ','), ''])
    assert main(['mark', str(path)]) == 0
    assert 'toggle  3 of 3' in capsys.readouterr().out


def test_answers_filled_in_are_kept(students: Path, tmp_path: Path, capsys: Capture) -> None:
    answers = tmp_path / 'answers.csv'
    make(students, tmp_path, 'toggle')
    empty = answers.read_bytes()
    answers.write_bytes(b'old')
    assert make(students, tmp_path, 'toggle') == 2
    assert 'has no column student' in capsys.readouterr().err
    filled = empty.replace(b'0011,toggle,Z,', b'0011,toggle,Z,7')
    answers.write_bytes(filled)
    assert make(students, tmp_path, 'toggle', '--format', 'moodle') == 0
    assert answers.read_bytes() == filled
    assert 'kept: it has answers' in capsys.readouterr().out
    answers.write_bytes(empty.replace(b'0012', b'0013'))
    assert make(students, tmp_path, 'toggle') == 0
    assert answers.read_bytes() == empty


@pytest.mark.parametrize(
    ('name', 'folder', 'kind', 'code', 'message'),
    [
        ('class.csv', 'out', 'newtn', 2, 'did you mean newton?'),
        ('answers.csv', '', 'toggle', 3, 'which is only read'),
        ('class.csv', 'class.csv', 'toggle', 3, 'cannot be written'),
    ],
)
def test_a_refusal_leaves_the_class_list_as_it_is(  # noqa: PLR0917 - a row of the table
    tmp_path: Path,
    capsys: Capture,
    name: str,
    folder: str,
    kind: str,
    code: int,
    message: str,
) -> None:
    path = tmp_path / name
    path.write_text(CLASS)
    assert make(path, tmp_path / folder, kind) == code
    assert message in capsys.readouterr().err
    assert path.read_text() == CLASS


def test_a_key_shows_every_step(capsys: Capture) -> None:
    assert main(['key', '--kind', 'newton', '--student', '0011']) == 0
    shown = capsys.readouterr().out
    for name in ('Phi_44', 'gamma_2', 'theta_3', 'iterations'):
        assert re.search(rf'^{name} = ', shown, re.MULTILINE)


@pytest.mark.parametrize('error', [-7.96e-15, -0.0])
def test_rounding_errors_are_shown_as_0(error: float) -> None:
    assert with_unit(error, 'mm', 'pt') == '0 mm'
    assert with_unit(error, 'deg', 'en') == '0°'


def test_the_kinds_are_listed_in_portuguese(capsys: Capture) -> None:
    assert main(['list', '--language', 'pt']) == 0
    assert capsys.readouterr().out.count('\n') == len(KINDS)


@pytest.mark.parametrize('arguments', [[], ['make'], ['mark'], ['key', '--kind', 'x']])
def test_missing_arguments_are_refused(arguments: list[str]) -> None:
    assert code_of(*arguments) == 2


def test_bars_of_one_length_keep_their_own_names() -> None:
    lengths = {'L_1': 200.0, 'L_2': 80.0, 'L_3': 200.0, 'L_4': 200.0, 'theta_2': 60.0}
    variant = replace(make_variant(KINDS['four-bar-position'], '1'), givens=lengths)
    drawn = picture(variant)
    assert [drawn.count(name) for name in ('>L₂<', '>L₃<', '>L₄<')] == [1, 1, 1]
