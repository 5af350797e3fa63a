"""Plots in a linkage's plane: its pose, its foot path and both in motion; axes and labels."""

from math import degrees, remainder, tau
import re
from typing import Any, TYPE_CHECKING

from klann_ros.kinematics import (
    AnyLeg,
    as_linkage,
    drawing,
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
from klann_ros.kinematics.arrays import FloatArray, plane_vectors
from klann_ros.missing_package import install_command
import numpy as np

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

# Default width of a bar [points].
BAR_WIDTH = 4.0


class PoseArtists:
    """
    The artists of a pose on axes, updated when it moves.

    Lines for bars, guides and the joints by their kind, polygons for the plates of bodies with
    more than two points, markers for sliding blocks, and the points' names as annotations. `width`
    is the width of the bars, to which the joints are scaled [points].
    """

    def __init__(
        self, ax: 'Axes', pose: LinkagePose, *, letters: bool = True, width: float = BAR_WIDTH
    ) -> None:
        pose_drawing = drawing.PoseDrawing.of(pose)
        # Distance of a letter from its point [points].
        self._letter_distance = 10.0 + width
        self.bodies: list[Any] = []
        self.plates: list[Any] = []
        self.guides: list[Any] = []
        self.blocks: list[Any] = []
        for body in pose_drawing.bodies:
            colour: dict[str, Any] = {'color': body.colour}
            style: dict[str, Any] = {'lw': width, 'solid_capstyle': 'round'}
            self.bodies += ax.plot([], **colour, label=body.label, **style)
            if len(body.points) > 2:
                self.plates += ax.fill(*pose_drawing.outline(body).T, **colour, alpha=0.2, lw=0)
            if body.line:
                self.guides += ax.plot([], ls='--', **colour, lw=0.35 * width, zorder=1)
                self.blocks += ax.plot([], **_block_style(body, width))
        self.joints = {}
        for kind in pose_drawing.joints:
            (self.joints[kind],) = ax.plot([], ls='', zorder=3, **_joint_style(kind, width))
        letter_style: dict[str, Any] = {'ha': 'center', 'va': 'center', 'zorder': 4}
        letter_style |= {'xytext': (0.0, 0.0), 'textcoords': 'offset points'}
        letter_style['fontsize'] = 9 + 0.75 * width
        self.letters = {}
        for name in pose_drawing.points if letters else ():
            self.letters[name] = ax.annotate(name, (0.0, 0.0), **letter_style)
        self.move(pose)
        ax.relim()
        ax.autoscale_view()

    def move(self, pose: LinkagePose) -> 'list[Artist]':
        """Show another pose of the linkage; return the moved artists."""
        pose_drawing = drawing.PoseDrawing.of(pose)
        for line, body in zip(self.bodies, pose_drawing.bodies, strict=True):
            line.set_data(*pose_drawing.line(body).T)
        rigid = [body for body in pose_drawing.bodies if len(body.points) > 2]
        for plate, body in zip(self.plates, rigid, strict=True):
            plate.set_xy(pose_drawing.outline(body))
        sliding = [body for body in pose_drawing.bodies if body.line]
        for k, direction in enumerate(drawing.line_directions(pose)):
            guide_ends = pose_drawing.guide(sliding[k], direction)
            self.guides[k].set_data(*guide_ends.T)
            block_points = (sliding[k].line or ())[1:]
            self.blocks[k].set_data(*pose_drawing.at(block_points).T)
            self.blocks[k].set_marker(_block(direction))
        for kind, joint in self.joints.items():
            joint.set_data(*pose_drawing.at(pose_drawing.joints[kind]).T)
        for name, letter in self.letters.items():
            letter.xy = tuple(pose_drawing.points[name])
            letter.set_position(self._letter_offset(pose_drawing, name))
        shapes = [*self.plates, *self.bodies, *self.guides, *self.blocks]
        return [*shapes, *self.joints.values(), *self.letters.values()]

    def _letter_offset(self, pose_drawing: drawing.PoseDrawing, name: str) -> tuple[float, float]:
        """Return the offset of a letter from its point [points]."""
        x, y = pose_drawing.free_side(name)
        is_block = any(body.line and body.line[1] == name for body in pose_drawing.bodies)
        distance = self._letter_distance * (1.3 if is_block else 1.0)
        return distance * x, distance * y


def _joint_style(kind: str, width: float) -> dict[str, Any]:
    ink: dict[str, Any] = {'color': 'white', 'markeredgecolor': 'black'}
    styles: dict[str, dict[str, Any]] = {
        drawing.PIVOT: {**ink, 'marker': _support(), 'markersize': 7.0 * width},
        drawing.PIN: {**ink, 'marker': 'o', 'markersize': 2.0 * width},
        drawing.POINT: {'color': 'black', 'marker': 'o', 'markersize': 1.2 * width},
    }
    return styles[kind]


def _block_style(body: drawing.BodyDrawing, width: float) -> dict[str, Any]:
    edge = {'markeredgecolor': body.colour, 'markeredgewidth': 0.4 * width}
    return {'color': 'white', 'markersize': 5.0 * width, 'ls': '', 'zorder': 2.5, **edge}


def _block(direction: complex) -> Any:
    from matplotlib.path import Path  # noqa: PLC0415 - matplotlib is optional

    corners = np.array([-1 - 0.55j, 1 - 0.55j, 1 + 0.55j, -1 + 0.55j, -1 - 0.55j]) * direction
    return Path(plane_vectors(corners), closed=True)


def _support() -> Any:
    """Return the textbooks' fixed pivot: a pin on a triangle on hatched ground."""
    from matplotlib.path import Path  # noqa: PLC0415 - matplotlib is optional

    triangle = [(-0.42, -0.72), (0.0, 0.0), (0.42, -0.72)]
    ground = [(-0.7, -0.72), (0.7, -0.72)]
    hatches = [[(x, -0.72), (x - 0.22, -1.0)] for x in (-0.4, -0.1, 0.2, 0.5)]
    lines = [[*triangle, triangle[0]], ground, *hatches]
    return Path.make_compound_path(*(Path(line) for line in lines), Path.circle((0, 0), 0.24))


GREY = '#555555'
PALE_BLUE = '#8d99ae'
# Below this angle its name is drawn beside it [deg].
MIN_LABEL_ANGLE = 25.0
GREEK = 'alpha|beta|gamma|delta|epsilon|zeta|eta|theta|kappa|lambda|mu|phi|psi|omega'
# Time of a turn of an animation [ms].
TURN_TIME = 4000
MIN_FRAMES = 2
# Tolerance between the ends of arcs and their samples [rad].
ARC_TOLERANCE = 1e-9


def plot_pose(
    linkage: Any,
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
    linkage : Linkage, KlannGeometry, FourBarGeometry, leg or LinkagePose
        The linkage, or a pose of it.
    alpha : float, optional
        Crank angle [rad]; by default the pose's, or the first reachable one.
    ax : matplotlib.axes.Axes, optional
        The axes; by default the axes of a new figure.
    letters, angles : bool
        Whether to label points, and to draw angles as arcs from the horizontal.
    width : float
        Width of the bars, to which the joints are scaled [points].

    Returns
    -------
    matplotlib.axes.Axes
        The axes, equally scaled, in the unit of the lengths; its lines are labelled with
        the bodies.

    Raises
    ------
    KinematicsError
        The linkage does not close at this crank angle.

    """
    if isinstance(linkage, LinkagePose) and alpha is None:
        pose = linkage
    else:
        leg = leg_of(linkage)
        pose = leg.closed_form(_crank_angles(leg, 1)[0] if alpha is None else alpha)
    ax = axes_of(ax)
    PoseArtists(ax, pose, letters=letters, width=width)
    if angles:
        draw_angles(ax, pose, radius=0.08 * float(np.ptp(pose.points, axis=0).max()))
    label_plane(ax, pose.linkage.structure.unit)
    return ax


def plot_foot_path(
    linkage: Any,
    *,
    point: str | tuple[str, float, float] | None = None,
    ax: 'Axes | None' = None,
    **style: Any,
) -> 'Axes':
    """
    Draw the path of the foot, or of any point, over all reachable crank angles.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.
    point : str, or (str, float, float), optional
        The point in place of the foot, as of `foot_path`: 'G', or ('theta3', u, v) for a coupler
        curve.
    ax : matplotlib.axes.Axes, optional
        The axes; by default the axes of a new figure.
    **style
        Properties of the line, such as `color` and `label`, by default the point's letter.

    Returns
    -------
    matplotlib.axes.Axes
        The axes, equally scaled, in the unit of the lengths.

    Raises
    ------
    NoFootPathError
        The crank reaches no angle.
    GeometryError
        There is no such point.

    """
    leg = leg_of(linkage)
    feet = _closed_path(foot_path(leg, point=point))
    ax = axes_of(ax)
    from matplotlib.cbook import normalize_kwargs  # noqa: PLC0415 - as in `axes_of`
    from matplotlib.lines import Line2D  # noqa: PLC0415 - as in `axes_of`

    default_style: dict[str, Any] = {'color': PALE_BLUE, 'linewidth': 1.5, 'zorder': 1}
    foot = leg.linkage.structure.foot if point is None else point
    default_style['label'] = foot if isinstance(foot, str) else foot[0]
    ax.plot(*feet.T, **default_style | normalize_kwargs(style, Line2D))
    label_plane(ax, leg.linkage.structure.unit)
    return ax


def animate(
    linkage: Any, *, frames: int = 120, ax: 'Axes | None' = None, path: bool = True, **style: Any
) -> 'FuncAnimation':
    """
    Return the animation of a linkage: a turn of the crank, or back and forth over an arc.

    In a notebook `HTML(animate(leg).to_jshtml())` shows it, with `HTML` of `IPython.display`;
    `animate(leg).save('leg.gif', writer='pillow')` writes a file.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.
    frames : int
        Number of poses.
    ax : matplotlib.axes.Axes, optional
        The axes; by default the axes of a new figure.
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
    leg = leg_of(linkage)
    frames = validation.whole_number('frames', frames, MIN_FRAMES)
    poses = [leg.closed_form(alpha) for alpha in _crank_angles(leg, frames)]
    is_new = ax is None
    ax = axes_of(ax)
    from matplotlib.animation import FuncAnimation  # noqa: PLC0415 - as in `axes_of`

    if path:
        plot_foot_path(leg, ax=ax)
    artists = PoseArtists(ax, poses[0], **style)
    label_plane(ax, leg.linkage.structure.unit)
    ax.update_datalim(np.concatenate([pose.points for pose in poses]))
    ax.autoscale_view()
    ax.autoscale(enable=False)
    # The figure that a subfigure belongs to.
    root_figure: Any = ax.figure.figure
    if is_new:
        # The layout is final: to compute it for each frame would take most of the time.
        root_figure.draw_without_rendering()
        root_figure.set_layout_engine('none')
    interval = TURN_TIME / frames
    return FuncAnimation(
        root_figure, lambda frame: artists.move(poses[frame]), frames=frames, interval=interval
    )


def _closed_path(path: FootPath) -> FloatArray:
    """Return the points of a path, closed after a turn; NaN between arcs."""
    if path.full_turn:
        return np.vstack([path.h, path.h[:1]])
    gap = np.full((1, 2), np.nan)
    lines = []
    for start, end in path.arcs:
        inside = (path.alphas >= start - ARC_TOLERANCE) & (path.alphas <= end + ARC_TOLERANCE)
        lines += [gap, path.h[inside]]
    return np.concatenate(lines[1:])


def _crank_angles(leg: AnyLeg, count: int) -> list[float]:
    """Return crank angles of a turn from 0, or several, or of an arc, back and forth."""
    arcs = leg.path_arcs()
    if not arcs:
        raise NoFootPathError
    start, end = arcs[0]
    shares = np.arange(count) / count
    if end - start < TURN:
        shares = (1.0 - np.cos(TURN * shares)) / 2.0
    angles = start + (end - start) * shares
    crank_angles: list[float] = angles.tolist()
    return crank_angles


class NoMatplotlibError(ImportError):
    """Matplotlib is not installed."""


def axes_of(ax: 'Axes | None') -> 'Axes':
    """Return the axes, or a new figure's; raises a NoMatplotlibError without matplotlib."""
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot as plt  # noqa: PLC0415 - optional, and slow to import
    except ImportError:
        remedy = install_command('matplotlib', 'plot')
        raise NoMatplotlibError(f'a plot needs matplotlib: {remedy}') from None
    return plt.subplots(layout='constrained')[1]


def leg_of(linkage: Any) -> AnyLeg:
    """Return a leg, or the leg of a linkage; raises a TypeError for anything else."""
    return linkage if isinstance(linkage, Leg) else LinkageLeg(as_linkage(linkage))


def draw_angles(ax: 'Axes', pose: LinkagePose, radius: float) -> None:
    """
    Draw every body's angle as an arc of a radius [m] from the horizontal at its first point.

    Clockwise angles lead downwards.
    """
    points = PoseDrawing.of(pose).points
    for body, angle in zip(pose.linkage.structure.bodies, pose.joints, strict=True):
        if body.slides:
            continue
        direction = degrees(body.sense * remainder(angle, tau))
        first_point = points[body.bars[0].start]
        draw_angle(ax, first_point, radius, (0.0, direction), symbol(body.angle))


def draw_angle(
    ax: 'Axes',
    centre: Any,
    radius: float,
    ends: tuple[float, float],
    name: str,
    *,
    colour: str = GREY,
) -> None:
    """Draw the arc between two directions [deg] around a point, its name outside the middle."""
    from matplotlib.patches import Arc  # noqa: PLC0415 - matplotlib is optional

    first, last = sorted(ends)
    x, y = centre
    ax.add_patch(Arc((x, y), 2 * radius, 2 * radius, theta1=first, theta2=last, color=colour))
    if 0.0 in ends:
        ax.plot([x, x + 1.25 * radius], [y, y], ':', color=GREY, linewidth=1)
    if last - first < MIN_LABEL_ANGLE:
        # The name of a narrow angle is on the other side of its first line.
        label_direction = np.radians(ends[0] - np.sign(ends[1] - ends[0]) * 15.0)
    else:
        label_direction = np.radians((first + last) / 2)
    label_x = x + 1.45 * radius * np.cos(label_direction)
    label_y = y + 1.45 * radius * np.sin(label_direction)
    ax.annotate(name, (label_x, label_y), ha='center', va='center', fontsize=12, color=colour)


def label_plane(ax: 'Axes', unit: str = 'm') -> None:
    """Label and scale the axes of a linkage's plane."""
    ax.set(xlabel=axis_label('x', unit), ylabel=axis_label('y', unit), aspect='equal')
    size = np.array(ax.dataLim.size)
    if np.isfinite(size).all() and (size > 0.0).all():
        # Equal margins for the letters along both sides.
        ax.margins(*(0.13 * size.max() / size))
    grid(ax)


def axis_label(name: str, unit: str) -> str:
    """Return the label of an axis, 'x / m'; the name alone without a unit."""
    return f'{name} / {unit}' if unit else name


def grid(ax: 'Axes') -> None:
    """Draw a fine grid below the curves."""
    ax.grid(visible=True, linewidth=0.3)
    ax.set_axisbelow(True)


def symbol(name: str) -> str:
    """Return an angle's name as a formula: a Latin or Greek letter and a number."""
    match = re.fullmatch(rf'({GREEK}|[A-Za-z])_?(\d*)', name)
    if not match:
        # A dollar sign would start a formula.
        return name.replace('$', r'\$')
    letter, number = match.groups()
    formula = letter if len(letter) == 1 else rf'\{letter}'
    return f'${formula}_{{{number}}}$' if number else f'${formula}$'
