"""A pose on matplotlib's axes: bodies, joints as in textbooks, letters and angles."""

from math import degrees, remainder, tau
import re
from typing import Any, TYPE_CHECKING

from klann_ros.kinematics import LinkagePose
import numpy as np

from .drawn import Drawn, DrawnBody, line_directions, PIN, PIVOT, POINT

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

GREY, PALE = '#555555', '#8d99ae'
WIDTH = 4.0
# An angle too narrow for its name [deg].
NARROW = 25.0
GREEK = 'alpha|beta|gamma|delta|epsilon|zeta|eta|theta|kappa|lambda|mu|phi|psi|omega'


class PoseArtists:
    """
    A pose drawn on axes, and drawn anew when it moves.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Where it is drawn.
    pose : LinkagePose
        The pose.
    letters : bool
        Whether every point's name is written beside it.
    width : float
        Width of the bars, by which the joints' sizes go [points].

    Attributes
    ----------
    bodies : list of matplotlib.lines.Line2D
        The bars of each body.
    plates : list of matplotlib.patches.Polygon
        What of the bodies is more than a bar.
    guides : list of matplotlib.lines.Line2D
        The lines that bodies slide along.
    blocks : list of matplotlib.patches.Polygon
        What slides along them.
    joints : dict of str to matplotlib.lines.Line2D
        The joints by their kind.
    letters : dict of str to matplotlib.text.Annotation
        The points' names.

    """

    def __init__(
        self, ax: 'Axes', pose: LinkagePose, *, letters: bool = True, width: float = WIDTH
    ) -> None:
        drawn = Drawn.of(pose)
        self.bodies, self.plates = [], []
        for body in drawn.bodies:
            style: dict[str, Any] = {'color': body.colour, 'solid_capstyle': 'round'}
            line = ax.plot(*drawn.line(body).T, lw=width, label=body.label, **style)
            self.bodies += line
            if len(body.points) > 2:
                # What is rigid is filled.
                self.plates += ax.fill(*drawn.outline(body).T, color=body.colour, alpha=0.2, lw=0)
        self.guides, self.blocks = [], []
        for body, guide, block in _sliding(drawn, pose):
            self.guides += ax.plot(*guide.T, '--', color=body.colour, lw=0.35 * width, zorder=1)
            at = drawn.at(body.line[1:] if body.line else ())
            self.blocks += ax.plot(*at.T, marker=block, **_block_style(body, width))
        self.joints = {
            kind: ax.plot(*drawn.at(names).T, ls='', zorder=3, **_joint_style(kind, width))[0]
            for kind, names in drawn.joints.items()
        }
        beside: dict[str, Any] = {
            'textcoords': 'offset points',
            'ha': 'center',
            'va': 'center',
            'zorder': 4,
        }
        self._far = 10.0 + width
        self.letters = {
            name: ax.annotate(
                name,
                tuple(at),
                xytext=self._offset(drawn, name),
                fontsize=9 + 0.75 * width,
                **beside,
            )
            for name, at in (drawn.points.items() if letters else ())
        }

    def move(self, pose: LinkagePose) -> 'list[Artist]':
        """Draw another pose of the linkage instead; return what has moved."""
        drawn = Drawn.of(pose)
        for line, body in zip(self.bodies, drawn.bodies, strict=True):
            line.set_data(*drawn.line(body).T)
        rigid = (body for body in drawn.bodies if len(body.points) > 2)
        for plate, body in zip(self.plates, rigid, strict=True):
            plate.set_xy(drawn.outline(body))
        sliding = zip(self.guides, self.blocks, _sliding(drawn, pose), strict=True)
        for guide, block, (body, ends, marker) in sliding:
            guide.set_data(*ends.T)
            block.set_data(*drawn.at(body.line[1:] if body.line else ()).T)
            block.set_marker(marker)
        for kind, joint in self.joints.items():
            joint.set_data(*drawn.at(drawn.joints[kind]).T)
        for name, letter in self.letters.items():
            letter.xy = tuple(drawn.points[name])
            letter.set_position(self._offset(drawn, name))
        moved = [*self.plates, *self.bodies, *self.guides, *self.blocks]
        return [*moved, *self.joints.values(), *self.letters.values()]

    def _offset(self, drawn: Drawn, name: str) -> tuple[float, float]:
        x, y = drawn.free_side(name)
        is_block = any(body.line and body.line[1] == name for body in drawn.bodies)
        far = self._far * (1.3 if is_block else 1.0)
        return far * x, far * y


def _sliding(drawn: Drawn, pose: LinkagePose) -> list[tuple[DrawnBody, Any, Any]]:
    """Return each body that slides, with its line's ends and its block as a marker."""
    bodies = [body for body in drawn.bodies if body.line]
    return [
        (body, drawn.guide(body, direction), _block(direction))
        for body, direction in zip(bodies, line_directions(pose), strict=True)
    ]


def _joint_style(kind: str, width: float) -> dict[str, Any]:
    """Return how a kind of joint is drawn: the one place that knows."""
    ink: dict[str, Any] = {'color': 'white', 'markeredgecolor': 'black'}
    styles: dict[str, dict[str, Any]] = {
        PIVOT: {**ink, 'marker': _support(), 'markersize': 7.0 * width},
        PIN: {**ink, 'marker': 'o', 'markersize': 2.0 * width},
        POINT: {'color': 'black', 'marker': 'o', 'markersize': 1.2 * width},
    }
    return styles[kind]


def _block_style(body: DrawnBody, width: float) -> dict[str, Any]:
    """Return how the block of a sliding joint is drawn."""
    edge = {'markeredgecolor': body.colour, 'markeredgewidth': 0.4 * width}
    return {'color': 'white', 'markersize': 5.0 * width, 'ls': '', 'zorder': 2.5, **edge}


def _block(direction: complex) -> Any:
    """Return a block that lies along a line."""
    from matplotlib.path import Path  # noqa: PLC0415 - matplotlib is optional

    corners = np.array([-1 - 0.55j, 1 - 0.55j, 1 + 0.55j, -1 + 0.55j, -1 - 0.55j]) * direction
    return Path(np.column_stack([corners.real, corners.imag]), closed=True)


def _support() -> Any:
    """Return the textbooks' fixed pivot: a pin on a triangle that stands on hatched ground."""
    from matplotlib.path import Path  # noqa: PLC0415 - matplotlib is optional

    triangle = [(-0.42, -0.72), (0.0, 0.0), (0.42, -0.72)]
    ground = [(-0.7, -0.72), (0.7, -0.72)]
    hatches = [[(x, -0.72), (x - 0.22, -1.0)] for x in (-0.4, -0.1, 0.2, 0.5)]
    lines = [[*triangle, triangle[0]], ground, *hatches]
    return Path.make_compound_path(*(Path(line) for line in lines), Path.circle((0, 0), 0.24))


def draw_angles(ax: 'Axes', pose: LinkagePose, radius: float) -> None:
    """
    Draw every body's angle as an arc from the horizontal where its first bar starts.

    Clockwise angles lead down from it. `radius` is in [m].
    """
    drawn, structure = Drawn.of(pose), pose.linkage.structure
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
    # Beside a narrow angle, where it would lie on the lines: on the other side of the first.
    narrow = last - first < NARROW
    half = np.radians(
        ends[0] - np.sign(ends[1] - ends[0]) * 15.0 if narrow else (first + last) / 2
    )
    where = (x + 1.45 * radius * np.cos(half), y + 1.45 * radius * np.sin(half))
    ax.annotate(name, where, ha='center', va='center', fontsize=12, color=colour)


def label_plane(ax: 'Axes') -> None:
    """Name the axes of a linkage's plane, equally scaled."""
    ax.set(xlabel='x / m', ylabel='y / m', aspect='equal')
    size = np.array(ax.dataLim.size)
    if np.isfinite(size).all() and (size > 0.0).all():
        # Letters stand beyond the points: as far along the shorter side as along the longer.
        ax.margins(*(0.13 * size.max() / size))
    grid(ax)


def grid(ax: 'Axes') -> None:
    """Draw a fine grid beneath."""
    ax.grid(visible=True, linewidth=0.3)
    ax.set_axisbelow(True)


def legend_beside(ax: 'Axes') -> None:
    """Draw the legend to the right of the axes, where it hides nothing."""
    ax.legend(fontsize='small', frameon=False, loc='center left', bbox_to_anchor=(1.0, 0.5))


def symbol(name: str) -> str:
    """Return an angle's name as it is written in formulas: a letter, Greek too, and a number."""
    found = re.fullmatch(rf'({GREEK}|[A-Za-z])_?(\d*)', name)
    if not found:
        # A dollar sign would start a formula.
        return name.replace('$', r'\$')
    letter, number = found.groups()
    sign = letter if len(letter) == 1 else rf'\{letter}'
    return f'${sign}_{{{number}}}$' if number else f'${sign}$'
