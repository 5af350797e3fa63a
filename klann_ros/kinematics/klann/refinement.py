"""
Newton-Raphson for the Klann leg, written out for speed.

`refine` makes the iterates of the full 4x4 Newton of `equations.f` and its Jacobian: Phi is block
lower triangular, so forward substitution with two 2x2 solves is the same as inverting it. It is
pure: the guess is an argument.
"""

from cmath import rect
from math import cos, hypot, pi, sin
from typing import NamedTuple

from klann_ros.kinematics.angles import FAR, wrap

from . import equations
from .geometry import KlannGeometry
from .pose import KlannPose, NO_COEFFICIENTS

Angles = tuple[float, float, float, float]


class Constants(NamedTuple):
    """What `refine` needs of a geometry, in the order it unpacks it."""

    l_ab: float
    l_bc: float
    l_dc: float
    l_ef: float
    l_fg: float
    x_d: float
    y_a: float
    x_ed: float
    y_e: float
    cg_1: float
    cg_2: float
    gh_1: float
    gh_2: float
    sign_1: float
    sign_2: float
    rounding_1: float
    rounding_2: float
    least_1: float
    least_2: float
    singular_1: float
    singular_2: float
    geometry: KlannGeometry


def constants(geometry: KlannGeometry) -> Constants:
    """Return the constants of a geometry; do it once, not for every pose."""
    g = geometry
    sign_1, sign_2 = g.assembly
    lengths = (g.l_ab, g.l_bc, g.l_dc, g.l_ef, g.l_fg)
    pivots = (g.x_d, g.y_a, g.x_e - g.x_d, g.y_e)
    # A bent body's second bar is its first one, turned and stretched.
    cg, gh = rect(g.l_cg / g.l_bc, g.angle_bcg), rect(g.l_gh / g.l_fg, g.angle_fgh)
    bends = (cg.real, cg.imag, gh.real, gh.imag)
    sine_1, sine_2 = equations.singular_sines(g)
    singular = (sine_1 * g.l_bc * g.l_dc, sine_2 * g.l_ef * g.l_fg)
    rounding_1, rounding_2 = equations.rounding(g)
    least = (-rounding_1 * (g.l_bc + g.l_dc), -rounding_2 * (g.l_ef + g.l_fg))
    signs = (float(sign_1), float(sign_2))
    roundings = (rounding_1, rounding_2, *least, *singular)
    return Constants(*lengths, *pivots, *bends, *signs, *roundings, g)


def refine(
    constants: Constants, alpha: float, guess: Angles, tolerance: float, max_iterations: int
) -> KlannPose | None:
    """
    Return the pose that Newton-Raphson reaches from a guess, or None.

    In the textbook's letters, with BC = L_BC (cos gamma, sin gamma) and so on, the 2x2 solves are

        dgamma = (DC.x f1 + DC.y f2) / det1      dbeta  = (BC.y f2 - BC.x f1) / det1
        ddelta = (FG.x r3 - FG.y r4) / det2      dtheta = (EF.x r3 + EF.y r4) / det2

        r3 = f3 + CG.y dgamma + DC.y dbeta       det1 = L_BC L_DC sin(gamma + beta)
        r4 = f4 + CG.x dgamma - DC.x dbeta       det2 = L_EF L_FG sin(delta + theta)

    The pose is the first iterate after a correction of at most `tolerance` in every angle, or one
    whose residual is rounding already (near a singular pose corrections stay above 1e-12 rad).

    Parameters
    ----------
    constants : Constants
        The leg.
    alpha : float
        Crank angle [rad].
    guess : tuple of float
        gamma, beta, delta, theta [rad].
    tolerance : float
        Largest correction of a converged pose [rad].
    max_iterations : int
        How many iterations it may take.

    Returns
    -------
    KlannPose or None
        None: it did not converge, or not on the geometry's assembly branch.

    """
    (
        l_ab, l_bc, l_dc, l_ef, l_fg, x_d, y_a, x_ed, y_e, cg_1, cg_2, gh_1, gh_2,
        sign_1, sign_2, rounding_1, rounding_2, least_1, least_2,
        singular_1, singular_2, geometry,
    ) = constants  # fmt: skip
    gamma, beta, delta, theta = guess
    ab_x, ab_y = l_ab * cos(alpha), l_ab * sin(alpha)
    db_x, db_y = ab_x - x_d, ab_y + y_a
    settled = False
    for iterations in range(1, max_iterations + 1):  # noqa: B007 - told in the pose
        bc_x, bc_y = l_bc * cos(gamma), l_bc * sin(gamma)
        dc_x, dc_y = l_dc * cos(beta), l_dc * sin(beta)
        cg_x, cg_y = cg_1 * bc_x + cg_2 * bc_y, cg_1 * bc_y - cg_2 * bc_x
        ef_x, ef_y = l_ef * cos(delta), l_ef * sin(delta)
        fg_x, fg_y = l_fg * cos(theta), l_fg * sin(theta)
        f1 = db_x + bc_x - dc_x
        f2 = db_y - bc_y - dc_y
        f3 = ef_x + fg_x - cg_x - dc_x + x_ed
        f4 = ef_y - fg_y + cg_y - dc_y + y_e
        det1 = bc_y * dc_x + bc_x * dc_y
        det2 = ef_y * fg_x + ef_x * fg_y
        if settled or (
            -rounding_1 <= f1 <= rounding_1
            and -rounding_1 <= f2 <= rounding_1
            and -rounding_2 <= f3 <= rounding_2
            and -rounding_2 <= f4 <= rounding_2
        ):
            break
        if det1 == 0.0 or det2 == 0.0:
            return None
        d_gamma = (dc_x * f1 + dc_y * f2) / det1
        d_beta = (bc_y * f2 - bc_x * f1) / det1
        r3 = f3 + cg_y * d_gamma + dc_y * d_beta
        r4 = f4 + cg_x * d_gamma - dc_x * d_beta
        d_delta = (fg_x * r3 - fg_y * r4) / det2
        d_theta = (ef_x * r3 + ef_y * r4) / det2
        gamma += d_gamma
        beta += d_beta
        delta += d_delta
        theta += d_theta
        settled = (
            -tolerance <= d_gamma <= tolerance
            and -tolerance <= d_beta <= tolerance
            and -tolerance <= d_delta <= tolerance
            and -tolerance <= d_theta <= tolerance
        )
    else:
        return None
    # det1 and det2 are sin(gamma + beta) and sin(delta + theta) times lengths; rounding may give
    # a pose that is singular the wrong sign.
    size_1 = det1 * sign_1
    size_2 = det2 * sign_2
    if size_1 < least_1 or size_2 < least_2:
        return None
    if not (-pi < gamma <= pi and -pi < beta <= pi and -pi < delta <= pi and -pi < theta <= pi):
        if not (max(map(abs, (gamma, beta, delta, theta))) < FAR):
            return None
        gamma = wrap(gamma)
        beta = wrap(beta)
        delta = wrap(delta)
        theta = wrap(theta)
    if size_1 <= singular_1 or size_2 <= singular_2:
        coefficients = NO_COEFFICIENTS
    else:
        # Phi dx/dalpha = -df/dalpha, by the same substitution.
        gamma_1 = (dc_y * ab_x - dc_x * ab_y) / det1
        beta_1 = (bc_y * ab_x + bc_x * ab_y) / det1
        r3 = cg_y * gamma_1 + dc_y * beta_1
        r4 = cg_x * gamma_1 - dc_x * beta_1
        coefficients = (
            gamma_1,
            beta_1,
            (fg_x * r3 - fg_y * r4) / det2,
            (ef_x * r3 + ef_y * r4) / det2,
        )
    gh_x, gh_y = gh_1 * fg_x - gh_2 * fg_y, gh_1 * fg_y + gh_2 * fg_x
    # The NamedTuple's own constructor takes a twentieth of the whole time.
    return tuple.__new__(
        KlannPose,
        (
            alpha,
            gamma,
            beta,
            delta,
            theta,
            (x_d + dc_x + cg_x + gh_x, dc_y - cg_y - gh_y),
            iterations,
            hypot(f1, f2, f3, f4),
            coefficients,
            geometry,
        ),
    )
