"""
Time one pose of the Klann leg, warm started at 1 deg steps: ours against SciPy's fsolve.

Both solve the same poses in the same run, in turn and several times, from the same kind of start:
the pose before. fsolve is given the textbook's f and the analytic Jacobian Phi, both in the
quickest form that NumPy allows. What counts is the ratio; the machine's speed drifts.
"""

from collections.abc import Callable
import math
from statistics import median
import sys
from time import perf_counter

from klann_ros.kinematics import KlannGeometry, KlannLeg
import numpy as np
from scipy.optimize import fsolve

ROUNDS = 9
ALPHAS = [math.radians(k) for k in range(360)]
GEOMETRY = KlannGeometry.sem104()


def newton() -> list[tuple[float, ...]]:
    """Solve a turn by KlannLeg.solve."""
    return [LEG.solve(alpha).x for alpha in ALPHAS]


def closed_form() -> list[tuple[float, ...]]:
    """Solve a turn by KlannLeg.closed_form."""
    return [LEG.closed_form(alpha).x for alpha in ALPHAS]


def scipy_fsolve() -> list[np.ndarray]:
    """Solve a turn by fsolve, each pose from the one before."""
    x, poses = np.array(LEG.closed_form(ALPHAS[0]).x), []
    for alpha in ALPHAS:
        ab = GEOMETRY.l_ab * math.cos(alpha), GEOMETRY.l_ab * math.sin(alpha)
        x = fsolve(f, x, args=ab, fprime=phi, xtol=1e-12)
        poses.append(x)
    return poses


def f(x: np.ndarray, ab_x: float, ab_y: float) -> list[float]:
    """Return the loop equations' left-hand sides, shape (4,) [m]."""
    g, (gamma, beta, delta, theta) = GEOMETRY, x.tolist()
    cos, sin, bent = math.cos, math.sin, gamma - g.angle_bcg
    dc_x, dc_y = g.l_dc * cos(beta), g.l_dc * sin(beta)
    return [
        ab_x + g.l_bc * cos(gamma) - dc_x - g.x_d,
        ab_y - g.l_bc * sin(gamma) - dc_y + g.y_a,
        g.l_ef * cos(delta) + g.l_fg * cos(theta) - g.l_cg * cos(bent) - dc_x - g.x_d + g.x_e,
        g.l_ef * sin(delta) - g.l_fg * sin(theta) + g.l_cg * sin(bent) - dc_y + g.y_e,
    ]


def phi(x: np.ndarray, *_: float) -> list[list[float]]:
    """Return the Jacobian, shape (4, 4) [m/rad]."""
    g, (gamma, beta, delta, theta) = GEOMETRY, x.tolist()
    cos, sin, bent = math.cos, math.sin, gamma - g.angle_bcg
    dc_x, dc_y = g.l_dc * cos(beta), g.l_dc * sin(beta)
    return [
        [-g.l_bc * sin(gamma), dc_y, 0.0, 0.0],
        [-g.l_bc * cos(gamma), -dc_x, 0.0, 0.0],
        [g.l_cg * sin(bent), dc_y, -g.l_ef * sin(delta), -g.l_fg * sin(theta)],
        [g.l_cg * cos(bent), -dc_x, g.l_ef * cos(delta), -g.l_fg * cos(theta)],
    ]


LEG = KlannLeg(GEOMETRY)
WAYS: dict[str, Callable[[], list]] = {
    'KlannLeg.solve': newton,
    'KlannLeg.closed_form': closed_form,
    'scipy.optimize.fsolve': scipy_fsolve,
}


def main() -> int:
    """Print the table; return 0 if solve is at least 5 times as fast as fsolve."""
    expected = np.array([LEG.closed_form(alpha).x for alpha in ALPHAS])
    times: dict[str, list[float]] = {name: [] for name in WAYS}
    errors = {}
    for _ in range(ROUNDS):
        for name, way in WAYS.items():
            begin = perf_counter()
            poses = way()
            times[name].append((perf_counter() - begin) / len(ALPHAS) * 1e6)
            errors[name] = np.abs(np.array(poses) - expected).max()
    ours = times['KlannLeg.solve']
    print(f'{len(ALPHAS)} poses at 1 deg steps, {ROUNDS} rounds in turn')
    print(f'{"":22} {"us a pose":>10} {"best":>7} {"of solve":>9} {"error/rad":>10}')
    ratios = {}
    for name, all_times in times.items():
        ratios[name] = median(theirs / own for theirs, own in zip(all_times, ours, strict=True))
        print(
            f'{name:22} {median(all_times):10.2f} {min(all_times):7.2f} '
            f'{ratios[name]:8.2f}x {errors[name]:10.1e}'
        )
    return 0 if ratios['scipy.optimize.fsolve'] >= 5.0 else 1


if __name__ == '__main__':
    sys.exit(main())
