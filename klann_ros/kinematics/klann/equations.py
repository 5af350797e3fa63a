"""
The Klann leg as SEM 104 writes it: loop equations f, Jacobian Phi, and the points A to H.

This is the readable form, with the state vector x = (gamma, beta, delta, theta) and the
textbook's letters. What solves it is the linkage that `KlannGeometry` is; the tests hold the two
together. gamma and theta are measured clockwise, all other angles counter-clockwise.

Source: R. Nicoletti, SEM 104 Mecanismos, lecture 7, "Mecanismo de N barras".
"""

from collections.abc import Sequence
from math import cos, sin

from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .geometry import KlannGeometry


def f(geometry: KlannGeometry, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
    """
    Return the loop equations' left-hand sides; both loops close where f = 0.

        f1 = L_AB cos(alpha) + L_BC cos(gamma) - L_DC cos(beta) - x_D
        f2 = L_AB sin(alpha) - L_BC sin(gamma) - L_DC sin(beta) + y_A
        f3 = L_EF cos(delta) + L_FG cos(theta) - L_CG cos(gamma - bend_C) - L_DC cos(beta)
             - x_D + x_E
        f4 = L_EF sin(delta) - L_FG sin(theta) + L_CG sin(gamma - bend_C) - L_DC sin(beta) + y_E

    Parameters
    ----------
    geometry : KlannGeometry
        The leg.
    alpha : float
        Crank angle [rad].
    x : sequence of float, shape (4,)
        gamma, beta, delta, theta [rad].

    Returns
    -------
    numpy.ndarray, shape (4,)
        f1 to f4 [m].

    """
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


def phi(geometry: KlannGeometry, x: Sequence[float] | FloatArray) -> FloatArray:
    """
    Return the Jacobian Phi = df/dx, shape (4, 4) [m/rad]; parameters as in `f`.

    It is block lower triangular: the first two rows, the loop A-B-C-D, do not know delta, theta.
    """
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


def points(geometry: KlannGeometry, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
    """
    Return the points A to H of a pose, shape (8, 2) [m]; parameters as in `f`.

        B = A + L_AB (cos alpha, sin alpha)             C = D + L_DC (cos beta, sin beta)
        F = E + L_EF (cos delta, sin delta)
        G = C + L_CG (cos(gamma - bend_C), -sin(gamma - bend_C))
        H = G + L_GH (cos(theta + bend_G), -sin(theta + bend_G))
    """
    g = geometry
    gamma, beta, delta, theta = x
    bent_c, bent_g = gamma - g.angle_bcg, theta + g.angle_fgh
    a = np.array([0.0, g.y_a])
    d = np.array([g.x_d, 0.0])
    e = np.array([g.x_e, g.y_e])
    b = a + g.l_ab * np.array([cos(alpha), sin(alpha)])
    c = d + g.l_dc * np.array([cos(beta), sin(beta)])
    f_ = e + g.l_ef * np.array([cos(delta), sin(delta)])
    g_ = c + g.l_cg * np.array([cos(bent_c), -sin(bent_c)])
    h = g_ + g.l_gh * np.array([cos(bent_g), -sin(bent_g)])
    return np.array([a, b, c, d, e, f_, g_, h])
