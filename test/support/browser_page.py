"""A page in the browser, with its requests, its errors, and the points that it draws."""

from typing import Any

import numpy as np

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

    def points(self, within: str = '#picture', group: str = 'leg') -> dict[str, np.ndarray]:
        """Return where the points are drawn, in metres of the leg's plane."""
        found = self.page.eval_on_selector(within, PLACES, group)
        return {
            name: np.array([left + x / scale, top - y / scale])
            for name, (x, y), left, top, scale in found
        }
