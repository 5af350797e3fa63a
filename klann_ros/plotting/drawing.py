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
    return Path(np.column_stack([corners.real, corners.imag]), closed=True)


def _support() -> Any:
    """Return the textbooks' fixed pivot: a pin on a triangle on hatched ground."""
    from matplotlib.path import Path  # noqa: PLC0415 - matplotlib is optional

    triangle = [(-0.42, -0.72), (0.0, 0.0), (0.42, -0.72)]
    ground = [(-0.7, -0.72), (0.7, -0.72)]
    hatches = [[(x, -0.72), (x - 0.22, -1.0)] for x in (-0.4, -0.1, 0.2, 0.5)]
    lines = [[*triangle, triangle[0]], ground, *hatches]
    return Path.make_compound_path(*(Path(line) for line in lines), Path.circle((0, 0), 0.24))
