"""Every pose that there is, and no other: 72 000 poses judged in 80-bit arithmetic."""

from dataclasses import replace
from functools import cache
import math
from typing import NamedTuple

from klann_ros.kinematics import GeometryError, klann_poses, KlannGeometry, reachable_arcs, Reason
from klann_ros.kinematics.klann import NUMBERS
import numpy as np
import pytest

LEGS = 200
ALPHAS = np.arange(360) * (2 * math.pi / 360)
# Inside of it rounding decides whether an angle can be reached.
BAND = 1e-12
both_kernels = pytest.mark.parametrize('kernel', ['numpy', 'numba'])
if np.finfo(np.longdouble).nmant < 63:
    pytest.skip('no 80-bit numbers here', allow_module_level=True)

Extended = np.ndarray


class Judgement(NamedTuple):
    """What there must be at each pose, whether rounding cannot decide it, and the least sine."""

    h: np.ndarray
    reason: np.ndarray
    sure: np.ndarray
    sine: np.ndarray


def dyad(
    p: Extended, q: Extended, r_p: Extended, r_q: Extended, sign: Extended
) -> tuple[Extended, Extended, Extended, Extended]:
    """Return a dyad's joint, how far it is within reach, folded and stretched, and its sine."""
    d = np.sqrt((q - p).real ** 2 + (q - p).imag ** 2)
    # The law of cosines by sin^2 of half the angle at P between PQ and PJ, and 1 less that.
    half = (r_q - (d - r_p)) * (r_q + (d - r_p)) / (4 * d * r_p)
    complement = ((d + r_p) - r_q) * ((d + r_p) + r_q) / (4 * d * r_p)
    cosine, sine = complement - half, 2 * np.sqrt(half * complement)
    joint = p + (q - p) * ((cosine + 1j * sign * sine) * (r_p / d))
    reach = r_p + r_q
    return joint, (d - abs(r_p - r_q)) / reach, (reach - d) / reach, sine * d / r_q


@cache
def legs() -> tuple[KlannGeometry, ...]:
    """Return legs far from the known ones: most of them do not turn fully."""
    random = np.random.default_rng(104)
    geometries: list[KlannGeometry] = []
    while len(geometries) < LEGS:
        base = (KlannGeometry.sem104(), KlannGeometry.patent())[len(geometries) % 2]
        numbers = {name: getattr(base, name) * random.uniform(0.7, 1.3) for name in NUMBERS}
        signs = base.assembly if len(geometries) % 3 else tuple(random.choice([-1, 1], 2).tolist())
        try:
            geometries.append(replace(base, **numbers, assembly=signs))
        except GeometryError:
            continue
    return tuple(geometries)


def judge(geometries: tuple[KlannGeometry, ...], alphas: np.ndarray) -> Judgement:
    """Judge poses; `alphas` has shape (n, k) or (1, k)."""

    def column(name: str) -> Extended:
        return np.array([[getattr(leg, name)] for leg in geometries], dtype=np.longdouble)

    s_1, s_2 = (column('assembly')[..., i] for i in (0, 1))
    alphas = alphas.astype(np.longdouble)
    bend_c, bend_g = (np.exp(1j * column(name)) for name in ('angle_bcg', 'angle_fgh'))
    b = 1j * column('y_a') + column('l_ab') * np.exp(1j * alphas)
    e = column('x_e') + 1j * column('y_e')
    with np.errstate(invalid='ignore'):
        c, *first = dyad(b, column('x_d') + 0j * b, column('l_bc'), column('l_dc'), s_1)
        g = c + column('l_cg') / column('l_bc') * bend_c * (c - b)
        f, *second = dyad(e, g, column('l_ef'), column('l_fg'), s_2)
        h = g + column('l_gh') / column('l_fg') * bend_g.conj() * (g - f)
    reason = np.full(b.shape, Reason.SOLVED)
    sure = np.ones(b.shape, dtype=bool)
    for too_far, too_close, (folded, stretched, _) in (
        (Reason.DYAD_2_TOO_FAR, Reason.DYAD_2_TOO_CLOSE, second),
        (Reason.DYAD_1_TOO_FAR, Reason.DYAD_1_TOO_CLOSE, first),
    ):
        reason[stretched < 0] = too_far
        reason[folded < 0] = too_close
        sure &= ~(np.minimum(abs(stretched), abs(folded)) <= BAND)
    sine = np.minimum(first[-1], second[-1]).astype(np.float64)
    return Judgement(h.astype(np.complex128), reason, sure, sine)


@cache
def ends_of_arcs() -> list[tuple[KlannGeometry, float]]:
    """Return where the reach of thirty legs ends."""
    return [(leg, end) for leg in legs()[:30] for arc in reachable_arcs(leg) for end in arc]


def error(h: np.ndarray, expected: np.ndarray) -> np.ndarray:
    return np.hypot(h[..., 0] - expected.real, h[..., 1] - expected.imag)


@both_kernels
def test_exactly_the_reachable_poses_are_solved_and_exact_to_rounding(kernel: str) -> None:
    h, reason, sure, sine = judge(legs(), ALPHAS[None, :])
    poses = klann_poses(legs(), ALPHAS, kernel=kernel)
    assert sure.mean() > 0.999999
    np.testing.assert_array_equal(poses.reason[sure], reason[sure])
    np.testing.assert_array_equal(np.isfinite(poses.h).all(axis=2), poses.reason == 0)
    np.testing.assert_array_equal(np.isnan(poses.h).all(axis=2), poses.reason != 0)
    # The set is a hard one.
    assert 0.5 < (reason != 0).any(axis=1).mean() < 0.95
    assert all((reason == code).mean() > 0.01 for code in range(6) if code != 1)
    solved = (reason == 0) & sure
    assert (error(poses.h, h)[solved] <= 1e-14 / np.minimum(1.0, sine[solved])).all()


@both_kernels
@pytest.mark.parametrize('offset', [1e-3, 1e-6, 1e-9])
def test_the_edge_of_the_reach_is_sharp(offset: float, kernel: str) -> None:
    ends = ends_of_arcs()
    assert len(ends) > 40
    alphas = np.array([[end - offset, end + offset] for _, end in ends])
    expected = judge(tuple(leg for leg, _ in ends), alphas)
    for (leg, _), angles, h, reason, sure, sine in zip(ends, alphas, *expected, strict=True):
        poses = klann_poses(leg, angles, kernel=kernel)
        np.testing.assert_array_equal(poses.reason[sure], reason[sure])
        solved = sure & (reason == 0)
        errors = error(poses.h, h)[solved]
        assert (errors <= 1e-11 / np.minimum(1.0, 1e3 * sine[solved])).all()
