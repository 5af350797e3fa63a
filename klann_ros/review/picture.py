"""A picture of a run: the leg at its last pose that closes, and the path that its foot took."""

from math import degrees

from klann_ros.kinematics import KinematicsError
from klann_ros.kinematics.leg_types import Leg, LegPose
import numpy as np

from .recording import LegRecording
from .reviewed import Review

# matplotlib cannot scale an axis to the largest doubles.
LARGEST = 1e60


class NoPictureError(Exception):
    """A picture that cannot be made; the text says why."""


def save_picture(review: Review, path: str) -> None:
    """
    Save a picture of a run's first leg.

    Its format follows from the path's ending, such as .png or .svg.

    Raises
    ------
    NoPictureError
        matplotlib is not installed, it knows no such format, or the leg closes at none of the
        run's poses.
    OSError
        The file cannot be written.

    """
    if not review.legs:
        raise NoPictureError('there is no leg in the run')
    recording = review.legs[0].judged
    if recording.solver.leg is None:
        raise NoPictureError('a picture needs a geometry, and the run tells none: --geometry FILE')
    pose = _last_that_closes(recording, recording.solver.leg)
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - optional, and slow to import
    except ModuleNotFoundError:
        msg = "a picture needs matplotlib: pip install 'klann_ros[plot]'"
        raise NoPictureError(msg) from None

    from .drawing import draw_foot_path, draw_leg, label_plane  # noqa: PLC0415

    figure = Figure(figsize=(8.0, 6.0), layout='constrained')
    axes = figure.add_subplot()
    feet = recording.feet.values
    # NaN fails the comparison as well.
    drawn = feet[(np.abs(feet) <= LARGEST).all(axis=1)]
    draw_foot_path(axes, drawn, f'path of the foot, {len(drawn)} points')
    draw_leg(axes, pose)
    label_plane(axes, f'crank angle {degrees(pose.alpha) % 360.0:.1f} deg')
    try:
        figure.savefig(path, dpi=120)
    except ValueError as error:
        raise NoPictureError(str(error)) from error


def _last_that_closes(recording: LegRecording, leg: Leg) -> LegPose:
    """Return the last of the poses at which the leg can be drawn."""
    alphas = reversed(recording.poses.values[:, 0].tolist())
    poses = (_pose(leg, alpha) for alpha in alphas)
    pose = next((pose for pose in poses if pose is not None), None)
    if pose is None:
        raise NoPictureError('there is no pose in the run at which this leg can be drawn')
    return pose


def _pose(leg: Leg, alpha: float) -> LegPose | None:
    try:
        return leg.closed_form(alpha)
    except KinematicsError:
        return None
