"""
Make the manual's picture of a data sheet: python docs/describe_picture.py [FILE].

It needs playwright, and Debian's chromium.
"""

from pathlib import Path
import shutil
import sys
import tempfile

from klann_ros.datasheet import data_sheet, motor_from_file
from klann_ros.datasheet.page import page
from klann_ros.robot import Robot, robot_from_file
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / 'docs' / 'describe.png'
SIZE = {'width': 1280, 'height': 1196}
LOAD = 40.0


def robot() -> Robot:
    """Return the leg of the picture, its file named as one types it."""
    found = robot_from_file(ROOT / 'config' / 'sem104.yaml')
    return Robot(found.name, found.legs, found.body, 'config/sem104.yaml')


def save_picture(file: Path) -> None:
    """Save what one sees first when the page of SEM 104's leg is opened."""
    motor = motor_from_file(str(ROOT / 'config' / 'motor_example.yaml'))
    sheet = data_sheet(robot(), load=LOAD, motor=motor)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = Path(folder, 'leg.html')
        path.write_text(page(sheet), encoding='utf-8')
        browser = playwright.chromium.launch(
            executable_path=shutil.which('chromium'), args=['--no-sandbox']
        )
        opened = browser.new_page(viewport=SIZE)
        opened.goto(path.as_uri())
        opened.screenshot(path=file)
        browser.close()


if __name__ == '__main__':
    save_picture(Path(sys.argv[1]) if len(sys.argv) > 1 else FILE)
