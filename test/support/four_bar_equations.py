"""
The four-bar as its course writes it, the oracle of its linkage; x = (theta3, theta4).

Source: "Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples, example 2.
"""

from collections.abc import Sequence
from math import cos, sin

from klann_ros.kinematics import FourBarGeometry
import numpy as np


def f(geometry: FourBarGeometry, theta2: float, x: Sequence[float]) -> np.ndarray:
    """Return f1 and f2 [m]: see `FourBar.f`."""
    l_1, l_2, l_3, l_4 = geometry.lengths
    theta3, theta4 = x
    return np.array(
        [
            l_1 + l_4 * cos(theta4) - l_2 * cos(theta2) - l_3 * cos(theta3),
            l_4 * sin(theta4) - l_2 * sin(theta2) - l_3 * sin(theta3),
        ]
    )


def phi(geometry: FourBarGeometry, x: Sequence[float]) -> np.ndarray:
    """Return Phi = df/dx [m/rad]."""
    (theta3, theta4), l_3, l_4 = x, geometry.coupler, geometry.rocker
    return np.array(
        [[l_3 * sin(theta3), -l_4 * sin(theta4)], [-l_3 * cos(theta3), l_4 * cos(theta4)]]
    )


def points(geometry: FourBarGeometry, theta2: float, x: Sequence[float]) -> np.ndarray:
    """Return O2, A, B and O4 [m]."""
    l_1, l_2, _, l_4 = geometry.lengths
    a = [l_2 * cos(theta2), l_2 * sin(theta2)]
    b = [l_1 + l_4 * cos(x[1]), l_4 * sin(x[1])]
    return np.array([[0.0, 0.0], a, b, [l_1, 0.0]])
