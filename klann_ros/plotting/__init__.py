"""
Plots of any linkage with matplotlib, which is imported only for drawing.

Each function takes a `Linkage`, a `KlannGeometry`, a `FourBarGeometry` or a leg as `given`, draws
on the axes `ax` or on those of a new figure, and returns them; `animate` returns the animation.
Labels are symbols and units. Anything else as `given` is a TypeError, and drawing without
matplotlib a NoMatplotlibError.
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .charts import plot_convergence, plot_turn
    from .plane import animate, NoMatplotlibError, plot_foot_path, plot_pose
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
