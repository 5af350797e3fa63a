"""The formats of learning platforms: well formed, with the key and the slips of the marking."""

from collections.abc import Callable
from doctest import DocTestParser, DocTestRunner
from html import escape, unescape
from itertools import cycle
import json
import math
from pathlib import Path
import re
import runpy
from typing import Any

from klann_ros.exercises import (
    check,
    command,
    ExerciseError,
    KINDS,
    make_variant,
    mark,
    platforms,
    Variant,
)
from klann_ros.exercises.calculation import slip_of
from klann_ros.exercises.marking import reason
from klann_ros.exercises.sheet import unit_sign
from klann_ros.exercises.variant import LANGUAGES, texts
from klann_ros.web import browser
from moodle_rules import imported, MoodleAnswer, MoodleQuestion
import pytest

NOTHING = MoodleAnswer(0.0, '', 0.0, '')


@pytest.fixture(scope='module')
def variants() -> list[Variant]:
    return [make_variant(KINDS['grashof'], '1'), make_variant(KINDS['grashof'], '2')]


def moodle(variants: list[Variant], language: str) -> tuple[MoodleQuestion, list[MoodleQuestion]]:
    """Return the first Cloze question, and the parts, as Moodle imports them."""
    whole, parts = platforms.moodle(variants, language).values()
    return imported(whole)[1][0], imported(parts)[1]


@pytest.mark.parametrize(('name', 'language'), [*zip(KINDS, cycle(LANGUAGES), strict=False)])
def test_moodle_gives_the_points_and_the_reasons_of_the_marking(name: str, language: str) -> None:
    variant = make_variant(KINDS[name], '21')
    doubt = texts()['marks']['perhaps'][language].format('')
    cloze, parts = moodle([variant], language)
    assert '{' not in cloze.text
    for question, field, part in zip(variant.kind.questions, cloze.parts, parts, strict=True):
        assert part.name == f'{name} 21 {question.name}'
        sign = unit_sign(question.unit)
        assert (f'[{sign}]' in part.text) == bool(sign)
        assert field.answers == part.answers
        if question.choices:
            right = texts()['choices'].get(variant.answers[question.name], {}).get(language)
            best = max(field.answers)
            assert best.fraction == 1.0
            assert best.text == (right or variant.answers[question.name])
            continue
        assert variant.is_right(question, float(field.answers[0].text))
        for answer in field.answers:
            marks = mark(variant, {question.name: answer.text})
            (answer_mark,) = [marked for marked in marks if marked.slip != 'empty']
            assert answer_mark.points == pytest.approx(answer.fraction)
            reasons = set()
            for mistake, wrong in variant.mistaken.items():
                number = wrong.get(question.name)
                if number is not None and variant.is_near(question, float(answer.text), number):
                    reasons.add(escape(reason(slip_of(mistake), language)))
            assert answer.fraction == 1.0 or answer.feedback.removeprefix(doubt) in reasons


def test_moodle_takes_an_angle_as_students_write_it() -> None:
    variant = make_variant(KINDS['klann-position'], '3')
    cloze, parts = moodle([variant], 'en')
    for question, field, part in zip(variant.kind.questions, cloze.parts, parts, strict=True):
        right = variant.answers[question.name]
        assert isinstance(right, float)
        spellings = {f'{right:.3f}': 1.0}
        if question.unit == 'deg':
            spellings |= {f'{right - math.copysign(360, right):.4f}': 1.0}
            unit = {f'{right:.3f}°': 1.0, f'{math.radians(right):.7f} rad': 1.0}
        else:
            metres = f'{right / 1e3:,.6f}'.replace('.', ',')
            unit = {f'{right / 10:.4f} cm': 1.0, f'{metres} m': 1.0}
        for text, points in spellings.items():
            assert (field.marked(text) or NOTHING).fraction == points, text
        for text, points in (spellings | unit).items():
            assert (part.marked(text) or NOTHING).fraction == points, text


def test_moodle_has_the_drawing_as_a_file(variants: list[Variant]) -> None:
    cloze, parts = moodle(variants, 'pt')
    assert cloze.files['/linkage.svg'].startswith(b'<svg')
    assert all(part.files == cloze.files for part in parts[:4])
    assert '@@PLUGINFILE@@/linkage.svg' in cloze.text
    assert '<svg' not in cloze.text


def test_a_reason_with_marks_of_moodle_is_shown_as_it_is() -> None:
    answer = platforms.Alternative('50', '2', '1', 'a < b ~ {c} #1 \\ "d" & é')
    right = platforms.Alternative('100', '1', '0.1')
    field = platforms.cloze_field([right, answer])
    quiz = f'<quiz>{platforms.moodle_question("cloze", "x", field)}</quiz>'
    _, (question,) = imported(quiz.encode())
    # The feedback is HTML.
    assert unescape(question.parts[0].answers[1].feedback) == answer.reason


@pytest.fixture
def served(tmp_path: Path, variants: list[Variant]) -> dict[str, Callable[[Any], None]]:
    for name, content in platforms.prairielearn(variants, 'en').items():
        place = tmp_path / name
        place.parent.mkdir(exist_ok=True)
        place.write_bytes(content)
    info = json.loads((tmp_path / 'grashof/info.json').read_text())
    assert set(info) == {'uuid', 'title', 'topic', 'tags', 'type'}
    return runpy.run_path(str(tmp_path / 'grashof/server.py'))


def test_prairielearn_generates_and_grades(served: dict[str, Callable[[Any], None]]) -> None:
    data: dict[str, Any] = {'variant_seed': 8, 'params': {}, 'correct_answers': {}}
    served['generate'](data)
    assert '<svg' in data['params']['problem']
    data |= {'submitted_answers': dict(data['correct_answers']), 'partial_scores': {}}
    data['submitted_answers']['s_l'] += ' cm'
    data['submitted_answers']['grashof'] = 'no'
    served['grade'](data)
    assert data['score'] == 0.5
    assert data['partial_scores']['p_q']['feedback'] == 'right'
    assert data['partial_scores']['grashof']['feedback'].startswith('not read: ')


def test_a_notebook_tests_itself(variants: list[Variant], tmp_path: Path) -> None:
    files = platforms.notebooks(variants, 'pt')
    book = json.loads(files['grashof/1.ipynb'])
    assert book['nbformat'] == 4
    assert len({cell['id'] for cell in book['cells']}) == len(book['cells'])
    script = tmp_path / 'grashof.py'
    script.write_bytes(files['grashof/tests/grashof.py'])
    scope = runpy.run_path(str(script))
    code = scope['test']['suites'][0]['cases'][0]['code']
    globs = {'student': '1', 'grashof': variants[0].answers['grashof']}
    runner = DocTestRunner(verbose=False)
    runner.run(DocTestParser().get_doctest(code, globs, 'grashof', None, None))
    assert (runner.tries, runner.failures) == (2, 0)


def test_check_gives_the_reason() -> None:
    variant = make_variant(KINDS['limits'], '9')
    swing = variant.answers['swing']
    assert isinstance(swing, float)
    assert check('limits', '9', 'swing', f'{swing:.5g}') == 'right'
    wrong = check('limits', '9', 'swing', swing * 3.14159265 / 180.0, 'pt')
    assert wrong == 'graus e radianos estão trocados'
    with pytest.raises(ExerciseError, match='did you mean swing'):
        check('limits', '9', 'swin', 1)


def test_a_file_name_is_never_the_students_own_path() -> None:
    students = [
        '../../etc/passwd',
        '..',
        '/',
        '1/2',
        '12',
        'a1',
        'A1',
        'CON',
        'nul',
        'Com1',
        '/aux',
    ]
    toggles = [make_variant(KINDS['toggle'], student) for student in students]
    names = [name for name in platforms.notebooks(toggles, 'en') if name.endswith('.ipynb')]
    assert len({name.casefold() for name in names}) == len(students)
    assert all(re.fullmatch(r'toggle/[\w-]+\.ipynb', name) for name in names)
    devices = {'con', 'nul', 'com1', 'aux'}
    assert devices.isdisjoint(Path(name).stem.casefold() for name in names)


def test_without_a_browser_the_pdf_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv('PATH', str(tmp_path))
    (tmp_path / 'class.csv').write_text('student\n1\n')
    place = ['--students', str(tmp_path / 'class.csv'), '-o', str(tmp_path / 'out')]
    assert command.main(['make', '--kind', 'toggle', *place, '--format', 'pdf']) == 3
    assert capsys.readouterr().err == (
        'exercise: a PDF needs chromium: install it, or print the HTML page\n'
    )


def test_a_page_is_printed() -> None:
    try:
        printed = browser.print_page(b'<!doctype html><title>x</title><p>Printed')
    except browser.PrintError as error:
        pytest.skip(str(error))
    assert printed.startswith(b'%PDF-')
