"""
Plots of any linkage with matplotlib, which is only imported when something is drawn.

Each takes a linkage, a geometry or a leg, draws on the axes it is given or on a figure of its own,
and returns the axes; `animate` returns the animation. What they write on axes are symbols and
units, no words.
"""

from .charts import plot_convergence, plot_turn
from .given import NoMatplotlibError
from .plane import animate, plot_foot_path, plot_pose

__all__ = [
    'NoMatplotlibError',
    'animate',
    'plot_convergence',
    'plot_foot_path',
    'plot_pose',
    'plot_turn',
]
