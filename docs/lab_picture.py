"""
Make the README's picture of the lab: python docs/lab_picture.py [LAB_FILE].

It needs playwright and Debian's chromium.
"""

from pathlib import Path
import shutil
import sys

from klann_ros.web.lab.build import LAB_FILE
from playwright.sync_api import sync_playwright

PICTURE = Path(__file__).resolve().parent / 'lab.png'
SIZE = {'width': 1280, 'height': 1500}
# The lecture's guess, which leads to the assembly that is drawn, at another crank angle.
STATE = 'lab.turnTo((100 * TAU) / 360); newton.run(); newton.draw(1)'


def save_picture(file: Path) -> None:
    """Save what one sees of the lab, with an iterate of Newton-Raphson drawn."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which('chromium'), args=['--no-sandbox']
        )
        opened = browser.new_page(viewport=SIZE, locale='en-US')
        opened.goto(LAB_FILE.as_uri())
        opened.evaluate(STATE)
        opened.wait_for_timeout(500)
        opened.screenshot(path=file)
        browser.close()


if __name__ == '__main__':
    save_picture(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE)
