"""Tables of the page; those that are too wide for it scroll by themselves."""

from collections.abc import Iterable, Sequence

from .markup import element, Markup


def scrolling_table(name: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> Markup:
    """Return a table; each row begins with what it is of."""
    head = element('tr', *(element('th', text, scope='col') for text in heads))
    table = element('table', element('thead', head), element('tbody', *map(_row, rows)))
    # What scrolls must be reached by keys.
    return element('div', table, class_='scrolls', tabindex='0', role='region', aria_label=name)


def _row(texts: Sequence[str]) -> Markup:
    first, *others = texts
    cells = (element('td', text) for text in others)
    return element('tr', element('th', first, scope='row'), *cells)
