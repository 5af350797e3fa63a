"""The live page of a real view_node in a browser."""

from typing import Any

import numpy as np
from ros_world import Process, World

# Where the points of a picture are, in metres of its plane, with what it was drawn from.
DRAWN = """(svg) => ({
    x: svg.dataset.x.split(' ').map(Number),
    points: [...svg.querySelectorAll('[data-point]')].map((node) => {
        const at = (name) => Number(node.getAttribute(name));
        const [x, y] = node.tagName === 'circle' ? [at('cx'), at('cy')]
            : [at('x') + at('width') / 2, at('y') + at('height') / 2];
        const { left, top, scale } = svg.dataset;
        return [Number(left) + x / scale, Number(top) - y / scale];
    }),
})"""


class Live:
    """A domain with a live page in a browser, and what that complained of."""

    def __init__(self, ros: World, url: str, browser: Any) -> None:
        self.ros, self.url = ros, url
        self.complaints: list[str] = []
        self.page = browser.new_page(viewport={'width': 1280, 'height': 900})
        self.page.on('console', lambda said: self.complaints.append(said.text))
        self.page.on('pageerror', lambda error: self.complaints.append(str(error)))
        self.page.goto(url)

    def until(self, expression: str) -> None:
        """Wait until something is so on the page; ROS goes on meanwhile."""
        self.ros.probe.until(lambda: self.page.evaluate(expression))

    def text(self, selector: str) -> str:
        return str(self.page.locator(selector).text_content())

    def drawn(self) -> tuple[list[float], np.ndarray]:
        """Return the pose that is drawn, and where its points are [m]."""
        found = self.page.eval_on_selector('#picture', DRAWN)
        return found['x'], np.array(found['points'])

    def press(self, selector: str) -> None:
        self.page.locator(selector).click()


def address(process: Process) -> str:
    """Return what a view_node has printed."""
    assert process.popen.stdout is not None
    return str(process.popen.stdout.readline()).strip()
