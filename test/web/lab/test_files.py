"""What the lab saves solver_node loads, files mean the same to both, and bombs do nothing."""

from pathlib import Path
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
BOMBS = [
    '[' * 21 + ']' * 21,
    f'{"x" * 2000}: 1\n',
    '[' * 100_000,
    '{a: ' * 5000,
    '- ' * 10_000,
    'a: ' + 'x' * 2_000_000,
    'x' * 10_000_000,
]
SAVE = """
function answer({ texts, factor }) {
  const found = {};
  for (const [name, text] of Object.entries(texts)) {
    const { linkage, content, start } = readFile(text, texts.klann);
    const { dimensions } = linkage.structure;
    const made = linkage.with(linkage.numbers.map((one, n) =>
      (dimensions[n].kind === 'length' ? factor * one : one)));
    const title = 'A "name": #1 \\u00e9 \\u2028 \\\\ {x}';
    const saved = linkageText(made, content, poseAt(made, start).x, title);
    found[name] = { saved, numbers: made.numbers, signs: made.signs, again: null };
    found[name].again = readFile(saved, texts.klann).linkage.numbers;
    if (isKlannLeg(linkage, texts.klann)) {
      const numbers = made.numbers.map((one, n) =>
        one + ('xy'.includes(dimensions[n].kind) ? 0.01 : 0));
      found[name].parameters = parametersText(made.with(numbers));
      const read = readFile(found[name].parameters, texts.klann).linkage;
      found[name].read = [read.numbers, read.signs, read.blocks.map((block) => block.outside)];
    }
  }
  return found;
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


def read_in_node(texts: list[str], *, is_yaml: bool) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = in_node(
        READ, {'texts': texts, 'klann': TEXTS['klann'], 'isYaml': is_yaml}
    )
    assert [one['crashed'] for one in found if 'crashed' in one] == []
    for one in found:
        for line in one.get('refused', ()):
            assert '\n' not in line
            assert 5 < len(line) < 500
    return found


@pytest.fixture(scope='module')
def saved() -> dict[str, Any]:
    found: dict[str, Any] = in_node(SAVE, {'texts': TEXTS, 'factor': 1.0078125})
    return found


@pytest.mark.parametrize('name', shipped_linkages())
def test_a_saved_linkage_is_loaded_as_it_was(saved: dict[str, Any], name: str) -> None:
    base, found = shipped_linkage(name), saved[name]
    linkage = linkage_from_text(found['saved'], name)
    assert linkage.structure == base.structure
    assert linkage.numbers == pytest.approx(found['numbers'], rel=4e-16, abs=1e-18)
    assert found['again'] == pytest.approx(found['numbers'], rel=4e-16, abs=1e-18)
    assert list(linkage.assembly) == found['signs']
    assert linkage.name == 'A "name": #1 é \u2028 \\ {x}'
    assert parse(found['saved']).get('springs') == parse(TEXTS[name]).get('springs')


def test_saved_parameters_are_those_of_the_leg(saved: dict[str, Any]) -> None:
    (values,) = parse(saved['klann']['parameters']).values()
    given = values['ros__parameters']
    # rcl takes no whole number for a double.
    assert all(type(value) is float for name, value in given.items() if name != 'assembly')
    factor, sem = 1.0078125, KlannGeometry.sem104()
    geometry = KlannGeometry(**given)
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
    for found, geometry in zip(
        read_in_node(texts, is_yaml=False),
        (KlannGeometry.sem104(), KlannGeometry.patent()),
        strict=True,
    ):
        structure = shipped_linkage('klann').structure
        numbers = dict(zip([d.name for d in structure.dimensions], found['content'], strict=True))
        assert numbers['A-B'] == geometry.l_ab
        assert numbers['bend of G-H'] == -geometry.angle_fgh
        assert numbers['D.x'] == geometry.x_d


def test_yaml_means_the_same_to_both() -> None:
    texts = [*TEXTS.values(), *FILES['read alike']]
    for text, found in zip(texts, read_in_node(texts, is_yaml=True), strict=True):
        assert found.get('content', found) == parse(text)


def test_refused_files_have_a_reason_in_one_line() -> None:
    texts = [*FILES['refused'], *BOMBS]
    found = read_in_node(texts, is_yaml=True)
    assert [text[:40] for text, one in zip(texts, found, strict=True) if 'content' in one] == []


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
            at = int(rng.integers(len(text) + 1))
            after = at + int(rng.integers(4))
            text = text[:at] + str(rng.choice(MARKS)) + text[after:]
        texts.append(text)
    return texts


def test_damaged_files_mean_no_more_than_to_python() -> None:
    texts = damaged(200)
    taken = 0
    for text, found in zip(texts, read_in_node(texts, is_yaml=True), strict=True):
        if 'content' in found:
            assert found['content'] == parse(text), text
            taken += 1
    assert 20 < taken < 180


def test_no_linkage_is_refused_in_a_line_as_python_does() -> None:
    broken = [TEXTS['klann'].replace(*change, 1) for change in FILES['broken']]
    assert TEXTS['klann'] not in broken
    texts = [*broken, *FILES['no linkages']]
    found = read_in_node(texts, is_yaml=False)
    assert [one.get('content') for one in found] == [None] * len(texts)
    for text in texts:
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
    text = '\n'.join(
        ['name: x', 'pivots: {A: [0, 0], B: [1, 0]}', 'crank: b0', 'foot: P0', 'bodies:', *bodies]
    )
    (found,) = read_in_node([f'{text}\nstart: {{{start}}}\n'], is_yaml=False)
    assert 'refused' in found
