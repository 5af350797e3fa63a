"""The live page of a real view_node in a browser."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
from playwright.sync_api import TimeoutError as ActionTimeoutError
from ros_domain import Domain, Process

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
# The buttons of the drives, and how long an action waits for an element [ms].
BUTTONS = {'crank': '#take', 'walk': '#walk-take'}
MAX_WAIT = 2000.0


class Live:
    """A domain with a live page in a browser, and the browser's errors."""

    def __init__(self, ros: Domain, url: str, browser: Any) -> None:
        self.ros, self.url = ros, url
        self.errors: list[str] = []
        self.page = browser.new_page(viewport={'width': 1280, 'height': 900})
        self.page.on('console', lambda message: self.errors.append(message.text))
        self.page.on('pageerror', lambda error: self.errors.append(str(error)))
        self.page.goto(url)

    def until(self, expression: str) -> None:
        """Wait until an expression is true on the page, while ROS spins."""
        self.ros.probe.until(lambda: self.page.evaluate(expression))

    def text(self, selector: str) -> str:
        return str(self.page.locator(selector).text_content())

    def drawn(self) -> tuple[list[float], np.ndarray]:
        """Return the drawn pose, and its points [m]."""
        found = self.page.eval_on_selector('#picture', DRAWN)
        return found['x'], np.array(found['points'])

    def press(self, selector: str) -> None:
        self.page.locator(selector).click()

    def has(self, drive: str = 'crank') -> bool:
        """Return whether the page drives."""
        return bool(self.page.evaluate(f'live.{drive}.isMine'))

    def take(self, drive: str = 'crank', *, back: bool = False) -> None:
        """Take over, or back, by the button."""
        # In one step: a report in between would turn the button into its opposite.
        is_due = f'live.{drive}.isOwner === {str(back).lower()}'
        click = f"{is_due} && document.querySelector('{BUTTONS[drive]}').click()"

        def is_done() -> bool:
            self.page.evaluate(click)
            return self.has(drive) != back

        self.ros.probe.until(is_done)

    def drive(
        self,
        act: Callable[[], object],
        condition: Callable[[], object],
        drive: str = 'crank',
    ) -> None:
        """
        Take over, act, and wait until a condition is true while the page drives.

        A busy machine may hold up a page until the watchdog ends its drive: then again.
        """
        has_acted = False

        def is_done() -> bool:
            nonlocal has_acted
            if not has_acted or not self.has(drive):
                self.take(drive)
                # Its elements are disabled if the drive has just been lost.
                with suppress(ActionTimeoutError):
                    act()
                    has_acted = True
            return bool(condition()) and self.has(drive)

        self.ros.probe.until(is_done)


def address(process: Process) -> str:
    """Return the address that a view_node has printed."""
    assert process.popen.stdout is not None
    return str(process.popen.stdout.readline()).strip()
