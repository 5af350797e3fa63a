"""The foot in 80-bit arithmetic: what the errors are measured against."""

from typing import Any

from klann_ros.kinematics import KlannGeometry
import numpy as np

# Arrays and numbers of 80 bits; NumPy types them by platform.
Extended = Any


def feet(geometry: KlannGeometry, alphas: np.ndarray) -> Extended:
    """
    Return H in 80-bit numbers, shape (k, 2) [m].

    The dyads are closed by the law of cosines; points are complex numbers.
    """
    number = np.longdouble
    g = geometry
    b = number(g.y_a) * 1j + number(g.l_ab) * _unit(alphas.astype(number))
    d, e = np.clongdouble(g.x_d), number(g.x_e) + number(g.y_e) * 1j
    c = _joint(b, d, number(g.l_bc), number(g.l_dc), g.assembly[0])
    g_ = c + number(g.l_cg) / number(g.l_bc) * _unit(number(g.angle_bcg)) * (c - b)
    f = _joint(e, g_, number(g.l_ef), number(g.l_fg), g.assembly[1])
    h = g_ + number(g.l_gh) / number(g.l_fg) * _unit(number(-g.angle_fgh)) * (g_ - f)
    return np.stack([h.real, h.imag], axis=-1)


def _unit(angle: Extended) -> Extended:
    return np.cos(angle) + 1j * np.sin(angle)


def _joint(p: Extended, q: Extended, r_p: Extended, r_q: Extended, sign: int) -> Extended:
    """Turn PQ by the angle at P, whose cosine is (r_p^2 + d^2 - r_q^2) / (2 r_p d)."""
    d = np.abs(q - p)
    angle = np.arccos((r_p * r_p + d * d - r_q * r_q) / (2 * r_p * d))
    return p + r_p * _unit(sign * angle) * (q - p) / d
