"""The formats of learning platforms: well formed, with the key and the slips of the marking."""

from collections.abc import Callable
from doctest import DocTestParser, DocTestRunner
import json
from pathlib import Path
import re
import runpy
from typing import Any
from xml.etree import ElementTree as ET

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
from klann_ros.web import browser
import pytest

# A field of Moodle's embedded answers: {1:TYPE:alternative~alternative}.
FIELD = re.compile(r'\{1:(NUMERICAL|MULTICHOICE):((?:[^\\}]|\\.)+)\}')
NUMERICAL = re.compile(r'(?:=|%(\d+)%)(-?[\d.]+):([\d.e-]+)(?:#(.+))?')


@pytest.fixture(scope='module')
def variants() -> list[Variant]:
    return [make_variant(KINDS['grashof'], '1'), make_variant(KINDS['grashof'], '2')]


def fields(variant: Variant, language: str) -> dict[str, str]:
    (content,) = platforms.moodle([variant], [''], language).values()
    quiz = ET.fromstring(content)  # noqa: S314 - our own
    text = quiz.findtext('question/questiontext/text') or ''
    found = FIELD.findall(text)
    assert '{' not in FIELD.sub('', text)
    names = [question.name for question in variant.kind.questions]
    return dict(zip(names, [alternatives for _, alternatives in found], strict=True))


@pytest.mark.parametrize('name', KINDS)
def test_a_moodle_field_takes_the_key_and_names_the_slips(name: str) -> None:
    variant = make_variant(KINDS[name], '21')
    for question in variant.kind.questions:
        alternatives = re.split(r'(?<!\\)~', fields(variant, 'en')[question.name])
        right = variant.answers[question.name]
        if isinstance(right, str):
            assert f'={right}' in alternatives
            continue
        numbers = [NUMERICAL.fullmatch(each) for each in alternatives]
        assert all(numbers)
        first, *others = (each for each in numbers if each)
        assert first[1] is None
        assert variant.is_right(question, float(first[2]))
        slips = [each for each in others if each[1]]
        for each in slips:
            assert not variant.is_right(question, float(each[2]))
            (found,) = [
                one for one in mark(variant, {question.name: each[2]}) if one.slip != 'empty'
            ]
            assert found.points == pytest.approx(float(each[1]) / 100.0)


def test_moodle_has_the_drawing_as_a_file(variants: list[Variant]) -> None:
    (content,) = platforms.moodle(variants, ['', ''], 'pt').values()
    quiz = ET.fromstring(content)  # noqa: S314 - our own
    assert [each.get('type') for each in quiz] == ['category', 'cloze', 'cloze']
    assert len(quiz.findall('question/questiontext/file')) == 2
    assert b'@@PLUGINFILE@@/linkage.svg' in content


@pytest.fixture
def served(tmp_path: Path, variants: list[Variant]) -> dict[str, Callable[[Any], None]]:
    for name, content in platforms.prairielearn(variants, ['', ''], 'en').items():
        place = tmp_path / name
        place.parent.mkdir(exist_ok=True)
        place.write_bytes(content)
    info = json.loads((tmp_path / 'grashof/info.json').read_text())
    assert set(info) == {'uuid', 'title', 'topic', 'tags', 'type'}
    return runpy.run_path(str(tmp_path / 'grashof/server.py'))


def test_prairielearn_generates_and_grades_by_this_package(
    served: dict[str, Callable[[Any], None]],
) -> None:
    data: dict[str, Any] = {'variant_seed': 8, 'params': {}, 'correct_answers': {}}
    served['generate'](data)
    assert '<svg' in data['params']['problem']
    data |= {'submitted_answers': dict(data['correct_answers']), 'partial_scores': {}}
    data['submitted_answers']['s_l'] += ' cm'
    data['submitted_answers']['grashof'] = 'no'
    served['grade'](data)
    assert data['score'] == 0.5
    assert data['partial_scores']['p_q']['feedback'] == 'right'
    assert data['partial_scores']['grashof']['feedback'] == 'no number of this unit'


def test_a_notebook_tests_itself(variants: list[Variant], tmp_path: Path) -> None:
    found = platforms.notebooks(variants, ['', ''], 'pt')
    book = json.loads(found['grashof/1.ipynb'])
    assert book['nbformat'] == 4
    assert len({cell['id'] for cell in book['cells']}) == len(book['cells'])
    scope = runpy.run_path(str(written(tmp_path, found, 'grashof/tests/grashof.py')))
    code = scope['test']['suites'][0]['cases'][0]['code']
    globs = {'student': '1', 'grashof': variants[0].answers['grashof']}
    runner = DocTestRunner(verbose=False)
    runner.run(DocTestParser().get_doctest(code, globs, 'grashof', None, None))
    assert (runner.tries, runner.failures) == (2, 0)


def written(folder: Path, files: dict[str, bytes], name: str) -> Path:
    place = folder / Path(name).name
    place.write_bytes(files[name])
    return place


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
    students = ['../../etc/passwd', '..', '/', '1/2', '12']
    made = [make_variant(KINDS['toggle'], student) for student in students]
    names = [name for name in platforms.notebooks(made, students, 'en') if name.endswith('.ipynb')]
    assert len(names) == len(students)
    assert all(re.fullmatch(r'toggle/[\w-]+\.ipynb', name) for name in names)


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
