"""What the leg did in a run: turns, foot path, how well it stood, how exact it was."""

from dataclasses import dataclass
from functools import lru_cache
from math import inf, nan

from klann_ros.kinematics import foot_path, KinematicsError, Linkage, LinkageLeg
from klann_ros.kinematics.foot.path import FootPath
from klann_ros.kinematics.foot.stance import Stance
import numpy as np

from .pose_errors import PoseErrors
from .recording import LegRecording
from .times import Floats, median

_TURN = 2 * np.pi


@dataclass(frozen=True)
class LegFigures:
    """The leg's figures in a run; NaN where the run does not tell."""

    # Net turns of the crank, positive counter-clockwise.
    turns: float
    # Extent of the foot path in x and y [m]; NaN where the crank did not turn once.
    stride: float
    lift: float
    # Part of the recorded poses at which the foot is on the ground.
    duty_factor: float
    # Greatest distance of the foot on the ground from the straight line that fits best, as a part
    # of the ground that it covers: of the geometry, over a turn.
    straightness: float
    # Least min(mu, pi - mu) of all dyads [rad].
    worst_transmission_angle: float
    # Largest residual of a recorded pose [m].
    worst_residual: float
    # Largest difference from the re-solved pose [rad].
    worst_angle_error: float
    # Largest distance of H from where the angles of its pose put it [m].
    worst_foot_error: float


def leg_figures(recording: LegRecording, errors: PoseErrors | None) -> LegFigures:
    """Return the figures of the judged part of a leg's run."""
    alphas, feet = (_finite(of.values) for of in (recording.poses, recording.feet))
    alphas = alphas[:, 0]
    # Whatever stands in the messages: what overflows is infinite.
    with np.errstate(over='ignore'):
        is_path = len(feet) and _covers_a_turn(alphas)
        stride, lift = np.ptp(feet, axis=0) if is_path else (nan, nan)
        turns = float(alphas[-1] - alphas[0]) / _TURN if len(alphas) else nan
    leg = recording.solver.leg
    stance = _stance(leg.linkage) if leg else None
    return LegFigures(
        turns=turns,
        stride=float(stride),
        lift=float(lift),
        duty_factor=_duty(alphas, stance) if stance else nan,
        straightness=stance.straightness if stance else nan,
        worst_transmission_angle=_from_singular(errors) if errors else nan,
        worst_residual=_worst(errors.residuals) if errors else nan,
        worst_angle_error=_worst(errors.angle_errors) if errors else nan,
        worst_foot_error=_worst(errors.foot_errors) if errors else nan,
    )


def _finite(rows: Floats) -> Floats:
    """Return the rows whose numbers are all finite."""
    finite = np.isfinite(rows).all(axis=1)
    return rows if finite.all() else rows[finite]


def _covers_a_turn(alphas: Floats) -> bool:
    """Return whether the crank was at all angles; without poses nobody knows that it was not."""
    if not len(alphas):
        return True
    steps = np.abs(np.diff(alphas))
    return bool(np.ptp(alphas) + (median(steps) if len(steps) else 0.0) >= _TURN)


@lru_cache(maxsize=16)
def path_of(linkage: Linkage) -> FootPath | None:
    """Return the path of a leg's foot, if it has one; a thousand runs of it need it once."""
    try:
        return foot_path(LinkageLeg(linkage))
    except KinematicsError:
        return None


@lru_cache(maxsize=16)
def _stance(linkage: Linkage) -> Stance | None:
    """Return the stance of a leg; a thousand runs of it, or windows, need it once."""
    path = path_of(linkage)
    try:
        return path.stance() if path is not None else None
    except KinematicsError:
        return None


def _duty(alphas: Floats, stance: Stance) -> float:
    turned = np.mod(alphas - stance.start, _TURN)
    return float(np.mean(turned < stance.end - stance.start)) if turned.size else nan


def _from_singular(errors: PoseErrors) -> float:
    mu = errors.transmission_angles
    least = np.fmin.reduce(np.minimum(mu, np.pi - mu), axis=None, initial=inf)
    return nan if np.isinf(least) else float(least)


def _worst(values: Floats) -> float:
    worst = np.fmax.reduce(values, initial=-inf)
    return nan if worst == -inf else float(worst)
