"""What the lab saves solver_node loads, files mean the same to both, and bombs do nothing."""

from typing import Any

from klann_ros.kinematics import KlannGeometry, shipped_linkage, shipped_linkages
from klann_ros.kinematics.linkage.file import linkage_from_text
from klann_ros.sanitize.yaml_text import parse
from lab_solver import in_node, NODE, TEXTS
import numpy as np
import pytest

if NODE is None:
    pytest.skip('no node: apt-get install nodejs', allow_module_level=True)

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
    import pathlib

    folder = pathlib.Path(__file__).resolve().parents[3] / 'config'
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


# To Python, too, these mean what they look like, or nothing.
YAML = [
    *TEXTS.values(),
    "a: 1\nb: [1, -2.5, 1e3, .5, +3, 1.]\nc: {d: \"x\\n\\u00e9\", e: 'it''s'}\n",
    '- a\n- {b: 1}\n-\n  c: 2\n- d: 1\n  e: 2\n- - 1\n  - 2\n',
    'a:\n- 1\n- 2\nb: # said\n  c: x # not this\n  d: a#b\n',
    '---\na: yes\nb: no\nc: ~\nd: null\ne: on\nf: "on"\n',
    'a: [1,\n  2, # two\n  3]\nb: {x: 1,\n y: 2}\n',
    'url: http://a.test/x\ntime: 1:30\nversion: 1.2.3\n',
    '"a b": 1\n\'c\': 2\n',
    '',
    '# nothing\n',
    'a: 08\nb: 1e5\nc: 1.5e+3\nd: -.5\n',
    '__proto__: {polluted: 1}\nconstructor: {prototype: {polluted: 1}}\nb: {__proto__: 1}\n',
    'a: "\\U0001F600"\n? b\n: [c: 1, d]\n',
]
REFUSED = [
    'a: &x 1\nb: *x\n',
    'a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n',
    'a: 1\na: 2\n',
    'a: |\n  text\n',
    'a: >\n  text\n',
    'a: !!python/object:os.system x\n',
    'a: .inf\n',
    'a: .nan\n',
    'a: 1e999\n',
    'a: 1_000\n',
    'a: 0x10\n',
    'a: 017\n',
    'a: 2020-01-01\n',
    '<<: {a: 1}\n',
    '%YAML 1.1\n---\na: 1\n',
    'a: 1\n---\nb: 2\n',
    '\ta: 1\n',
    'a: "x\n  y"\n',
    'a: b: c\n',
    'a: [1, 2\n',
    'a: {b: 1\n',
    'a: 1\n  b: 2\n',
    '1: 2\n',
    'null: 2\n',
    '? [a]\n: b\n',
    '? {a: 1}\n: b\n',
    '__proto__: 1\n__proto__: 2\n',
    'a: !!str 1\n',
    'a: ! 1\n',
    'a: !x\n  |\n  y\n',
    'a: [b?]\n',
    'a: [:b]\n',
    'a: {b\n}c: 1\n',
    'a: "\\ud83d\\ude00"\n',
    'a: "\\U00110000"\n',
    'a: 1\n...\n',
    '[' * 21 + ']' * 21,
    f'{"x" * 2000}: 1\n',
    'a: "\\q"\n',
    'a: \x00\n',
    'a: \x1b[31m\n',
    '[' * 100_000,
    '{a: ' * 5000,
    '- ' * 10_000,
    'a: ' + 'x' * 2_000_000,
    'x' * 10_000_000,
]


def test_yaml_means_the_same_to_both() -> None:
    for text, found in zip(YAML, read_in_node(YAML, is_yaml=True), strict=True):
        assert found.get('content', found) == parse(text)


def test_refused_files_have_a_reason_in_one_line() -> None:
    found = read_in_node(REFUSED, is_yaml=True)
    assert [text[:40] for text, one in zip(REFUSED, found, strict=True) if 'content' in one] == []


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


def broken(place: str, new: str) -> str:
    text = TEXTS['klann']
    assert place in text
    return text.replace(place, new, 1)


NO_LINKAGES = [
    broken('length: 120', 'length: 0'),
    broken('length: 120', 'length: -1'),
    broken('length: 120', 'length: 1e300'),
    broken('length: 120', 'length: 1e-300'),
    broken('length: 120', 'length: x'),
    broken('length: 120', 'length: true'),
    broken('length: 120', 'length: 120, colour: red'),
    broken('[0, 90]', '[0, 90, 1]'),
    broken('[0, 90]', '[.nan, 90]'),
    broken('crank: alpha', 'crank: alfa'),
    broken('foot: H', 'foot: A'),
    broken('foot: H', 'foot: "<img src=x onerror=alert(1)>"'),
    broken('from: D, to: C', 'from: D, to: Q'),
    broken('bend: 10', 'bend: 1000'),
    broken('gamma: 15', 'gama: 15'),
    broken('alpha: 60, ', ''),
    broken('start:', 'assembly: [1, 1, 1]\nstart:'),
    broken('start:', 'assembly: [-1, 1]\nstart:'),
    broken('units: {length: mm, angle: deg}', 'units: {length: mm}'),
    broken('name: Klann leg', 'name: "a\\nb"'),
    broken('name: Klann leg', 'name: ""'),
    '[]',
    '{}',
    'null',
    '/**: {ros__parameters: {l_ab: -1.0}}',
    '/**: {ros__parameters: {l_ab: 5.0}}',
    '/**: {ros__parameters: {assembly: [1, 2]}}',
    'a: {ros__parameters: {}}\nb: {ros__parameters: {}}',
    '/**: {ros__parameters: {left: {l_ab: 0.1}}}',
]


def test_no_linkage_is_refused_in_a_line_as_python_does() -> None:
    found = read_in_node(NO_LINKAGES, is_yaml=False)
    assert [one.get('content') for one in found] == [None] * len(NO_LINKAGES)
    for text in NO_LINKAGES:
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
