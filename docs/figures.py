"""Make the documentation's figures with the package's own code: python docs/figures.py."""

import math
from pathlib import Path

from klann_ros.kinematics import KlannLeg
from klann_ros.review.drawing import draw_angles, draw_foot_path, draw_leg, label_plane
from matplotlib.figure import Figure
import numpy as np

FOLDER = Path(__file__).resolve().parent


def klann_leg() -> Figure:
    """Return the leg of SEM 104 at a crank angle of 60 deg, with its letters and angles."""
    leg = KlannLeg()
    feet = np.array([leg.solve(math.radians(k / 2)).h for k in range(721)])
    figure = Figure(figsize=(8.0, 5.6), layout='constrained')
    axes = figure.add_subplot()
    draw_foot_path(axes, feet, 'path of H')
    pose = leg.solve(math.radians(60.0))
    draw_leg(axes, pose)
    draw_angles(axes, pose, radius=0.07)
    label_plane(axes, 'The Klann leg of SEM 104 at a crank angle of 60 deg')
    return figure


if __name__ == '__main__':
    klann_leg().savefig(FOLDER / 'klann_leg.png', dpi=110)
