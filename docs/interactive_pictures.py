"""
Make the images that stand for interactive figures: python docs/interactive_pictures.py [NAME ...].

They hold no words, so that the pages of both languages share them. It needs playwright and a
Chromium.
"""

from collections.abc import Iterable
from pathlib import Path
import shutil
import sys
from tempfile import TemporaryDirectory

from playwright.sync_api import sync_playwright
from static_site import figures_script, figures_style

FOLDER = Path(__file__).resolve().parent
CHROMIUMS = ('chromium-headless-shell', 'chromium', 'google-chrome')
# Those that no other script makes.
NAMES = (
    'warm_start',
    'many_poses',
    'example_walker',
    'example_four_bar',
    'example_change_point',
    'example_newton',
    'example_quick_return',
)
HEAD = '<!doctype html><html lang="en"><meta charset="utf-8">'
BARE = '.interactive-title, .interactive-grip { display: none } body { margin: 0; width: 680px }'


def save_pictures(names: Iterable[str], folder: Path) -> None:
    """Save the stage of each figure, as it is before the reader moves it."""
    with TemporaryDirectory() as work, sync_playwright() as playwright:
        path = next(filter(None, map(shutil.which, CHROMIUMS)), None)
        browser = playwright.chromium.launch(executable_path=path, args=['--no-sandbox'])
        page = browser.new_page(viewport={'width': 720, 'height': 900}, device_scale_factor=1.5)
        Path(work, 'figures.js').write_text(figures_script(), encoding='utf-8')
        for name in names:
            image = f'<img src="_images/{name}.png" alt="{name}" width="9" height="9">'
            content = f'<style>{figures_style()}{BARE}</style>{image}<script src="figures.js">'
            Path(work, 'page.html').write_text(f'{HEAD}{content}</script>', encoding='utf-8')
            page.goto(Path(work, 'page.html').as_uri())
            page.locator('.interactive-stage').screenshot(path=folder / f'{name}.png')
        browser.close()


if __name__ == '__main__':
    save_pictures(sys.argv[1:] or NAMES, FOLDER)
