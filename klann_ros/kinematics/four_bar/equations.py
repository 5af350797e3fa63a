"""
The four-bar linkage as the course writes it: loop equations f, Jacobian Phi, and the points.

This is the readable form, with the state vector x = (theta3, theta4) and the course's letters.
What solves it is the linkage that `FourBarGeometry` is; the tests hold the two together. All
angles are counter-clockwise from the ground, which lies along x.

Source: "Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples, example 2.
"""

from collections.abc import Sequence
from math import cos, sin

from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .geometry import FourBarGeometry


def f(geometry: FourBarGeometry, theta2: float, x: Sequence[float] | FloatArray) -> FloatArray:
    """
    Return the loop equations' left-hand sides; the loop closes where f = 0.

        f1 = L1 + L4 cos(theta4) - L2 cos(theta2) - L3 cos(theta3)
        f2 =      L4 sin(theta4) - L2 sin(theta2) - L3 sin(theta3)

    Parameters
    ----------
    geometry : FourBarGeometry
        The linkage.
    theta2 : float
        Crank angle [rad].
    x : sequence of float, shape (2,)
        theta3, theta4 [rad].

    Returns
    -------
    numpy.ndarray, shape (2,)
        f1 and f2 [m].

    """
    l_1, l_2, l_3, l_4 = geometry.lengths
    theta3, theta4 = x
    return np.array(
        [
            l_1 + l_4 * cos(theta4) - l_2 * cos(theta2) - l_3 * cos(theta3),
            l_4 * sin(theta4) - l_2 * sin(theta2) - l_3 * sin(theta3),
        ]
    )


def phi(geometry: FourBarGeometry, x: Sequence[float] | FloatArray) -> FloatArray:
    """
    Return the Jacobian Phi = df/dx, shape (2, 2) [m/rad]; parameters as in `f`.

    Its determinant is -L3 L4 sin(theta4 - theta3).
    """
    theta3, theta4 = x
    l_3, l_4 = geometry.coupler, geometry.rocker
    return np.array(
        [
            [l_3 * sin(theta3), -l_4 * sin(theta4)],
            [-l_3 * cos(theta3), l_4 * cos(theta4)],
        ]
    )


def points(
    geometry: FourBarGeometry, theta2: float, x: Sequence[float] | FloatArray
) -> FloatArray:
    """
    Return the points O2, A, B and O4 of a pose, shape (4, 2) [m]; parameters as in `f`.

        A = L2 (cos theta2, sin theta2)        B = O4 + L4 (cos theta4, sin theta4)
    """
    l_1, l_2, _, l_4 = geometry.lengths
    _, theta4 = x
    a = [l_2 * cos(theta2), l_2 * sin(theta2)]
    b = [l_1 + l_4 * cos(theta4), l_4 * sin(theta4)]
    return np.array([[0.0, 0.0], a, b, [l_1, 0.0]])
