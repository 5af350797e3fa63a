"""
The kernel compiled by numba: the operations of the NumPy kernel in the same order.

Only `kernels` imports this module, and only when it is needed: numba takes half a second.
"""

from collections.abc import Callable
from math import cos as cosine, isnan, nan, sin as sine, sqrt
from typing import Any, TypeVar

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
import numba

from .block import Block, Codes
from .constants import Array
from .reason import Reason

Function = TypeVar('Function', bound=Callable[..., Any])
# Seven numbers, and one dyad's ten twice: a column of `constants.pack`.
Column = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]


def compiled(*signature: str) -> Callable[[Function], Function]:
    """
    Return a decorator: compile, at once and for later runs where the signature is given.

    Without one a function is compiled into those that call it.
    """
    # Division by zero gives NaN or an infinity, as in NumPy.
    options = {'error_model': 'numpy', 'nogil': True}

    def decorate(function: Function) -> Function:
        try:
            result: Function = numba.njit(*signature, cache=bool(signature), **options)(function)
        except Exception:  # noqa: BLE001, RUF100 - the cache has no place, no room, or is broken
            result = numba.njit(*signature, **options)(function)
        return result

    return decorate


def place(constants: Array, block: Block, *, keep: bool) -> None:
    """Fill in a block's rows, the first two only if `keep` is not set, and its reasons."""
    given = (constants, block.legs.start, block.cos, block.sin)
    if _place(*given, block.rows, keep):
        _explain(*given, block.reason)
    else:
        block.reason[...] = Reason.SOLVED


@compiled('(float64[::1], float64[::1], float64[::1])')
def turn(alphas: Array, cos: Array, sin: Array) -> None:
    """Fill in cosines and sines of crank angles, shape (k,) each; NaN for those refused."""
    for j in range(alphas.size):
        alpha = alphas[j] if abs(alphas[j]) <= MAX_CRANK_ANGLE else nan
        cos[j] = cosine(alpha)
        sin[j] = sine(alpha)


@compiled()
def _column(k: Array, i: int) -> Column:
    # Spelt out, since numba's tuples are of a length that it knows.
    return (
        (k[0, i], k[1, i], k[2, i], k[3, i], k[4, i], k[5, i], k[6, i]),
        (
            k[7, i], k[8, i], k[9, i], k[10, i], k[11, i],
            k[12, i], k[13, i], k[14, i], k[15, i], k[16, i],
        ),
        (
            k[17, i], k[18, i], k[19, i], k[20, i], k[21, i],
            k[22, i], k[23, i], k[24, i], k[25, i], k[26, i],
        ),
    )  # fmt: skip


@compiled()
def _close(dyad: tuple[float, ...], v_x: float, v_y: float) -> tuple[float, ...]:
    """Return d^2, w, r and the factor of a dyad."""
    stretched, folded, f0_x, f0_y, f1_x, f1_y, f2_x, f2_y, _, _ = dyad
    d = v_x * v_x + v_y * v_y
    w = 0.5 / d
    r = sqrt((stretched - d) * (d - folded))
    return d, w, r, (f2_x * r + f1_x) * w + f0_x, (f2_y * r + f1_y) * w + f0_y


@compiled()
def _pose(column: Column, cos: float, sin: float) -> tuple[float, ...]:
    """Return the first twelve of `Rows`."""
    (l_ab, x_d, y_a, ed_x, ed_y, x_e, y_e), dyad_1, dyad_2 = column
    m_x, m_y = l_ab * cos - x_d, l_ab * sin + y_a
    d_1, w_1, r_1, f_x, f_y = _close(dyad_1, m_x, m_y)
    u_x = m_x * f_x - m_y * f_y + ed_x
    u_y = m_y * f_x + m_x * f_y + ed_y
    d_2, w_2, r_2, f_x, f_y = _close(dyad_2, u_x, u_y)
    h_x = u_x * f_x - u_y * f_y + x_e
    h_y = u_y * f_x + u_x * f_y + y_e
    return h_x, h_y, m_x, m_y, w_1, r_1, u_x, u_y, w_2, r_2, d_1, d_2


@compiled('int64(float64[:, ::1], int64, float64[::1], float64[::1], float64[:, :, ::1], boolean)')
def _place(  # noqa: PLR0917 - numba knows no keywords
    constants: Array, start: int, cos: Array, sin: Array, rows: Array, keep: bool
) -> int:
    """Return how many poses are missing."""
    missing = 0
    for i in range(rows.shape[1]):
        column = _column(constants, start + i)
        # Rows of their own let the compiler see that the loops can be vectorised.
        h_x, h_y = rows[0, i], rows[1, i]
        m_x, m_y, w_1, r_1 = rows[2, i], rows[3, i], rows[4, i], rows[5, i]
        u_x, u_y, w_2, r_2 = rows[6, i], rows[7, i], rows[8, i], rows[9, i]
        if keep:
            for j in range(cos.size):
                pose = _pose(column, cos[j], sin[j])
                h_x[j], h_y[j], m_x[j], m_y[j], w_1[j], r_1[j] = pose[:6]
                u_x[j], u_y[j], w_2[j], r_2[j] = pose[6:10]
                missing += isnan(pose[0])
        else:
            for j in range(cos.size):
                pose = _pose(column, cos[j], sin[j])
                h_x[j], h_y[j] = pose[:2]
                missing += isnan(pose[0])
    return missing


@compiled('(float64[:, ::1], int64, float64[::1], float64[::1], uint8[:, ::1])')
def _explain(constants: Array, start: int, cos: Array, sin: Array, reason: Codes) -> None:
    """Say for each pose whether it is there, and why not; whatever failed has left NaN behind."""
    for i in range(reason.shape[0]):
        column = _column(constants, start + i)
        stretched_1, stretched_2 = column[1][0], column[2][0]
        for j in range(cos.size):
            pose = _pose(column, cos[j], sin[j])
            h_x, d_1, d_2 = pose[0], pose[10], pose[11]
            if not isnan(h_x):
                reason[i, j] = Reason.SOLVED
            elif isnan(d_1):
                reason[i, j] = Reason.CRANK_ANGLE
            elif isnan(d_2):
                far = d_1 > stretched_1
                reason[i, j] = Reason.DYAD_1_TOO_FAR if far else Reason.DYAD_1_TOO_CLOSE
            else:
                far = d_2 > stretched_2
                reason[i, j] = Reason.DYAD_2_TOO_FAR if far else Reason.DYAD_2_TOO_CLOSE
