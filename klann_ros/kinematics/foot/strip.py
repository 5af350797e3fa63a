"""The narrowest strips that hold curves: their middle lines are the minimax lines."""

from klann_ros.kinematics.arrays import FloatArray
import numpy as np

# Angles of the first grid over half a turn, and of each later one, a quarter as wide.
GRID_ANGLES, ZOOM_ANGLES = 33, 9
# The last step [rad].
MIN_STEP = 1e-10


def narrowest_strips(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return half the width of the strip of each row of points [m], and its angle [rad]."""
    rows = np.arange(len(x))
    angles = np.zeros((len(x), 1))
    step = np.pi / (GRID_ANGLES - 1)
    offsets = np.linspace(-np.pi / 2.0, np.pi / 2.0, GRID_ANGLES)
    while step > MIN_STEP:
        trials = angles + offsets
        heights = np.cos(trials)[..., None] * y[:, None] - np.sin(trials)[..., None] * x[:, None]
        widths = np.ptp(heights, axis=2)
        best = widths.argmin(axis=1)
        angles = trials[rows, best][:, None]
        offsets = np.linspace(-step, step, ZOOM_ANGLES)
        step /= (ZOOM_ANGLES - 1) / 2.0
    return widths[rows, best] / 2.0, angles[:, 0]
