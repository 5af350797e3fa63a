"""Cubics between even samples of a periodic function, such as a coordinate over a crank turn."""

from klann_ros.kinematics.arrays import FloatArray
import numpy as np


def periodic_cubics(
    samples: FloatArray, slopes: FloatArray, *, axis: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """
    Return the coefficients of t^0 to t^3 behind each sample, t from 0 to 1 at the next one.

    The cubic c_0 + c_1 t + c_2 t^2 + c_3 t^3 has the samples p, q and the slopes m, n at its ends:
    c_2 = 3 (q - p) - 2 m - n, c_3 = 2 (p - q) + m + n. `slopes` are derivatives by t; along `axis`
    the samples follow one another over a period.
    """
    next_samples = np.roll(samples, -1, axis)
    next_slopes = np.roll(slopes, -1, axis)
    c_2 = 3.0 * (next_samples - samples) - 2.0 * slopes - next_slopes
    c_3 = 2.0 * (samples - next_samples) + slopes + next_slopes
    return samples, slopes, c_2, c_3
