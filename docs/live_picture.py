"""
Make the README's picture of the live page: python docs/live_picture.py [FILE].

It starts a simulated walker and view_node, and needs MuJoCo, playwright and Debian's chromium.
"""

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import shutil
import subprocess
import sys
import time

from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / 'docs' / 'live.png'
WALKER = ROOT / 'config' / 'printed_walker.yaml'
SIZE = {'width': 1280, 'height': 1340}
# Until the charts are full [s].
SECONDS = 32.0
# At the speed of walking [m/s]; drawn as smoothly as by a graphics card.
SPEED = 'linear:=0.05'
SMOOTH = """
    const { scene } = live.stage;
    scene.adapt = () => {};
    scene.restartMeasurements(0);
    scene.renderer.setPixelRatio(2);
"""


@contextmanager
def running(name: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run an executable of the checkout."""
    code = f'import sys; from klann_ros.executables import {name}; sys.exit({name}())'
    process = subprocess.Popen(  # noqa: S603
        [sys.executable, '-c', code, *arguments],
        env={**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'},
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def save_picture(file: Path) -> None:
    """Save what one sees of a walker that walks."""
    parameters = ('--ros-args', '--params-file', str(WALKER))
    with (
        running('sim_node', *parameters, '-p', SPEED),
        running('walker_node', *parameters, '-p', 'use_imu:=true'),
        running('solver_node', *parameters),
        running('view_node', '--port', '0') as view,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(
            executable_path=shutil.which('chromium'), args=['--no-sandbox']
        )
        opened = browser.new_page(viewport=SIZE)
        opened.goto(next(iter(view.stdout or [])).strip())
        opened.wait_for_selector('#picture[data-x]')
        time.sleep(SECONDS)
        opened.evaluate(f'() => {{ {SMOOTH} }}')
        time.sleep(0.5)
        opened.screenshot(path=file)
        browser.close()


if __name__ == '__main__':
    save_picture(Path(sys.argv[1]) if len(sys.argv) > 1 else FILE)
