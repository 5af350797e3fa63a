"""
Time poses of the Klann leg, one by one and by the million: ours, SciPy's fsolve and pylinkage.

All solve the same leg in the same run, in turn and several times. What counts is the ratio of the
times a pose, since the machine's speed drifts. pylinkage and fsolve are slow, so they solve fewer
poses; the first column says how many. The errors are those of H, against 80-bit arithmetic.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import math
from math import atan2, cos, hypot, sin
from statistics import median
import sys
from time import perf_counter
from typing import Any

from klann_ros.kinematics import klann_poses, KlannGeometry, KlannLeg
import numba
import numpy as np
from pylinkage.actuators import Crank
from pylinkage.components import Ground
from pylinkage.dyads import FixedDyad, RRRDyad
from pylinkage.simulation import Linkage
from scipy.optimize import fsolve
from support.aims import exit_code, is_met, sized

ROUNDS_OF_A_TURN, ROUNDS_OF_A_MILLION = sized(1, 41), sized(1, 9)
MILLION = sized(100_000, 1_000_000)
GEOMETRY = KlannGeometry.sem104()
# Arrays and numbers of 80 bits; NumPy types them by platform.
Extended = Any


@dataclass
class Way:
    """A name, how many poses one call makes, and the call, which returns H if it makes it."""

    name: str
    poses: int
    call: Callable[[], Sequence[tuple[float, float]] | np.ndarray | None]
    times: list[float] = field(default_factory=list)
    error: float | None = None

    @property
    def time(self) -> float:
        """Return the median time a pose [s]."""
        return median(self.times)

    def ratio(self, reference: 'Way') -> float:
        """Return the ratio of its times a pose to a reference: the median over the rounds."""
        return median(time / base for time, base in zip(self.times, reference.times, strict=True))


@dataclass(frozen=True)
class Aim:
    """Maximum ratio of the times per pose of two solvers; None: only reported."""

    way: str
    reference: str
    max_ratio: float | None = None


def run(ways: Sequence[Way], expected: np.ndarray, rounds: int) -> None:
    """Time all ways in turn, several times; take the errors of the first round."""
    for way in ways:
        feet = way.call()
        if feet is not None:
            way.error = float(np.abs(np.asarray(feet) - expected[: way.poses]).max())
    for _ in range(rounds):
        for way in ways:
            begin = perf_counter()
            way.call()
            way.times.append((perf_counter() - begin) / way.poses)


def report(ways: Sequence[Way], aims: Sequence[Aim]) -> bool:
    """Print the results; return whether the aims are met."""
    print(f'{"":36} {"poses":>9} {"us a pose":>10} {"best":>9} {"error/m":>9}')
    for way in ways:
        error = '' if way.error is None else f'{way.error:.1e}'
        best = min(way.times) * 1e6
        print(f'{way.name:36} {way.poses:9} {way.time * 1e6:10.4f} {best:9.4f} {error:>9}')
    named = {way.name: way for way in ways}
    met = True
    for aim in aims:
        ratio = named[aim.way].ratio(named[aim.reference])
        name = f'{aim.way} / {aim.reference}'
        if aim.max_ratio is None:
            print(f'{name}: {ratio:.4f}')
        else:
            met &= is_met(name, ratio, aim.max_ratio)
    return met


def exact_feet(geometry: KlannGeometry, alphas: np.ndarray) -> Extended:
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


class FsolveLeg:
    """
    A leg whose every pose starts from the one before.

    fsolve is given the textbook's f and the analytic Jacobian Phi.
    """

    def __init__(self, geometry: KlannGeometry) -> None:
        """Start at a crank angle of 0."""
        self._geometry = geometry
        self._x = np.array(KlannLeg(geometry).closed_form(0.0).x)

    def feet(self, alphas: Sequence[float]) -> list[tuple[float, float]]:
        """Return H at some crank angles [m]."""
        return [self._foot(alpha) for alpha in alphas]

    def _foot(self, alpha: float) -> tuple[float, float]:
        g = self._geometry
        ab = g.l_ab * cos(alpha), g.l_ab * sin(alpha)
        self._x = fsolve(self._f, self._x, args=ab, fprime=self._phi, xtol=1e-12)
        gamma, beta, _, theta = self._x.tolist()
        bent_c = gamma - g.angle_bcg
        bent_g = theta + g.angle_fgh
        return (
            g.x_d + g.l_dc * cos(beta) + g.l_cg * cos(bent_c) + g.l_gh * cos(bent_g),
            g.l_dc * sin(beta) - g.l_cg * sin(bent_c) - g.l_gh * sin(bent_g),
        )

    def _f(self, x: np.ndarray, ab_x: float, ab_y: float) -> list[float]:
        """Return the loop equations' left-hand sides, shape (4,) [m]."""
        g = self._geometry
        gamma, beta, delta, theta = x.tolist()
        bent = gamma - g.angle_bcg
        dc_x = g.l_dc * cos(beta)
        dc_y = g.l_dc * sin(beta)
        return [
            ab_x + g.l_bc * cos(gamma) - dc_x - g.x_d,
            ab_y - g.l_bc * sin(gamma) - dc_y + g.y_a,
            g.l_ef * cos(delta) + g.l_fg * cos(theta) - g.l_cg * cos(bent) - dc_x - g.x_d + g.x_e,
            g.l_ef * sin(delta) - g.l_fg * sin(theta) + g.l_cg * sin(bent) - dc_y + g.y_e,
        ]

    def _phi(self, x: np.ndarray, *_: float) -> list[list[float]]:
        """Return the Jacobian, shape (4, 4) [m/rad]."""
        g = self._geometry
        gamma, beta, delta, theta = x.tolist()
        bent = gamma - g.angle_bcg
        dc_x = g.l_dc * cos(beta)
        dc_y = g.l_dc * sin(beta)
        return [
            [-g.l_bc * sin(gamma), dc_y, 0.0, 0.0],
            [-g.l_bc * cos(gamma), -dc_x, 0.0, 0.0],
            [g.l_cg * sin(bent), dc_y, -g.l_ef * sin(delta), -g.l_fg * sin(theta)],
            [g.l_cg * cos(bent), -dc_x, g.l_ef * cos(delta), -g.l_fg * cos(theta)],
        ]


class PylinkageLeg:
    """
    A leg that turns in equal steps, one pose after the other; that is pylinkage's way.

    Parameters
    ----------
    geometry : KlannGeometry
        The leg.
    step : float
        Of the crank [rad].

    """

    def __init__(self, geometry: KlannGeometry, step: float) -> None:
        """Build it at a crank angle of 0, so that the first pose is one step on."""
        g = geometry
        start = KlannLeg(geometry).closed_form(0.0).points
        a = Ground(0.0, g.y_a)
        d = Ground(g.x_d, 0.0)
        e = Ground(g.x_e, g.y_e)
        b = Crank(anchor=a, radius=g.l_ab, angular_velocity=step)
        # Each dyad stays nearest to where it was; these are the starts.
        c = RRRDyad(b.output, d, g.l_bc, g.l_dc, x=start[2, 0], y=start[2, 1])
        g_ = FixedDyad(b.output, c, *_end(g.l_bc, g.l_cg, g.angle_bcg))
        f = RRRDyad(e, g_, g.l_ef, g.l_fg, x=start[5, 0], y=start[5, 1])
        h = FixedDyad(f, g_, *_end(g.l_fg, g.l_gh, -g.angle_fgh))
        self._linkage = Linkage([a, d, e, b, c, g_, f, h])
        self._linkage.compile()

    def feet(self, count: int) -> np.ndarray:
        """Return H of the next poses by `step`, shape (count, 2) [m]."""
        return np.array([pose[-1] for pose in self._linkage.step(count)])

    def feet_fast(self, count: int) -> np.ndarray:
        """Return H of the next poses by the compiled `step_fast`, shape (count, 2) [m]."""
        return np.asarray(self._linkage.step_fast(count)[:, -1])


def _end(first: float, second: float, bend: float) -> tuple[float, float]:
    """Return R of a bent body P-Q-R as pylinkage wants it: |PR|, and the angle from PQ to PR."""
    x = first + second * np.cos(bend)
    y = second * np.sin(bend)
    return hypot(x, y), atan2(y, x)


@numba.njit  # type: ignore[untyped-decorator]
def sines_and_cosines(alphas: np.ndarray) -> float:
    """Take what no pose can do without, and do nothing with it but to add it up."""
    total = 0.0
    for k in range(alphas.size):
        total += math.cos(alphas[k]) + math.sin(alphas[k])
    return total


def one_by_one() -> bool:
    """Solve a turn in steps of 1 deg, each pose started from the one before."""
    alphas = [math.radians(k) for k in range(1, 361)]
    leg = KlannLeg(GEOMETRY)
    fsolve = FsolveLeg(GEOMETRY)
    pylinkage = PylinkageLeg(GEOMETRY, math.radians(1))
    ways = [
        Way('KlannLeg.solve', 360, lambda: [leg.solve(alpha).h for alpha in alphas]),
        Way('KlannLeg.closed_form', 360, lambda: [leg.closed_form(alpha).h for alpha in alphas]),
        Way('pylinkage step', 360, lambda: pylinkage.feet(360)),
        Way('SciPy fsolve', 360, lambda: fsolve.feet(alphas)),
    ]
    aims = [
        Aim('KlannLeg.solve', 'pylinkage step', 0.45),
        Aim('KlannLeg.solve', 'SciPy fsolve', 0.15),
    ]
    run(ways, exact_feet(GEOMETRY, np.array(alphas)), ROUNDS_OF_A_TURN)
    print(f'One pose at a time, warm started, {ROUNDS_OF_A_TURN} rounds in turn')
    return report(ways, aims)


def by_the_million() -> bool:
    """Solve a million poses of one leg, with H into an array that is there already."""
    step = 2 * math.pi / MILLION
    # pylinkage starts at 0 and makes a step first; it adds its steps up.
    alphas = step * np.arange(1, MILLION + 1)
    out = np.empty((MILLION, 2))
    sums: list[float] = []
    step_leg = PylinkageLeg(GEOMETRY, step)
    fast_leg = PylinkageLeg(GEOMETRY, step)

    def ours(kernel: str, **more: bool) -> Way:
        name = ' + '.join([f'klann_poses {kernel}', *more])
        return Way(
            name, MILLION, lambda: klann_poses(GEOMETRY, alphas, out=out, kernel=kernel, **more).h
        )

    ways = [
        ours('numba'),
        ours('numpy'),
        *(ours(kernel, angles=True) for kernel in ('numba', 'numpy')),
        *(ours(kernel, points=True) for kernel in ('numba', 'numpy')),
        Way(
            'sines and cosines alone, numba',
            MILLION,
            lambda: sums.append(sines_and_cosines(alphas)),
        ),
        Way('pylinkage step', 10_000, lambda: step_leg.feet(10_000)),
        Way('pylinkage step_fast', 100_000, lambda: fast_leg.feet_fast(100_000)),
    ]
    aims = [
        Aim('klann_poses numba', 'pylinkage step', 1 / 25),
        Aim('klann_poses numba', 'sines and cosines alone, numba', 2.5),
        Aim('klann_poses numpy', 'pylinkage step', 1 / 5),
        Aim('klann_poses numba', 'pylinkage step_fast'),
        Aim('klann_poses numpy', 'pylinkage step_fast'),
    ]
    run(ways, exact_feet(GEOMETRY, alphas), ROUNDS_OF_A_MILLION)
    print(f'\nA million poses, {ROUNDS_OF_A_MILLION} rounds in turn')
    return report(ways, aims)


def main() -> int:
    """Print both tables; return 0 if every aim is met."""
    met = [one_by_one(), by_the_million()]
    return exit_code(*met)


if __name__ == '__main__':
    sys.exit(main())
