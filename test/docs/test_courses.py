"""Every number that the courses print comes out of a public call, as `docs/courses.md` says."""

from collections.abc import Iterator
from pathlib import Path
import re
from typing import Any

import numpy as np
import pytest

PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'courses.md'
TEXT = PAGE.read_text(encoding='utf-8')
NUMBER = re.compile(r'-?\d+(?:\.(\d+))?')


def names() -> dict[str, Any]:
    """Return what the page's example defines."""
    (source,) = re.findall(r'^```python\n(.*?)^```', TEXT, re.DOTALL | re.MULTILINE)
    found: dict[str, Any] = {}
    exec(source, found)  # noqa: S102 - our own page
    return found


def rows(columns: int) -> Iterator[list[str]]:
    """Yield the cells of the tables of so many columns; calls may hold what parts cells."""
    for line in TEXT.splitlines():
        if line.startswith('|') and '`' in line:
            before, call, after = line.split('`', 2)
            cells = [before.strip('| '), call, after.strip().removeprefix('|').strip('| ')]
            if (before.count('|'), after.count('|') >= 2) == (2, columns == 3):
                yield cells


PRINTED, OTHERS = [*rows(3)], [*rows(2)]
NAMES = names()


def test_the_page_has_both_courses() -> None:
    assert len(PRINTED) == 11 + 34
    assert sum(len(NUMBER.findall(printed)) for printed, *_ in PRINTED) == 41 + 75
    assert len(OTHERS) == 7 + 14


@pytest.mark.parametrize(('printed', 'call', 'note'), PRINTED, ids=[row[1] for row in PRINTED])
def test_every_printed_digit_comes_out(printed: str, call: str, note: str) -> None:
    values = np.ravel(eval(call, NAMES)).tolist()  # noqa: S307 - our own page
    texts = printed.split()
    assert len(values) == len(texts)
    within = re.match(r'within (\S+):', note)
    for value, text in zip(values, texts, strict=True):
        if within:
            assert abs(value - float(text)) <= float(within[1])
        else:
            places = len(NUMBER.fullmatch(text)[1] or '')
            assert f'{value:.{places}f}' == text


@pytest.mark.parametrize('call', [row[1] for row in OTHERS])
def test_every_other_call_answers(call: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = eval(call, NAMES)  # noqa: S307 - our own page
    assert answer is not None or capsys.readouterr().out.count(' ') > 3


def test_the_exact_iterates_are_those_of_the_page() -> None:
    (text,) = re.findall(r'exact iterates are (.*?) deg\.', TEXT, re.DOTALL)
    said = [float(number) for number in re.findall(r'\d+\.\d+', text)]
    iterates = np.degrees(NAMES['bar'].newton(NAMES['theta2'], NAMES['x_1']))
    assert iterates[1:4].round(5).ravel().tolist() == said
