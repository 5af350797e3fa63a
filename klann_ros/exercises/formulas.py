"""
The courses' formulas: a function works those of an exercise, as a student does, on a Calculation.

Lengths are in mm, angles in degrees. A step is what a student writes down, and may round; a result
is used as it is. Names are followed by their units, 1 of a number. `sign(k)` is -1 in the other
assembly mode of loop k, a mistake; `half_turn` is 180, or pi by a mistake. What is required, keeps
a draw. The lab's JavaScript works the same formulas: see `lab`.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from .calculation import Calculation

Formula = Callable[[Calculation], None]


class EquationSystem(NamedTuple):
    """Equations f = 0 of unknown angles, their Jacobian, and the formulas of their root."""

    unknowns: tuple[str, ...]
    position: Formula
    f: Callable[[Calculation], Sequence[Any]]
    phi: Callable[[Calculation], Sequence[Sequence[Any]]]


def _cosine(side_a: Any, side_b: Any, opposite: Any) -> Any:
    """Return the cosine of the angle between two sides of a triangle."""
    return (side_a**2 + side_b**2 - opposite**2) / (2 * side_a * side_b)


def _asin(c: Calculation, sine: Any) -> Any:
    """Return the angle of a sine, by the arc cosine that marking and the lab have."""
    return c.half_turn / 2 - c.acos(sine)


def _cosine_text(letter: str, side_a: str, side_b: str, opposite: str) -> str:
    return f'cos {letter} = ({side_a}² + {side_b}² - {opposite}²) / (2 {side_a} {side_b})'


def _corner(c: Calculation, symbol: str, letter: str, *sides: str) -> Any:
    """Work the angle between two sides of a triangle; the third one is opposite."""
    angle = c.acos(_cosine(*c.read(' '.join(sides))))
    return c.step(f'{symbol} deg', angle, _cosine_text(letter, *sides))


def _klann(c: Calculation) -> None:
    """Work the angles of a Klann leg, one loop after the other."""
    x_b = c.step('x_B mm', c.L_AB * c.cos(c.alpha), 'L_AB cos α')
    y_b = c.step('y_B mm', c.y_A + c.L_AB * c.sin(c.alpha), 'y_A + L_AB sin α')
    c.step('BD mm', c.hypot(x_b - c.x_D, y_b), '|BD|')
    phi_bd = _corner(c, 'phi_BD', 'φ', 'BD', 'L_DC', 'L_BC')
    psi_bd = c.step('psi_BD deg', c.atan2(y_b, x_b - c.x_D), '∠(BD)')
    beta = c.result('beta deg', c.wrapped(psi_bd - c.sign(1) * phi_bd), 'ψ_BD - φ_BD')
    x_c = c.step('x_C mm', c.x_D + c.L_DC * c.cos(beta), 'x_D + L_DC cos β')
    y_c = c.step('y_C mm', c.L_DC * c.sin(beta), 'L_DC sin β')
    gamma = c.result('gamma deg', -c.atan2(y_c - y_b, x_c - x_b), '-∠(BC)')
    x_g = c.step('x_G mm', x_c + c.L_CG * c.cos(gamma - c.angle_BCG), 'x_C + L_CG cos(γ - ∠BCG)')
    y_g = c.step('y_G mm', y_c - c.L_CG * c.sin(gamma - c.angle_BCG), 'y_C - L_CG sin(γ - ∠BCG)')
    c.step('EG mm', c.hypot(x_g - c.x_E, y_g - c.y_E), '|EG|')
    phi_eg = _corner(c, 'phi_EG', 'φ', 'EG', 'L_EF', 'L_FG')
    psi_eg = c.step('psi_EG deg', c.atan2(y_g - c.y_E, x_g - c.x_E), '∠(EG)')
    delta = c.result('delta deg', c.wrapped(psi_eg + c.sign(2) * phi_eg), 'ψ_EG + φ_EG')
    x_f = c.step('x_F mm', c.x_E + c.L_EF * c.cos(delta), 'x_E + L_EF cos δ')
    y_f = c.step('y_F mm', c.y_E + c.L_EF * c.sin(delta), 'y_E + L_EF sin δ')
    c.result('theta deg', -c.atan2(y_g - y_f, x_g - x_f), '-∠(FG)')


def _klann_f(c: Calculation) -> Sequence[Any]:
    angle_g = c.gamma - c.angle_BCG
    return (
        c.L_AB * c.cos(c.alpha) + c.L_BC * c.cos(c.gamma) - c.L_DC * c.cos(c.beta) - c.x_D,
        c.L_AB * c.sin(c.alpha) - c.L_BC * c.sin(c.gamma) - c.L_DC * c.sin(c.beta) + c.y_A,
        c.L_EF * c.cos(c.delta) + c.L_FG * c.cos(c.theta) - c.L_CG * c.cos(angle_g)
        - c.L_DC * c.cos(c.beta) - c.x_D + c.x_E,
        c.L_EF * c.sin(c.delta) - c.L_FG * c.sin(c.theta) + c.L_CG * c.sin(angle_g)
        - c.L_DC * c.sin(c.beta) + c.y_E,
    )  # fmt: skip


def _klann_phi(c: Calculation) -> Sequence[Sequence[Any]]:
    angle_g = c.gamma - c.angle_BCG
    by_beta_x, by_beta_y = c.L_DC * c.sin(c.beta), -c.L_DC * c.cos(c.beta)
    by_delta_x, by_delta_y = -c.L_EF * c.sin(c.delta), c.L_EF * c.cos(c.delta)
    return (
        (-c.L_BC * c.sin(c.gamma), by_beta_x, 0, 0),
        (-c.L_BC * c.cos(c.gamma), by_beta_y, 0, 0),
        (c.L_CG * c.sin(angle_g), by_beta_x, by_delta_x, -c.L_FG * c.sin(c.theta)),
        (c.L_CG * c.cos(angle_g), by_beta_y, by_delta_y, -c.L_FG * c.cos(c.theta)),
    )


def _klann_position(c: Calculation) -> None:
    """Work the angles and the foot of a Klann leg."""
    _klann(c)
    angle_g = c.gamma - c.angle_BCG
    angle_h = c.theta + c.angle_FGH
    c.result(
        'x_H mm',
        c.x_D + c.L_DC * c.cos(c.beta) + c.L_CG * c.cos(angle_g) + c.L_GH * c.cos(angle_h),
        'x_D + L_DC cos β + L_CG cos(γ - ∠BCG) + L_GH cos(θ + ∠FGH)',
    )
    c.result(
        'y_H mm',
        c.L_DC * c.sin(c.beta) - c.L_CG * c.sin(angle_g) - c.L_GH * c.sin(angle_h),
        'L_DC sin β - L_CG sin(γ - ∠BCG) - L_GH sin(θ + ∠FGH)',
    )


def _foot_rates(c: Calculation, quantity: str) -> tuple[Any, Any]:
    """Return the rates of the foot by those of the angles: omega or epsilon."""
    rates = c.read(f'{quantity}_gamma {quantity}_beta {quantity}_theta')
    rate_gamma, rate_beta, rate_theta = rates
    angle_g = c.gamma - c.angle_BCG
    angle_h = c.theta + c.angle_FGH
    x = -c.L_CG * c.sin(angle_g) * rate_gamma - c.L_DC * c.sin(c.beta) * rate_beta
    y = -c.L_CG * c.cos(angle_g) * rate_gamma + c.L_DC * c.cos(c.beta) * rate_beta
    return x - c.L_GH * c.sin(angle_h) * rate_theta, y - c.L_GH * c.cos(angle_h) * rate_theta


def _velocity(c: Calculation) -> None:
    _klann(c)
    right = (c.L_AB * c.sin(c.alpha) * c.omega, -c.L_AB * c.cos(c.alpha) * c.omega, 0, 0)
    symbols = 'omega_gamma omega_beta omega_delta omega_theta rad/s'
    c.solve(symbols, _klann_phi(c), right, 'Φ ω = -∂f/∂α ω_α', is_result=True)
    v_x, v_y = _foot_rates(c, 'omega')
    c.result('v_Hx mm/s', v_x, 'dx_H/dt')
    c.result('v_Hy mm/s', v_y, 'dy_H/dt')


def _acceleration(c: Calculation) -> None:
    _velocity(c)
    rates = c.read('omega_gamma omega_beta omega_delta omega_theta')
    gamma_2, beta_2, delta_2, theta_2 = (rate**2 for rate in rates)
    angle_g = c.gamma - c.angle_BCG
    angle_h = c.theta + c.angle_FGH
    # Φ ε = -(∂f/∂α ε_α + the terms of the squared rates)
    right = (
        c.L_AB * (c.sin(c.alpha) * c.epsilon + c.cos(c.alpha) * c.omega**2)
        + c.L_BC * c.cos(c.gamma) * gamma_2 - c.L_DC * c.cos(c.beta) * beta_2,
        c.L_AB * (c.sin(c.alpha) * c.omega**2 - c.cos(c.alpha) * c.epsilon)
        - c.L_BC * c.sin(c.gamma) * gamma_2 - c.L_DC * c.sin(c.beta) * beta_2,
        c.L_EF * c.cos(c.delta) * delta_2 + c.L_FG * c.cos(c.theta) * theta_2
        - c.L_CG * c.cos(angle_g) * gamma_2 - c.L_DC * c.cos(c.beta) * beta_2,
        c.L_EF * c.sin(c.delta) * delta_2 - c.L_FG * c.sin(c.theta) * theta_2
        + c.L_CG * c.sin(angle_g) * gamma_2 - c.L_DC * c.sin(c.beta) * beta_2,
    )  # fmt: skip
    symbols = 'epsilon_gamma epsilon_beta epsilon_delta epsilon_theta rad/s²'
    c.solve(symbols, _klann_phi(c), right, 'Φ ε = -(∂f/∂α ε_α + …ω²)', is_result=True)
    a_x, a_y = _foot_rates(c, 'epsilon')
    a_x = a_x - c.L_DC * c.cos(c.beta) * beta_2 - c.L_CG * c.cos(angle_g) * gamma_2
    a_y = a_y - c.L_DC * c.sin(c.beta) * beta_2 + c.L_CG * c.sin(angle_g) * gamma_2
    c.result('a_Hx mm/s²', a_x - c.L_GH * c.cos(angle_h) * theta_2, 'd²x_H/dt²')
    c.result('a_Hy mm/s²', a_y + c.L_GH * c.sin(angle_h) * theta_2, 'd²y_H/dt²')


def _torque(c: Calculation) -> None:
    _klann(c)
    right = (c.L_AB * c.sin(c.alpha), -c.L_AB * c.cos(c.alpha), 0, 0)
    symbols = 'omega_gamma omega_beta omega_delta omega_theta 1'
    c.solve(symbols, _klann_phi(c), right, 'Φ dx/dα = -∂f/∂α', is_result=True)
    rate_x, rate_y = _foot_rates(c, 'omega')
    h_x = c.result('h_x mm', rate_x, 'dx_H/dα')
    h_y = c.result('h_y mm', rate_y, 'dy_H/dα')
    c.result('T N·m', -(c.F_x * h_x + c.F_y * h_y) / 1000, 'T dα + F · dH = 0')


def _grashof(c: Calculation) -> None:
    s = c.define('s', c.smallest(c.L_1, c.L_2, c.L_3, c.L_4))
    l = c.define('l', c.largest(c.L_1, c.L_2, c.L_3, c.L_4))  # noqa: E741 - the lecture's letter
    s_l = c.step('s_l mm', s + l, 's + l')
    p_q = c.step('p_q mm', c.L_1 + c.L_2 + c.L_3 + c.L_4 - s - l, 'p + q')
    c.require(l < s + p_q)
    c.define('grashof', c.choose(s_l == p_q, 'III', c.choose(s_l < p_q, 'I', 'II')))
    rocker = c.choose(s == c.L_4, 'rocker-crank', 'double rocker')
    crank = c.choose(s == c.L_4, 'double crank', 'crank-rocker')
    turning = c.choose(s == c.L_1, 'double crank', c.choose(s == c.L_2, crank, rocker))
    c.define('motion', c.choose(s_l > p_q, 'triple rocker', turning))


def _diagonal(c: Calculation) -> None:
    z = c.sqrt(c.L_1**2 + c.L_2**2 - 2 * c.L_1 * c.L_2 * c.cos(c.theta_2))
    c.step('Z mm', z, 'Z² = L_1² + L_2² - 2 L_1 L_2 cos θ_2')


def _four_bar(c: Calculation) -> None:
    _diagonal(c)
    _corner(c, 'mu', 'μ', 'L_3', 'L_4', 'Z')
    alpha = _corner(c, 'alpha', 'α', 'Z', 'L_4', 'L_3')
    cos_beta = c.define('cos_beta', c.largest(-1, c.smallest(1, _cosine(c.Z, c.L_1, c.L_2))))
    beta = c.choose(c.sin(c.theta_2) >= 0, c.acos(cos_beta), -c.acos(cos_beta))
    beta = c.step('beta deg', beta, _cosine_text('β', 'Z', 'L_1', 'L_2'))
    theta_4 = c.half_turn - (beta + c.sign(1) * alpha)
    theta_4 = c.result('theta_4 deg', theta_4, 'θ_4 = 180° - (α + β)')
    y = c.L_4 * c.sin(theta_4) - c.L_2 * c.sin(c.theta_2)
    x = c.L_1 + c.L_4 * c.cos(theta_4) - c.L_2 * c.cos(c.theta_2)
    text = 'tan θ_3 = (L_4 sin θ_4 - L_2 sin θ_2) / (L_1 + L_4 cos θ_4 - L_2 cos θ_2)'
    c.result('theta_3 deg', c.atan2(y, x), text)


def _four_bar_f(c: Calculation) -> Sequence[Any]:
    return (
        c.L_1 + c.L_4 * c.cos(c.theta_4) - c.L_2 * c.cos(c.theta_2) - c.L_3 * c.cos(c.theta_3),
        c.L_4 * c.sin(c.theta_4) - c.L_2 * c.sin(c.theta_2) - c.L_3 * c.sin(c.theta_3),
    )


def _four_bar_phi(c: Calculation) -> Sequence[Sequence[Any]]:
    return (
        (c.L_3 * c.sin(c.theta_3), -c.L_4 * c.sin(c.theta_4)),
        (-c.L_3 * c.cos(c.theta_3), c.L_4 * c.cos(c.theta_4)),
    )


def _limits(c: Calculation) -> None:
    """Work the limits of a crank-rocker, crank and coupler in line, its swing and time ratio."""
    c.require(
        c.smallest(c.L_1, c.L_2, c.L_3, c.L_4) == c.L_2,
        c.L_3 > c.L_2,
        c.L_1 + c.L_2 + c.L_3 + c.L_4 - 2 * c.largest(c.L_1, c.L_3, c.L_4) - 2 * c.L_2 > 0,
    )
    theta_2 = []
    theta_4 = []
    for limit, line, text in (
        ('S', c.L_3 + c.L_2, '(L_3 + L_2)'),
        ('F', c.L_3 - c.L_2, '(L_3 - L_2)'),
    ):
        angle = c.acos(_cosine(c.L_1, line, c.L_4))
        angle = angle if limit == 'S' else c.wrapped(angle + c.half_turn)
        shown = _cosine_text('φ', 'L_1', text, 'L_4')
        theta_2.append(c.step(f'theta_2_{limit} deg', angle, shown))
        angle = c.half_turn - c.sign(1) * c.acos(_cosine(c.L_1, c.L_4, line))
        shown = _cosine_text('ψ', 'L_1', 'L_4', text)
        theta_4.append(c.step(f'theta_4_{limit} deg', angle, shown))
    c.result('swing deg', abs(theta_4[1] - theta_4[0]), '|θ_4,F - θ_4,S|')
    forward = c.define('forward', abs(theta_2[1] - theta_2[0]))
    quick = c.define('quick', c.smallest(forward, 2 * c.half_turn - forward))
    c.result('Q 1', (2 * c.half_turn - quick) / quick, 'Q = (360° - φ) / φ')


def _dead_points(c: Calculation) -> None:
    """Work the dead points of a four-bar without a crank, driven at either side."""
    s = c.smallest(c.L_1, c.L_2, c.L_3, c.L_4)
    l = c.largest(c.L_1, c.L_2, c.L_3, c.L_4)  # noqa: E741 - the lecture's letter
    c.require(2 * (s + l) > c.L_1 + c.L_2 + c.L_3 + c.L_4)
    cos_c = c.define('cos_C', _cosine(c.L_1, c.L_2, c.L_3 + c.L_4))
    cos_r = c.define('cos_R', _cosine(c.L_1, c.L_4, c.L_2 + c.L_3))
    c.require(c.largest(abs(cos_c), abs(cos_r)) <= 0.97)
    crank, rocker = c.acos(cos_c), c.acos(cos_r)
    c.step('theta_2_C deg', crank, _cosine_text('φ', 'L_1', 'L_2', '(L_3 + L_4)'))
    angle = c.atan2(c.L_2 * c.sin(crank), c.L_1 - c.L_2 * c.cos(crank))
    text = 'tan θ_4 = L_2 sin θ_2 / (L_2 cos θ_2 - L_1)'
    c.step('theta_4_C deg', c.half_turn - angle, text)
    text = _cosine_text('φ', 'L_1', 'L_4', '(L_2 + L_3)')
    c.step('theta_4_R deg', c.half_turn - rocker, text)
    angle = c.atan2(c.L_4 * c.sin(rocker), c.L_1 - c.L_4 * c.cos(rocker))
    c.step('theta_2_R deg', angle, 'tan θ_2 = L_4 sin θ_4 / (L_1 + L_4 cos θ_4)')


def _transmission(c: Calculation) -> None:
    _diagonal(c)
    _corner(c, 'mu', 'μ', 'L_3', 'L_4', 'Z')
    c.require(c.L_1 > c.L_2)
    text = _cosine_text('μ', 'L_3', 'L_4', 'Z')
    z_min = c.step('Z_min mm', c.L_1 - c.L_2, 'L_1 - L_2')
    c.step('mu_min deg', c.acos(_cosine(c.L_3, c.L_4, z_min)), text)
    z_max = c.step('Z_max mm', c.L_1 + c.L_2, 'L_1 + L_2')
    c.step('mu_max deg', c.acos(_cosine(c.L_3, c.L_4, z_max)), text)


def _mechanical_advantage(c: Calculation) -> None:
    _four_bar(c)
    ratio = c.L_4 * c.sin(c.theta_4 - c.theta_3) / (c.L_2 * c.sin(c.theta_2 - c.theta_3))
    text = 'T_4/T_2 = L_4 sin(θ_4 - θ_3) / (L_2 sin(θ_2 - θ_3))'
    ratio = c.step('MA 1', ratio, text)
    c.result('T_4 N·m', ratio * c.T_2, 'T_4 = MA T_2')


def _slider_crank(c: Calculation) -> None:
    """Work the pose, the velocity, the stroke and the time ratio of an offset slider-crank."""
    phi = _asin(c, (c.e - c.L_2 * c.sin(c.theta_2)) / c.L_3)
    phi = c.step('phi deg', phi, 'sin φ = (e - L_2 sin θ_2) / L_3')
    x_c = c.L_2 * c.cos(c.theta_2) + c.sign(1) * c.L_3 * c.cos(phi)
    c.result('x_C mm', x_c, 'L_2 cos θ_2 + L_3 cos φ')
    v_c = -c.L_2 * c.omega_2 * c.sin(c.theta_2 - phi) / c.cos(phi)
    c.result('v_C mm/s', v_c, '-L_2 ω_2 sin(θ_2 - φ) / cos φ')
    x_max = c.step('x_max mm', c.sqrt((c.L_3 + c.L_2) ** 2 - c.e**2), '√((L_3 + L_2)² - e²)')
    x_min = c.step('x_min mm', c.sqrt((c.L_3 - c.L_2) ** 2 - c.e**2), '√((L_3 - L_2)² - e²)')
    c.result('stroke mm', x_max - x_min, 'x_max - x_min')
    # asin x - asin y = acos y - acos x
    delta = c.acos(c.e / (c.L_3 + c.L_2)) - c.acos(c.e / (c.L_3 - c.L_2))
    delta = c.step('delta deg', delta, 'asin(e/(L_3 - L_2)) - asin(e/(L_3 + L_2))')
    ratio = (c.half_turn + delta) / (c.half_turn - delta)
    c.result('Q 1', ratio, 'Q = (180° + δ) / (180° - δ)')


def _quick_return(c: Calculation) -> None:
    """Work the lever, the swing, the stroke and the time ratio of a slotted-lever drive."""
    c.require(0.8 * c.d > c.L_2)
    x_b = c.step('x_B mm', c.L_2 * c.cos(c.theta_2), 'L_2 cos θ_2')
    y_b = c.step('y_B mm', c.d + c.L_2 * c.sin(c.theta_2), 'd + L_2 sin θ_2')
    c.result('theta_4 deg', c.atan2(y_b, x_b), 'tan θ_4 = y_B / x_B')
    s = c.sqrt(c.d**2 + c.L_2**2 + 2 * c.d * c.L_2 * c.sin(c.theta_2))
    s = c.step('s mm', s, 's² = d² + L_2² + 2 d L_2 sin θ_2')
    omega_4 = c.omega_2 * c.L_2 * (c.L_2 + c.d * c.sin(c.theta_2)) / s**2
    c.result('omega_4 rad/s', omega_4, 'ω_4 = ω_2 L_2 (L_2 + d sin θ_2) / s²')
    half = c.define('half', _asin(c, c.L_2 / c.d))
    c.step('swing deg', 2 * half, '2 asin(L_2 / d)')
    c.result('stroke mm', 2 * c.L_4 * c.sin(half), '2 L_4 sin(Δθ_4 / 2)')
    ratio = (c.half_turn + 2 * half) / (c.half_turn - 2 * half)
    c.result('Q 1', ratio, 'Q = (180° + Δθ_4) / (180° - Δθ_4)')


def _precision_points(c: Calculation, last: str, angles: Sequence[int]) -> list[tuple[Any, Any]]:
    """Work Chebyshev's points of y = x^n up to `last`; return theta_2 and theta_4 at each."""
    x_0, x_n, n, start_2, start_4 = c.read(f'x_0 {last} n theta_2_0 theta_4_0')
    y_n = last.replace('x', 'y')
    points = []
    for k, angle in enumerate(angles, start=1):
        x = (x_0 + x_n) / 2 - (x_n - x_0) / 2 * c.cos(angle)
        x = c.result(f'x_{k} 1', x, f'(x_0 + {last})/2 - ({last} - x_0)/2 cos {angle}°')
        theta_2 = start_2 + c.dtheta_2 * (x - x_0) / (x_n - x_0)
        text = f'θ_2,0 + Δθ_2 (x_k - x_0)/({last} - x_0)'
        theta_2 = c.step(f'theta_2_{k} deg', theta_2, text)
        theta_4 = start_4 + c.dtheta_4 * (x**n - x_0**n) / (x_n**n - x_0**n)
        text = f'θ_4,0 + Δθ_4 (y_k - y_0)/({y_n} - y_0)'
        points.append((theta_2, c.step(f'theta_4_{k} deg', theta_4, text)))
    return points


def _function_generation(c: Calculation) -> None:
    points = _precision_points(c, 'x_4', (30, 90, 150))
    rows = [(c.cos(theta_4), -c.cos(theta_2), 1) for theta_2, theta_4 in points]
    right = [c.cos(theta_2 - theta_4) for theta_2, theta_4 in points]
    c.solve('K_1 K_2 K_3 1', rows, right, 'K_1 cos θ_4 - K_2 cos θ_2 + K_3 = cos(θ_2 - θ_4)')
    _function_lengths(c, points, c.theta_2_0 + c.dtheta_2)


def _function_lengths(c: Calculation, points: Sequence[tuple[Any, Any]], last: Any) -> None:
    """Work the bars; one assembly mode and mu of 10 to 170 deg up to the last crank angle."""
    l_2 = c.result('L_2 mm', c.L_1 / c.K_1, 'K_1 = L_1 / L_2')
    l_4 = c.result('L_4 mm', c.L_1 / c.K_2, 'K_2 = L_1 / L_4')
    # The sheet can draw it.
    c.require(c.smallest(l_2, l_4) / c.L_1 > 0.125, c.largest(l_2, l_4) / c.L_1 < 4)
    l_3 = c.sqrt(c.L_1**2 + l_2**2 + l_4**2 - 2 * l_2 * l_4 * c.K_3)
    l_3 = c.result('L_3 mm', l_3, 'K_3 = (L_1² + L_2² - L_3² + L_4²) / (2 L_2 L_4)')
    # L_3 / L_2 sin mu, whose sign is the assembly mode.
    sines = [c.K_1 * c.sin(theta_4) + c.sin(theta_2 - theta_4) for theta_2, theta_4 in points]
    c.require(c.smallest(*sines) * c.largest(*sines) > 0, last < 180)
    # Z grows with the crank angle.
    for angle in (c.theta_2_0, last):
        square = c.L_1**2 + l_2**2 - 2 * c.L_1 * l_2 * c.cos(angle)
        c.require(abs(l_3**2 + l_4**2 - square) < 1.96 * l_3 * l_4)


def _function_least_squares(c: Calculation) -> None:
    """Work the normal equations of K_1 cos theta_4 - K_2 cos theta_2 + K_3 = cos(difference)."""
    points = _precision_points(c, 'x_6', (18, 54, 90, 126, 162))
    sums: list[Any] = [0] * 8
    for theta_2, theta_4 in points:
        cos_2 = c.cos(theta_2)
        cos_4 = c.cos(theta_4)
        cos_d = c.cos(theta_2 - theta_4)
        terms = [cos_2, cos_4, cos_2**2, cos_4**2, cos_2 * cos_4]
        terms += [cos_d, cos_d * cos_2, cos_d * cos_4]
        sums = [total + term for total, term in zip(sums, terms, strict=True)]
    s_1 = c.step('S_1 1', sums[0], 'Σ cos θ_2,k')
    s_2 = c.step('S_2 1', sums[1], 'Σ cos θ_4,k')
    s_3 = c.step('S_3 1', sums[2], 'Σ cos² θ_2,k')
    s_4 = c.step('S_4 1', sums[3], 'Σ cos² θ_4,k')
    s_5 = c.step('S_5 1', sums[4], 'Σ cos θ_2,k cos θ_4,k')
    c_1 = c.step('c_1 1', sums[5], 'Σ cos(θ_2,k - θ_4,k)')
    c_2 = c.step('c_2 1', sums[6], 'Σ cos(θ_2,k - θ_4,k) cos θ_2,k')
    c_3 = c.step('c_3 1', sums[7], 'Σ cos(θ_2,k - θ_4,k) cos θ_4,k')
    c.solve(
        'K_1 K_2 K_3 1',
        ((s_4, -s_5, s_2), (-s_5, s_3, -s_1), (s_2, -s_1, 5)),
        (c_3, -c_2, c_1),
        'S_4 K_1 - S_5 K_2 + S_2 K_3 = c_3; -S_5 K_1 + S_3 K_2 - S_1 K_3 = -c_2; '
        'S_2 K_1 - S_1 K_2 + 5 K_3 = c_1',
    )
    _function_lengths(c, points, c.theta_2_0 + c.dtheta_2)


def _function_four_points(c: Calculation) -> None:
    """Work equations linear in u, v, K_2, K_3, for cos and sin of theta_4,0 alone."""
    start = c.define('theta_2_1', c.theta_2_0)
    rows: list[Sequence[Any]] = [(1, 0, -c.cos(start), 1)]
    arguments = [start]
    for k in (2, 3, 4):
        phi, psi = c.read(f'phi_{k} psi_{k}')
        theta_2 = c.step(f'theta_2_{k} deg', start + phi, 'θ_2,0 + φ_k')
        rows.append((c.cos(psi), -c.sin(psi), -c.cos(theta_2), 1))
        arguments.append(theta_2 - psi)
    for letter, name, function in (('c', 'cos', c.cos), ('s', 'sin', c.sin)):
        symbols = ' '.join(f'{letter}_{k}' for k in (1, 2, 3, 4))
        text = f'u cos ψ_k - v sin ψ_k - K_2 cos θ_2,k + K_3 = {name}(θ_2,k - ψ_k)'
        c.solve(f'{symbols} 1', rows, [function(argument) for argument in arguments], text)
    w = c.step('w 1', (c.c_1 - c.s_2) ** 2 + 4 * c.s_1 * c.c_2, 'w = (c_1 - s_2)² + 4 s_1 c_2')
    roots = (
        (c.s_2 - c.c_1 + c.sqrt(w)) / (2 * c.s_1),
        (c.s_2 - c.c_1 - c.sqrt(w)) / (2 * c.s_1),
    )
    t = c.step('t 1', c.largest(*roots), 't = tan θ_4,0, s_1 t² + (c_1 - s_2) t - c_2 = 0')
    c.require(abs(t) < 10)
    theta_4 = c.result('theta_4_0 deg', c.atan2(t, 1), 'tan θ_4,0 = t')
    c.define('theta_4_1', theta_4)
    c.step('K_1 1', c.c_1 + c.s_1 * t, 'K_1 = c_1 + s_1 t')
    c.step('K_2 1', (c.c_3 + c.s_3 * t) * c.cos(theta_4), 'K_2 = (c_3 + s_3 t) cos θ_4,0')
    c.step('K_3 1', (c.c_4 + c.s_4 * t) * c.cos(theta_4), 'K_3 = (c_4 + s_4 t) cos θ_4,0')
    later = [(c[f'theta_2_{k}'], theta_4 + c[f'psi_{k}']) for k in (2, 3, 4)]
    _function_lengths(c, [(start, theta_4), *later], c.theta_2_4)


def _circle_centre(
    c: Calculation, point: str, centre_and_bar: str, later: Sequence[Sequence[Any]], text: str
) -> None:
    """Work the centre and the radius of the circle through a point's three places, not in line."""
    centre, bar = centre_and_bar.split()
    x, y = c.read(f'x_{point} y_{point}')
    (x_2, y_2), (x_3, y_3) = later
    area = abs((x_2 - x) * (y_3 - y) - (y_2 - y) * (x_3 - x))
    c.require(area >= 0.2 * c.hypot(x_2 - x, y_2 - y) * c.hypot(x_3 - x, y_3 - y))
    rows = ((2 * (x_2 - x), 2 * (y_2 - y)), (2 * (x_3 - x), 2 * (y_3 - y)))
    right = (x_2**2 + y_2**2 - x**2 - y**2, x_3**2 + y_3**2 - x**2 - y**2)
    c.solve(f'x_{centre} y_{centre} mm', rows, right, text)
    x_c, y_c = c.read(f'x_{centre} y_{centre}')
    c.result(f'{bar} mm', c.hypot(x - x_c, y - y_c), f'|{point} {centre}|')


def _moved(c: Calculation, pin: str, k: int) -> tuple[Any, Any]:
    """Return a pin's place in pose k."""
    x, y, x_p, y_p, psi = c.read(f'x_{pin} y_{pin} x_P{k} y_P{k} psi_{k}')
    return x_p + x * c.cos(psi) - y * c.sin(psi), y_p + x * c.sin(psi) + y * c.cos(psi)


def _three_poses(c: Calculation, *, is_sound: bool = True) -> None:
    """Work the pivots of given pins of the coupler, the centres of their circles."""
    for pin, pivot, bar in (('A', 'O2', 'L_2'), ('B', 'O4', 'L_4')):
        moved = []
        for k in (2, 3):
            text = f'P_{k} + R(ψ_{k}) {pin}_1'
            places = zip('xy', _moved(c, pin, k), strict=True)
            moved.append([c.step(f'{axis}_{pin}{k} mm', place, text) for axis, place in places])
        text = ' = '.join(f'|{pin}_{k} {pivot}|' for k in (1, 2, 3))
        _circle_centre(c, pin, f'{pivot} {bar}', moved, text)
    _coupler_poses(c, is_sound)


def _coupler_poses(c: Calculation, is_sound: bool) -> None:
    """Work the crank angle from the ground and mu in each pose; sound designs have no defect."""
    x, y = c.x_O4 - c.x_O2, c.y_O4 - c.y_O2
    c.step('L_1 mm', c.hypot(x, y), '|O2 O4|')
    c.step('L_3 mm', c.hypot(c.x_B - c.x_A, c.y_B - c.y_A), '|A B|')
    ground = c.step('theta_1 deg', c.atan2(y, x), '∠(O2 O4)')
    for k, pose in enumerate(('', '2', '3'), start=1):
        x_a, y_a, x_b, y_b = c.read(f'x_A{pose} y_A{pose} x_B{pose} y_B{pose}')
        crank = c.atan2(y_a - c.y_O2, x_a - c.x_O2) - ground
        theta = c.step(f'theta_2_{k} deg', c.wrapped(crank), f'∠(O2 A_{k}) - θ_1')
        mu = c.atan2(y_b - c.y_O4, x_b - c.x_O4) - c.atan2(y_b - y_a, x_b - x_a)
        mu = c.step(f'mu_{k} deg', c.wrapped(mu), f'∠(O4 B_{k}) - ∠(A_{k} B_{k})')
        c.require(c.smallest(abs(c.sin(mu)), abs(c.sin(theta))) > 0.1)
    lengths = c.read('L_1 L_2 L_3 L_4')
    c.require(c.smallest(*lengths) > 20, c.largest(*lengths) < 600)
    # Positive where all angles have one sign.
    for name, angle in (('one_mode', 'mu'), ('one_side', 'theta_2')):
        first, second, third = c.read(f'{angle}_1 {angle}_2 {angle}_3')
        c.define(name, c.smallest(first * second, first * third))
    if is_sound:
        c.require(c.one_mode > 0, c.one_side > 0, (second - first) * (third - second) > 0)


def _synthesis_defects(c: Calculation) -> None:
    """Work whether a design takes its poses in one assembly mode, on one circuit, in order."""
    _three_poses(c, is_sound=False)
    odd_pose = c.choose(c.mu_1 * c.mu_3 > 0, '2', c.choose(c.mu_1 * c.mu_2 > 0, '3', '1'))
    c.define('mode', c.choose(c.one_mode > 0, 'none', odd_pose))
    lengths = l_1, l_2, l_3, l_4 = c.read('L_1 L_2 L_3 L_4')
    s_l = c.step('s_l mm', c.smallest(*lengths) + c.largest(*lengths), 's + l')
    p_q = c.step('p_q mm', l_1 + l_2 + l_3 + l_4 - s_l, 'p + q')
    touches_o2 = c.smallest(l_1, l_2) < c.smallest(l_3, l_4)
    in_class_1 = c.choose(c.choose(touches_o2, c.one_mode, c.one_side) > 0, 'one', 'two')
    c.define('circuit', c.choose(s_l < p_q, in_class_1, 'one'))
    # The crank passes 0 and 180 deg where these are positive; its angles must not jump there.
    p_0 = c.step('p_0 mm', abs(l_1 - l_2) - abs(l_3 - l_4), '|L_1 - L_2| - |L_3 - L_4|')
    p_180 = c.step('p_180 mm', l_3 + l_4 - l_1 - l_2, 'L_3 + L_4 - L_1 - L_2')
    thetas = c.read('theta_2_1 theta_2_2 theta_2_3')
    first, second, third = (c.choose(p_0 > 0, theta, c.wrapped(theta - 180)) for theta in thetas)
    turn = c.define('turn', (second - first) * (third - second))
    on_arc = c.choose(c.largest(p_0, p_180) < 0, c.smallest(turn, c.one_side), turn)
    c.define('order', c.choose(c.largest(c.smallest(p_0, p_180), on_arc) > 0, 'yes', 'no'))
    c.require(c.smallest(abs(p_0), abs(p_180)) > 2, abs(turn) > 1)


def _three_poses_pivots(c: Calculation) -> None:
    """Work the pins of given pivots, as seen from the coupler in its first pose."""
    for pin, pivot, bar in (('A', 'O2', 'L_2'), ('B', 'O4', 'L_4')):
        x_o, y_o = c.read(f'x_{pivot} y_{pivot}')
        seen = []
        for k in (2, 3):
            x_p, y_p, psi = c.read(f'x_P{k} y_P{k} psi_{k}')
            x, y = x_o - x_p, y_o - y_p
            text = f'R(-ψ_{k}) ({pivot} - P_{k})'
            x_k = c.step(f'x_{pivot}_{k} mm', x * c.cos(psi) + y * c.sin(psi), text)
            y_k = c.step(f'y_{pivot}_{k} mm', y * c.cos(psi) - x * c.sin(psi), text)
            seen.append((x_k, y_k))
        text = f'|{pin} {pivot}| = |{pin} {pivot}_2| = |{pin} {pivot}_3|'
        _circle_centre(c, pivot, f'{pin} {bar}', seen, text)
        for k in (2, 3):
            for axis, place in zip('xy', _moved(c, pin, k), strict=True):
                c.define(f'{axis}_{pin}{k}', place)
    c.require(c.largest(abs(c.x_A), abs(c.y_A), abs(c.x_B), abs(c.y_B)) <= 600)
    _coupler_poses(c, is_sound=True)


def _four_poses(c: Calculation) -> None:
    """Work a triangle of D, D_3 e^(i beta_3) and D_4 e^(i beta_4)."""
    for k in (2, 3, 4):
        psi = c[f'psi_{k}']
        c.step(f'r_{k} 1', c.cos(psi) - 1, 'r_k = e^(iψ_k) - 1')
        c.step(f'q_{k} 1', c.sin(psi), 'r_k = e^(iψ_k) - 1')
    for n, i, j in ((2, 3, 4), (3, 4, 2), (4, 2, 3)):
        r_i, q_i, x_i, y_i = c.read(f'r_{i} q_{i} x_P{i} y_P{i}')
        r_j, q_j, x_j, y_j = c.read(f'r_{j} q_{j} x_P{j} y_P{j}')
        text = f'D_{n} = r_{i} P_{j} - r_{j} P_{i}'
        c.step(f'D_{n}x mm', r_i * x_j - q_i * y_j - r_j * x_i + q_j * y_i, text)
        c.step(f'D_{n}y mm', r_i * y_j + q_i * x_j - r_j * y_i - q_j * x_i, text)
    beta = c.beta_2
    text = 'D = (e^(iβ_2) - 1) D_2 - D_3 - D_4'
    x = c.step(
        'D_x mm', c.D_2x * c.cos(beta) - c.D_2y * c.sin(beta) - c.D_2x - c.D_3x - c.D_4x, text
    )
    y = c.step(
        'D_y mm', c.D_2x * c.sin(beta) + c.D_2y * c.cos(beta) - c.D_2y - c.D_3y - c.D_4y, text
    )
    d = c.step('d mm', c.hypot(x, y), '|D|')
    d_3 = c.step('d_3 mm', c.hypot(c.D_3x, c.D_3y), '|D_3|')
    phi = c.acos((d**2 + d_3**2 - c.D_4x**2 - c.D_4y**2) / (2 * d * d_3))
    phi = c.step('phi deg', phi, 'cos φ = (|D|² + |D_3|² - |D_4|²) / (2 |D| |D_3|)')
    beta_3 = c.wrapped(c.atan2(-y, -x) + c.sign(1) * phi - c.atan2(c.D_3y, c.D_3x))
    beta_3 = c.result('beta_3 deg', beta_3, 'β_3 = ∠(-D) + φ - ∠D_3')
    x = x + c.D_3x * c.cos(beta_3) - c.D_3y * c.sin(beta_3)
    y = y + c.D_3x * c.sin(beta_3) + c.D_3y * c.cos(beta_3)
    c.require(beta_3 < c.wrapped(c.atan2(-y, -x) - c.atan2(c.D_4y, c.D_4x)))
    # Bars that turn with the coupler solve the triangle, but are of any length.
    c.require(abs(beta - c.psi_2) > 1)
    _timed_path(c)


def _timed_path(c: Calculation) -> None:
    """Work w (e^(i beta) - 1) + z (e^(i psi) - 1) = P_k, real and imaginary parts."""
    rows: list[Sequence[Any]] = []
    for k in (2, 3):
        beta, psi = c.read(f'beta_{k} psi_{k}')
        b_k = c.step(f'b_{k} 1', c.cos(beta) - 1, f'cos β_{k} - 1')
        c_k = c.step(f'c_{k} 1', c.sin(beta), f'sin β_{k}')
        d_k = c.step(f'd_{k} 1', c.cos(psi) - 1, f'cos ψ_{k} - 1')
        e_k = c.step(f'e_{k} 1', c.sin(psi), f'sin ψ_{k}')
        rows += [(b_k, -c_k, d_k, -e_k), (c_k, b_k, e_k, d_k)]
    text = 'w (e^(iβ_k) - 1) + z (e^(iψ_k) - 1) = P_k - P_1'
    c.solve('w_x w_y z_x z_y mm', rows, c.read('x_P2 y_P2 x_P3 y_P3'), text)
    c.require(c.largest(abs(c.w_x), abs(c.w_y), abs(c.z_x), abs(c.z_y)) <= 500)
    c.require(c.beta_2 < c.beta_3)
    c.result('L_2 mm', c.hypot(c.w_x, c.w_y), '|w|')
    c.result('x_A mm', -c.z_x, 'A = P_1 - z')
    c.result('y_A mm', -c.z_y, 'A = P_1 - z')
    c.result('x_O2 mm', -c.z_x - c.w_x, 'O2 = A - w')
    c.result('y_O2 mm', -c.z_y - c.w_y, 'O2 = A - w')


def _cognates(c: Calculation) -> None:
    """Work triangles similar to that of the coupler, which stand on each bar."""
    diagonal = c.sqrt(c.L_1**2 + c.L_2**2 - 2 * c.L_1 * c.L_2 * c.cos(c.theta_2))
    c.require(abs(c.L_3 - c.L_4) < diagonal, diagonal < c.L_3 + c.L_4)
    sides = {
        'AP': c.step('AP mm', c.hypot(c.u, c.v), '√(u² + v²)'),
        'BP': c.step('BP mm', c.hypot(c.L_3 - c.u, c.v), '√((L_3 - u)² + v²)'),
    }
    cognates = {'a': ('AP', 'L_1 L_3 L_2 L_4'), 'b': ('BP', 'L_1 L_2 L_4 L_3')}
    for letter, (side, bars) in cognates.items():
        for k, bar in enumerate(bars.split(), start=1):
            length = c[bar] * sides[side] / c.L_3
            c.result(f'{letter}_{k} mm', length, f'{bar} {side} / L_3')


def _instant_centres(c: Calculation) -> None:
    """Work I13, where O2 A and O4 B meet, and I24, where A B meets the ground."""
    _four_bar(c)
    radius = c.define('radius', c.L_1 * c.sin(c.theta_4) / c.sin(c.theta_4 - c.theta_2))
    text = '|O2 I13| = L_1 sin θ_4 / sin(θ_4 - θ_2)'
    c.result('x_I13 mm', radius * c.cos(c.theta_2), text)
    c.result('y_I13 mm', radius * c.sin(c.theta_2), text)
    x = c.L_2 * c.cos(c.theta_2) - c.L_2 * c.sin(c.theta_2) * c.cos(c.theta_3) / c.sin(c.theta_3)
    x = c.step('x_I24 mm', x, 'x_A - y_A / tan θ_3')
    c.result('omega_4 rad/s', c.omega_2 * x / (x - c.L_1), 'ω_4 = ω_2 |I12 I24| / |I14 I24|')
    c.require(c.largest(abs(radius), abs(x)) <= 20 * c.L_3)


def _toggle(c: Calculation) -> None:
    _diagonal(c)
    c.require(c.Z > 1.1 * c.L_4)
    c.result('L_3_S mm', c.Z - c.L_4, 'L_3 + L_4 = Z')
    c.result('L_3_F mm', c.Z + c.L_4, 'L_3 - L_4 = Z')


def _quick_return_design(c: Calculation) -> None:
    """Work the crank-rocker of a time ratio, a swing, a rocker and a crank."""
    delta = c.half_turn * (c.Q - 1) / (c.Q + 1)
    delta = c.step('delta deg', delta, 'δ = 180° (Q - 1) / (Q + 1)')
    chord = c.step('C mm', 2 * c.L_4 * c.sin(c.swing / 2), '2 L_4 sin(Δθ_4 / 2)')
    l_3 = c.sqrt((chord**2 / 2 - c.L_2**2 * (1 + c.cos(delta))) / (1 - c.cos(delta)))
    text = 'C² = (L_3 + L_2)² + (L_3 - L_2)² - 2 (L_3² - L_2²) cos δ'
    l_3 = c.step('L_3 mm', l_3, text)
    y = ((l_3 + c.L_2) ** 2 - (l_3 - c.L_2) ** 2) / (2 * chord)
    y = c.step('y mm', y, '2 L_2 L_3 / C')
    x = c.sqrt((l_3 - c.L_2) ** 2 - (chord / 2 - y) ** 2)
    x = c.step('x mm', x, 'x² + (C/2 - y)² = (L_3 - L_2)²')
    h = c.step('h mm', c.L_4 * c.cos(c.swing / 2), 'L_4 cos(Δθ_4 / 2)')
    l_1 = c.result('L_1 mm', c.hypot(h - c.sign(1) * x, y), '|O2 O4|')
    longest = c.largest(l_1, l_3, c.L_4)
    c.require(c.smallest(l_1, l_3, c.L_4) > c.L_2, l_1 + l_3 + c.L_4 - c.L_2 - 2 * longest > 5)
    stretched = c.acos(_cosine(l_1, c.L_4, l_3 + c.L_2))
    folded = c.acos(_cosine(l_1, c.L_4, l_3 - c.L_2))
    c.require(abs(abs(stretched - folded) - c.swing) < 0.000001)


SYSTEMS = {
    'klann': EquationSystem(('gamma', 'beta', 'delta', 'theta'), _klann, _klann_f, _klann_phi),
    'four-bar': EquationSystem(('theta_3', 'theta_4'), _four_bar, _four_bar_f, _four_bar_phi),
}
FORMULAS: dict[str, Formula] = {
    'newton': lambda c: c.newton(SYSTEMS['klann']),
    'klann-position': _klann_position,
    'velocity': _velocity,
    'acceleration': _acceleration,
    'foot-path': lambda c: c.sweep(_klann_position, {'stride': 'x_H', 'lift': 'y_H'}),
    'torque': _torque,
    'grashof': _grashof,
    'four-bar-position': _four_bar,
    'four-bar-newton': lambda c: c.newton(SYSTEMS['four-bar']),
    'limits': _limits,
    'dead-points': _dead_points,
    'transmission': _transmission,
    'mechanical-advantage': _mechanical_advantage,
    'slider-crank': _slider_crank,
    'quick-return': _quick_return,
    'function-generation': _function_generation,
    'function-four-points': _function_four_points,
    'function-least-squares': _function_least_squares,
    'three-poses': _three_poses,
    'three-poses-pivots': _three_poses_pivots,
    'synthesis-defects': _synthesis_defects,
    'four-poses': _four_poses,
    'timed-path': _timed_path,
    'cognates': _cognates,
    'instant-centres': _instant_centres,
    'toggle': _toggle,
    'quick-return-design': _quick_return_design,
}
"""The formulas of each kind of exercise."""
