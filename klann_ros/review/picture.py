"""A picture of a run: the leg at its last pose, and the path that its foot took."""

from math import degrees

from klann_ros.kinematics import KlannGeometry, KlannLeg

from .recording import Recording


class NoPictureError(Exception):
    """A picture that cannot be made; the text says why."""


def save_picture(recording: Recording, geometry: KlannGeometry, path: str) -> None:
    """
    Save a picture; its format follows from the path's ending, such as .png or .svg.

    Raises
    ------
    NoPictureError
        matplotlib is not installed, it knows no such format, or the run has no pose.
    OSError
        The file cannot be written.

    """
    if not len(recording.poses):
        raise NoPictureError('there is no pose in the run to draw')
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - optional, and slow to import
    except ModuleNotFoundError:
        msg = "a picture needs matplotlib: pip install 'klann_ros[plot]'"
        raise NoPictureError(msg) from None

    from .drawing import draw_foot_path, draw_leg, label_plane  # noqa: PLC0415

    pose = KlannLeg(geometry).closed_form(float(recording.poses[-1, 0]))
    figure = Figure(figsize=(8.0, 6.0), layout='constrained')
    axes = figure.add_subplot()
    draw_foot_path(axes, recording.feet, f'path of H, {len(recording.feet)} points')
    draw_leg(axes, pose)
    label_plane(axes, f'crank angle {degrees(pose.alpha) % 360.0:.1f} deg')
    try:
        figure.savefig(path, dpi=120)
    except ValueError as error:
        raise NoPictureError(str(error)) from error
