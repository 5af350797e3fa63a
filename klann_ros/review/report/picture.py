"""A picture of a run: the leg at its last pose that closes, and the path of its foot."""

from contextlib import suppress
from math import degrees
from pathlib import Path
from typing import BinaryIO

from klann_ros.kinematics import AnyLeg, KinematicsError, LinkagePose
from klann_ros.plotting import plot_pose
from klann_ros.plotting.plane import legend_beside, PALE
from klann_ros.review.model.recording import LegRecording
from klann_ros.review.model.review import Review
from klann_ros.sanitize.outputs import OutputError
from klann_ros.sanitize.text import printable
import numpy as np

# matplotlib cannot scale an axis to the largest doubles.
LARGEST = 1e60


class NoPictureError(OutputError):
    """A picture that cannot be made; the text says why."""


def picture_format(path: str) -> str:
    """Return the format of a picture by the ending of its path; a NoPictureError for none."""
    try:
        from matplotlib.backend_bases import FigureCanvasBase  # noqa: PLC0415 - as below
    except ModuleNotFoundError:
        msg = "a picture needs matplotlib: pip install 'klann_ros[plot]'"
        raise NoPictureError(msg) from None
    known = FigureCanvasBase.get_supported_filetypes()
    ending = Path(path).suffix.removeprefix('.').lower() or 'png'
    if ending not in known:
        msg = f'there is no picture of the format {printable(ending)}: {", ".join(sorted(known))}'
        raise NoPictureError(msg)
    return ending


def save_picture(review: Review, form: str, file: BinaryIO) -> None:
    """Write a picture of a run's first leg; a NoPictureError if it closes at none of its poses."""
    if not review.legs:
        raise NoPictureError('there is no leg in the run')
    recording = review.legs[0].evaluated
    if recording.solver.leg is None:
        raise NoPictureError('a picture needs a geometry, and the run has none: --geometry FILE')
    pose = _last_that_closes(recording, recording.solver.leg)
    from matplotlib.figure import Figure  # noqa: PLC0415 - optional, and slow to import

    figure = Figure(figsize=(8.0, 6.0), layout='constrained')
    axes = figure.add_subplot()
    feet = recording.feet.values
    # NaN fails the comparison as well.
    drawn = feet[(np.abs(feet) <= LARGEST).all(axis=1)]
    label = f'path of the foot, {len(drawn)} points'
    axes.plot(*drawn.T, color=PALE, lw=1.5, zorder=1, label=label)
    plot_pose(pose, ax=axes)
    axes.set_title(f'crank angle {degrees(pose.crank_angle) % 360.0:.1f} deg')
    legend_beside(axes)
    try:
        figure.savefig(file, format=form, dpi=120)
    except ValueError as error:
        raise NoPictureError(str(error)) from error


def _last_that_closes(recording: LegRecording, leg: AnyLeg) -> LinkagePose:
    for alpha in reversed(recording.poses.values[:, 0].tolist()):
        with suppress(KinematicsError):
            pose: LinkagePose = leg.closed_form(alpha)
            return pose
    raise NoPictureError('there is no pose in the run at which this leg can be drawn')
