"""
The Klann leg as SEM 104 writes it, the oracle of its linkage; x = (gamma, beta, delta, theta).

Source: R. Nicoletti, SEM 104 Mecanismos, lecture 7, "Mecanismo de N barras".
"""

from collections.abc import Sequence
from math import cos, sin

from klann_ros.kinematics import KlannGeometry
import numpy as np


def f(geometry: KlannGeometry, alpha: float, x: Sequence[float]) -> np.ndarray:
    """Return f1 to f4 [m]: see `KlannLeg`."""
    g = geometry
    gamma, beta, delta, theta = x
    bent = gamma - g.angle_bcg
    return np.array(
        [
            g.l_ab * cos(alpha) + g.l_bc * cos(gamma) - g.l_dc * cos(beta) - g.x_d,
            g.l_ab * sin(alpha) - g.l_bc * sin(gamma) - g.l_dc * sin(beta) + g.y_a,
            g.l_ef * cos(delta) + g.l_fg * cos(theta) - g.l_cg * cos(bent) - g.l_dc * cos(beta)
            - g.x_d + g.x_e,
            g.l_ef * sin(delta) - g.l_fg * sin(theta) + g.l_cg * sin(bent) - g.l_dc * sin(beta)
            + g.y_e,
        ]
    )  # fmt: skip


def phi(geometry: KlannGeometry, x: Sequence[float]) -> np.ndarray:
    """Return Phi = df/dx [m/rad]; the loop A-B-C-D does not depend on delta and theta."""
    g = geometry
    gamma, beta, delta, theta = x
    bent = gamma - g.angle_bcg
    return np.array(
        [
            [-g.l_bc * sin(gamma), g.l_dc * sin(beta), 0.0, 0.0],
            [-g.l_bc * cos(gamma), -g.l_dc * cos(beta), 0.0, 0.0],
            [g.l_cg * sin(bent), g.l_dc * sin(beta), -g.l_ef * sin(delta), -g.l_fg * sin(theta)],
            [g.l_cg * cos(bent), -g.l_dc * cos(beta), g.l_ef * cos(delta), -g.l_fg * cos(theta)],
        ]
    )


def points(geometry: KlannGeometry, alpha: float, x: Sequence[float]) -> np.ndarray:
    """Return A to H [m]."""
    g = geometry
    gamma, beta, delta, theta = x
    a, d, e = np.array([[0.0, g.y_a], [g.x_d, 0.0], [g.x_e, g.y_e]])
    b = a + g.l_ab * np.array([cos(alpha), sin(alpha)])
    c = d + g.l_dc * np.array([cos(beta), sin(beta)])
    f_ = e + g.l_ef * np.array([cos(delta), sin(delta)])
    g_ = c + g.l_cg * np.array([cos(gamma - g.angle_bcg), -sin(gamma - g.angle_bcg)])
    h = g_ + g.l_gh * np.array([cos(theta + g.angle_fgh), -sin(theta + g.angle_fgh)])
    return np.array([a, b, c, d, e, f_, g_, h])
