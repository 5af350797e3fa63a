"""HTML elements whose texts are escaped by how they are made: a log may hold any text."""

from collections.abc import Iterable, Sequence
from html import escape
from math import isnan
import re

from klann_ros.sanitize.text import decimal, printable

# Longer texts are cut.
_MAX_TEXT = 20_000
# Stands for an unknown number.
_UNKNOWN = '\N{EN DASH}'
# Elements without content, and without an end.
_VOID = frozenset({'input', 'link', 'meta', 'br', 'img'})


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def number(value: float | None, form: str) -> str:
    """Return a number in a format; a dash for an unknown one, None or NaN."""
    return _UNKNOWN if value is None or isnan(value) else decimal(value, form)


def element(name: str, *content: str, **attributes: str | float | bool) -> Markup:
    """
    Return an element, such as 'p'; content is escaped as text unless it is Markup.

    In names of attributes an underscore stands for a hyphen and ends a name that Python keeps for
    itself; False leaves the attribute out.
    """
    attributes_text = ''.join(_attribute(key, value) for key, value in attributes.items())
    if name in _VOID:
        return Markup(f'<{name}{attributes_text}>')
    return Markup(f'<{name}{attributes_text}>{joined(content)}</{name}>')


def joined(content: Iterable[str]) -> Markup:
    """Return markup and texts, one after the other, as markup."""
    return Markup(''.join(map(_escaped, content)))


def _escaped(text: str) -> str:
    # Marks that turn a line's direction would do that to what stands beside it.
    return text if isinstance(text, Markup) else escape(printable(text, _MAX_TEXT))


def _attribute(key: str, value: str | float | bool) -> str:
    if value is False:
        return ''
    name = key.rstrip('_').replace('_', '-')
    return f' {name}' if value is True else f' {name}="{escape(printable(value, _MAX_TEXT))}"'


def scrolling_table(
    name: str, heads: Sequence[str], rows: Iterable[Sequence[str]], kind: str = ''
) -> Markup:
    """
    Return a table, which scrolls where it is too wide; each row begins with its heading.

    One of the kind 'stacks' or 'sortable' has a card for each row on a phone, in which each cell
    stands behind the heading of its column; sortable.js sorts the latter by any column.
    """
    head_cells = []
    for text in heads:
        heading = element('button', text, type='button') if kind == 'sortable' else text
        head_cells.append(element('th', heading, scope='col'))
    head = element('thead', element('tr', *head_cells))
    cards = (_headed_row(heads, row) if kind else table_row(*row) for row in rows)
    table = element('table', head, element('tbody', *cards), class_=kind or False)
    # What scrolls must be reached by keys.
    return element('div', table, class_='scrolls', tabindex='0', role='region', aria_label=name)


def _headed_row(heads: Sequence[str], texts: Sequence[str]) -> Markup:
    """Return a row whose cells know the heads of their columns."""
    row = [element('th', texts[0], scope='row')]
    for head, cell in zip(heads[1:], texts[1:], strict=True):
        class_ = 'unknown' if cell == _UNKNOWN else False
        row.append(element('td', cell, data_head=head, class_=class_))
    return element('tr', *row)


def breakable(name: str) -> Markup:
    """Return a path or a name as markup that may break after its separators, not in a word."""
    pieces = re.split(r'(?<=[/_.\-])(?=[^/_.\-])', name)
    return Markup('<wbr>'.join(map(_escaped, pieces)))


def table_row(heading: str, *cells: str) -> Markup:
    """Return a row of a table that begins with its heading."""
    row = [element('td', cell) for cell in cells]
    return element('tr', element('th', heading, scope='row'), *row)
