"""The tables of a class: lists as universities export them, answers of forms, the gradebook."""

from collections.abc import Callable, Mapping
import csv
import hashlib
import hmac
import html
import json
from pathlib import Path
import re
import stat
from typing import Any

from browser_page import OpenedPage
from klann_ros.exercises import ExerciseError, KINDS, make_variant, Variant
from klann_ros.exercises.answers import AnswerTable, read_students
from klann_ros.exercises.assignment import Assignment, load_assignment, read_tasks
from klann_ros.exercises.command import main
from klann_ros.exercises.gradebook import save_template
from klann_ros.exercises.sheet import key, question_markup, sheets
import pytest

Capture = pytest.CaptureFixture[str]

ANA_EVA = {'0123': 'Ana Sá', '0456': 'Eva Luz'}
CLASS_LISTS = {
    'Moodle, participants': 'Nome,Sobrenome,"Número de identificação","Endereço de email",Grupos\n'
    'Ana,Sá,0123,a@usp.br,\nEva,Luz,0456,e@usp.br,\n',
    'Moodle, grades': '"First name",Surname,"ID number",Institution,Department,"Email address",'
    '"Course total (Real)","Last downloaded from this course"\n'
    'Ana,Sá,0123,,,a@x.org,-,1764400000\nEva,Luz,0456,,,e@x.org,-,1764400000\n',
    'Moodle 4, grades': 'First name,Last name,ID number,Email address\n'
    'Ana,Sá,0123,a@x.org\nEva,Luz,0456,e@x.org\n',
    'e-Disciplinas': 'Nome,Sobrenome,Número USP,Endereço de email,Total do curso (Real),'
    'Último download realizado neste curso.\nAna,Sá,0123,,-,\nEva,Luz,0456,,-,\n',
    'Júpiter': 'Universidade de São Paulo\nDisciplina: SEM0104 - Mecanismos;;;\n;;;\n'
    'Seq.;Nº USP;Nome;Curso\n1;0123;Ana Sá;18003\n2;0456;Eva Luz;18003\n;;;\nTotal: 2 alunos\n',
    'SIGAA': 'Matrícula\tNome\tCurso\n0123\tAna Sá\tMEC\n0456\tEva Luz\tMEC\n',
    'RA': 'RA;NOME COMPLETO;E-MAIL\n0123;Ana Sá;a@x\n0456;Eva Luz;e@x\n',
    'form': 'Carimbo de data/hora,Qual é o seu Número USP?,Nome\n,0123,Ana Sá\n,0456,Eva Luz\n',
    'status of enrolment': 'Situação da matrícula;Nome;Nº USP\nMA;Ana Sá;0123\nMA;Eva Luz;0456\n',
    'date of enrolment': 'Data da matrícula;RA;Nome\n1/2;0123;Ana Sá\n1/2;0456;Eva Luz\n',
    'both names': 'Nome completo,Sobrenome,Nº USP\nAna Sá,Sá,0123\nEva Luz,Luz,0456\n',
    'aluno': 'NUSP;Aluno(a)\n0123;Ana Sá\n0456;Eva Luz\n',
    'Canvas': 'Student,Student ID,SIS User ID,Section\nAna Sá,0123,x,1\nEva Luz,0456,x,1\n',
    'spreadsheet': 'sep=;\n"Nº  USP";"Nome"\n="0123";" Ana Sá "\n;\n="0456";Eva Luz\n;;;\n',
}


def written(folder: Path, content: str, encoding: str = 'utf-8', name: str = 'class.csv') -> str:
    path = folder / name
    path.write_bytes(content.encode(encoding))
    return str(path)


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-8-sig', 'utf-16', 'latin-1'])
@pytest.mark.parametrize('name', CLASS_LISTS)
def test_a_class_list_of_a_university_is_read(tmp_path: Path, name: str, encoding: str) -> None:
    students, notes = read_students(written(tmp_path, CLASS_LISTS[name], encoding), {})
    assert students == ANA_EVA
    assert notes[0].startswith('columns: student = ')
    assert ('left out: ' in ''.join(notes)) == (name == 'Júpiter')


def test_a_number_with_the_decimals_of_a_program_is_whole(tmp_path: Path) -> None:
    path = written(tmp_path, 'Turma 1\nMatrícula;Nome\n11223344.0;Ana\n')
    assert read_students(path, {})[0] == {'11223344': 'Ana'}
    path = written(tmp_path, 'Turma 1\nMatrícula;Nome\n1;Ana\n;Eva\n')
    with pytest.raises(ExerciseError, match='line 4: no student number'):
        read_students(path, {})


def test_a_column_is_named_by_its_heading(tmp_path: Path) -> None:
    path = written(tmp_path, 'Nome;Código interno;Matrícula\nAna Sá;0123;9\nEva Luz;0456;8\n')
    assert read_students(path, {'student': 'codigo INTERNO'})[0] == ANA_EVA
    for column, message in {
        'student': 'no column student, such as x;',
        'aluno': 'is unknown',
    }.items():
        with pytest.raises(ExerciseError, match=message):
            read_students(path, {column: 'x'})


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['toggle', 'toggle:2'], 'kind toggle is there twice'),
        (['toggle:'], ''),
        (['toggle:0'], 'must be a number > 0, such as toggle:1.5'),
        (['toggle:nan'], 'must be a number > 0'),
        (['toggle:-1'], 'must be a number > 0'),
        (['toggle:1e9'], 'must be a number > 0'),
        (['toggle:x'], 'must be a number > 0'),
        (['togle:1'], 'did you mean toggle'),
    ],
)
def test_points_of_a_task_are_positive_numbers(arguments: list[str], message: str) -> None:
    if not message:
        assert read_tasks(arguments) == {'toggle': 3.0}
        return
    with pytest.raises(ExerciseError, match=message):
        read_tasks(arguments)


def make(
    tmp_path: Path, *more: str, content: str = 'student,name\n0123,Ana Sá\n0456,Eva Luz\n'
) -> Path:
    folder = tmp_path / 'exam'
    place = ['--students', written(tmp_path, content), '-o', str(folder)]
    tasks = ['--kind', 'toggle:1,5', '--kind', 'grashof:2']
    assert main(['make', *tasks, *place, *more]) == 0
    return folder


def test_a_sheet_has_all_tasks_and_one_key(tmp_path: Path) -> None:
    folder = make(tmp_path, '--language', 'pt', '--title', 'Prova <1>', '--room', '3')
    page = (folder / 'sheets.html').read_text()
    assert page.count('<section>') == 2
    assert page.count('<h1>Prova &lt;1&gt;</h1>') == 2
    assert page.count('<h2>1. Projeto de ponto morto (1,5 ponto)</h2>') == 2
    assert page.count('<h2>2. Lei de Grashof (2 pontos)</h2>') == 2
    assert page.count('____ / 3,5 pontos') == 2
    assert page.count('<div></div>') == 2 * 2 * 3
    answer_key = (folder / 'key.html').read_text()
    assert answer_key.count('<table>') == 1
    for student in ANA_EVA:
        assert answer_key.count(student) == 1
        length = make_variant(KINDS['toggle'], student).answers['Z']
        assert isinstance(length, float)
        assert f'<td>{length:.1f}</td>'.replace('.', ',') in answer_key


@pytest.mark.parametrize(
    ('kinds', 'tables'),
    [
        (['newton'], 1),
        (['newton', 'grashof'], 2),
        (['newton', 'toggle'], 1),
        (['toggle', 'grashof', 'limits'], 1),
    ],
)
def test_tables_of_a_key_fit_on_the_paper(kinds: list[str], tables: int) -> None:
    assignment = Assignment(dict.fromkeys(kinds, 1.0), {'1': ''})
    page = key(assignment, assignment.variants(), has_steps=False)
    assert page.count('<table>') == tables
    assert page.count('<h2>') == len(kinds)


Texts = Mapping[str, Callable[[Variant, str], str]]


def right(variant: Variant, name: str, factor: float = 1.0) -> str:
    """Return an answer as a student in Brazil writes it."""
    answer = variant.answers[name]
    return answer if isinstance(answer, str) else f'{answer * factor:.6g}'.replace('.', ',')


# Headings of a form, and the columns that they are: toggle is task 1, grashof is task 2.
FORMS = {
    'template': 'aluno;nome;toggle Z (mm);toggle L_3_S (mm);toggle L_3_F (mm);grashof s_l (mm);'
    'grashof p_q (mm);grashof classe;grashof tipo',
    'Google Forms': 'Carimbo de data/hora;Nº USP;1. Z [cm];1) L₃,S (cm);Questão 1: L_3_F (cm);s_l;'
    '2 p_q;Grashof [classe];2. tipo',
    'Microsoft Forms': 'ID;Student ID;Toggle: Z;Toggle: L_3_S;Toggle: L_3_F;Task 2: s_l;p_q;Class;'
    'Type;',
}


@pytest.mark.parametrize('name', FORMS)
def test_a_row_of_a_form_is_the_answers_of_a_student(
    tmp_path: Path, capsys: Capture, name: str
) -> None:
    folder = make(tmp_path)
    factor = 0.1 if name == 'Google Forms' else 1.0
    rows = [FORMS[name]]
    for number, student in enumerate(ANA_EVA):
        cells = [student, ''] if name == 'template' else [str(number), student]
        for kind, scale in (('toggle', factor), ('grashof', 1.0)):
            variant = make_variant(KINDS[kind], student)
            for question in variant.kind.questions:
                cells.append(
                    right(variant, question.name, scale if question.unit == 'mm' else 1.0)
                )
        rows.append(';'.join(cells))
    path = written(tmp_path, '\n'.join(rows), name='form.csv')
    capsys.readouterr()
    assert main(['mark', path, '--folder', str(folder)]) == 0
    shown = capsys.readouterr().out
    for student in ANA_EVA:
        assert f'{student}  toggle  1.5 of 1.5' in shown
        assert f'{student}  grashof  2 of 2' in shown
    assert ('Carimbo de data/hora' in shown) == (name == 'Google Forms')


@pytest.mark.parametrize('is_wide', [True, False])
@pytest.mark.parametrize('language', ['en', 'pt'])
def test_the_table_of_all_kinds_is_read_back(
    tmp_path: Path, language: str, *, is_wide: bool
) -> None:
    assignment = Assignment(dict.fromkeys(KINDS, 1.0), ANA_EVA, language)
    path = tmp_path / 'answers.csv'
    with path.open('wb') as file:
        save_template(assignment, is_wide, file)
    heads, *rows = path.read_text('utf-8-sig').splitlines()
    assert 'grashof grashof' not in heads
    delimiter = ';' if language == 'pt' else ','
    filled = []
    for row in rows:
        labels = row.rstrip(delimiter)
        blank_count = heads.count(delimiter) - labels.count(delimiter)
        filled.append(labels + f'{delimiter}7' * blank_count)
    path.write_text('\n'.join([heads, *filled]), 'utf-8-sig')
    answers = AnswerTable(str(path), assignment, {})
    assert not [note for note in answers.notes if 'question' in note]
    for kind in KINDS.values():
        expected = {question.name: '7' for question in kind.questions}
        assert answers.texts['0123', kind.name] == expected


@pytest.mark.parametrize('language', ['en', 'pt'])
def test_a_printed_label_is_a_heading(tmp_path: Path, language: str) -> None:
    assignment = Assignment(dict.fromkeys(KINDS, 1.0), ANA_EVA, language)
    labels = ['NUSP']
    for number, kind in enumerate(KINDS.values(), 1):
        for question in kind.questions:
            label = re.sub('<[^>]+>', '', str(question_markup(question, language)))
            labels.append(f'{number}. {html.unescape(label)}')
    path = written(tmp_path, f'{";".join(labels)}\n0123{";7" * (len(labels) - 1)}\n')
    notes = AnswerTable(path, assignment, {}).notes
    assert not [note for note in notes if 'question' in note]


@pytest.mark.parametrize(
    'heading', ['newton theta_2', '1. θ₂', 'Newton: θ2 (°)', 'task 1 θ_2 [deg]', 'Theta 2']
)
def test_a_heading_has_the_symbols_of_the_sheet(
    tmp_path: Path, capsys: Capture, heading: str
) -> None:
    folder = make(tmp_path, '--kind', 'newton')
    angle = make_variant(KINDS['newton'], '0123').answers['theta_2']
    path = written(tmp_path, f'NUSP;{heading.replace("1", "3")}\n0123;{angle:.3f}\n')
    capsys.readouterr()
    assert main(['mark', path, '--folder', str(folder)]) == 0
    assert '0123  newton  1 of 15' in capsys.readouterr().out


@pytest.mark.parametrize('cell', ['{:.4f}', '{:.4f} cm', '{:.4f}cm.'])
def test_a_unit_of_an_answer_goes_before_that_of_its_heading(
    tmp_path: Path, capsys: Capture, cell: str
) -> None:
    folder = make(tmp_path)
    length = make_variant(KINDS['toggle'], '0123').answers['Z']
    assert isinstance(length, float)
    path = written(tmp_path, f'NUSP;Z [cm]\n0123;{cell.format(length / 10.0)}\n')
    capsys.readouterr()
    assert main(['mark', path, '--folder', str(folder)]) == 0
    assert '0123  toggle  0.5 of 1.5' in capsys.readouterr().out


@pytest.mark.parametrize('task', ['toggle,Z', ',Z', '1,Z', 'Toggle,z (mm)', ',1. Z', ',toggle: Z'])
def test_a_row_of_an_answer_names_its_question_as_a_heading_does(
    tmp_path: Path, task: str
) -> None:
    assignment = Assignment(read_tasks(['toggle', 'grashof']), ANA_EVA)
    path = written(tmp_path, f'student,kind,question,answer\n0123,{task},7\n')
    assert AnswerTable(path, assignment, {}).texts == {('0123', 'toggle'): {'Z': '7'}}


def test_the_report_has_the_points_of_the_class(tmp_path: Path, capsys: Capture) -> None:
    numbers = ['1', '01', '2', '3']
    folder = make(tmp_path, '--language', 'pt', content='\n'.join(['student', *numbers]))
    rows = ['student;Z;L_3_S;L_3_F']
    for student, count in {'1': 3, '2': 1, '3': 0, '001': 3}.items():
        variant = make_variant(KINDS['toggle'], student)
        texts = [right(variant, q.name) for q in variant.kind.questions]
        rows.append(';'.join([student, *texts[:count], *['x'] * (3 - count)]))
    path = written(tmp_path, '\n'.join(rows))
    capsys.readouterr()
    assert main(['mark', path, '--folder', str(folder)]) == 1
    shown = capsys.readouterr().out
    assert 'pontos de 3,5: média 0,6667, quartis 0,25, 0,5, 1\n' in shown
    assert 'questão mais difícil, 33 % dos pontos: toggle L_3_S\n' in shown
    assert 'sem respostas: 01\n' in shown
    # Of 1 and 01 it may be either.
    assert 'refused: line 5: student 001 is not in the class\n' in shown


def test_rows_of_a_form_that_are_guessed_doubled_or_unknown_are_named(
    tmp_path: Path, capsys: Capture
) -> None:
    folder = make(tmp_path)
    student_rows = ['NUSP 123,1', '0123,2', '0457,3', ',4', '0123,']
    path = written(tmp_path, '\n'.join(['NUSP,Z', *student_rows]), name='form.csv')
    capsys.readouterr()
    assert main(['mark', path, '--folder', str(folder)]) == 1
    shown = capsys.readouterr().out
    for line in (
        'note: columns: student = NUSP',
        'note: questions without a column: grashof grashof, grashof motion, grashof p_q, ',
        'note: student NUSP 123 is taken for 0123',
        'note: lines 2 and 3 are both of 0123: the last counts',
        '    Z = 2: 0, wrong',
        'no answers: 0456',
        'refused: line 4: student 0457 is not in the class',
        'refused: line 5: no student number',
    ):
        assert line in shown


@pytest.mark.parametrize(
    ('heads', 'message'),
    [
        ('student,x', 'has no columns question and answer, nor one of a question of toggle'),
        ('student,Z,toggle Z', 'has two columns of toggle Z'),
        ('Z,theta', 'has no column student'),
    ],
)
def test_a_table_without_questions_is_refused(
    tmp_path: Path, capsys: Capture, heads: str, message: str
) -> None:
    folder = make(tmp_path)
    path = written(tmp_path, f'{heads}\n0123\n', name='form.csv')
    assert main(['mark', path, '--folder', str(folder)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count('\n') == 1


def test_a_heading_of_two_tasks_needs_the_kind(tmp_path: Path, capsys: Capture) -> None:
    path = written(tmp_path, 'student,1 f_1\n1,2\n')
    # Tasks have numbers on a sheet alone.
    assert main(['mark', path]) == 2
    path = written(tmp_path, 'student,swing\n1,2\n')
    assert main(['mark', path]) == 2
    assert 'put the kind before swing: limits, quick-return' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('language', 'delimiter', 'heads', 'points', 'absent'),
    [
        ('pt', ';', 'toggle (1,5);grashof (2);Total (3,5);motivos', '0,9', 'sem respostas'),
        ('en', ',', 'toggle (1.5),grashof (2),Total (3.5),reasons', '0.9', 'no answers'),
    ],
)
def test_the_gradebook_has_a_row_a_student(  # noqa: PLR0917 - a row of the table
    tmp_path: Path, language: str, delimiter: str, heads: str, points: str, absent: str
) -> None:
    hostile = 'student,name\n0123,=HYPERLINK("x")\n0456,@Eva\n'
    folder = make(tmp_path, '--language', language, '--wide', content=hostile)
    answers = folder / 'answers.csv'
    variant = make_variant(KINDS['toggle'], '0123')
    lines = answers.read_text('utf-8-sig').splitlines()
    cells = lines[1].split(delimiter)
    cells[2] = right(variant, 'Z').replace(',', '.')
    # A slip, worth 0.8 - and 0 of 1 for the last.
    cells[3] = f'{float(variant.answers["L_3_S"]) / 10.0:.6g}'  # type: ignore[arg-type]
    answers.write_text('\n'.join([lines[0], delimiter.join(cells), lines[2]]), 'utf-8-sig')
    book = tmp_path / 'book.csv'
    assert main(['mark', str(answers), '--gradebook', str(book)]) == 0
    assert book.read_text('utf-8-sig').splitlines()[0].endswith(heads)
    first, second = csv.reader(book.read_text('utf-8-sig').splitlines()[1:], delimiter=delimiter)
    assert first[:5] == ['0123', '\'=HYPERLINK("x")', points, '0', points]
    assert first[5].startswith('toggle L_3_S = ')
    assert second == ['0456', "'@Eva", '', '', '', absent]


def test_a_folder_remembers_its_assignment(tmp_path: Path, capsys: Capture) -> None:
    folder = make(tmp_path, '--language', 'pt')
    assert load_assignment(folder) == Assignment({'toggle': 1.5, 'grashof': 2.0}, ANA_EVA, 'pt')
    answers = folder / 'answers.csv'
    answers.write_text('student,kind,question,answer\n0123,toggle,Z,x\n0123,newton,f_1,1\n')
    capsys.readouterr()
    assert main(['mark', str(answers)]) == 1
    shown = capsys.readouterr().out
    assert 'exercise.json: 2 students, points toggle 1.5, grashof 2, language pt\n' in shown
    assert 'Z = x: 0, não foi lida: ' in shown
    assert "refused: line 3: 'newton f_1' is no question of toggle, grashof" in shown


DAMAGED: dict[str, Any] = {
    'no JSON': '{',
    'a list': [],
    'an unknown kind': {'points': {'x': 1}},
    'no points': {'points': {'toggle': 'x'}},
    'points of another kind': {'points': [1]},
    'a name that is no text': {'students': {'1': 2}},
    'an unknown language': {'language': 'fr'},
    'an unknown field': {'x': 1},
    'no secret': {'secret': 7},
}


@pytest.mark.parametrize('name', DAMAGED)
def test_a_damaged_assignment_is_refused(tmp_path: Path, capsys: Capture, name: str) -> None:
    content = DAMAGED[name]
    good = {'points': {'toggle': 1}, 'students': {'1': ''}}
    if isinstance(content, dict):
        content = json.dumps({**good, **content})
    written(
        tmp_path,
        content if isinstance(content, str) else json.dumps(content),
        name='exercise.json',
    )
    path = written(tmp_path, 'student,Z\n1,2\n')
    assert main(['mark', path]) == 2
    error = capsys.readouterr().err
    assert 'exercise.json is damaged: ' in error
    assert error.count('\n') == 1


def test_answers_to_other_sheets_are_kept(tmp_path: Path, capsys: Capture) -> None:
    folder = make(tmp_path)
    answers = folder / 'answers.csv'
    answers.write_text('student,kind,question,answer\n0123,toggle,Z,1\n')
    pages = (folder / 'sheets.html').read_bytes()
    place = ['--students', str(tmp_path / 'class.csv'), '-o', str(folder)]
    assert main(['make', '--kind', 'limits', *place]) == 3
    assert 'has answers to other sheets: 2 students' in capsys.readouterr().err
    secret = str(tmp_path / 'secret.txt')
    tasks = ['--kind', 'toggle', '--kind', 'grashof']
    assert main(['make', *tasks, *place, '--secret', secret]) == 3
    assert (folder / 'sheets.html').read_bytes() == pages
    # More students and other points are the same sheets.
    written(tmp_path, 'student\n0123\n0456\n0789\n')
    assert main(['make', '--kind', 'toggle:7', '--kind', 'grashof', *place]) == 0
    assert (folder / 'sheets.html').read_bytes() != pages
    assert answers.read_text().endswith('Z,1\n')


def test_a_secret_draws_numbers_that_no_student_number_gives(
    tmp_path: Path, capsys: Capture
) -> None:
    path = tmp_path / 'secret.txt'
    folder = make(tmp_path, '--secret', str(path))
    assert f'keep {path}: marking needs it' in capsys.readouterr().out
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    secret = path.read_text().strip()
    assert len(secret) == 32
    for file in folder.iterdir():
        assert secret not in file.read_text('utf-8-sig')
    variant = make_variant(KINDS['toggle'], '0123', secret=secret)
    digest = hmac.new(secret.encode(), b'0123', hashlib.sha256).hexdigest()
    assert variant.givens == make_variant(KINDS['toggle'], digest).givens
    assert variant.givens != make_variant(KINDS['toggle'], '0123').givens
    assert f'<td>{variant.answers["Z"]:.1f}</td>' in (folder / 'key.html').read_text()
    answers = folder / 'answers.csv'
    answers.write_text(f'student,kind,question,answer\n0123,toggle,Z,"{right(variant, "Z")}"\n')
    capsys.readouterr()
    assert main(['mark', str(answers)]) == 0
    assert '0123  toggle  0.5 of 1.5' in capsys.readouterr().out
    assert main(['key', '--kind', 'toggle', '--student', '0123', '--secret', str(path)]) == 0
    assert f'Z = {variant.answers["Z"]:.1f} mm' in capsys.readouterr().out
    # Where it has moved to is said; another one marks nothing.
    moved = path.rename(tmp_path / 'moved.txt')
    refusals = {
        'cannot be used: No such file': [],
        'not that of the sheets': ['--secret', str(path)],
    }
    assert main(['mark', str(answers), '--secret', str(moved)]) == 0
    for message, option in refusals.items():
        if option:
            path.write_text('another secret')
        assert main(['mark', str(answers), *option]) == 2
        assert message in capsys.readouterr().err


def test_a_secret_that_can_be_guessed_is_refused(tmp_path: Path, capsys: Capture) -> None:
    path = written(tmp_path, 'sem104\n', name='secret.txt')
    place = ['--students', written(tmp_path, 'student\n1\n'), '-o', str(tmp_path / 'out')]
    assert main(['make', '--kind', 'toggle', *place, '--secret', path]) == 2
    assert 'can be guessed: it must have 12 characters' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('form', 'options', 'named'),
    [
        ('moodle', ['--kind', 'limits:2'], 'points'),
        ('moodle', ['--room', '3', '--title', 'x'], '--title, --room'),
        ('prairielearn', ['--secret', 's'], '--secret'),
        ('notebook', ['--steps', '--secret', 's'], '--steps, --secret'),
    ],
)
def test_options_that_a_platform_has_not_are_refused_by_name(
    tmp_path: Path, capsys: Capture, form: str, options: list[str], named: str
) -> None:
    place = ['--students', written(tmp_path, 'student\n1\n'), '-o', str(tmp_path / 'out')]
    with pytest.raises(SystemExit) as end:
        main(['make', '--kind', 'toggle', *place, '--format', form, *options])
    assert end.value.code == 2
    assert f'--format {form} takes no {named}: ' in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()


def test_a_platform_takes_several_kinds_and_moodle_a_secret(tmp_path: Path) -> None:
    place = ['--students', written(tmp_path, 'student\n1\n'), '-o', str(tmp_path / 'out')]
    tasks = ['--kind', 'toggle', '--kind', 'grashof']
    secret = ['--secret', str(tmp_path / 's')]
    assert main(['make', *tasks, *place, '--format', 'moodle', *secret]) == 0
    assert {path.name for path in (tmp_path / 'out').glob('*.xml')} == {
        f'{kind}{part}.xml' for kind in ('toggle', 'grashof') for part in ('', '_parts')
    }


@pytest.mark.slow
def test_sheets_and_key_are_read_on_a_phone(tmp_path: Path, new_page: Callable[..., Any]) -> None:
    assignment = Assignment(
        read_tasks(['newton:3', 'grashof', 'function-generation', 'four-poses']),
        {'0123': 'Maria da Conceição', '9' * 64: ''},
        'pt',
        room=4,
    )
    students = assignment.variants()
    for page in (sheets(assignment, students), key(assignment, students, has_steps=True)):
        path = tmp_path / 'page.html'
        path.write_text(page, encoding='utf-8')
        opened = OpenedPage(new_page(viewport={'width': 390, 'height': 800}), path.as_uri())
        assert not opened.is_too_wide()
        assert opened.barriers() == []
        assert not opened.complaints
