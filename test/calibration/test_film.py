"""A leg that MuJoCo moves and films is calibrated by its tracked markers, without an encoder."""

from collections.abc import Callable
from dataclasses import replace
import math
from typing import Any

from klann_ros.calibration import calibrate
from klann_ros.calibration.load import paired, RawSeries
from klann_ros.robot import robot_of
from klann_ros.twin import robot_mjcf
from measured_robots import built
import numpy as np
import pytest

mujoco = pytest.importorskip('mujoco')
WIDTH, HEIGHT = 640, 480
# Markers, each in a channel of the image.
MARKERS = 'BGH'
MARKER_RADIUS = 0.015
FIELD_OF_VIEW = 38.0
CAMERA = f'<camera name="film" pos="0.55 -2.4 0.1" euler="1.52 0.06 0.03" fovy="{FIELD_OF_VIEW}"/>'
TIME_STEP = 5e-4
# Steps of the engine in a frame, and frames: more than a turn.
STEPS, FRAMES = 55, 85


def film(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the true dimensions, the frames' times, and the markers, shape (n, 3, 2) [px]."""
    robot = robot_of('sem104')
    (leg,) = robot.legs
    real_leg = replace(leg, linkage=built(seed))
    text = robot_mjcf(replace(robot, legs=(real_leg,)), time_step=TIME_STEP)
    size = f'<visual><global offwidth="{WIDTH}" offheight="{HEIGHT}"/></visual>'
    text = text.replace('<worldbody>', f'{size}<worldbody>{CAMERA}', 1)
    model = mujoco.MjModel.from_xml_string(text)
    # Black but for the markers.
    model.geom_rgba[:] = 0.0
    model.site_rgba[:] = 0.0
    model.vis.headlight.ambient[:] = 1.0
    model.vis.headlight.diffuse[:] = 0.0
    model.vis.headlight.specular[:] = 0.0
    for channel, marker in enumerate(MARKERS):
        site = model.site(marker.lower())
        site.size[:] = MARKER_RADIUS
        site.rgba[[channel, 3]] = 1.0
    state = mujoco.MjData(model)
    try:
        track = tracker(model)
    except (ImportError, AttributeError, RuntimeError, mujoco.FatalError):
        track = project
    state.ctrl[:] = 3.0
    mujoco.mj_step(model, state, 400)
    times = []
    tracks = []
    for _ in range(FRAMES):
        mujoco.mj_step(model, state, STEPS)
        mujoco.mj_kinematics(model, state)
        mujoco.mj_camlight(model, state)
        times.append(state.time)
        tracks.append(track(state))
    return np.array(real_leg.linkage.numbers), np.array(times), np.array(tracks)


def tracker(model: Any) -> Callable[[Any], np.ndarray]:
    """Return a function that renders a state and tracks the markers, x right and y up [px]."""
    from mujoco.egl import GLContext

    window = GLContext(WIDTH, HEIGHT)
    window.make_current()
    context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
    scene = mujoco.MjvScene(model, 1000)
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
    camera.fixedcamid = model.camera('film').id
    view = mujoco.MjrRect(0, 0, WIDTH, HEIGHT)
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]

    def track(state: Any) -> np.ndarray:
        everything = mujoco.mjtCatBit.mjCAT_ALL
        options = mujoco.MjvOption()
        mujoco.mjv_updateScene(model, state, options, None, camera, everything, scene)
        mujoco.mjr_render(view, scene, context)
        mujoco.mjr_readPixels(image, None, view, context)
        places = []
        for channel in range(len(MARKERS)):
            weights = np.where(image[..., channel] > 30, image[..., channel], 0).astype(float)
            weights /= weights.sum()
            places.append(((weights * columns).sum(), (weights * rows).sum()))
        # It keeps the window.
        assert window
        return np.array(places)

    return track


def project(state: Any) -> np.ndarray:
    """Return the markers by the camera's matrix, as tracked within 0.03 px."""
    camera = state.camera('film')
    rng = np.random.default_rng(round(1e6 * state.time))
    places = []
    for marker in MARKERS:
        x, y, z = (state.site(marker.lower()).xpos - camera.xpos) @ camera.xmat.reshape(3, 3)
        focal_length = HEIGHT / 2.0 / math.tan(math.radians(FIELD_OF_VIEW) / 2.0)
        places.append(rng.normal((-focal_length * x / z, -focal_length * y / z), 0.03))
    return np.array(places)


@pytest.mark.slow
def test_a_filmed_leg_is_calibrated_without_an_encoder() -> None:
    numbers, times, tracks = film(1)
    (leg,) = robot_of('sem104').legs
    quantities = []
    for n, marker in enumerate(MARKERS):
        quantities.append(RawSeries('point', marker, times, tracks[:, n]))
    loaded = paired(leg, quantities, None)
    assert loaded.notes == ['the crank is that of the point B']
    # The scale is that of the drawing, within the tolerance of a workshop.
    calibration = calibrate(leg.linkage, loaded.measured, camera='tilt', prior=5e-4)
    deviations = calibration.standard_errors[: len(numbers)]
    normalized_errors = np.abs(calibration.values[: len(numbers)] - numbers) / deviations
    assert np.mean(normalized_errors < 1.96) > 0.8
    assert normalized_errors.max() < 3.5
    # Pixels tell more than the tolerance.
    assert deviations[calibration.model.names.index('l_ab')] < 1e-4
    assert abs(calibration.dimension('camera keystone x')[0]) > 0.005
