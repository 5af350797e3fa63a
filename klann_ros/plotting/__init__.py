"""
Plots of any linkage with matplotlib, which is imported only for drawing.

Each function takes a linkage, a geometry or a leg, draws on given axes or on a new figure, and
returns the axes; `animate` returns the animation. Labels are symbols and units. Anything else than
a linkage, a geometry or a leg is a TypeError, and drawing without matplotlib a NoMatplotlibError.
"""

from .charts import plot_convergence, plot_turn
from .plane import animate, NoMatplotlibError, plot_foot_path, plot_pose

__all__ = [
    'NoMatplotlibError',
    'animate',
    'plot_convergence',
    'plot_foot_path',
    'plot_pose',
    'plot_turn',
]
