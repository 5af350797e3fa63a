"""
Make the README's picture of a review: python docs/review_picture.py RUN [FILE].

It needs a run, such as one of scripts/demo, playwright, and Debian's chromium.
"""

from pathlib import Path
import shutil
import sys
import tempfile

from klann_ros.review.page import save
from klann_ros.review.reviewing import review_run
from playwright.sync_api import sync_playwright

FILE = Path(__file__).resolve().parent / 'review.png'
SIZE = {'width': 1280, 'height': 1360}
# In the stroke that lifts the foot [part of the run].
MOMENT = 0.285


def save_picture(run: str, file: Path) -> None:
    """Save what one sees first when the page of a run is opened."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = Path(folder, 'review.html')
        with path.open('wb') as written:
            save([review_run(run, rates='f4')], None, written)
        browser = playwright.chromium.launch(
            executable_path=shutil.which('chromium'), args=['--no-sandbox']
        )
        opened = browser.new_page(viewport=SIZE)
        opened.goto(path.as_uri())
        opened.evaluate(f'page.player.go(page.duration * {MOMENT})')
        opened.screenshot(path=file)
        browser.close()


if __name__ == '__main__':
    save_picture(sys.argv[1], Path(sys.argv[2]) if len(sys.argv) > 2 else FILE)
