"""The leg drawn: bars, joints with their letters, and the path of the foot."""

from collections.abc import Sequence
from itertools import chain
from math import hypot
from typing import NamedTuple, TYPE_CHECKING

from klann_ros.kinematics import KlannPose, LinkagePose
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Bodies take the colours in turn; those of the Klann leg are crank, coupler, both rockers, leg.
COLOURS = ('#d1495b', '#30638e', '#7a9e7e', '#edae49', '#003d5b', '#8f5c38', '#66618c')


class Drawn(NamedTuple):
    """
    What a pose is drawn from.

    Attributes
    ----------
    points : dict of str to numpy.ndarray, shape (2,)
        Every point by its name [m].
    pivots : sequence of str
        Those that are fixed.
    bodies : list of (list of (str, str), str, str)
        Each body by its bars, with its name and colour.

    """

    points: dict[str, NDArray[np.float64]]
    pivots: Sequence[str]
    bodies: list[tuple[list[tuple[str, str]], str, str]]

    @classmethod
    def of(cls, pose: LinkagePose) -> 'Drawn':
        """Return what a pose is drawn from."""
        structure = pose.linkage.structure
        points = dict(zip(structure.points, pose.points, strict=True))
        bodies = [
            ([(bar.start, bar.end) for bar in body.bars], label, COLOURS[i % len(COLOURS)])
            for i, (body, label) in enumerate(zip(structure.bodies, structure.labels, strict=True))
        ]
        return cls(points, structure.pivots, bodies)


def draw_leg(axes: 'Axes', pose: LinkagePose) -> None:
    """Draw a pose: each body in its colour, the pivots as squares, every point's name."""
    drawn = Drawn.of(pose)
    points = drawn.points
    for bars, body, colour in drawn.bodies:
        line = _line(bars, points)
        axes.plot(*line.T, '-', color=colour, linewidth=4, solid_capstyle='round', label=body)
        if len(bars) > 1:
            # What is rigid is filled.
            corners = _around([points[name] for name in dict.fromkeys(chain(*bars))])
            axes.fill(*corners.T, color=colour, alpha=0.2, linewidth=0)
    for letter, (x, y) in points.items():
        free_x, free_y = _free_side(letter, drawn)
        marker = 's' if letter in drawn.pivots else 'o'
        axes.plot(x, y, marker, color='white', markeredgecolor='black', markersize=8, zorder=3)
        axes.annotate(
            letter,
            (x, y),
            xytext=(14.0 * free_x, 14.0 * free_y),
            textcoords='offset points',
            fontsize=12,
            ha='center',
            va='center',
        )


def _around(corners: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return points in the order in which they stand around their middle, shape (n, 2)."""
    array = np.array(corners)
    x, y = (array - array.mean(axis=0)).T
    ordered: NDArray[np.float64] = array[np.argsort(np.arctan2(y, x))]
    return ordered


def _line(
    bars: Sequence[tuple[str, str]], points: dict[str, NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Return the points along bars, shape (n, 2); a row of NaN where a bar starts elsewhere."""
    line = [points[bars[0][0]]]
    last = bars[0][0]
    for start, end in bars:
        if start != last:
            line += [np.full(2, np.nan), points[start]]
        line.append(points[end])
        last = end
    return np.array(line)


def _free_side(letter: str, drawn: Drawn) -> tuple[float, float]:
    """Return the unit vector away from the bars that meet at a point."""
    points = drawn.points
    along = (bar for bars, _, _ in drawn.bodies for bar in bars)
    ends = [q if p == letter else p for p, q in along if letter in (p, q)]
    bars = np.array([points[end] - points[letter] for end in ends]).reshape(-1, 2)
    x, y = -(bars / np.hypot(*bars.T)[:, np.newaxis]).sum(axis=0)
    size = hypot(x, y)
    # Two bars in line leave both sides free.
    return (x / size, y / size) if size > 0.1 else (0.0, 1.0)


def draw_angles(axes: 'Axes', pose: KlannPose, radius: float) -> None:
    """
    Draw the textbook's angles as arcs from the horizontal, with their names.

    gamma and theta are clockwise, so their arcs lead down from it. `radius` is in [m].
    """
    from matplotlib.patches import Arc  # noqa: PLC0415 - matplotlib is optional

    arcs = (
        ('A', r'$\alpha$', pose.alpha),
        ('D', r'$\beta$', pose.beta),
        ('B', r'$\gamma$', -pose.gamma),
        ('E', r'$\delta$', pose.delta),
        ('F', r'$\theta$', -pose.theta),
    )
    for letter, name, angle in arcs:
        x, y = pose.points['ABCDEFGH'.index(letter)]
        ends = sorted([0.0, float(np.degrees(angle))])
        size = 2.0 * radius
        axes.add_patch(Arc((x, y), size, size, theta1=ends[0], theta2=ends[1], color='#555555'))
        axes.plot([x, x + 1.2 * radius], [y, y], ':', color='#555555', linewidth=1)
        half = angle / 2.0
        where = (x + 1.5 * radius * np.cos(half), y + 1.5 * radius * np.sin(half))
        axes.annotate(name, where, ha='center', va='center', fontsize=13)


def draw_foot_path(axes: 'Axes', feet: NDArray[np.float64], label: str) -> None:
    """Draw the path of the foot H, shape (n, 2) [m]."""
    axes.plot(*feet.T, '-', color='#8d99ae', linewidth=1.5, label=label, zorder=0)


def label_plane(axes: 'Axes', title: str) -> None:
    """Name the axes of the leg's plane, equally scaled."""
    axes.set(title=title, xlabel='x / m', ylabel='y / m', aspect='equal')
    axes.margins(0.08)
    axes.grid(visible=True, linewidth=0.3)
    axes.legend(fontsize='small', frameon=False, loc='center left', bbox_to_anchor=(1.0, 0.5))
