"""The drawing of a pose by matplotlib's artists."""

from typing import Any, TYPE_CHECKING

from klann_ros.kinematics import drawing, LinkagePose
import numpy as np

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

# Default width of a bar [points].
BAR_WIDTH = 4.0


class PoseArtists:
    """
    The artists of a pose on axes, updated when it moves.

    Lines for bars, guides and the joints by their kind, polygons for the plates of bodies with
    more than two points, markers for sliding blocks, and the points' names as annotations. `width`
    is that of the bars, to which the joints are scaled [points].
    """

    def __init__(
        self, ax: 'Axes', pose: LinkagePose, *, letters: bool = True, width: float = BAR_WIDTH
    ) -> None:
        drawn = drawing.PoseDrawing.of(pose)
        self._far = 10.0 + width
        self.bodies, self.plates, self.guides, self.blocks = [], [], [], []
        for body in drawn.bodies:
            colour: dict[str, Any] = {'color': body.colour}
            style: dict[str, Any] = {'lw': width, 'solid_capstyle': 'round'}
            self.bodies += ax.plot([], **colour, label=body.label, **style)
            if len(body.points) > 2:
                self.plates += ax.fill(*drawn.outline(body).T, **colour, alpha=0.2, lw=0)
            if body.line:
                self.guides += ax.plot([], ls='--', **colour, lw=0.35 * width, zorder=1)
                self.blocks += ax.plot([], **_block_style(body, width))
        self.joints = {
            kind: ax.plot([], ls='', zorder=3, **_joint_style(kind, width))[0]
            for kind in drawn.joints
        }
        beside: dict[str, Any] = {'ha': 'center', 'va': 'center', 'zorder': 4}
        beside |= {'xytext': (0.0, 0.0), 'textcoords': 'offset points'}
        self.letters = {
            name: ax.annotate(name, (0.0, 0.0), fontsize=9 + 0.75 * width, **beside)
            for name in (drawn.points if letters else ())
        }
        self.move(pose)
        ax.relim()
        ax.autoscale_view()

    def move(self, pose: LinkagePose) -> 'list[Artist]':
        """Show another pose of the linkage; return the moved artists."""
        drawn = drawing.PoseDrawing.of(pose)
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

    def _offset(self, drawn: drawing.PoseDrawing, name: str) -> tuple[float, float]:
        x, y = drawn.free_side(name)
        is_block = any(body.line and body.line[1] == name for body in drawn.bodies)
        far = self._far * (1.3 if is_block else 1.0)
        return far * x, far * y


def _sliding(
    drawn: drawing.PoseDrawing, pose: LinkagePose
) -> list[tuple[drawing.BodyDrawing, Any, Any]]:
    """Return each sliding body, with its line's ends and its block as a marker."""
    bodies = [body for body in drawn.bodies if body.line]
    return [
        (body, drawn.guide(body, direction), _block(direction))
        for body, direction in zip(bodies, drawing.line_directions(pose), strict=True)
    ]


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
    return Path(np.column_stack([corners.real, corners.imag]), closed=True)


def _support() -> Any:
    """Return the textbooks' fixed pivot: a pin on a triangle on hatched ground."""
    from matplotlib.path import Path  # noqa: PLC0415 - matplotlib is optional

    triangle = [(-0.42, -0.72), (0.0, 0.0), (0.42, -0.72)]
    ground = [(-0.7, -0.72), (0.7, -0.72)]
    hatches = [[(x, -0.72), (x - 0.22, -1.0)] for x in (-0.4, -0.1, 0.2, 0.5)]
    lines = [[*triangle, triangle[0]], ground, *hatches]
    return Path.make_compound_path(*(Path(line) for line in lines), Path.circle((0, 0), 0.24))
