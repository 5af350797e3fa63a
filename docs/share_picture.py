"""
Make the picture that networks show beside a link to the site: python docs/share_picture.py.

A walker of four Klann legs in the colours of the pages at night, the front legs over a turn.
"""

from pathlib import Path
import sys

from klann_ros.kinematics import klann_poses, KlannGeometry, KlannLeg
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
import numpy as np

PICTURE = Path(__file__).resolve().parent / 'static' / 'klann_ros.png'
PAPER, INK, QUIET, ACCENT = '#12161c', '#e8ecf1', '#a3afbf', '#4fc1c9'
# The bars of each body by their ends, and the body's colour.
BARS = {
    '#f07584': ['ab'],
    '#74aee0': ['bc', 'cg'],
    '#8cc496': ['dc'],
    '#efbb54': ['ef'],
    '#a9c7e6': ['fg', 'gh'],
}
CRANK_ANGLE = 75
SHADOWS = range(CRANK_ANGLE + 12, CRANK_ANGLE + 360, 12)


def draw_leg(axes: Axes, points: dict[str, np.ndarray], *, alpha: float, width: float) -> None:
    """Draw a leg and, where it is wide, its joints."""
    for colour, bars in BARS.items():
        lines = [[points[p], points[q]] for p, q in bars]
        collection = LineCollection(lines, colors=colour, alpha=alpha, linewidths=width)
        collection.set_capstyle('round')
        axes.add_collection(collection)
    if width > 2:
        joints = np.array([points[name] for name in 'abcdefgh'])
        size = 2.2 * width
        axes.plot(*joints.T, 'o', ms=size, mfc=PAPER, mec=INK, mew=1.4, alpha=alpha)


def leg_points(degrees: float, side: int = 1) -> dict[str, np.ndarray]:
    """Return the points of a leg [m]; the mirror image of side -1 has the same crank."""
    angle = degrees if side > 0 else 180.0 - degrees
    points = KlannLeg().solve(np.radians(angle)).points * np.array([side, 1.0])
    return dict(zip('abcdefgh', points, strict=True))


def share_picture() -> Figure:
    """Return the picture, 1200 by 630 pixels."""
    figure = Figure(figsize=(12.0, 6.3), dpi=100, facecolor=PAPER)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-1.62, 1.2), ylim=(-0.5, 0.9805), aspect='equal')
    axes.axis('off')
    turn = klann_poses(KlannGeometry.sem104(), np.radians(np.arange(361.0)))
    ground = turn.h[:, 1].min()
    axes.axhline(ground, color=QUIET, lw=1.5)
    for degrees in SHADOWS:
        draw_leg(axes, leg_points(degrees), alpha=0.1, width=1.4)
    for width, alpha in ((14, 0.10), (8, 0.18), (3, 1.0)):
        axes.plot(*turn.h.T, color=ACCENT, lw=width, alpha=alpha, solid_capstyle='round')
    for degrees, alpha, width in ((CRANK_ANGLE + 180, 0.3, 7.0), (CRANK_ANGLE, 1.0, 8.0)):
        for side in (-1, 1):
            draw_leg(axes, leg_points(degrees, side), alpha=alpha, width=width)
    text = {'transform': axes.transAxes, 'ha': 'left', 'family': 'DejaVu Sans'}
    axes.text(0.045, 0.855, 'klann_ros', size=46, weight='bold', color=INK, **text)
    axes.text(0.047, 0.785, 'Leg linkages: solve, turn, build, walk', size=19, color=QUIET, **text)
    return figure


if __name__ == '__main__':
    share_picture().savefig(sys.argv[1] if len(sys.argv) > 1 else PICTURE, facecolor=PAPER)
