"""The Klann leg of SEM 104, built with pylinkage."""

from math import atan2, hypot

from klann_ros.kinematics import KlannGeometry, KlannLeg
import numpy as np
from pylinkage.actuators import Crank
from pylinkage.components import Ground
from pylinkage.dyads import FixedDyad, RRRDyad
from pylinkage.simulation import Linkage


class PylinkageLeg:
    """
    A leg that turns in equal steps, one pose after the other; that is pylinkage's way.

    Parameters
    ----------
    geometry : KlannGeometry
        The leg.
    step : float
        Of the crank [rad].

    """

    def __init__(self, geometry: KlannGeometry, step: float) -> None:
        """Build it at a crank angle of 0, so that the first pose is one step on."""
        g, start = geometry, KlannLeg(geometry).closed_form(0.0).points
        a, d, e = Ground(0.0, g.y_a), Ground(g.x_d, 0.0), Ground(g.x_e, g.y_e)
        b = Crank(anchor=a, radius=g.l_ab, angular_velocity=step)
        # Each dyad stays nearest to where it was; these are the starts.
        c = RRRDyad(b.output, d, g.l_bc, g.l_dc, x=start[2, 0], y=start[2, 1])
        g_ = FixedDyad(b.output, c, *_end(g.l_bc, g.l_cg, g.angle_bcg))
        f = RRRDyad(e, g_, g.l_ef, g.l_fg, x=start[5, 0], y=start[5, 1])
        h = FixedDyad(f, g_, *_end(g.l_fg, g.l_gh, -g.angle_fgh))
        self._linkage = Linkage([a, d, e, b, c, g_, f, h])
        self._linkage.compile()

    def feet(self, count: int) -> np.ndarray:
        """Return H of the next poses by `step`, shape (count, 2) [m]."""
        return np.array([pose[-1] for pose in self._linkage.step(count)])

    def feet_fast(self, count: int) -> np.ndarray:
        """Return H of the next poses by the compiled `step_fast`, shape (count, 2) [m]."""
        return np.asarray(self._linkage.step_fast(count)[:, -1])


def _end(first: float, second: float, bend: float) -> tuple[float, float]:
    """Return R of a bent body P-Q-R as pylinkage wants it: |PR|, and the angle from PQ to PR."""
    x, y = first + second * np.cos(bend), second * np.sin(bend)
    return hypot(x, y), atan2(y, x)
