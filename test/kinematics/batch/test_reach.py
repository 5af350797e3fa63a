"""Every pose that there is, and no other: 72 000 poses judged in 80-bit arithmetic."""

from dataclasses import replace
from functools import cache
import math
from typing import NamedTuple

from klann_ros.kinematics import GeometryError, klann_poses, KlannGeometry, reachable_arcs, Reason
from klann_ros.kinematics.klann import BENDS, COORDINATES, LENGTHS
import numpy as np
import pytest

LEGS, ANGLES = 200, 360
# Inside of it rounding decides whether an angle can be reached.
BAND = 1e-12

Extended = np.ndarray


class Dyad(NamedTuple):
    """Where a dyad's joint is (complex), how far within reach (relative), and its sine."""

    joint: Extended
    folded: Extended
    stretched: Extended
    sine: Extended


class Judgement(NamedTuple):
    """What there must be at each pose; `unsure` where rounding may decide."""

    h: np.ndarray
    reason: np.ndarray
    unsure: np.ndarray
    sine: np.ndarray


def dyad(p: Extended, q: Extended, r_p: Extended, r_q: Extended, sign: Extended) -> Dyad:
    """Close a dyad by the law of cosines, with the half angle's sine for its digits."""
    d = np.sqrt((q - p).real ** 2 + (q - p).imag ** 2)
    # sin^2 of half the angle at P between PQ and PJ, and 1 less that.
    half = (r_q - (d - r_p)) * (r_q + (d - r_p)) / (4 * d * r_p)
    rest = ((d + r_p) - r_q) * ((d + r_p) + r_q) / (4 * d * r_p)
    cosine, sine = rest - half, 2 * np.sqrt(half * rest)
    joint = p + (q - p) * ((cosine + 1j * sign * sine) * (r_p / d))
    reach = r_p + r_q
    return Dyad(joint, (d - abs(r_p - r_q)) / reach, (reach - d) / reach, sine * d / r_q)


@cache
def legs() -> tuple[KlannGeometry, ...]:
    """Return legs far from the known ones: most of them do not turn fully."""
    random = np.random.default_rng(104)
    made: list[KlannGeometry] = []
    while len(made) < LEGS:
        base = (KlannGeometry.sem104(), KlannGeometry.patent())[len(made) % 2]
        numbers = {
            name: getattr(base, name) * random.uniform(0.7, 1.3)
            for name in (*LENGTHS, *COORDINATES, *BENDS)
        }
        signs = base.assembly if len(made) % 3 else tuple(random.choice([-1, 1], 2).tolist())
        try:
            made.append(replace(base, **numbers, assembly=signs))
        except GeometryError:
            continue
    return tuple(made)


def judge(geometries: tuple[KlannGeometry, ...], alphas: np.ndarray) -> Judgement:
    """Judge poses; `alphas` has shape (n, k) or (1, k)."""

    def of(name: str) -> Extended:
        return np.array([[getattr(leg, name)] for leg in geometries], dtype=np.longdouble)

    s_1, s_2 = (of('assembly')[..., i] for i in (0, 1))
    alphas = alphas.astype(np.longdouble)
    bends = {name: np.cos(of(name)) + 1j * np.sin(of(name)) for name in BENDS}
    b = 1j * of('y_a') + of('l_ab') * (np.cos(alphas) + 1j * np.sin(alphas))
    e = of('x_e') + 1j * of('y_e')
    with np.errstate(invalid='ignore'):
        first = dyad(b, of('x_d') + 0j * b, of('l_bc'), of('l_dc'), s_1)
        c = first.joint
        g = c + of('l_cg') / of('l_bc') * bends['angle_bcg'] * (c - b)
        second = dyad(e, g, of('l_ef'), of('l_fg'), s_2)
        h = g + of('l_gh') / of('l_fg') * bends['angle_fgh'].conj() * (g - second.joint)
    reason = np.full(b.shape, Reason.SOLVED)
    unsure = np.zeros(b.shape, dtype=bool)
    for far, close, made in (
        (Reason.DYAD_2_TOO_FAR, Reason.DYAD_2_TOO_CLOSE, second),
        (Reason.DYAD_1_TOO_FAR, Reason.DYAD_1_TOO_CLOSE, first),
    ):
        reason[made.stretched < 0] = far
        reason[made.folded < 0] = close
        unsure |= np.minimum(abs(made.stretched), abs(made.folded)) <= BAND
    sine = np.minimum(first.sine, second.sine).astype(np.float64)
    return Judgement(h.astype(np.complex128), reason, unsure, sine)


@cache
def judged() -> Judgement:
    """Judge all legs, a few at a time: 80-bit numbers are slow enough within the cache."""
    alphas = np.arange(ANGLES)[None, :] * (2 * math.pi / ANGLES)
    parts = [judge(some, alphas) for some in zip(*[iter(legs())] * 20, strict=True)]
    return Judgement(*(np.concatenate(part) for part in zip(*parts, strict=True)))


@cache
def ends_of_arcs() -> list[tuple[KlannGeometry, float]]:
    """Return where the reach of thirty legs ends."""
    return [(leg, end) for leg in legs()[:30] for arc in reachable_arcs(leg) for end in arc]


def error(h: np.ndarray, expected: np.ndarray) -> np.ndarray:
    return np.hypot(h[..., 0] - expected.real, h[..., 1] - expected.imag)


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason='no 80-bit numbers here')
@pytest.mark.parametrize('kernel', ['numpy', 'numba'])
def test_exactly_the_reachable_poses_are_solved_and_exact_to_rounding(kernel: str) -> None:
    expected = judged()
    poses = klann_poses(legs(), np.arange(ANGLES) * (2 * math.pi / ANGLES), kernel=kernel)
    sure = ~expected.unsure
    assert sure.mean() > 0.999999
    np.testing.assert_array_equal(poses.reason[sure], expected.reason[sure])
    np.testing.assert_array_equal(np.isfinite(poses.h).all(axis=2), poses.reason == 0)
    np.testing.assert_array_equal(np.isnan(poses.h).all(axis=2), poses.reason != 0)
    # The set is a hard one.
    stuck = (expected.reason != 0).any(axis=1)
    assert 0.5 < stuck.mean() < 0.95
    assert all((expected.reason == reason).mean() > 0.01 for reason in range(6) if reason != 1)
    solved = (expected.reason == 0) & sure
    apart = error(poses.h, expected.h)[solved]
    assert (apart <= 1e-14 / np.minimum(1.0, expected.sine[solved])).all()


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason='no 80-bit numbers here')
@pytest.mark.parametrize('kernel', ['numpy', 'numba'])
@pytest.mark.parametrize('offset', [1e-3, 1e-6, 1e-9])
def test_the_edge_of_the_reach_is_sharp(offset: float, kernel: str) -> None:
    ends = ends_of_arcs()
    assert len(ends) > 40
    alphas = np.array([[end - offset, end + offset] for _, end in ends])
    geometries = tuple(leg for leg, _ in ends)
    expected = judge(geometries, alphas)
    for k in range(len(ends)):
        poses = klann_poses(geometries[k], alphas[k], kernel=kernel)
        sure = ~expected.unsure[k]
        np.testing.assert_array_equal(poses.reason[sure], expected.reason[k][sure])
        solved = sure & (expected.reason[k] == 0)
        apart = error(poses.h, expected.h[k])[solved]
        assert (apart <= 1e-11 / np.minimum(1.0, 1e3 * expected.sine[k][solved])).all()
