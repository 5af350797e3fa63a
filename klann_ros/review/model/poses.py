"""Recorded poses against the solved ones, and the figures of a leg."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf, nan
from typing import Any, NamedTuple

from klann_ros.kinematics import (
    AnyLeg,
    differences,
    feet,
    foot_path,
    FootPath,
    KinematicsError,
    Linkage,
    linkage_poses,
    LinkageLeg,
    LinkagePoses,
    loop_errors,
    Stance,
    transmission_angles,
    vectors,
)
from klann_ros.kinematics.angles import MAX_CRANK_ANGLE, TURN
from klann_ros.kinematics.arrays import FloatArray, IndexArray
from klann_ros.sanitize.units import omits_degrees
import numpy as np

from .recording import LegRecording
from .times import median, pairs

# Poses solved at once; and those after a gap, of more than [ns], that tell the turn of a path.
_BLOCK_SIZE = 65536
_FIRST_POSES = 20
_PATH_GAP = 1_000_000_000
_LARGEST = np.finfo(np.float64).max


class SolvedBlock(NamedTuple):
    """Some recorded poses, and the solved ones at their crank angles."""

    rows: slice
    # Shape (k, number of angles) [rad]: recorded, and by the closed form, which shares no equation
    # with the solver; NaN for an unreachable crank angle.
    recorded: FloatArray
    solved: FloatArray
    # Shape (k, 2): the foot of the solved poses [m].
    solved_feet: FloatArray
    # Rows of the recorded feet that belong to them, and their poses in the block.
    of_feet: IndexArray
    of_poses: IndexArray

    def angle_errors(self, leg: AnyLeg) -> FloatArray:
        """Return the error of each angle but the crank's, modulo a turn [rad]."""
        errors: FloatArray = np.abs(differences(leg, self.recorded[:, 1:], self.solved[:, 1:]))
        return errors


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """Errors of recorded poses against the solved ones."""

    # Shape (n,): largest difference of the angles from the solved ones, modulo a turn [rad], or of
    # a distance in the linkage's size; NaN for an unreachable crank angle, infinite for an angle
    # that is not finite.
    angle_errors: FloatArray
    # Shape (n,): norm of f at the recorded pose [m]; infinite where an angle is not finite.
    residuals: FloatArray
    # Shape (m,): distance of H from the foot of its pose [m]; NaN without a unique finite pose,
    # infinite where H is not finite.
    foot_errors: FloatArray
    # Shape (n, number of dyads): those of the solved poses, in [0, pi] [rad]; NaN for none.
    transmission_angles: FloatArray
    # The solved poses, if they are kept.
    solved: tuple[SolvedBlock, ...] = ()


def path_angles(recording: LegRecording, leg: AnyLeg) -> FloatArray:
    """
    Return the crank angles of the poses in the turns of the linkage's path, shape (n,) [rad].

    Past change points it may be back only after several turns: its first poses tell which one.
    """
    alphas = recording.poses.values[:, 0]
    period = leg.linkage.change_points.period
    is_angle = np.abs(alphas) <= MAX_CRANK_ANGLE
    if period == 1 or not is_angle.any():
        return alphas
    # What is no angle counts as the one before it.
    known = np.where(is_angle, np.arange(len(alphas)), np.argmax(is_angle))
    betas = np.unwrap(alphas[np.maximum.accumulate(known)])
    gaps = np.flatnonzero(np.diff(recording.poses.times) > _PATH_GAP)
    for rows in np.split(np.arange(len(betas)), gaps + 1):
        first = rows[:_FIRST_POSES]
        misfits = []
        for turn in range(period):
            solved: Any = poses_at(leg, betas[first] + turn * TURN)
            errors = differences(leg, recording.poses.values[first, 1:], solved.angles)
            misfits.append(np.median(np.abs(np.nan_to_num(errors))))
        betas[rows] += TURN * np.argmin(misfits)
    return np.where(is_angle, betas, alphas)


def poses_at(leg: AnyLeg, alphas: FloatArray) -> LinkagePoses:
    """Return the poses at recorded angles, of which a finding tells degrees, not a warning."""
    token = omits_degrees.set(True)
    try:
        return linkage_poses(leg, alphas, angles=True)
    finally:
        omits_degrees.reset(token)


def solve_blocks(recording: LegRecording, leg: AnyLeg) -> Iterator[SolvedBlock]:
    """Solve every recorded pose again, from its crank angle alone, block by block."""
    poses = recording.poses.values
    betas = path_angles(recording, leg)
    of_feet, of_poses = pairs(recording.feet.stamps, recording.poses.stamps)
    for begin in range(0, len(poses), _BLOCK_SIZE):
        end = min(begin + _BLOCK_SIZE, len(poses))
        recorded = poses[slice(begin, end)]
        solved = poses_at(leg, betas[slice(begin, end)])
        angles: FloatArray = solved.angles  # type: ignore[assignment]  # asked for
        paired = slice(*np.searchsorted(of_poses, [begin, end]))
        yield SolvedBlock(
            slice(begin, end),
            recorded,
            np.column_stack([recorded[:, 0], angles]),
            solved.h,
            of_feet[paired],
            of_poses[paired] - begin,
        )


def pose_errors(
    recording: LegRecording,
    leg: AnyLeg,
    progress: Callable[[float], object] = lambda _: None,
    *,
    keep: bool = False,
) -> PoseErrors:
    """Return the errors of a leg's poses; `progress` gets the finished share, `keep` the poses."""
    blocks: list[SolvedBlock] = []
    count = len(recording.poses)
    errors = PoseErrors(
        np.empty(count),
        np.empty(count),
        np.full(len(recording.feet), nan),
        np.empty((count, len(leg.assembly))),
    )
    for block in solve_blocks(recording, leg):
        rows = block.rows
        angles = block.recorded
        finite = np.isfinite(angles).all(axis=1)
        errors.transmission_angles[rows] = transmission_angles(leg, block.solved)
        errors.angle_errors[rows] = np.where(finite, block.angle_errors(leg).max(axis=1), inf)
        u = vectors(leg, angles)
        errors.residuals[rows] = np.where(finite, loop_errors(leg, angles, u), inf)
        recorded_feet = recording.feet.values[block.of_feet]
        computed_feet = feet(leg, angles, u)[block.of_poses]
        errors.foot_errors[block.of_feet] = _foot_errors(recorded_feet, computed_feet)
        if keep:
            blocks.append(block)
        progress(rows.stop / count)
    return replace(errors, solved=tuple(blocks))


def _foot_errors(recorded: FloatArray, computed: FloatArray) -> FloatArray:
    with np.errstate(invalid='ignore', over='ignore'):
        distances = np.hypot(*(recorded - computed).T)
    # NaN of a foot is its own fault; NaN of its pose is not.
    return np.where(np.isfinite(recorded).all(axis=1), np.minimum(distances, _LARGEST), inf)


@dataclass(frozen=True)
class LegFigures:
    """Figures of a leg in a run; NaN for unknown."""

    turns: float  #: net turns of the crank, positive counter-clockwise
    stride: float  #: extent of the foot path in x [m]; NaN where the crank did not turn once
    lift: float  #: and in y
    duty_factor: float  #: share of the poses in stance
    #: Largest distance of the stance path from its best straight line, as a share of its length;
    #: of the geometry, over a turn.
    straightness: float
    worst_transmission_angle: float = nan  #: least min(mu, pi - mu) of all dyads [rad]
    worst_residual: float = nan  #: of a recorded pose [m]
    worst_angle_error: float = nan  #: largest difference from the solved pose [rad]
    worst_foot_error: float = nan  #: largest distance of H from the foot of its pose [m]


def leg_figures(recording: LegRecording, errors: PoseErrors | None) -> LegFigures:
    """Return the figures of the judged part of a leg's run."""
    leg = recording.solver.leg
    cranks = path_angles(recording, leg) if leg else recording.poses.values[:, 0]
    alphas = cranks[np.isfinite(recording.poses.values).all(axis=1)]
    feet = recording.feet.finite().values
    # Messages hold any number: overflow gives infinity.
    with np.errstate(over='ignore'):
        is_path = len(feet) and _covers_a_turn(alphas)
        stride, lift = np.ptp(feet, axis=0) if is_path else (nan, nan)
        turns = float(alphas[-1] - alphas[0]) / TURN if len(alphas) else nan
    stance = _stance(leg.linkage) if leg else None
    duty_factor = straightness = nan
    if stance is not None:
        straightness = stance.straightness
        duty_factor = float(np.mean(stance.holds(alphas))) if len(alphas) else nan
    figures = LegFigures(turns, float(stride), float(lift), duty_factor, straightness)
    if errors is None:
        return figures
    mu = errors.transmission_angles
    return replace(
        figures,
        worst_transmission_angle=-_worst((-np.minimum(mu, np.pi - mu)).ravel()),
        worst_residual=_worst(errors.residuals),
        worst_angle_error=_worst(errors.angle_errors),
        worst_foot_error=_worst(errors.foot_errors),
    )


def _covers_a_turn(alphas: FloatArray) -> bool:
    """Return whether the crank made a full turn; True without poses, as it is unknown."""
    if not len(alphas):
        return True
    steps = np.abs(np.diff(alphas))
    return bool(np.ptp(alphas) + (median(steps) if len(steps) else 0.0) >= TURN)


@lru_cache(maxsize=16)
def linkage_foot_path(linkage: Linkage) -> FootPath | None:
    """Return the foot path of a linkage, if any; cached for many runs."""
    try:
        return foot_path(LinkageLeg(linkage))
    except KinematicsError:
        return None


@lru_cache(maxsize=16)
def _stance(linkage: Linkage) -> Stance | None:
    path = linkage_foot_path(linkage)
    try:
        return path.stance() if path is not None else None
    except KinematicsError:
        return None


def _worst(errors: FloatArray) -> float:
    """Return the largest error that is known; NaN without any."""
    worst = np.fmax.reduce(errors, initial=-inf)
    return nan if worst == -inf else float(worst)
