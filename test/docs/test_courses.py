"""Every number that the courses print comes out of a public call, in both languages."""

from collections.abc import Iterator
from pathlib import Path
import re
from typing import Any

import numpy as np
import pytest

DOCS = Path(__file__).resolve().parents[2] / 'docs'
# The tables of the pages, which translations.py writes.
TEXTS = [
    Path(__file__).with_name(name).read_text(encoding='utf-8')
    for name in ('courses.md', 'cursos.md')
]
TEXT = TEXTS[0]
NUMBER = re.compile(r'-?\d+(?:\.(\d+))?')


# What the page's example defines.
NAMES: dict[str, Any] = {}
PAGE = (DOCS / 'courses.md').read_text(encoding='utf-8')
exec(*re.findall(r'(?ms)^```python\n(.*?)^```', PAGE), NAMES)  # noqa: S102 - our own page


def table_cells(columns: int, text: str = TEXT) -> Iterator[list[str]]:
    """Yield the cells of the tables with two or three columns; calls may hold what parts cells."""
    for line in text.splitlines():
        if line.startswith('|') and '`' in line:
            before, call, after = line.split('`', 2)
            if before.count('|') == 2 and (after.count('|') >= 2) == (columns == 3):
                yield [before.strip('| '), call, after.strip().removeprefix('|').strip('| ')]


PRINTED = [*table_cells(3)]
OTHERS = [*table_cells(2)]


def test_the_page_has_both_courses() -> None:
    assert len(PRINTED) == 11 + 34
    assert sum(len(NUMBER.findall(printed)) for printed, *_ in PRINTED) == 41 + 75
    assert len(OTHERS) == 7 + 15


@pytest.mark.parametrize(
    ('printed', 'call', 'note'), PRINTED, ids=[call for _, call, _ in PRINTED]
)
def test_every_printed_digit_comes_out(printed: str, call: str, note: str) -> None:
    answers = np.ravel(eval(call, NAMES)).tolist()  # noqa: S307 - our own page
    tolerance = re.match(r'within (\S+):', note)
    for answer, text in zip(answers, printed.split(), strict=True):
        if tolerance:
            assert abs(answer - float(text)) <= float(tolerance[1])
        else:
            decimals = len(NUMBER.fullmatch(text)[1] or '')
            assert f'{answer:.{decimals}f}' == text


def test_both_languages_print_the_same_digits() -> None:
    portuguese = [(digits.replace(',', '.'), call) for digits, call, _ in table_cells(3, TEXTS[1])]
    assert portuguese == [(digits, call) for digits, call, _ in PRINTED]
    assert all('.' not in digits for digits, *_ in table_cells(3, TEXTS[1]))


@pytest.mark.parametrize('call', [call for _, call, _ in OTHERS])
def test_every_other_call_answers(call: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = eval(call, NAMES)  # noqa: S307 - our own page
    assert answer is not None or capsys.readouterr().out.count(' ') > 3


def test_the_exact_iterates_are_those_of_the_page() -> None:
    (text,) = re.findall(r'exact iterates are (.*?) deg\.', TEXT, re.DOTALL)
    iterates = np.degrees(NAMES['bar'].newton(NAMES['theta2'], NAMES['x_1']))
    assert iterates[1:4].round(5).ravel().tolist() == [*map(float, re.findall(r'\d+\.\d+', text))]
