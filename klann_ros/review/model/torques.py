"""
What the efforts of a crank should be, by the masses of the legs that it turns.

Rate and acceleration of the crank follow from its recorded angles: a cubic through the samples
around each moment, by least squares. What the samples are off the cubic by says how well both are
known, and so how well the torque is.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
import numpy as np

from .recording import Drive, LegRecording
from .times import Floats, Times

# A window reaches so far to both sides [s], and not so far that the crank turns by more [rad] ...
REACH, TURNED = 0.04, 0.2
# ... which are so many samples, to each side.
FEWEST, MOST = 3, 40
# A window has no gap, an interval so many times the usual one.
GAP = 5.0
# At most so many moments of a run are looked at, evenly spread, so many at a time.
MOMENTS, CHUNK = 50_000, 2048


class Motion(NamedTuple):
    """How a crank moves, at some of its samples."""

    # Shape (k,): which samples.
    rows: Times
    # Shape (k,): [rad/s], [rad/s^2].
    rate: Floats
    acceleration: Floats
    # Shape (k,): their standard errors.
    rate_error: Floats
    acceleration_error: Floats


class Torques(NamedTuple):
    """Recorded and expected efforts of a drive."""

    # Shape (k,): log times [ns].
    times: Times
    # Shape (k,): efforts [N m].
    recorded: Floats
    expected: Floats
    # Shape (k,): the standard error of what is expected [N m].
    accuracy: Floats
    # How many of how many efforts are no numbers.
    invalid: int
    told: int


def torques(drive: Drive, legs: Sequence[LegRecording]) -> Torques | None:
    """
    Return recorded and expected efforts of a drive, where both are known.

    None where it tells none: no effort, or one that is 0 throughout.
    """
    series = drive.efforts
    own = [legs[k] for k in drive.legs]
    since = max(leg.solver.leg_time for leg in own)
    first = int(np.searchsorted(series.times, since))
    angles, efforts = series.values[first:].T
    known = np.isfinite(efforts)
    if not efforts[known].any():
        return None
    invalid, told = int((~known).sum()), len(efforts)
    known &= np.abs(angles) <= MAX_CRANK_ANGLE
    angles, efforts = angles[known], efforts[known]
    logged, stamps = series.times[first:][known], series.stamps[first:][known]
    moving = crank_motion(_seconds(stamps, logged), angles)
    rows = moving.rows
    expected, inertia, turning = (np.zeros(len(rows)) for _ in range(3))
    for leg in own:
        dynamics = leg.solver.dynamics
        if dynamics is None:
            return Torques(*(np.empty(0),) * 4, invalid, told)  # type: ignore[arg-type]
        sense = leg.solver.direction if drive.is_input else 1.0
        alphas = sense * angles[rows] + (leg.solver.phase if drive.is_input else 0.0)
        alphas[~(np.abs(alphas) <= MAX_CRANK_ANGLE)] = np.nan
        rates, changes = sense * moving.rate, sense * moving.acceleration
        expected += sense * dynamics.crank_torque(alphas, rates, changes)
        own_inertia, slope = dynamics.reduced_inertia(alphas)
        inertia += own_inertia
        turning += np.abs(slope * rates)
    accuracy = inertia * moving.acceleration_error + turning * moving.rate_error
    there = np.isfinite(expected) & np.isfinite(accuracy)
    return Torques(
        logged[rows][there],
        efforts[rows][there],
        expected[there],
        accuracy[there],
        invalid,
        told,
    )


def crank_motion(times: Floats, angles: Floats) -> Motion:
    """
    Return how a crank moves, at most at MOMENTS of its samples.

    Parameters
    ----------
    times : numpy.ndarray, shape (n,)
        [s].
    angles : numpy.ndarray, shape (n,)
        Any number of turns [rad].

    """
    later = np.concatenate([[True], times[1:] > np.maximum.accumulate(times)[:-1]])
    kept = np.flatnonzero(later)
    times, angles = times[kept], angles[kept]
    found = [_fitted(times, angles, *window) for window in _windows(times, angles)]
    parts = zip(*found, strict=True) if found else ((np.empty(0),) * 5)
    rows, *others = (np.concatenate([np.empty(0), *part]) for part in parts)
    return Motion(kept[rows.astype(np.int64)], *others)


def _windows(times: Floats, angles: Floats) -> Iterator[tuple[Times, int]]:
    """Yield moments whose windows have no gap, and how many samples these have to each side."""
    if len(times) < 2 * FEWEST + 1:
        return
    steps = np.diff(times)
    period, usual = float(np.median(steps)), float(np.median(np.abs(np.diff(angles))))
    most = min(REACH / period, TURNED / usual if usual else MOST)
    side = int(np.clip(most, FEWEST, MOST))
    broken = np.concatenate([[0], np.cumsum(steps > GAP * period)])
    moments = np.arange(side, len(times) - side)
    moments = moments[broken[moments + side] == broken[moments - side]]
    moments = moments[:: max(1, -(-len(moments) // MOMENTS))]
    for first in range(0, len(moments), CHUNK):
        yield moments[slice(first, first + CHUNK)], side


def _fitted(times: Floats, angles: Floats, moments: Times, side: int) -> tuple[Floats, ...]:
    """Return moments with rate, acceleration and their errors, by cubics around them."""
    around = moments[:, None] + np.arange(-side, side + 1)
    far = times[around] - times[moments][:, None]
    size = np.abs(far).max(axis=1)
    powers = (far / size[:, None])[..., None] ** np.arange(4)
    inverse = np.linalg.pinv(np.swapaxes(powers, 1, 2) @ powers, hermitian=True)
    moved = angles[around] - angles[moments][:, None]
    factors = (inverse @ (np.swapaxes(powers, 1, 2) @ moved[..., None]))[..., 0]
    off = moved - (powers @ factors[..., None])[..., 0]
    noise = np.sqrt((off**2).sum(axis=1) / (2 * side - 3))
    spread = noise[:, None] * np.sqrt(np.abs(np.diagonal(inverse, axis1=1, axis2=2)))
    return (
        moments.astype(np.float64),
        factors[:, 1] / size,
        2.0 * factors[:, 2] / size**2,
        spread[:, 1] / size,
        2.0 * spread[:, 2] / size**2,
    )


def _seconds(stamps: Times, logged: Times) -> Floats:
    """Return the times of samples [s]: their stamps where they have any that go forward."""
    are_times = len(stamps) and (stamps > 0).all() and (np.diff(stamps) > 0).all()
    given = stamps if are_times else logged
    return (given - given[:1]) / 1e9
