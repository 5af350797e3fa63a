"""What the leg did in a run: turns, foot path, and how far it is from what it should be."""

from dataclasses import dataclass
from math import inf, nan

from klann_ros.kinematics import closed_form, klann, KlannGeometry, UnreachableError
import numpy as np
from numpy.typing import NDArray

from .recording import Recording

Floats = NDArray[np.float64]


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
        Distance of H from the re-solved one of the same stamp [m]; NaN without one, infinite
        where H is not finite.
    transmission_angles : numpy.ndarray, shape (n, 2)
        gamma + beta and delta + theta, folded into [0, pi] [rad].

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
        Least min(mu, pi - mu) of both dyads [rad].
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


def resolve(recording: Recording, geometry: KlannGeometry) -> Resolved:
    """
    Solve every recorded pose again by the geometry, from its crank angle alone.

    The closed form does it: it shares no equation with the solver that made the pose.
    """
    count = len(recording.poses)
    angle_errors, residuals = np.full(count, nan), np.empty(count)
    feet: dict[int, tuple[float, float]] = {}
    for i, (stamp, recorded) in enumerate(
        zip(recording.pose_stamps.tolist(), recording.poses.tolist(), strict=True)
    ):
        alpha, *x = recorded
        if not np.isfinite(recorded).all():
            residuals[i] = angle_errors[i] = inf
            continue
        residuals[i] = np.linalg.norm(klann.f(geometry, alpha, x))
        try:
            joints = closed_form.joints(geometry, alpha)
        except UnreachableError:
            continue
        expected = closed_form.angles(geometry, joints)
        angle_errors[i] = np.abs(_wrapped(np.subtract(x, expected))).max()
        feet[stamp] = joints.h
    again = [feet.get(stamp, (nan, nan)) for stamp in recording.foot_stamps.tolist()]
    foot_errors: Floats = np.hypot(*(recording.feet - np.array(again).reshape(-1, 2)).T)
    foot_errors[~np.isfinite(recording.feet).all(axis=1)] = inf
    _, gamma, beta, delta, theta = recording.poses.T
    mu = np.abs(_wrapped(np.column_stack([gamma + beta, delta + theta])))
    return Resolved(angle_errors, residuals, foot_errors, mu)


def leg_figures(recording: Recording, resolved: Resolved | None) -> LegFigures:
    """Return the leg's figures in a run."""
    alphas, feet = recording.poses[:, 0], recording.feet
    stride, lift = np.ptp(feet, axis=0) if len(feet) else (nan, nan)
    mu = resolved.transmission_angles if resolved else np.empty((0, 2))
    mu = mu[np.isfinite(mu)]
    return LegFigures(
        turns=float(alphas[-1] - alphas[0]) / (2 * np.pi) if len(alphas) else nan,
        stride=float(stride),
        lift=float(lift),
        worst_transmission_angle=float(np.minimum(mu, np.pi - mu).min()) if mu.size else nan,
        worst_residual=_worst(resolved.residuals) if resolved else nan,
        worst_angle_error=_worst(resolved.angle_errors) if resolved else nan,
        worst_foot_error=_worst(resolved.foot_errors) if resolved else nan,
    )


def _wrapped(angles: Floats) -> Floats:
    """Return angles in [-pi, pi], exact where they are small already; NaN for infinite ones."""
    turn = 2 * np.pi
    with np.errstate(invalid='ignore'):
        return angles - turn * np.round(angles / turn)


def _worst(values: Floats) -> float:
    known = values[~np.isnan(values)]
    return float(known.max()) if known.size else nan
