"""What the lab saves solver_node loads, files mean the same to both, and bombs do nothing."""

from collections.abc import Iterator
from importlib import resources
import json
from pathlib import Path
import re
from typing import Any

from klann_ros.kinematics import KlannGeometry, shipped_linkage, shipped_linkages
from klann_ros.kinematics.linkage.file import linkage_from_text
from klann_ros.sanitize.yaml_text import parse
from lab_solver import in_node, NODE, TEXTS
import numpy as np
import pytest
from yaml_tables import read_table

if NODE is None:
    pytest.skip('no node: apt-get install nodejs', allow_module_level=True)

FILES = read_table(Path(__file__).with_name('files.yaml'))
BOMBS = ['[' * 21 + ']' * 21, f'{"x" * 2000}: 1\n', '[' * 100_000, '{a: ' * 5000, '- ' * 10_000]
BOMBS += ['a: ' + 'x' * 2_000_000, 'x' * 10_000_000]
SAVE = """
function answer({ texts, factor }) {
  const answers = {};
  for (const [name, text] of Object.entries(texts)) {
    const { linkage, content, start } = readFile(text, texts.klann);
    const { dimensions } = linkage.structure;
    const made = linkage.with(linkage.numbers.map((number, n) =>
      (dimensions[n].kind === 'length' ? factor * number : number)));
    const title = 'A "name": #1 \\u00e9 \\u2028 \\\\ {x}';
    const saved = linkageText(made, content, poseAt(made, start).x, title);
    const again = readFile(saved, texts.klann).linkage.numbers;
    answers[name] = { saved, numbers: made.numbers, signs: made.signs, again };
    if (isKlannLeg(linkage, texts.klann)) {
      const numbers = made.numbers.map((number, n) =>
        number + ('xy'.includes(dimensions[n].kind) ? 0.01 : 0));
      const parameters = parametersText(made.with(numbers));
      const read = readFile(parameters, texts.klann).linkage;
      const outside = read.blocks.map((block) => block.outside);
      Object.assign(answers[name], { parameters, read: [read.numbers, read.signs, outside] });
    }
  }
  return answers;
}
"""

READ = """
function answer({ texts, klann, isYaml }) {
  return texts.map((text) => {
    try {
      const content = isYaml ? readYaml(text) : readFile(text, klann).linkage.numbers;
      if ('polluted' in {}) throw Error('the prototype of all objects was changed');
      return { content };
    } catch (error) {
      if (error instanceof Refusal) return { refused: Object.values(error.texts) };
      return { crashed: String(error.stack) };
    }
  });
}
"""


SCHEMA = json.loads(
    (resources.files('klann_ros.kinematics.linkage') / 'schema.json').read_text(encoding='utf-8')
)


def read_in_node(texts: list[str], *, is_yaml: bool) -> list[dict[str, Any]]:
    given = {'texts': texts, 'klann': TEXTS['klann'], 'isYaml': is_yaml}
    answers: list[dict[str, Any]] = in_node(READ, given)
    for answer in answers:
        assert 'crashed' not in answer, answer
        for line in answer.get('refused', ()):
            assert '\n' not in line
            assert 5 < len(line) < 500
    return answers


@pytest.fixture(scope='module')
def saved() -> dict[str, Any]:
    answers: dict[str, Any] = in_node(SAVE, {'texts': TEXTS, 'factor': 1.0078125})
    return answers


@pytest.mark.parametrize('name', shipped_linkages())
def test_a_saved_linkage_is_loaded_as_it_was(saved: dict[str, Any], name: str) -> None:
    answer = saved[name]
    linkage = linkage_from_text(answer['saved'], name)
    assert linkage.structure == shipped_linkage(name).structure
    assert linkage.numbers == pytest.approx(answer['numbers'], rel=4e-16, abs=1e-18)
    assert answer['again'] == pytest.approx(answer['numbers'], rel=4e-16, abs=1e-18)
    assert list(linkage.assembly) == answer['signs']
    assert linkage.name == 'A "name": #1 é \u2028 \\ {x}'
    assert parse(answer['saved']).get('springs') == parse(TEXTS[name]).get('springs')


def test_saved_parameters_are_those_of_the_leg(saved: dict[str, Any]) -> None:
    (node,) = parse(saved['klann']['parameters']).values()
    parameters = node['ros__parameters']
    factor = 1.0078125
    sem = KlannGeometry.sem104()
    geometry = KlannGeometry(**parameters)
    # rcl takes no whole number for a double.
    del parameters['assembly']
    assert {type(number) for number in parameters.values()} == {float}
    lengths = [getattr(geometry, name) for name in ('l_ab', 'l_fg', 'l_gh')]
    assert lengths == pytest.approx([factor * sem.l_ab, factor * sem.l_fg, factor * sem.l_gh])
    # Moved by (10, 10) mm and back again: A is above the origin, D beside it.
    assert (geometry.x_d, geometry.y_a) == pytest.approx((sem.x_d, sem.y_a))
    assert (geometry.x_e, geometry.y_e) == pytest.approx((sem.x_e, sem.y_e))
    assert geometry.angle_fgh == pytest.approx(sem.angle_fgh, rel=1e-15)
    numbers, signs, outside = saved['klann']['read']
    assert signs == [1, 1]
    assert outside == [False, True]
    assert numbers[0] == geometry.l_ab


def test_shipped_parameters_are_read() -> None:
    folder = Path(__file__).resolve().parents[3] / 'config'
    texts = [(folder / f'{name}.yaml').read_text() for name in ('sem104', 'patent')]
    geometries = [KlannGeometry.sem104(), KlannGeometry.patent()]
    names = [dimension.name for dimension in shipped_linkage('klann').structure.dimensions]
    for answer, geometry in zip(read_in_node(texts, is_yaml=False), geometries, strict=True):
        numbers = dict(zip(names, answer['content'], strict=True))
        assert numbers['A-B'] == geometry.l_ab
        assert numbers['bend of G-H'] == -geometry.angle_fgh
        assert numbers['D.x'] == geometry.x_d


def test_yaml_means_the_same_to_both() -> None:
    texts = [*TEXTS.values(), *FILES['read alike']]
    for text, answer in zip(texts, read_in_node(texts, is_yaml=True), strict=True):
        assert answer.get('content', answer) == parse(text)


def test_refused_files_have_a_reason_in_one_line() -> None:
    texts = [*FILES['refused'], *BOMBS]
    for text, answer in zip(texts, read_in_node(texts, is_yaml=True), strict=True):
        assert 'refused' in answer, text[:40]


PATTERNS = """
function answer({ patterns, texts }) {
  return patterns.map((pattern) => texts.map((text) => new RegExp(pattern, 'u').test(text)));
}
"""


def patterns_in(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict):
        if isinstance(schema.get('pattern'), str):
            yield schema['pattern']
        for part in schema.values():
            yield from patterns_in(part)


def test_patterns_mean_the_same_to_editors() -> None:
    patterns = [*patterns_in(SCHEMA)]
    texts = ['A', 'a_1', 'A\n', '1a', '', "Watt's linkage", 'a\x00', 'a\nb']
    expected = [[bool(re.search(pattern, text)) for text in texts] for pattern in patterns]
    assert in_node(PATTERNS, {'patterns': patterns, 'texts': texts}) == expected
    assert [True, True, False, False, False, False, False, False] in expected


MARKS = [
    *'#:-,[]{}"\'&*!|>%@`~? \n\t0.e',
    ': ',
    '\n  ',
    '- ',
    ' #',
    '? ',
    '!!str ',
    '&a ',
    '*a',
    '',
]


def damaged(count: int) -> list[str]:
    """Return shipped files, some places of each changed; always the same ones."""
    rng = np.random.default_rng(11)
    texts = []
    for _ in range(count):
        text = TEXTS[rng.choice(sorted(TEXTS))]
        for _ in range(rng.integers(1, 4)):
            start = int(rng.integers(len(text) + 1))
            end = start + int(rng.integers(4))
            text = text[:start] + str(rng.choice(MARKS)) + text[end:]
        texts.append(text)
    return texts


def test_damaged_files_mean_no_more_than_to_python() -> None:
    texts = damaged(200)
    accepted = 0
    for text, answer in zip(texts, read_in_node(texts, is_yaml=True), strict=True):
        if 'content' in answer:
            assert answer['content'] == parse(text), text
            accepted += 1
    assert 20 < accepted < 180


def test_no_linkage_is_refused_in_a_line_as_python_does() -> None:
    broken = [TEXTS['klann'].replace(*change, 1) for change in FILES['broken']]
    assert TEXTS['klann'] not in broken
    texts = [*broken, *FILES['no linkages']]
    for text, answer in zip(texts, read_in_node(texts, is_yaml=False), strict=True):
        assert 'refused' in answer, text
        if 'ros__parameters' not in text:
            with pytest.raises(ValueError, match='holds no linkage'):
                linkage_from_text(text, 'file')


def test_many_entangled_bodies_do_not_keep_the_page_busy() -> None:
    rng = np.random.default_rng(3)
    points = [f'P{n}' for n in range(24)]
    bodies = ['  b0: {bars: [{from: A, to: P0, length: 1}]}']
    for n in range(1, 24):
        a, b, c = rng.choice(points, 3, replace=False)
        bars = f'[{{from: {a}, to: {b}, length: 1}}, {{from: {a}, to: {c}, length: 1}}]'
        bodies.append(f'  b{n}: {{bars: {bars}}}')
    start = ', '.join(f'b{n}: 0' for n in range(24))
    head = 'name: x\npivots: {A: [0, 0], B: [1, 0]}\ncrank: b0\nfoot: P0\nbodies:\n'
    text = head + '\n'.join([*bodies, f'start: {{{start}}}\n'])
    (answer,) = read_in_node([text], is_yaml=False)
    assert 'refused' in answer


def test_every_key_of_a_linkage_file_is_read() -> None:
    text = TEXTS['four_bar'] + (
        'at_change_points: crossed\n'
        'springs: [{from: A, to: [0, 1], stiffness: 2, free_length: 3}]\n'
        'torsion_springs: [{joint: A, between: [theta2, theta3], stiffness: 1, rest_angle: 9}]\n'
        'mass_source: a pair of scales\n'
        'parts: {material: 650, pins: steel, infill: 0.3, wall: 1, thickness: 3, width: 10,\n'
        '  hole: 3.2, holes: {A: 5}, seat: [7, 2], seats: {A: [9, 2]}, washer: 0,\n'
        '  clearance: 0.2}\n'
    )
    assert {*parse(text)['parts']} == {*SCHEMA['$defs']['parts']['properties']}
    assert linkage_from_text(text, 'all').at_change_points == 'crossed'
    assert {*parse(text)} | {'assembly', 'points', 'ground', 'links'} == {*SCHEMA['properties']}
    (answer,) = read_in_node([text], is_yaml=False)
    assert 'refused' not in answer
