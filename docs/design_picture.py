"""
Make the manual's picture of a search: python docs/design_picture.py [FILE].

It needs the extra `design`, playwright, and Debian's chromium; it searches for half a minute.
"""

from pathlib import Path
import shutil
import sys
import tempfile

from klann_ros.design import requirements_from_file, search
from klann_ros.design.page import page
from klann_ros.design.report import leg_name
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / 'docs' / 'design.png'
REQUIREMENTS = ROOT / 'examples' / 'requirements' / 'toy.yaml'
SIZE = {'width': 1280, 'height': 800}


def save_picture(file: Path) -> None:
    """Save what one sees of the legs for a toy, the aims and the list."""
    result = search(requirements_from_file(REQUIREMENTS), evaluations=6000)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = Path(folder, 'index.html')
        names = [leg_name(number) for number in range(len(result.legs))]
        path.write_text(page(result, names), encoding='utf-8')
        browser = playwright.chromium.launch(
            executable_path=shutil.which('chromium') or shutil.which('chromium-headless-shell'),
            args=['--no-sandbox'],
        )
        opened = browser.new_page(viewport=SIZE, reduced_motion='reduce')
        opened.goto(path.as_uri())
        opened.screenshot(path=file)
        browser.close()


if __name__ == '__main__':
    save_picture(Path(sys.argv[1]) if len(sys.argv) > 1 else FILE)
