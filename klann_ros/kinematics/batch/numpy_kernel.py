"""The kernel in NumPy: the geometric method on a block of poses, next to no temporary arrays."""

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
import numpy as np

from .block import Block, Codes, Rows
from .constants import Array, Constants, Dyad, legs_of
from .reason import Reason

Vector = tuple[Array, Array]


def turn(alphas: Array, cos: Array, sin: Array) -> None:
    """Fill in cosines and sines of crank angles, shape (k,) each; NaN for those refused."""
    np.cos(alphas, out=cos)
    np.sin(alphas, out=sin)
    # NaN fails every comparison.
    cos[~(np.abs(alphas) <= MAX_CRANK_ANGLE)] = np.nan


def place(constants: Array, block: Block, *, keep: bool) -> None:  # noqa: ARG001 - numba's saves
    """
    Fill in a block's rows and reasons.

    Parameters
    ----------
    constants : numpy.ndarray, shape (27, n)
        All legs; see `constants.pack`.
    block : Block
        Which of them, at which crank angles, and where the results go.
    keep : bool
        Whether more than h_x, h_y is wanted; here it is made anyway.

    """
    c, r = legs_of(constants, block), Rows(*block.rows)
    axis = 1 if block.across else 0
    m, u, factor = (r.m_x, r.m_y), (r.u_x, r.u_y), (r.f_x, r.f_y)
    np.multiply(c.l_ab, np.expand_dims(block.cos, axis), out=r.m_x)
    np.multiply(c.l_ab, np.expand_dims(block.sin, axis), out=r.m_y)
    r.m_x[...] -= c.x_d
    r.m_y[...] += c.y_a
    _close(c.dyad_1, m, (r.d_1, r.w_1, r.r_1), factor)
    _add_product((c.ed_x, c.ed_y), m, factor, u, r.h_x)
    _close(c.dyad_2, u, (r.d_2, r.w_2, r.r_2), factor)
    _add_product((c.x_e, c.y_e), u, factor, (r.h_x, r.h_y), r.f_x)
    _explain(c, r, block.reason)


def _close(dyad: Dyad, v: Vector, kept: tuple[Array, Array, Array], factor: Vector) -> None:
    """Fill in d^2, w and r of a dyad, and the factor that it turns and stretches v by."""
    (v_x, v_y), (d, w, r), (f_x, f_y) = v, kept, factor
    np.multiply(v_x, v_x, out=d)
    np.multiply(v_y, v_y, out=w)
    d += w
    np.divide(0.5, d, out=w)
    np.subtract(dyad.stretched, d, out=r)
    np.subtract(d, dyad.folded, out=f_x)
    r *= f_x
    np.sqrt(r, out=r)
    for part, f0, f1, f2 in (
        (f_x, dyad.f0_x, dyad.f1_x, dyad.f2_x),
        (f_y, dyad.f0_y, dyad.f1_y, dyad.f2_y),
    ):
        np.multiply(f2, r, out=part)
        np.add(part, f1, out=part)
        np.multiply(part, w, out=part)
        np.add(part, f0, out=part)


def _add_product(o: Vector, v: Vector, f: Vector, out: Vector, spare: Array) -> None:
    """
    Fill in o + v f, all of them complex.

    `spare` may be the first part of f; then it is gone.
    """
    (o_x, o_y), (v_x, v_y), (f_x, f_y), (out_x, out_y) = o, v, f, out
    np.multiply(v_x, f_x, out=out_x)
    np.multiply(v_y, f_x, out=out_y)
    np.multiply(v_y, f_y, out=spare)
    out_x -= spare
    np.multiply(v_x, f_y, out=spare)
    out_y += spare
    out_x += o_x
    out_y += o_y


def _explain(c: Constants, r: Rows, reason: Codes) -> None:
    """Say for each pose whether it is there, and why not; whatever failed has left NaN behind."""
    missing = np.isnan(r.h_x)
    reason[...] = Reason.SOLVED
    if not missing.any():
        return
    reason[missing] = Reason.DYAD_2_TOO_CLOSE
    reason[missing & (r.d_2 > c.dyad_2.stretched)] = Reason.DYAD_2_TOO_FAR
    missing = np.isnan(r.d_2)
    reason[missing] = Reason.DYAD_1_TOO_CLOSE
    reason[missing & (r.d_1 > c.dyad_1.stretched)] = Reason.DYAD_1_TOO_FAR
    reason[np.isnan(r.d_1)] = Reason.CRANK_ANGLE
