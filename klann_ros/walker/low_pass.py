"""Gains of first-order filters: the share of a new reading in a filtered quantity."""

from math import exp


def low_pass_gain(dt: float, time_constant: float) -> float:
    """Return the gain of a low-pass filter for a reading that lasted for `dt` [s]: 1 - e^-dt/T."""
    # NaN compares with nothing.
    return 1.0 - exp(-dt / time_constant) if dt > 0.0 else 0.0


def mean_gain(dt: float, elapsed: float, window: float) -> float:
    """Return the gain of a mean: of the time `elapsed` with `dt`, or of the last `window` [s]."""
    return min(1.0, dt / min(elapsed, window))
