"""Plots in a linkage's plane: its pose, its foot path and both in motion; axes and labels."""

from math import degrees, remainder, tau
import re
from typing import Any, TYPE_CHECKING

from klann_ros.kinematics import (
    AnyLeg,
    as_linkage,
    foot_path,
    FootPath,
    Leg,
    LinkageLeg,
    LinkagePose,
    NoFootPathError,
    PoseDrawing,
    validation,
)
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .drawing import BAR_WIDTH, PoseArtists

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

GREY, PALE = '#555555', '#8d99ae'
# Below this angle its name is drawn beside it [deg].
MIN_LABEL_ANGLE = 25.0
GREEK = 'alpha|beta|gamma|delta|epsilon|zeta|eta|theta|kappa|lambda|mu|phi|psi|omega'
# Time of a turn of an animation [ms], and its least number of frames.
TURN_TIME, MIN_FRAMES = 4000, 2
# Tolerance between the ends of arcs and their samples [rad].
ARC_TOLERANCE = 1e-9


def plot_pose(
    given: Any,
    alpha: float | None = None,
    *,
    ax: 'Axes | None' = None,
    letters: bool = True,
    angles: bool = False,
    width: float = BAR_WIDTH,
) -> 'Axes':
    """
    Draw a linkage at a crank angle: bars, plates, joints and the letters of its points.

    A fixed pivot stands on hatched ground, a circle joins bodies, a dot is a point of one body.

    Parameters
    ----------
    given : Linkage, KlannGeometry, FourBarGeometry, leg or LinkagePose
        The linkage, or a pose of it.
    alpha : float, optional
        Crank angle [rad]; by default that of the pose, or the first reachable one.
    ax : matplotlib.axes.Axes, optional
        By default those of a new figure.
    letters, angles : bool
        Whether to label points, and to draw angles as arcs from the horizontal.
    width : float
        Width of the bars, to which the joints are scaled [points].

    Returns
    -------
    matplotlib.axes.Axes
        The axes, equally scaled, in metres; its lines are labelled with the bodies.

    Raises
    ------
    KinematicsError
        The linkage does not close at this crank angle.

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
    Draw the path of the foot, or of any point, over all reachable crank angles.

    Parameters
    ----------
    given : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.
    point : str, or (str, float, float), optional
        The point in place of the foot, as of `foot_path`: 'G', or ('theta3', u, v) for a coupler
        curve.
    ax : matplotlib.axes.Axes, optional
        By default those of a new figure.
    **style
        Of the line, such as `color` and `label`, by default the point's letter.

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
    Return the animation of a linkage: a turn of the crank, or back and forth over an arc.

    In a notebook `HTML(animate(leg).to_jshtml())` shows it, with `HTML` of `IPython.display`;
    `animate(leg).save('leg.gif', writer='pillow')` writes a file.

    Parameters
    ----------
    given : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.
    frames : int
        Number of poses.
    ax : matplotlib.axes.Axes, optional
        By default those of a new figure.
    path : bool
        Whether to draw the foot path.
    **style
        `letters` and `width`, as of `plot_pose`.

    Returns
    -------
    matplotlib.animation.FuncAnimation
        The animation; it runs while it is referenced.

    Raises
    ------
    NoFootPathError
        The crank reaches no angle.
    ValueError
        `frames` is no whole number of at least 2.

    """
    leg = leg_of(given)
    frames = validation.count('frames', frames, MIN_FRAMES)
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
    # The whole figure of a subfigure.
    whole: Any = ax.figure.figure
    if is_new:
        # The layout is final: to compute it for each frame would take most of the time.
        whole.draw_without_rendering()
        whole.set_layout_engine('none')

    def show(frame: int) -> 'list[Artist]':
        return drawn.move(poses[frame])

    interval = TURN_TIME / frames
    return FuncAnimation(whole, show, frames=frames, interval=interval)


def _closed(path: FootPath) -> FloatArray:
    """Return the points of a path, closed after a turn; NaN between arcs."""
    if path.full_turn:
        return np.vstack([path.h, path.h[:1]])
    nothing, parts = np.full((1, 2), np.nan), []
    for start, end in path.arcs:
        inside = (path.alphas >= start - ARC_TOLERANCE) & (path.alphas <= end + ARC_TOLERANCE)
        parts += [nothing, path.h[inside]]
    return np.concatenate(parts[1:])


def _crank_angles(leg: AnyLeg, count: int) -> list[float]:
    """Return crank angles of a turn from 0, or of an arc, back and forth."""
    arcs = leg.reachable_arcs()
    if not arcs:
        raise NoFootPathError
    start, end = arcs[0]
    turned = TURN / count * np.arange(count)
    swung = start + (end - start) * (1.0 - np.cos(turned)) / 2.0
    angles: list[float] = (turned if end - start >= TURN else swung).tolist()
    return angles


class NoMatplotlibError(ImportError):
    """Matplotlib is not installed."""

    def __str__(self) -> str:
        return "a plot needs matplotlib: pip install 'klann_ros[plot]'"


def axes_of(ax: 'Axes | None') -> 'Axes':
    """Return the axes, or those of a new figure; raises a NoMatplotlibError without matplotlib."""
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot as plt  # noqa: PLC0415 - optional, and slow to import
    except ImportError:
        raise NoMatplotlibError from None
    return plt.subplots(layout='constrained')[1]


def leg_of(given: Any) -> AnyLeg:
    """Return a leg, or the leg of a linkage; raises a TypeError for anything else."""
    return given if isinstance(given, Leg) else LinkageLeg(as_linkage(given))


def draw_angles(ax: 'Axes', pose: LinkagePose, radius: float) -> None:
    """
    Draw every body's angle as an arc of a radius [m] from the horizontal at its first point.

    Clockwise angles lead downwards.
    """
    drawn, structure = PoseDrawing.of(pose), pose.linkage.structure
    for body, angle in zip(structure.bodies, pose.joints, strict=True):
        if body.slides:
            continue
        turn = body.sense * remainder(angle, tau)
        at = drawn.points[body.bars[0].start]
        draw_angle(ax, at, radius, (0.0, degrees(turn)), symbol(body.angle))


def draw_angle(
    ax: 'Axes', at: Any, radius: float, ends: tuple[float, float], name: str, *, colour: str = GREY
) -> None:
    """Draw the arc between two directions [deg] around a point, its name outside the middle."""
    from matplotlib.patches import Arc  # noqa: PLC0415 - matplotlib is optional

    first, last = sorted(ends)
    x, y = at
    ax.add_patch(Arc((x, y), 2 * radius, 2 * radius, theta1=first, theta2=last, color=colour))
    if 0.0 in ends:
        ax.plot([x, x + 1.25 * radius], [y, y], ':', color=GREY, linewidth=1)
    # The name of a narrow angle is on the other side of its first line.
    narrow = last - first < MIN_LABEL_ANGLE
    half = np.radians(
        ends[0] - np.sign(ends[1] - ends[0]) * 15.0 if narrow else (first + last) / 2
    )
    where = (x + 1.45 * radius * np.cos(half), y + 1.45 * radius * np.sin(half))
    ax.annotate(name, where, ha='center', va='center', fontsize=12, color=colour)


def label_plane(ax: 'Axes') -> None:
    """Label and scale the axes of a linkage's plane."""
    ax.set(xlabel='x / m', ylabel='y / m', aspect='equal')
    size = np.array(ax.dataLim.size)
    if np.isfinite(size).all() and (size > 0.0).all():
        # Equal margins for the letters along both sides.
        ax.margins(*(0.13 * size.max() / size))
    grid(ax)


def grid(ax: 'Axes') -> None:
    """Draw a fine grid below the curves."""
    ax.grid(visible=True, linewidth=0.3)
    ax.set_axisbelow(True)


def symbol(name: str) -> str:
    """Return an angle's name as a formula: a Latin or Greek letter and a number."""
    found = re.fullmatch(rf'({GREEK}|[A-Za-z])_?(\d*)', name)
    if not found:
        # A dollar sign would start a formula.
        return name.replace('$', r'\$')
    letter, number = found.groups()
    sign = letter if len(letter) == 1 else rf'\{letter}'
    return f'${sign}_{{{number}}}$' if number else f'${sign}$'
