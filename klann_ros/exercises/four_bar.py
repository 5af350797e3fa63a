"""
Exercises on the four-bar, by the formulas of its course: position, limits and figures of merit.

References
----------
"Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples.

"""

from math import degrees, radians, sqrt
from typing import Any

from klann_ros.kinematics import FourBar
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .calculation import Answer, Calculation
from .klann import Givens, guesses, newton_key
from .variant import Draw, kind_of

LINKS = ('L_1', 'L_2', 'L_3', 'L_4')
ANGLES = ('theta_3', 'theta_4')
# A share of the linkages to classify are drawn as class III.
CHANGE_POINT_SHARE = 0.2
# The cosine at a dead point stays below this, so that a slip shows.
MAX_COSINE = 0.97


def four_bar_of(givens: Givens) -> FourBar:
    """Return the four-bar of the givens, in the open assembly, +1."""
    l_1, l_2, l_3, l_4 = (givens[name] for name in LINKS)
    return FourBar(l_1, l_2, l_3, l_4)


def leg_of(givens: Givens) -> tuple[Any, float]:
    """Return the four-bar and its crank angle, 60 deg where none is given."""
    return four_bar_of(givens), radians(givens.get('theta_2', 60.0))


def _z(c: Calculation) -> float:
    l_1, l_2, *_ = c.many(*LINKS)
    square = l_1**2 + l_2**2 - 2.0 * l_1 * l_2 * c.cos(c['theta_2'])
    return c.step('Z', sqrt(square), 'mm', 'Z² = L_1² + L_2² - 2 L_1 L_2 cos θ_2')


def _transmission(c: Calculation, z: float, name: str = 'mu') -> float:
    _, _, l_3, l_4 = c.many(*LINKS)
    angle = c.acos((l_3**2 + l_4**2 - z**2) / (2.0 * l_3 * l_4))
    return c.step(name, angle, 'deg', 'cos μ = (L_3² + L_4² - Z²) / (2 L_3 L_4)')


def analytic(c: Calculation) -> tuple[float, float]:
    """Return theta3 and theta4 by the course's triangles, the open assembly [deg]."""
    l_1, l_2, l_3, l_4 = c.many(*LINKS)
    z = _z(c)
    c.answer('Z', z)
    c.answer('mu', _transmission(c, z))
    cosine = (z**2 + l_4**2 - l_3**2) / (2.0 * z * l_4)
    alpha = c.step('alpha', c.acos(cosine), 'deg', 'cos α = (Z² + L_4² - L_3²) / (2 Z L_4)')
    cosine = (z**2 + l_1**2 - l_2**2) / (2.0 * z * l_1)
    beta = c.acos(max(-1.0, min(1.0, cosine))) * (1.0 if c.sin(c['theta_2']) >= 0.0 else -1.0)
    c.step('beta', beta, 'deg', 'cos β = (Z² + L_1² - L_2²) / (2 Z L_1)')
    c.answer('alpha', alpha)
    c.answer('beta', beta)
    theta_4 = c.half_turn - (beta + c.sign() * alpha)
    c.answer('theta_4', theta_4, 'deg', 'θ_4 = 180° - (α + β)')
    rise = l_4 * c.sin(theta_4) - l_2 * c.sin(c['theta_2'])
    run = l_1 + l_4 * c.cos(theta_4) - l_2 * c.cos(c['theta_2'])
    rule = 'tan θ_3 = (L_4 sin θ_4 - L_2 sin θ_2) / (L_1 + L_4 cos θ_4 - L_2 cos θ_2)'
    theta_3 = c.atan2(rise, run)
    c.answer('theta_3', theta_3, 'deg', rule)
    return theta_3, theta_4


def _work_position(c: Calculation) -> None:
    analytic(c)


def _key_position(givens: Givens) -> Givens:
    pose = four_bar_of(givens).closed_form(radians(givens['theta_2']))
    names = {'mu': pose.transmission_angle, 'alpha': pose.alpha, 'beta': pose.beta}
    angles = {**names, 'theta_3': pose.theta3, 'theta_4': pose.theta4}
    return {'Z': pose.z, **{name: degrees(value) for name, value in angles.items()}}


def _equations(c: Calculation, x: FloatArray) -> FloatArray:
    theta_3, theta_4 = x.tolist()
    l_1, l_2, l_3, l_4 = c.many(*LINKS)
    return np.array(
        [
            l_1 + l_4 * c.cos(theta_4) - l_2 * c.cos(c['theta_2']) - l_3 * c.cos(theta_3),
            l_4 * c.sin(theta_4) - l_2 * c.sin(c['theta_2']) - l_3 * c.sin(theta_3),
        ]
    )


def _jacobian(c: Calculation, x: FloatArray) -> FloatArray:
    theta_3, theta_4 = x.tolist()
    _, _, l_3, l_4 = c.many(*LINKS)
    return np.array(
        [
            [l_3 * c.sin(theta_3), -l_4 * c.sin(theta_4)],
            [-l_3 * c.cos(theta_3), l_4 * c.cos(theta_4)],
        ]
    )


def _work_newton(c: Calculation) -> None:
    guess = np.array(c.many('theta_3_1', 'theta_4_1'))
    c.newton(lambda x: _equations(c, x), lambda x: _jacobian(c, x), guess, ANGLES)
    c.use_other_root(analytic, ANGLES)


def _key_newton(givens: Givens) -> Givens:
    bar, theta_2 = four_bar_of(givens), radians(givens['theta_2'])
    guess = [radians(givens[f'{name}_1']) for name in ANGLES]
    f, phi = bar.f(theta_2, guess), bar.phi(theta_2, guess)
    return newton_key(bar.newton(theta_2, guess), f, phi, ANGLES)


def _make_change_points(draw: Draw, givens: dict[str, float]) -> None:
    """Make some linkages class III: the longest link is p + q - s."""
    if draw.unit() < CHANGE_POINT_SHARE:
        s, p, q, _ = sorted(givens.values())
        givens[max(givens, key=lambda name: givens[name])] = p + q - s


def _work_grashof(c: Calculation) -> None:
    lengths = c.many(*LINKS)
    s, p, q, l = sorted(lengths)  # noqa: E741 - the law's own letters
    if l >= s + p + q:
        raise ValueError('it does not close')
    c.answer('s_l', c.step('s_l', s + l, 'mm', 's + l'))
    c.answer('p_q', c.step('p_q', p + q, 'mm', 'p + q'))
    c.answer('grashof', 'III' if s + l == p + q else 'I' if s + l < p + q else 'II')
    turns = [s + l <= p + q and length == s for length in lengths]
    if turns[0] or (turns[1] and turns[3]):
        motion = 'double crank'
    else:
        motion = 'crank-rocker' if turns[1] else 'rocker-crank' if turns[3] else 'double rocker'
    c.answer('motion', motion if s + l <= p + q else 'triple rocker')


def _key_grashof(givens: Givens) -> dict[str, Answer]:
    grashof, lengths = four_bar_of(givens).grashof, sorted(givens[name] for name in LINKS)
    sums = {'s_l': lengths[0] + lengths[3], 'p_q': lengths[1] + lengths[2]}
    return {**sums, 'grashof': grashof.class_, 'motion': grashof.motion}


def _work_limits(c: Calculation) -> None:
    l_1, l_2, l_3, l_4 = c.many(*LINKS)
    if l_2 != min(l_1, l_2, l_3, l_4) or l_3 <= l_2:
        raise ValueError('it is no crank-rocker')
    found = {}
    for name, far, rule in (('S', l_3 + l_2, 'L_3 + L_2'), ('F', l_3 - l_2, 'L_3 - L_2')):
        crank = c.acos((l_1**2 + far**2 - l_4**2) / (2.0 * l_1 * far))
        laws = {
            f'theta_2_{name}': f'cos φ = (L_1² + ({rule})² - L_4²) / (2 L_1 ({rule}))',
            f'theta_4_{name}': f'cos ψ = (L_1² + L_4² - ({rule})²) / (2 L_1 L_4)',
        }
        found[f'theta_2_{name}'] = crank + (c.half_turn if name == 'F' else 0.0)
        rocker = c.acos((l_1**2 + l_4**2 - far**2) / (2.0 * l_1 * l_4))
        found[f'theta_4_{name}'] = c.half_turn - c.sign() * rocker
        for quantity, law in laws.items():
            c.answer(quantity, c.step(quantity, found[quantity], 'deg', law))
    swing = abs(found['theta_4_F'] - found['theta_4_S'])
    c.answer('swing', swing, 'deg', '|θ_4,F - θ_4,S|')
    away = abs(found['theta_2_F'] - found['theta_2_S'])
    quick = min(away, 2.0 * c.half_turn - away)
    c.answer('Q', (2.0 * c.half_turn - quick) / quick, '1', 'Q = (360° - φ) / φ')


def _key_limits(givens: Givens) -> Givens:
    limits = four_bar_of(givens).rocker_limits
    found = {'swing': degrees(limits.swing), 'Q': limits.time_ratio}
    for name, point in (('S', limits.stretched), ('F', limits.folded)):
        if point:
            found[f'theta_2_{name}'] = degrees(point.theta2)
            found[f'theta_4_{name}'] = degrees(point.theta4)
    return found


def _work_dead_points(c: Calculation) -> None:
    l_1, l_2, l_3, l_4 = c.many(*LINKS)
    s, p, q, l = sorted((l_1, l_2, l_3, l_4))  # noqa: E741 - the law's own letters
    if s + l <= p + q:
        raise ValueError('it is not class II')
    for driver, other, rest, law in (
        ('C', l_2, l_3 + l_4, 'cos φ = (L_1² + L_2² - (L_3 + L_4)²) / (2 L_1 L_2)'),
        ('R', l_4, l_2 + l_3, 'cos φ = (L_1² + L_4² - (L_2 + L_3)²) / (2 L_1 L_4)'),
    ):
        cosine = (l_1**2 + other**2 - rest**2) / (2.0 * l_1 * other)
        if not c.mistake and abs(cosine) > MAX_COSINE:
            raise ValueError('it has no such dead point')
        inner = c.acos(cosine)
        # The end of the driver, seen from the other pivot, which the two in line reach.
        x, y = l_1 - other * c.cos(inner), other * c.sin(inner)
        across = c.atan2(y, x)
        driven, driving = ('theta_4', 'theta_2') if driver == 'C' else ('theta_2', 'theta_4')
        angles = (inner, c.half_turn - across) if driver == 'C' else (c.half_turn - inner, across)
        for name, angle in zip((driving, driven), angles, strict=True):
            c.answer(f'{name}_{driver}', c.step(f'{name}_{driver}', angle, 'deg', law))


def _key_dead_points(givens: Givens) -> Givens:
    bar, found = four_bar_of(givens), {}
    for name, driver in (('C', 'crank'), ('R', 'rocker')):
        for point in bar.dead_points(driver):
            if point.kind == 'stretched' and point.angle > 0.0:
                found[f'theta_2_{name}'] = degrees(point.theta2)
                found[f'theta_4_{name}'] = degrees(point.theta4)
    return found


def _work_transmission(c: Calculation) -> None:
    l_1, l_2, *_ = c.many(*LINKS)
    c.answer('mu', _transmission(c, _z(c)))
    c.answer('mu_min', _transmission(c, c.step('Z_min', l_1 - l_2, 'mm', 'L_1 - L_2'), 'mu_min'))
    c.answer('mu_max', _transmission(c, c.step('Z_max', l_1 + l_2, 'mm', 'L_1 + L_2'), 'mu_max'))


def _key_transmission(givens: Givens) -> Givens:
    bar, theta_2 = four_bar_of(givens), radians(givens['theta_2'])
    extremes = bar.transmission_extremes
    angles = {'mu_min': extremes.least, 'mu_max': extremes.greatest}
    angles['mu'] = bar.transmission_angle(theta_2)
    return {name: degrees(value) for name, value in angles.items()}


def _work_advantage(c: Calculation) -> None:
    theta_3, theta_4 = analytic(c)
    _, l_2, _, l_4 = c.many(*LINKS)
    rule = 'T_4/T_2 = L_4 sin(θ_4 - θ_3) / (L_2 sin(θ_2 - θ_3))'
    ratio = l_4 * c.sin(theta_4 - theta_3) / (l_2 * c.sin(c['theta_2'] - theta_3))
    c.answer('MA', c.step('MA', ratio, '1', rule))
    c.answer('T_4', ratio * c['T_2'], 'N·m', 'T_4 = MA T_2')


def _key_advantage(givens: Givens) -> Givens:
    ratio = four_bar_of(givens).mechanical_advantage(radians(givens['theta_2']))
    position = _key_position(givens)
    angles = {name: position[name] for name in ANGLES}
    return {**angles, 'MA': ratio, 'T_4': ratio * givens['T_2']}


POSITION = kind_of('four-bar-position', _work_position, _key_position, leg_of)
FOUR_BAR_KINDS = (
    kind_of('grashof', _work_grashof, _key_grashof, leg_of, _make_change_points),
    POSITION,
    kind_of('four-bar-newton', _work_newton, _key_newton, leg_of, guesses(POSITION, ANGLES)),
    kind_of('limits', _work_limits, _key_limits, leg_of),
    kind_of('dead-points', _work_dead_points, _key_dead_points, leg_of),
    kind_of('transmission', _work_transmission, _key_transmission, leg_of),
    kind_of('mechanical-advantage', _work_advantage, _key_advantage, leg_of),
)
