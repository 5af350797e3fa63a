"""
Exercises on the Klann leg, by SEM 104's equations: Newton, geometric method, motion, foot, torque.

References
----------
R. Nicoletti, SEM 104 Mecanismos, lecture 7.

"""

from collections.abc import Callable, Mapping
from math import degrees, hypot, radians
from typing import Any

from klann_ros.kinematics import foot_path, KlannGeometry, KlannLeg
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .calculation import Calculation
from .variant import Draw, Kind, kind_of

Givens = Mapping[str, float]
MM = 1e3
BARS, PIVOTS = ('AB', 'BC', 'DC', 'CG', 'EF', 'FG', 'GH'), ('x_D', 'y_A', 'x_E', 'y_E')
KLANN_LENGTHS = (*(f'L_{bar}' for bar in BARS), *PIVOTS)
ANGLES = ('gamma', 'beta', 'delta', 'theta')
BENDS = ('angle_BCG', 'angle_FGH')
# Crank angles of the table of the foot path, and of its printed rows [deg].
PATH_STEP, PRINTED_STEP = 2, 30


def _leg(givens: Givens) -> tuple[KlannLeg, float]:
    lengths: dict[str, Any] = {name.lower(): givens[name] / MM for name in KLANN_LENGTHS}
    bends: dict[str, Any] = {name.lower(): radians(givens[name]) for name in BENDS}
    return KlannLeg(KlannGeometry(**lengths, **bends)), radians(givens.get('alpha', 60.0))


def _equations(c: Calculation, x: FloatArray) -> FloatArray:
    gamma, beta, delta, theta = x.tolist()
    bent, cos, sin = gamma - c['angle_BCG'], c.cos, c.sin
    return np.array(
        [
            c['L_AB'] * cos(c['alpha']) + c['L_BC'] * cos(gamma) - c['L_DC'] * cos(beta)
            - c['x_D'],
            c['L_AB'] * sin(c['alpha']) - c['L_BC'] * sin(gamma) - c['L_DC'] * sin(beta)
            + c['y_A'],
            c['L_EF'] * cos(delta) + c['L_FG'] * cos(theta) - c['L_CG'] * cos(bent)
            - c['L_DC'] * cos(beta) - c['x_D'] + c['x_E'],
            c['L_EF'] * sin(delta) - c['L_FG'] * sin(theta) + c['L_CG'] * sin(bent)
            - c['L_DC'] * sin(beta) + c['y_E'],
        ]
    )  # fmt: skip


def _jacobian(c: Calculation, x: FloatArray) -> FloatArray:
    gamma, beta, delta, theta = x.tolist()
    bent, cos, sin = gamma - c['angle_BCG'], c.cos, c.sin
    l_dc, l_ef, l_fg, l_cg = c.many('L_DC', 'L_EF', 'L_FG', 'L_CG')
    return np.array(
        [
            [-c['L_BC'] * sin(gamma), l_dc * sin(beta), 0.0, 0.0],
            [-c['L_BC'] * cos(gamma), -l_dc * cos(beta), 0.0, 0.0],
            [l_cg * sin(bent), l_dc * sin(beta), -l_ef * sin(delta), -l_fg * sin(theta)],
            [l_cg * cos(bent), -l_dc * cos(beta), l_ef * cos(delta), -l_fg * cos(theta)],
        ]
    )


def _geometric(c: Calculation) -> FloatArray:
    """Return gamma, beta, delta, theta by two triangles, assembly (+1, +1) [deg]."""
    b_x = c.step('x_B', c['L_AB'] * c.cos(c['alpha']), 'mm', 'L_AB cos α')
    b_y = c.step('y_B', c['y_A'] + c['L_AB'] * c.sin(c['alpha']), 'mm', 'y_A + L_AB sin α')
    # C is on the circles about D and B, G and F on those about E and G.
    beta = _corner(c, (c['x_D'], 0.0), (b_x, b_y), ('L_DC', 'L_BC', 'BD'), c.sign(1))
    c_x = c.step('x_C', c['x_D'] + c['L_DC'] * c.cos(beta), 'mm', 'x_D + L_DC cos β')
    c_y = c.step('y_C', c['L_DC'] * c.sin(beta), 'mm', 'L_DC sin β')
    gamma = -c.atan2(c_y - b_y, c_x - b_x)
    bent = gamma - c['angle_BCG']
    g_x = c.step('x_G', c_x + c['L_CG'] * c.cos(bent), 'mm', 'x_C + L_CG cos(γ - ∠BCG)')
    g_y = c.step('y_G', c_y - c['L_CG'] * c.sin(bent), 'mm', 'y_C - L_CG sin(γ - ∠BCG)')
    e = c['x_E'], c['y_E']
    delta = _corner(c, e, (g_x, g_y), ('L_EF', 'L_FG', 'EG'), -c.sign(2))
    f_x = c.step('x_F', e[0] + c['L_EF'] * c.cos(delta), 'mm', 'x_E + L_EF cos δ')
    f_y = c.step('y_F', e[1] + c['L_EF'] * c.sin(delta), 'mm', 'y_E + L_EF sin δ')
    theta = -c.atan2(g_y - f_y, g_x - f_x)
    angles = (gamma, beta, delta, theta)
    for name, value in zip(ANGLES, angles, strict=True):
        c.answer(name, value, 'deg')
    return np.array(angles)


def _corner(
    c: Calculation,
    pivot: tuple[float, float],
    to: tuple[float, float],
    names: tuple[str, str, str],
    sign: float,
) -> float:
    """Return the direction of the first bar of a triangle over pivot and pin [deg]."""
    first, second, diagonal = names
    x, y = to[0] - pivot[0], to[1] - pivot[1]
    far = c.step(diagonal, hypot(x, y), 'mm', f'|{diagonal}|')
    cosine = (far**2 + c[first] ** 2 - c[second] ** 2) / (2.0 * far * c[first])
    rule = f'cos φ = ({diagonal}² + {first}² - {second}²) / (2 {diagonal} {first})'
    angle = c.step(f'phi_{diagonal}', c.acos(cosine), 'deg', rule)
    base = c.step(f'psi_{diagonal}', c.atan2(y, x), 'deg', f'∠({diagonal})')
    return c.wrapped(base - sign * angle)


def _foot(c: Calculation, x: FloatArray) -> tuple[float, float]:
    gamma, beta, _, theta = x.tolist()
    bent, leg = gamma - c['angle_BCG'], theta + c['angle_FGH']
    l_dc, l_cg, l_gh = c.many('L_DC', 'L_CG', 'L_GH')
    h_x = c['x_D'] + l_dc * c.cos(beta) + l_cg * c.cos(bent) + l_gh * c.cos(leg)
    h_y = l_dc * c.sin(beta) - l_cg * c.sin(bent) - l_gh * c.sin(leg)
    return h_x, h_y


def _foot_derivative(c: Calculation, x: FloatArray) -> FloatArray:
    """Return dH/d(gamma, beta, theta), shape (2, 3) [mm/rad]."""
    gamma, beta, _, theta = x.tolist()
    bent, leg = gamma - c['angle_BCG'], theta + c['angle_FGH']
    l_dc, l_cg, l_gh = c.many('L_DC', 'L_CG', 'L_GH')
    return np.array(
        [
            [-l_cg * c.sin(bent), -l_dc * c.sin(beta), -l_gh * c.sin(leg)],
            [-l_cg * c.cos(bent), l_dc * c.cos(beta), -l_gh * c.cos(leg)],
        ]
    )


def _rates(c: Calculation, x: FloatArray, omega: float) -> FloatArray:
    """Return the rates of the four angles: Phi dx/dt = -df/dalpha omega [rad/s]."""
    by_alpha = c['L_AB'] * np.array([-c.sin(c['alpha']), c.cos(c['alpha']), 0.0, 0.0])
    rates = c.solve(_jacobian(c, x), -omega * by_alpha)
    for name, value in zip(ANGLES, rates.tolist(), strict=True):
        c.step(f'omega_{name}', value, 'rad/s', 'Φ ω = -∂f/∂α ω_α')
    return rates


def _foot_velocity(c: Calculation, x: FloatArray, rates: FloatArray) -> FloatArray:
    moving: FloatArray = _foot_derivative(c, x) @ rates[[0, 1, 3]]
    return moving


# The kinds: draw, work by the course's formulas, key by the library.


def guesses(position: Kind, names: tuple[str, ...]) -> Callable[[Draw, dict[str, float]], None]:
    """Return what adds a guess near the root to the givens, in multiples of 5 deg."""

    def complete(draw: Draw, givens: dict[str, float]) -> None:
        worked = position.calculated(givens)
        for name in names:
            root = float(worked.answers[name]) if worked else 0.0
            givens[f'{name}_1'] = 5.0 * round(root / 5.0) + 5.0 * draw.value(-3.0, 3.0)

    return complete


def _work_newton(c: Calculation) -> None:
    guess = np.array(c.many(*(f'{name}_1' for name in ANGLES)))
    c.newton(lambda x: _equations(c, x), lambda x: _jacobian(c, x), guess, ANGLES)
    c.use_other_root(_geometric, ANGLES)


def newton_key(run: FloatArray, f: FloatArray, phi: FloatArray, names: tuple[str, ...]) -> Givens:
    """Return the answers of a run of the library's Newton, iterates in rad, f and Phi in mm."""
    moved = np.abs(np.degrees(np.diff(run, axis=0))).max(axis=1)
    found = {f'f_{k}': value for k, value in enumerate(f.tolist(), 1)}
    found |= {'Phi_12': float(phi[0, 1]), 'Phi_21': float(phi[1, 0])}
    found |= {f'{name}_2': degrees(value) for name, value in zip(names, run[1], strict=True)}
    found |= {name: degrees(value) for name, value in zip(names, run[-1], strict=True)}
    return {**found, 'iterations': float(np.argmax(moved <= 1e-2) + 1)}


def _key_newton(givens: Givens) -> Givens:
    leg, alpha = _leg(givens)
    guess = [radians(givens[f'{name}_1']) for name in ANGLES]
    f, phi = MM * leg.f(alpha, guess), MM * leg.phi(alpha, guess)
    return newton_key(leg.newton(alpha, guess), f, phi, ANGLES)


def _work_position(c: Calculation) -> None:
    h_x, h_y = _foot(c, _geometric(c))
    c.answer('x_H', h_x, 'mm', 'x_D + L_DC cos β + L_CG cos(γ - ∠BCG) + L_GH cos(θ + ∠FGH)')
    c.answer('y_H', h_y, 'mm', 'L_DC sin β - L_CG sin(γ - ∠BCG) - L_GH sin(θ + ∠FGH)')


def _key_position(givens: Givens) -> Givens:
    leg, alpha = _leg(givens)
    pose = leg.closed_form(alpha)
    angles = {name: degrees(getattr(pose, name)) for name in ANGLES}
    return {**angles, 'x_H': MM * pose.h[0], 'y_H': MM * pose.h[1]}


def _work_velocity(c: Calculation) -> None:
    x = _geometric(c)
    rates = _rates(c, x, c['omega'])
    for name, value in zip(ANGLES, rates.tolist(), strict=True):
        c.answer(f'omega_{name}', value)
    for name, value in zip('xy', _foot_velocity(c, x, rates).tolist(), strict=True):
        c.answer(f'v_H{name}', value, 'mm/s', f'd{name}_H/dt')


def _key_velocity(givens: Givens) -> Givens:
    leg, alpha = _leg(givens)
    moving = leg.velocity(leg.closed_form(alpha), givens['omega'])
    rates = {f'omega_{name}': float(getattr(moving, name)) for name in ANGLES}
    return {**rates, 'v_Hx': MM * moving.h[0], 'v_Hy': MM * moving.h[1]}


def _work_acceleration(c: Calculation) -> None:
    x, omega, epsilon = _geometric(c), c['omega'], c['epsilon']
    rates = _rates(c, x, omega)
    gamma, beta, delta, theta = x.tolist()
    # Phi d2x/dt2 = -(df/dalpha epsilon + the terms of the squared rates).
    cos, sin, bent = c.cos, c.sin, gamma - c['angle_BCG']
    l_ab, l_bc, l_dc = c.many('L_AB', 'L_BC', 'L_DC')
    l_cg, l_ef, l_fg, l_gh = c.many('L_CG', 'L_EF', 'L_FG', 'L_GH')
    s_g, s_b, s_d, s_t = (rates**2).tolist()
    a = c['alpha']
    first = (
        -l_ab * (sin(a) * epsilon + cos(a) * omega**2) - l_bc * cos(gamma) * s_g
        + l_dc * cos(beta) * s_b,
        l_ab * (cos(a) * epsilon - sin(a) * omega**2) + l_bc * sin(gamma) * s_g
        + l_dc * sin(beta) * s_b,
    )  # fmt: skip
    second = (
        -l_ef * cos(delta) * s_d - l_fg * cos(theta) * s_t + l_cg * cos(bent) * s_g
        + l_dc * cos(beta) * s_b,
        -l_ef * sin(delta) * s_d + l_fg * sin(theta) * s_t - l_cg * sin(bent) * s_g
        + l_dc * sin(beta) * s_b,
    )  # fmt: skip
    found = c.solve(_jacobian(c, x), -np.array([*first, *second]))
    for name, value in zip(ANGLES, found.tolist(), strict=True):
        c.answer(f'epsilon_{name}', value, 'rad/s²', 'Φ ε = -(∂f/∂α ε_α + …ω²)')
    leg = theta + c['angle_FGH']
    squared = (
        -l_dc * cos(beta) * s_b - l_cg * cos(bent) * s_g - l_gh * cos(leg) * s_t,
        -l_dc * sin(beta) * s_b + l_cg * sin(bent) * s_g + l_gh * sin(leg) * s_t,
    )
    moved = _foot_velocity(c, x, found) + np.array(squared)
    for name, value in zip('xy', moved.tolist(), strict=True):
        c.answer(f'a_H{name}', value, 'mm/s²', f'd²{name}_H/dt²')


def _key_acceleration(givens: Givens) -> Givens:
    leg, alpha = _leg(givens)
    changing = leg.acceleration(leg.closed_form(alpha), givens['omega'], givens['epsilon'])
    rates = {f'epsilon_{name}': float(getattr(changing, name)) for name in ANGLES}
    return {**rates, 'a_Hx': MM * changing.h[0], 'a_Hy': MM * changing.h[1]}


def _work_foot(c: Calculation) -> None:
    places = []
    for alpha in range(0, 360, PATH_STEP):
        at = Calculation({**c.givens, 'alpha': float(alpha)}, c.mistake, 'alpha')
        places.append(_foot(at, _geometric(at)))
        if alpha % PRINTED_STEP == 0:
            for name, value in zip(('x_H', 'y_H'), places[-1], strict=True):
                c.step(name, value, 'mm', f'α = {alpha}°')
    (x_low, y_low), (x_high, y_high) = np.min(places, axis=0), np.max(places, axis=0)
    c.answer('stride', float(x_high - x_low), 'mm', 'max x_H - min x_H')
    c.answer('lift', float(y_high - y_low), 'mm', 'max y_H - min y_H')


def _key_foot(givens: Givens) -> Givens:
    path = foot_path(_leg(givens)[0])
    return {'stride': MM * path.stride, 'lift': MM * path.lift}


def _work_torque(c: Calculation) -> None:
    x = _geometric(c)
    rates = _rates(c, x, 1.0)
    by_alpha = _foot_velocity(c, x, rates).tolist()
    for name, value in zip('xy', by_alpha, strict=True):
        c.answer(f'h_{name}', value, 'mm', f'd{name}_H/dα')
    torque = -(c['F_x'] * by_alpha[0] + c['F_y'] * by_alpha[1]) / MM
    c.answer('T', torque, 'N·m', 'T dα + F · dH = 0')


def _key_torque(givens: Givens) -> Givens:
    leg, alpha = _leg(givens)
    pose = leg.closed_form(alpha)
    h_x, h_y = leg.velocity(pose, 1.0).h
    torque = leg.crank_torque(pose, (givens['F_x'], givens['F_y']))
    return {'h_x': MM * h_x, 'h_y': MM * h_y, 'T': torque}


POSITION = kind_of('klann-position', _work_position, _key_position, _leg)
KLANN_KINDS = (
    kind_of('newton', _work_newton, _key_newton, _leg, guesses(POSITION, ANGLES)),
    POSITION,
    kind_of('velocity', _work_velocity, _key_velocity, _leg),
    kind_of('acceleration', _work_acceleration, _key_acceleration, _leg),
    kind_of('foot-path', _work_foot, _key_foot, _leg),
    kind_of('torque', _work_torque, _key_torque, _leg),
)
