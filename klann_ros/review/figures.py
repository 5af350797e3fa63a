"""What the leg did in a run: turns, foot path, and how far it is from what it should be."""

from dataclasses import dataclass
from math import inf, nan

from klann_ros.kinematics import KinematicsError
from klann_ros.kinematics.leg_types import Leg
import numpy as np
from numpy.typing import NDArray

from .recording import Floats, Recording, Series

Rows = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Resolved:
    """
    A run's poses, solved again.

    Attributes
    ----------
    angle_errors : numpy.ndarray, shape (n,)
        Largest difference of a pose's angles from the re-solved ones, modulo a turn [rad]; NaN
        where the crank angle cannot be reached, infinite where an angle is not finite.
    residuals : numpy.ndarray, shape (n,)
        Norm of f at the recorded pose [m].
    foot_errors : numpy.ndarray, shape (m,)
        Distance of H from the re-solved one of its pose [m]; NaN where no pose is known to be
        its own, infinite where H is not finite.
    transmission_angles : numpy.ndarray, shape (n, number of dyads)
        Those of the re-solved poses, in [0, pi] [rad]; NaN where there is none.

    """

    angle_errors: Floats
    residuals: Floats
    foot_errors: Floats
    transmission_angles: Floats


@dataclass(frozen=True)
class LegFigures:
    """
    The leg's figures in a run; NaN where the run does not tell.

    Attributes
    ----------
    turns : float
        Net turns of the crank, positive counter-clockwise.
    stride, lift : float
        Extent of the foot path in x and y [m].
    worst_transmission_angle : float
        Least min(mu, pi - mu) of all dyads [rad].
    worst_residual : float
        Largest residual of a recorded pose [m].
    worst_angle_error : float
        Largest difference from the re-solved pose [rad].
    worst_foot_error : float
        Largest distance of H from the re-solved one [m].

    """

    turns: float
    stride: float
    lift: float
    worst_transmission_angle: float
    worst_residual: float
    worst_angle_error: float
    worst_foot_error: float


def resolve(recording: Recording, leg: Leg) -> Resolved:
    """
    Solve every recorded pose again, from its crank angle alone.

    The closed form does it: it shares no equation with the solver that made the pose.
    """
    count = len(recording.poses)
    angle_errors, residuals = np.full(count, nan), np.full(count, inf)
    feet, mu = np.full((count, 2), nan), np.full((count, len(leg.assembly)), nan)
    for i, recorded in enumerate(recording.poses.values.tolist()):
        alpha, *x = recorded
        if not np.isfinite(recorded).all():
            angle_errors[i] = inf
            continue
        residuals[i] = leg.residual(alpha, x)
        try:
            expected = leg.closed_form(alpha)
        except KinematicsError:
            continue
        angle_errors[i] = np.abs(_wrapped(np.subtract(x, expected.x))).max()
        feet[i], mu[i] = expected.h, expected.transmission_angles
    return Resolved(angle_errors, residuals, _foot_errors(recording, feet), mu)


def leg_figures(recording: Recording, resolved: Resolved | None) -> LegFigures:
    """Return the leg's figures in a run."""
    alphas, feet = recording.poses.values[:, 0], recording.feet.values
    # Whatever stands in the messages: what overflows is infinite, what has no value is NaN.
    with np.errstate(over='ignore', invalid='ignore'):
        stride, lift = np.ptp(feet, axis=0) if len(feet) else (nan, nan)
        turns = float(alphas[-1] - alphas[0]) / (2 * np.pi) if len(alphas) else nan
    mu = resolved.transmission_angles if resolved else np.empty((0, 2))
    mu = mu[np.isfinite(mu)]
    return LegFigures(
        turns=turns,
        stride=float(stride),
        lift=float(lift),
        worst_transmission_angle=float(np.minimum(mu, np.pi - mu).min()) if mu.size else nan,
        worst_residual=_worst(resolved.residuals) if resolved else nan,
        worst_angle_error=_worst(resolved.angle_errors) if resolved else nan,
        worst_foot_error=_worst(resolved.foot_errors) if resolved else nan,
    )


def _foot_errors(recording: Recording, again: Floats) -> Floats:
    """Return the distances of the feet from those of their poses, solved again."""
    errors = np.full(len(recording.feet), nan)
    feet, poses = _pairs(recording)
    with np.errstate(over='ignore', invalid='ignore'):
        errors[feet] = np.hypot(*(recording.feet.values[feet] - again[poses]).T)
    # NaN against a pose that cannot be reached is no fault of the foot's, NaN of its own is.
    finite = np.isfinite(recording.feet.values[feet]).all(axis=1)
    errors[feet[np.logical_not(finite)]] = inf
    return errors


def _pairs(recording: Recording) -> tuple[Rows, Rows]:
    """
    Return which foot belongs to which pose, by their rows.

    A simulated clock gives many the same stamp: the k-th foot of a stamp is that of its k-th
    pose. Where one of them is missing nobody knows which, and none of the stamp is paired.
    """
    poses = _rows_by_stamp(recording.poses)
    feet: list[int] = []
    of_poses: list[int] = []
    for stamp, rows in _rows_by_stamp(recording.feet).items():
        if len(rows) == len(poses.get(stamp, ())):
            feet += rows
            of_poses += poses[stamp]
    return np.array(feet, dtype=np.intp), np.array(of_poses, dtype=np.intp)


def _rows_by_stamp(series: Series) -> dict[int, list[int]]:
    rows: dict[int, list[int]] = {}
    for row, stamp in enumerate(series.stamps.tolist()):
        rows.setdefault(stamp, []).append(row)
    return rows


def _wrapped(angles: Floats) -> Floats:
    """Return angles in [-pi, pi], exact where they are small already; NaN for infinite ones."""
    turn = 2 * np.pi
    with np.errstate(over='ignore', invalid='ignore'):
        wrapped: Floats = angles - turn * np.round(angles / turn)
    return wrapped


def _worst(values: Floats) -> float:
    known = values[~np.isnan(values)]
    return float(known.max()) if known.size else nan
