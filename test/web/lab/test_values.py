"""Every number of the lab's values and tables is that of `table` in Python, over whole turns."""

import csv
from io import StringIO
from typing import Any

from change_point_linkages import change_point_file
from klann_ros.kinematics import (
    FourBar,
    KlannLeg,
    linkage_from_text,
    LinkageLeg,
)
from lab_solver import in_node, NODE, TEXTS
import numpy as np
import pytest

if NODE is None:
    pytest.skip('no node: apt-get install nodejs', allow_module_level=True)

RATE = -2.5
PERIODIC = ('two_turns', 'kite_on_crank', 'coupled_parallelogram')
ALL_TEXTS = TEXTS | {
    name: change_point_file(name).read_text(encoding='utf-8') for name in PERIODIC
}
NEAR = 1e-12
SCRIPT = """
function answer({ texts, rate, step }) {
  const answers = {};
  for (const [name, text] of Object.entries(texts)) {
    const { linkage: read } = readFile(text, texts.klann);
    // As the page has it.
    const linkage = name === 'klann' ? new Linkage(read.structure, read.numbers, {
      ...read.kept, signs: read.signs, outside: [2],
    }) : read;
    const quantities = quantitiesOf(linkage);
    const rows = turnRows(linkage, quantities, step, rate);
    const written = [false, true].map((hasComma) => csvOf(quantities, rows, hasComma));
    answers[name] = { keys: quantities.map(({ key }) => key), texts: written };
  }
  return answers;
}
"""


@pytest.fixture(scope='module')
def turns() -> Any:
    return in_node(SCRIPT, {'texts': ALL_TEXTS, 'rate': RATE, 'step': 1})


def numbers_of(text: str, delimiter: str) -> tuple[list[str], np.ndarray]:
    head, *rows = csv.reader(StringIO(text), delimiter=delimiter)
    numbers = [[float(cell.replace(',', '.') or 'nan') for cell in row] for row in rows]
    return head, np.array(numbers)


@pytest.mark.parametrize('name', ALL_TEXTS)
def test_a_turn_in_the_lab_is_the_table_of_python(turns: Any, name: str) -> None:
    linkage = linkage_from_text(ALL_TEXTS[name], name)
    leg: Any = KlannLeg() if name == 'klann' else LinkageLeg(linkage)
    period = linkage.change_points.period
    alphas = np.radians(np.arange(0.0, 360.0 * period + 1.0))
    head, ours = numbers_of(leg.table(alphas, RATE).csv(), ',')
    answer = turns[name]
    lab_head, lab = numbers_of(answer['texts'][0], ',')
    if name == 'klann':
        # A KlannLeg has its points in the order of the alphabet.
        ours = ours[:, [head.index(column) for column in lab_head]]
        assert {*head} == {*lab_head}
        head = lab_head
    assert lab_head == head
    assert answer['keys'] == [column.partition(' [')[0] for column in head]
    np.testing.assert_array_equal(np.isnan(lab), np.isnan(ours))
    np.testing.assert_array_equal(numbers_of(answer['texts'][1], ';')[1], lab)
    closed = ~np.isnan(ours[:, 1])
    assert closed.sum() >= 80 * period
    is_advantage = np.array(['advantage' in column for column in head])
    # The inverse of an advantage is a rate, which is 0 where that is infinite.
    for numbers in (ours, lab):
        numbers[:, is_advantage] = 1.0 / numbers[:, is_advantage]
    orders = [2 if 'acceleration' in column else 'rate' in column for column in head]
    orders = np.where(is_advantage, 1, orders)
    units = np.array([column.partition(' [')[2] for column in head])
    is_transmission = np.array([column.startswith('mu_') for column in head])
    is_angle = units == 'deg]'
    lengths = [1000.0 * linkage.size if 'mm' in unit else 1.0 for unit in units]
    sizes = np.nan_to_num(np.abs(ours))
    for unit in {*units.tolist()}:
        # What is small by cancellation is compared with the largest of its unit.
        sizes[:, units == unit] = sizes[:, units == unit].max(axis=1, keepdims=True)
    sizes += np.array(lengths) * abs(RATE) ** orders
    sines = np.abs(np.sin(np.radians(ours[:, is_transmission]))).min(axis=1)
    # Near a singular pose rounding grows as its derivatives do, and with an interpolation.
    near = NEAR / np.clip(5.0 * sines, 1e-9, 1.0)[:, None] ** (1.0 + 1.5 * orders)
    for index, alpha in enumerate(alphas.tolist()):
        if linkage.interpolated(alpha) is not None:
            near[index] = NEAR * 500.0**orders
    difference = lab - ours
    difference -= np.where(is_angle, 360.0 * np.round(difference / 360.0), 0.0)
    errors = np.nan_to_num(np.abs(difference) / sizes / near)
    row, column = np.unravel_index(int(errors.argmax()), errors.shape)
    assert errors.max() <= 1.0, (np.degrees(alphas[row]), sines[row], head[column])


def test_the_rockers_advantage_is_that_of_the_course(turns: Any) -> None:
    head, numbers = numbers_of(turns['four_bar']['texts'][0], ',')
    bar = FourBar(180, 80, 200, 150)
    angles = np.radians(numbers[:, 0])
    expected = [bar.mechanical_advantage(angle) for angle in angles]
    ours = numbers[:, head.index('theta4_advantage [1]')]
    assert 1.0 / ours == pytest.approx(1.0 / np.array(expected), rel=1e-12, abs=1e-14)
