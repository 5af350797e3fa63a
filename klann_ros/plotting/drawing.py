"""
The drawing of a pose: its points, bodies and joints, and matplotlib's artists for them.

`PoseDrawing` needs no matplotlib; markers and URDF use it as well.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, radians, sin, tau
from typing import Any, NamedTuple, TYPE_CHECKING

from klann_ros.kinematics import LinkagePose
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

# Default width of a bar [points].
BAR_WIDTH = 4.0
# Colours of the bodies, repeated; of a Klann leg: crank, coupler, both rockers, leg.
COLOURS = ('#d1495b', '#30638e', '#7a9e7e', '#edae49', '#003d5b', '#8f5c38', '#66618c')
# Kinds of points: a fixed pivot, a pin between bodies, a point of one body. Sliding joints are
# drawn as a block on a line.
PIVOT, PIN, POINT = 'pivot', 'pin', 'point'
# Extension of a line beyond both its points, relative to the size of the drawing.
LINE_EXTENSION = 0.1
# Directions of the ground from a pivot [rad].
SUPPORT_DIRECTIONS = (radians(225.0), radians(315.0))


class BodyDrawing(NamedTuple):
    """The drawing of a body."""

    # Its bars, by their points.
    bars: list[tuple[str, str]]
    label: str
    colour: str
    # The line of a sliding body: from a point of the line's body to its own first.
    line: tuple[str, str] | None = None

    @property
    def points(self) -> list[str]:
        """Return its unique points."""
        return list(dict.fromkeys(name for bar in self.bars for name in bar))

    @property
    def strokes(self) -> list[tuple[str, str]]:
        """Return its line and its bars."""
        return [*([self.line] if self.line else ()), *self.bars]


class PoseDrawing(NamedTuple):
    """The points, bodies and joints of a pose."""

    # Every point by its name [m], shape (2,) each.
    points: dict[str, FloatArray]
    # The bodies, the crank first.
    bodies: list[BodyDrawing]
    # The points by the kind of their joint: PIVOT, PIN and POINT.
    joints: dict[str, list[str]]

    @classmethod
    def of(cls, pose: LinkagePose) -> 'PoseDrawing':
        """Return the drawing of a pose."""
        structure = pose.linkage.structure
        points = dict(zip(structure.points, pose.points, strict=True))
        bodies = [
            BodyDrawing(
                [(bar.start, bar.end) for bar in body.rigid],
                label,
                colour_of(i),
                (body.line.start, body.line.end) if body.line else None,
            )
            for i, (body, label) in enumerate(zip(structure.bodies, structure.labels, strict=True))
        ]
        joints: dict[str, list[str]] = {PIVOT: [], PIN: [], POINT: []}
        for name in points:
            several = len(structure.owners[name]) > 1
            kind = PIVOT if name in structure.pivots else PIN if several else POINT
            joints[kind].append(name)
        return cls(points, bodies, joints)

    @property
    def pivots(self) -> Sequence[str]:
        """Return the fixed pivots."""
        return self.joints[PIVOT]

    def at(self, names: Sequence[str]) -> FloatArray:
        """Return points, shape (n, 2) [m]."""
        return np.array([self.points[name] for name in names]).reshape(-1, 2)

    def line(self, body: BodyDrawing) -> FloatArray:
        """Return the points along a body's bars, shape (n, 2); NaN between disconnected bars."""
        if not body.bars:
            return np.empty((0, 2))
        last, *_ = body.bars[0]
        line = [self.points[last]]
        for start, end in body.bars:
            if start != last:
                line += [np.full(2, np.nan), self.points[start]]
            line.append(self.points[end])
            last = end
        return np.array(line)

    def outline(self, body: BodyDrawing) -> FloatArray:
        """Return a body's points, ordered around their centre."""
        corners = self.at(body.points)
        x, y = (corners - corners.mean(axis=0)).T
        ordered: FloatArray = corners[np.argsort(np.arctan2(y, x))]
        return ordered

    @property
    def size(self) -> float:
        """Return the larger side of the drawing [m]."""
        return float(np.ptp([*self.points.values()], axis=0).max())

    def guide(self, body: BodyDrawing, direction: complex) -> FloatArray:
        """Return the ends of a sliding body's line, extended beyond both points."""
        start, end = (complex(*self.points[name]) for name in body.line or ())
        beyond = LINE_EXTENSION * self.size * direction
        first, last = sorted((start, end), key=lambda at: (at * direction.conjugate()).real)
        return np.array([(at.real, at.imag) for at in (first - beyond, last + beyond)])

    def free_side(self, name: str) -> tuple[float, float]:
        """Return the direction at a point farthest from its bars and its support."""
        bars = [bar for body in self.bodies for bar in body.strokes if name in bar]
        ends = [self.points[q if p == name else p] - self.points[name] for p, q in bars]
        lines = [body.line[::-1] for body in self.bodies if body.line and body.line[1] == name]
        # A block extends to both sides of its point.
        ends += [self.points[p] - self.points[q] for p, q in lines]
        # A body at the start of its line has no direction along it.
        ends = [end for end in ends if end.any()]
        taken = [atan2(y, x) % tau for x, y in ends]
        taken = sorted([*taken, *(SUPPORT_DIRECTIONS if name in self.pivots else ())]) or [0.0]
        gaps = [(b - a, (a + b) / 2.0) for a, b in pairwise([*taken, taken[0] + tau])]
        _, middle = max(gaps)
        return cos(middle), sin(middle)


def line_directions(pose: LinkagePose) -> list[complex]:
    """Return the direction of each sliding body's line, in the bodies' order."""
    linkage, u = pose.linkage, pose.vectors
    return [complex(linkage.line(u, j)) for j in sorted(linkage.structure.line_of)]


def colour_of(body: int) -> str:
    """Return the colour of a body, by its number."""
    return COLOURS[body % len(COLOURS)]


class PoseArtists:
    """
    The artists of a pose on axes, updated when it moves.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        The axes.
    pose : LinkagePose
        The pose.
    letters : bool
        Whether to label the points.
    width : float
        Width of the bars, to which the joints are scaled [points].

    Attributes
    ----------
    bodies : list of matplotlib.lines.Line2D
        The bars of each body.
    plates : list of matplotlib.patches.Polygon
        The bodies with more than two points.
    guides : list of matplotlib.lines.Line2D
        The lines of sliding bodies.
    blocks : list of matplotlib.patches.Polygon
        The blocks on these lines.
    joints : dict of str to matplotlib.lines.Line2D
        The joints by their kind.
    letters : dict of str to matplotlib.text.Annotation
        The points' names.

    """

    def __init__(
        self, ax: 'Axes', pose: LinkagePose, *, letters: bool = True, width: float = BAR_WIDTH
    ) -> None:
        drawn = PoseDrawing.of(pose)
        self.bodies, self.plates = [], []
        for body in drawn.bodies:
            style: dict[str, Any] = {'color': body.colour, 'solid_capstyle': 'round'}
            line = ax.plot(*drawn.line(body).T, lw=width, label=body.label, **style)
            self.bodies += line
            if len(body.points) > 2:
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
        """Show another pose of the linkage; return the moved artists."""
        drawn = PoseDrawing.of(pose)
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
        changed = [*self.plates, *self.bodies, *self.guides, *self.blocks]
        return [*changed, *self.joints.values(), *self.letters.values()]

    def _offset(self, drawn: PoseDrawing, name: str) -> tuple[float, float]:
        x, y = drawn.free_side(name)
        is_block = any(body.line and body.line[1] == name for body in drawn.bodies)
        far = self._far * (1.3 if is_block else 1.0)
        return far * x, far * y


def _sliding(drawn: PoseDrawing, pose: LinkagePose) -> list[tuple[BodyDrawing, Any, Any]]:
    """Return each sliding body, with its line's ends and its block as a marker."""
    bodies = [body for body in drawn.bodies if body.line]
    return [
        (body, drawn.guide(body, direction), _block(direction))
        for body, direction in zip(bodies, line_directions(pose), strict=True)
    ]


def _joint_style(kind: str, width: float) -> dict[str, Any]:
    ink: dict[str, Any] = {'color': 'white', 'markeredgecolor': 'black'}
    styles: dict[str, dict[str, Any]] = {
        PIVOT: {**ink, 'marker': _support(), 'markersize': 7.0 * width},
        PIN: {**ink, 'marker': 'o', 'markersize': 2.0 * width},
        POINT: {'color': 'black', 'marker': 'o', 'markersize': 1.2 * width},
    }
    return styles[kind]


def _block_style(body: BodyDrawing, width: float) -> dict[str, Any]:
    edge = {'markeredgecolor': body.colour, 'markeredgewidth': 0.4 * width}
    return {'color': 'white', 'markersize': 5.0 * width, 'ls': '', 'zorder': 2.5, **edge}


def _block(direction: complex) -> Any:
    from matplotlib.path import Path  # noqa: PLC0415 - matplotlib is optional

    corners = np.array([-1 - 0.55j, 1 - 0.55j, 1 + 0.55j, -1 + 0.55j, -1 - 0.55j]) * direction
    return Path(np.column_stack([corners.real, corners.imag]), closed=True)


def _support() -> Any:
    """Return the textbooks' fixed pivot: a pin on a triangle on hatched ground."""
    from matplotlib.path import Path  # noqa: PLC0415 - matplotlib is optional

    triangle = [(-0.42, -0.72), (0.0, 0.0), (0.42, -0.72)]
    ground = [(-0.7, -0.72), (0.7, -0.72)]
    hatches = [[(x, -0.72), (x - 0.22, -1.0)] for x in (-0.4, -0.1, 0.2, 0.5)]
    lines = [[*triangle, triangle[0]], ground, *hatches]
    return Path.make_compound_path(*(Path(line) for line in lines), Path.circle((0, 0), 0.24))
