"""The Klann leg solved by SciPy's fsolve, as quickly as NumPy allows."""

from collections.abc import Sequence
from math import cos, sin

from klann_ros.kinematics import KlannGeometry, KlannLeg
import numpy as np
from scipy.optimize import fsolve


class FsolveLeg:
    """
    A leg whose every pose starts from the one before.

    fsolve is given the textbook's f and the analytic Jacobian Phi.
    """

    def __init__(self, geometry: KlannGeometry) -> None:
        """Start at a crank angle of 0."""
        self._geometry = geometry
        self._x = np.array(KlannLeg(geometry).closed_form(0.0).x)

    def feet(self, alphas: Sequence[float]) -> list[tuple[float, float]]:
        """Return H at some crank angles [m]."""
        return [self._foot(alpha) for alpha in alphas]

    def _foot(self, alpha: float) -> tuple[float, float]:
        g = self._geometry
        ab = g.l_ab * cos(alpha), g.l_ab * sin(alpha)
        self._x = fsolve(self._f, self._x, args=ab, fprime=self._phi, xtol=1e-12)
        gamma, beta, _, theta = self._x.tolist()
        bent_c, bent_g = gamma - g.angle_bcg, theta + g.angle_fgh
        return (
            g.x_d + g.l_dc * cos(beta) + g.l_cg * cos(bent_c) + g.l_gh * cos(bent_g),
            g.l_dc * sin(beta) - g.l_cg * sin(bent_c) - g.l_gh * sin(bent_g),
        )

    def _f(self, x: np.ndarray, ab_x: float, ab_y: float) -> list[float]:
        """Return the loop equations' left-hand sides, shape (4,) [m]."""
        g, (gamma, beta, delta, theta) = self._geometry, x.tolist()
        bent = gamma - g.angle_bcg
        dc_x, dc_y = g.l_dc * cos(beta), g.l_dc * sin(beta)
        return [
            ab_x + g.l_bc * cos(gamma) - dc_x - g.x_d,
            ab_y - g.l_bc * sin(gamma) - dc_y + g.y_a,
            g.l_ef * cos(delta) + g.l_fg * cos(theta) - g.l_cg * cos(bent) - dc_x - g.x_d + g.x_e,
            g.l_ef * sin(delta) - g.l_fg * sin(theta) + g.l_cg * sin(bent) - dc_y + g.y_e,
        ]

    def _phi(self, x: np.ndarray, *_: float) -> list[list[float]]:
        """Return the Jacobian, shape (4, 4) [m/rad]."""
        g, (gamma, beta, delta, theta) = self._geometry, x.tolist()
        bent = gamma - g.angle_bcg
        dc_x, dc_y = g.l_dc * cos(beta), g.l_dc * sin(beta)
        return [
            [-g.l_bc * sin(gamma), dc_y, 0.0, 0.0],
            [-g.l_bc * cos(gamma), -dc_x, 0.0, 0.0],
            [g.l_cg * sin(bent), dc_y, -g.l_ef * sin(delta), -g.l_fg * sin(theta)],
            [g.l_cg * cos(bent), -dc_x, g.l_ef * cos(delta), -g.l_fg * cos(theta)],
        ]
