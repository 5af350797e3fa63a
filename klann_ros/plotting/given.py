"""What the plots are given: axes or none, and a linkage as whatever it is."""

from typing import Any, TYPE_CHECKING

from klann_ros.kinematics import AnyLeg, Leg, LinkageLeg
from klann_ros.kinematics.linkage.linkage import as_linkage

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class NoMatplotlibError(ImportError):
    """Matplotlib, which draws, is not installed."""

    def __str__(self) -> str:
        return "a plot needs matplotlib: pip install 'klann_ros[plot]'"


def axes_of(ax: 'Axes | None') -> 'Axes':
    """
    Return axes, or those of a new figure; without a display that is one to be saved.

    A NoMatplotlibError says that matplotlib is not installed.
    """
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot as plt  # noqa: PLC0415 - optional, and slow to import
    except ImportError:
        raise NoMatplotlibError from None
    return plt.subplots(layout='constrained')[1]


def leg_of(given: Any) -> AnyLeg:
    """Return the leg that is given, or one of the linkage; a TypeError where it is neither."""
    return given if isinstance(given, Leg) else LinkageLeg(as_linkage(given))
