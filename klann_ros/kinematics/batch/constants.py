"""
What the kernels need of a leg: the geometric method with all that is constant taken out.

With points as complex numbers, one dyad places one body. The dyad's ends are P and Q, its links
r_p and r_q, d^2 = |PQ|^2; `dyad.joint` is then

    J - P = z (Q - P),    z = 1/2 + w (K + i s r),    w = 1 / (2 d^2),
    K = (r_p - r_q) (r_p + r_q),    r = sqrt(((r_p + r_q)^2 - d^2) (d^2 - (r_p - r_q)^2)),

where r is Heron's product again: its factors are taken two at a time, which needs no d and keeps
the same digits. A bent body that is fixed to the dyad has its end at a constant factor from J, so
the bends enter as constants only, and both bodies' ends have the form "vector times (f0 + w (f1 +
f2 r))":

    G - E = (D - E) + (B - D) (1 - k_1 z_1),      k_1 = 1 + L_CG / L_BC e^(i bend_C)
    H - E = (G - E) (1 + k_2 (1 - z_2)),          k_2 = L_GH / L_FG e^(-i bend_G)
"""

from collections.abc import Sequence
from operator import attrgetter
from typing import NamedTuple, TYPE_CHECKING, TypeAlias

from klann_ros.kinematics.klann.geometry import KlannGeometry, NUMBERS
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .block import Block

Array: TypeAlias = NDArray[np.float64]

_numbers = attrgetter(*NUMBERS, 'assembly')


class Dyad(NamedTuple):
    """One dyad and the body it places: each a number a geometry."""

    stretched: Array  # (r_p + r_q)^2
    folded: Array  # (r_p - r_q)^2
    f0_x: Array
    f0_y: Array
    f1_x: Array
    f1_y: Array
    f2_x: Array
    f2_y: Array
    k: Array  # K
    s: Array


class Constants(NamedTuple):
    """A row of the kernels' constants each, in their order: each a number a geometry."""

    l_ab: Array
    x_d: Array
    y_a: Array
    ed_x: Array  # D - E
    ed_y: Array
    x_e: Array
    y_e: Array
    dyad_1: Dyad
    dyad_2: Dyad


def numbers(geometries: Sequence[KlannGeometry]) -> tuple[Array, Array]:
    """Return all `NUMBERS`, shape (13, n) [m, rad], and assembly signs, shape (2, n)."""
    rows = [_numbers(geometry) for geometry in geometries]
    table = np.array([row[:-1] for row in rows], dtype=np.float64).reshape(-1, len(NUMBERS))
    signs = np.array([row[-1] for row in rows], dtype=np.float64).reshape(-1, 2)
    return table.T, signs.T


def pack(numbers: Array, signs: Array) -> Array:
    """
    Return the constants of n legs.

    Parameters
    ----------
    numbers : numpy.ndarray, shape (13, n)
        The `NUMBERS` of each leg [m, rad].
    signs : numpy.ndarray, shape (2, n) or (2, 1)
        The assembly of each leg.

    Returns
    -------
    numpy.ndarray, shape (27, n)
        In the order of `Constants`.

    """
    l_ab, l_bc, l_dc, l_cg, l_ef, l_fg, l_gh, x_d, y_a, x_e, y_e, bcg, fgh = numbers
    s_1, s_2 = signs
    k_1 = 1.0 + l_cg / l_bc * (np.cos(bcg) + 1j * np.sin(bcg))
    k_2 = l_gh / l_fg * (np.cos(fgh) - 1j * np.sin(fgh))
    dyad_1 = _dyad(l_bc, l_dc, s_1, (1.0 - k_1 / 2.0, -k_1))
    dyad_2 = _dyad(l_ef, l_fg, s_2, (1.0 + k_2 / 2.0, -k_2))
    rows = (l_ab, x_d, y_a, x_d - x_e, -y_e, x_e, y_e, *dyad_1, *dyad_2)
    return np.array(np.broadcast_arrays(*rows), order='C')


def legs_of(constants: Array, block: 'Block') -> Constants:
    """Return the constants of a block's legs by name, shaped to broadcast over the block."""
    rows = np.expand_dims(constants[:, block.legs], 1 if block.across else 2)
    first, second = 7, 7 + len(Dyad._fields)
    dyads = Dyad._make(rows[first:second]), Dyad._make(rows[second:])
    return Constants._make([*rows[:first], *dyads])


def _dyad(r_p: Array, r_q: Array, s: Array, factor: tuple[Array, Array]) -> Dyad:
    """Return a dyad whose factor is f0 + g w (K + i s r), given f0 and g."""
    f0, g = factor
    k = (r_p - r_q) * (r_p + r_q)
    f1, f2 = g * k, g * (1j * s)
    folded, stretched = (r_p - r_q) ** 2, (r_p + r_q) ** 2
    return Dyad(stretched, folded, f0.real, f0.imag, f1.real, f1.imag, f2.real, f2.imag, k, s)
