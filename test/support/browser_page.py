"""A page in the browser, with its requests, its errors, and the points that it draws."""

from typing import Any

import numpy as np
import pytest

# All rules of axe but the contrast of AAA, those that it is still trying out included.
_TAGS = 'wcag2a wcag2aa wcag21a wcag21aa wcag22aa best-practice experimental'
ALL_RULES = {'runOnly': {'type': 'tag', 'values': _TAGS.split()}}
# Of a picture: its points' names, where they are in it, and how it is scaled.
PLACES = """(svg, group) => [...svg.querySelectorAll(`.${group} [data-point]`)].map((node) => {
    const at = (name) => Number(node.getAttribute(name));
    const middle = node.tagName === 'circle'
        ? [at('cx'), at('cy')]
        : [at('x') + at('width') / 2, at('y') + at('height') / 2];
    const plane = ['left', 'top', 'scale'].map((name) => Number(svg.dataset[name]));
    return [node.dataset.point, middle, ...plane];
})"""


class OpenedPage:
    """A page of a browser."""

    def __init__(self, page: Any, url: str) -> None:
        self.page = page
        self.requests: list[str] = []
        self.complaints: list[str] = []
        page.on('request', lambda request: self.requests.append(request.url))
        page.on('console', lambda entry: self.complaints.append(entry.text))
        page.on('pageerror', lambda error: self.complaints.append(str(error)))
        page.goto(url)

    def until(self, expression: str) -> None:
        """Wait for something; playwright's own waiting needs what the policy forbids."""
        for _ in range(2000):
            if self.page.evaluate(expression):
                return
            self.page.wait_for_timeout(10)
        raise AssertionError(expression)

    def is_too_wide(self) -> bool:
        """Return whether the page scrolls sideways."""
        root = 'document.documentElement'
        return bool(self.page.evaluate(f'{root}.scrollWidth > {root}.clientWidth'))

    def barriers(
        self, options: Any = ALL_RULES, excluded: str = ''
    ) -> list[tuple[str, list[str]]]:
        """Return the rules of accessibility that axe finds broken, and by which elements."""
        axe = pytest.importorskip('axe_playwright_python.sync_playwright')
        context = {'exclude': [excluded]} if excluded else None
        report = axe.Axe().run(self.page, context, options).response
        assert report['passes']
        broken = report['violations']
        return [
            (rule['id'], [node['html'][:120] for node in rule['nodes'][:3]]) for rule in broken
        ]

    def points(self, within: str = '#picture', group: str = 'leg') -> dict[str, np.ndarray]:
        """Return where the points are drawn, in metres of the leg's plane."""
        points = {}
        for name, (x, y), left, top, scale in self.page.eval_on_selector(within, PLACES, group):
            points[name] = np.array([left + x / scale, top - y / scale])
        return points
