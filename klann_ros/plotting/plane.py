"""Plots in a linkage's plane: its pose, the path of its foot, and both in motion."""

from typing import Any, TYPE_CHECKING

from klann_ros.kinematics import AnyLeg, foot_path, FootPath, LinkagePose, validation
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.foot.path import NoFootPathError
import numpy as np
from numpy.typing import NDArray

from .artists import draw_angles, label_plane, PALE, PoseArtists, WIDTH
from .given import axes_of, leg_of

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
# How long a turn of an animation takes [ms], and its fewest frames.
TURN_TIME, FEWEST_FRAMES = 4000, 2
# The ends of arcs are this near to their samples [rad].
SAME = 1e-9


def plot_pose(
    given: Any,
    alpha: float | None = None,
    *,
    ax: 'Axes | None' = None,
    letters: bool = True,
    angles: bool = False,
    width: float = WIDTH,
) -> 'Axes':
    """
    Draw a linkage at a crank angle: bars and plates, joints, and every point's letter.

    A fixed pivot stands on hatched ground, a circle joins bodies, a dot is a point of one alone.

    Parameters
    ----------
    given : Linkage, KlannGeometry, FourBarGeometry, leg or LinkagePose
        The linkage, or a pose of it.
    alpha : float, optional
        Crank angle [rad]; where left out that of the pose, or the first that can be reached.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure where left out.
    letters, angles : bool
        Whether points are labelled, and angles drawn as arcs from the horizontal.
    width : float
        Width of the bars, by which the joints' sizes go [points].

    Returns
    -------
    matplotlib.axes.Axes
        The axes, equally scaled, in metres; its lines are labelled with the bodies.

    Raises
    ------
    KinematicsError
        The linkage does not close at this crank angle.
    TypeError
        `given` is none of these.
    NoMatplotlibError
        matplotlib is not installed.

    """
    if isinstance(given, LinkagePose) and alpha is None:
        pose = given
    else:
        leg = leg_of(given)
        pose = leg.closed_form(_crank_angles(leg, 1)[0] if alpha is None else alpha)
    ax = axes_of(ax)
    PoseArtists(ax, pose, letters=letters, width=width)
    if angles:
        draw_angles(ax, pose, radius=0.08 * float(np.ptp(pose.points, axis=0).max()))
    label_plane(ax)
    return ax


def plot_foot_path(
    given: Any,
    *,
    point: str | tuple[str, float, float] | None = None,
    ax: 'Axes | None' = None,
    **style: Any,
) -> 'Axes':
    """
    Draw the path of the foot, or of any point, over all crank angles that can be reached.

    Parameters
    ----------
    given : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.
    point : str, or (str, float, float), optional
        The point in place of the foot, as of `foot_path`: 'G', or ('theta3', u, v) for a coupler
        curve.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure where left out.
    **style
        Of the line, such as `color` and `label`, which is the point's letter where left out.

    Returns
    -------
    matplotlib.axes.Axes
        The axes, equally scaled, in metres.

    Raises
    ------
    NoFootPathError
        The crank reaches no angle.
    GeometryError
        There is no such point.
    TypeError
        `given` is none of these.
    NoMatplotlibError
        matplotlib is not installed.

    """
    leg = leg_of(given)
    feet = _closed(foot_path(leg, point=point))
    ax = axes_of(ax)
    from matplotlib.cbook import normalize_kwargs  # noqa: PLC0415 - as in `axes_of`
    from matplotlib.lines import Line2D  # noqa: PLC0415 - as above

    look: dict[str, Any] = {'color': PALE, 'linewidth': 1.5, 'zorder': 1}
    foot = leg.linkage.structure.foot
    look['label'] = foot if point is None else point if isinstance(point, str) else point[0]
    ax.plot(*feet.T, **look | normalize_kwargs(style, Line2D))
    label_plane(ax)
    return ax


def animate(
    given: Any, *, frames: int = 120, ax: 'Axes | None' = None, path: bool = True, **style: Any
) -> 'FuncAnimation':
    """
    Return a linkage in motion: once round, or to and fro over an arc of the crank.

    In a notebook `HTML(animate(leg).to_jshtml())` shows it, with `HTML` of `IPython.display`;
    `animate(leg).save('leg.gif', writer='pillow')` writes a file.

    Parameters
    ----------
    given : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.
    frames : int
        How many poses.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure where left out.
    path : bool
        Whether the path of the foot is drawn as well.
    **style
        `letters` and `width`, as of `plot_pose`.

    Returns
    -------
    matplotlib.animation.FuncAnimation
        The animation; keep it as long as it is to move.

    Raises
    ------
    NoFootPathError
        The crank reaches no angle.
    ValueError
        `frames` is no whole number of at least 2.
    TypeError
        `given` is none of these.
    NoMatplotlibError
        matplotlib is not installed.

    """
    leg = leg_of(given)
    frames = validation.count('frames', frames, FEWEST_FRAMES)
    poses = [leg.closed_form(alpha) for alpha in _crank_angles(leg, frames)]
    is_new = ax is None
    ax = axes_of(ax)
    from matplotlib.animation import FuncAnimation  # noqa: PLC0415 - as in `axes_of`

    if path:
        plot_foot_path(leg, ax=ax)
    drawn = PoseArtists(ax, poses[0], **style)
    label_plane(ax)
    ax.update_datalim(np.concatenate([pose.points for pose in poses]))
    ax.autoscale_view()
    ax.autoscale(enable=False)
    # Of a part of a figure the whole.
    whole: Any = ax.figure.figure
    if is_new:
        # Nothing needs other room from here on: to lay out each frame would take most of its time.
        whole.draw_without_rendering()
        whole.set_layout_engine('none')

    def show(frame: int) -> 'list[Artist]':
        return drawn.move(poses[frame])

    interval = TURN_TIME / frames
    return FuncAnimation(whole, show, frames=frames, interval=interval)


def _closed(path: FootPath) -> Array:
    """Return the points of a path, the first once more after a turn; NaN between arcs."""
    if path.full_turn:
        return np.vstack([path.h, path.h[:1]])
    nothing, parts = np.full((1, 2), np.nan), []
    for start, end in path.arcs:
        inside = (path.alphas >= start - SAME) & (path.alphas <= end + SAME)
        parts += [nothing, path.h[inside]]
    return np.concatenate(parts[1:])


def _crank_angles(leg: AnyLeg, count: int) -> list[float]:
    """Return crank angles of a turn, from 0 on; or of an arc, to and fro."""
    arcs = leg.reachable_arcs()
    if not arcs:
        raise NoFootPathError
    start, end = arcs[0]
    turned = TURN / count * np.arange(count)
    swung = start + (end - start) * (1.0 - np.cos(turned)) / 2.0
    angles: list[float] = (turned if end - start >= TURN else swung).tolist()
    return angles
