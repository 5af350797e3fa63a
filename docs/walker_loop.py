"""
Make the README's loop of a walker in three dimensions: python docs/walker_loop.py [FILE].

It simulates the printed walker, draws it as the live page does, and needs MuJoCo, playwright,
Debian's chromium, and Pillow.
"""

from base64 import b64decode
from io import BytesIO
from math import pi
from pathlib import Path
import shutil
import sys
from typing import Any

from klann_ros.export import scene_parts
from klann_ros.kinematics import linkage_poses
from klann_ros.robot import Robot, robot_from_file
from klann_ros.twin import Twin
from klann_ros.web import leg_shape, SHARED
import numpy as np
from PIL import Image
from playwright.sync_api import Page, sync_playwright

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / 'docs' / 'walker.webp'
WALKER = ROOT / 'config' / 'printed_walker.yaml'
SIZE = (720, 400)
# Sky that is cut off [px].
SKY = 60
# A turn of the cranks is one loop.
FRAMES = 48
FRAME_TIME = 1.0 / 15.0
# Turns until the gait is periodic.
FIRST_TURNS = 2
QUALITY = 60
SCRIPTS = ('three/three.min.js', 'theme.js', 'drawing.js', 'orbit.js', 'solids.js', 'scene.js')
PAGE = '<style>body { margin: 0 } canvas { width: 100vw; height: 100vh }</style><canvas></canvas>'
BUILD = """robot => {
    scene = new RobotScene(document.querySelector('canvas'));
    scene.build(robot);
    Object.assign(scene.orbit, {azimuth: -1.1, elevation: 0.3, zoom: 1.02});
    // All frames have the same quality.
    scene.adapt = () => {};
}"""
# The stride is a whole number of cells of the ground.
RENDER = """([poses, place, stride]) => {
    const cells = Math.round(stride / scene.cell);
    place.at[0] *= (cells * scene.cell) / stride;
    place.path = [[place.at[0] - 10, 0, 0]];
    scene.show(poses, place);
    scene.render();
    return scene.canvas.toDataURL();
}"""


def scene_robot(robot: Robot) -> dict[str, Any]:
    """Return a robot as scene.js builds it."""
    parts = scene_parts(robot)
    legs = []
    for leg in robot.legs:
        place = parts['legs'][leg.name]
        mount = {'xyz': leg.mount.xyz, 'rpy': leg.mount.rpy}
        model = parts['models'][place['model']]
        turn: Any = linkage_poses(leg.linkage, np.linspace(0.0, 2.0 * pi, FRAMES), points=True)
        corners = turn.points.reshape(-1, 2)
        box = [*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist()]
        shape = {**leg_shape(leg.linkage), 'box': box}
        legs.append({**place, 'shape': shape, 'mount': mount, 'model': model})
    body = robot.body and {'size': robot.body.size, 'centre': robot.body.centre}
    return {'legs': legs, 'body': body}


def leg_points(robot: Robot, cranks: dict[str, float]) -> list[Any]:
    """Return the points of each leg in its plane."""
    points = []
    for leg in robot.legs:
        alpha = leg.phase + leg.direction * cranks[leg.crank_joint]
        poses: Any = linkage_poses(leg.linkage, [alpha], points=True)
        points.append(poses.points[0].tolist())
    return points


def simulated_frames(robot: Robot) -> list[Any]:
    """Return the points of the legs, the place and the stride of each frame of a turn."""
    twin = Twin(robot)
    for joint in twin.joints:
        twin.command(joint, 2.0 * pi / (FRAMES * FRAME_TIME))
    points = []
    places = []
    for number in range(FRAMES + 1):
        twin.step((FIRST_TURNS * FRAMES + number) * FRAME_TIME)
        cranks = {joint: crank.position for joint, crank in twin.cranks().items()}
        points.append(leg_points(robot, cranks))
        places.append(twin.truth())
    x_start, y_start, _ = places[0].position
    x_end, y_end, _ = places[-1].position
    frames = []
    for number in range(FRAMES):
        x, y, z = places[number].position
        drift = number / FRAMES * (y_end - y_start)
        place = {'at': [x - x_start, y - y_start - drift, z], 'turn': places[number].orientation}
        frames.append([points[number], place, x_end - x_start])
    return frames


def rendered(page: Page, robot: Robot) -> list[Image.Image]:
    """Return the pictures of all frames."""
    page.set_content(PAGE)
    page.add_style_tag(path=SHARED / 'theme.css')
    for script in SCRIPTS:
        page.add_script_tag(path=SHARED / script)
    page.evaluate(BUILD, scene_robot(robot))
    pictures = []
    for frame in simulated_frames(robot):
        content = page.evaluate(RENDER, frame).partition(',')[2]
        picture = Image.open(BytesIO(b64decode(content))).convert('RGB')
        picture = picture.resize(SIZE, Image.Resampling.LANCZOS)
        pictures.append(picture.crop((0, SKY, *SIZE)))
    return pictures


def save_loop(file: Path) -> None:
    """Save a turn of the walker's cranks."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which('chromium') or shutil.which('chromium-headless-shell'),
            args=['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
        )
        width, height = SIZE
        viewport = {'width': width, 'height': height}
        page = browser.new_page(viewport=viewport, device_scale_factor=2)
        first, *others = rendered(page, robot_from_file(WALKER))
        browser.close()
    first.save(
        file,
        save_all=True,
        append_images=others,
        duration=round(1000 * FRAME_TIME),
        loop=0,
        quality=QUALITY,
        method=6,
    )


if __name__ == '__main__':
    save_loop(Path(sys.argv[1]) if len(sys.argv) > 1 else FILE)
