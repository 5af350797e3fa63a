"""What ament_flake8 refuses, and neither ruff nor its formatter does."""

import builtins
from pathlib import Path
import re

from checks import FILES
import pytest

ROOT = Path(__file__).resolve().parents[2]
BUILTINS = '|'.join(name for name in dir(builtins) if name.islower() and name[0] != '_')
# Of lines: a syntax tree of all files takes ten times as long.
REFUSED = re.compile(
    r'^\ *(?:'
    # E203: the formatter's own a[i : i + 2]; in text it is none.
    r'(?:[^\#\n\'"]|\'[^\'\n]*\'|"[^"\n]*")*\[[^]\n\'"]*[^\s,[]\ :(?!=)'
    # E266
    r'|\#\#'
    # A003: ruff refuses it only where the class itself uses the name.
    rf'|(?<=\ )(?:def\ (?:{BUILTINS})\(|(?:{BUILTINS})(?::\ |\ =\ ))(?!.*noqa:\ A003)'
    # CNL100
    r'|class\ .*:\n\ +(?:@|def\ )'
    r')',
    re.MULTILINE | re.VERBOSE,
)


@pytest.mark.slow
def test_ament_flake8_refuses_nothing_that_ruff_accepts() -> None:
    files = {path for name in FILES for path in (ROOT / name).rglob('*.py')}
    files -= {Path(__file__).resolve()}
    texts = {path.relative_to(ROOT): path.read_text('utf-8') for path in files}
    assert len(texts) > 500
    found = {path: REFUSED.search(text) for path, text in texts.items()}
    assert {path: match[0] for path, match in found.items() if match} == {}


@pytest.mark.parametrize(
    'text',
    [
        'a[i : i + 2]',
        "    a['b'] = b[len(c) :]",
        '## Title',
        'class A:\n    def max(self):',
        'class A:\n    """A."""\n\n    id: int',
        'class A:\n    """A."""\n\n    type = 1',
        'class A:\n    def run(self):',
        'class A:\n    @property',
    ],
)
def test_it_is_found(text: str) -> None:
    assert REFUSED.search(text)


@pytest.mark.parametrize(
    'text',
    [
        'a[i:end]',
        '# a[i : i + 2]',
        "a = 'b[i : i + 2]'",
        '[a for a in b if (c := a)]',
        'class A:\n    """A."""\n\n    maximum: int',
        'f(\n    type=1,\n)',
        'class A:\n    """A."""\n\n    def run(self):',
    ],
)
def test_what_ament_flake8_accepts_is_not_found(text: str) -> None:
    assert not REFUSED.search(text)
