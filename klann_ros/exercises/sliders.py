"""
Exercises on the slider-crank and on the quick return of a crank and a slotted arm.

References
----------
R. L. Norton, Design of Machinery, sections 2.11 and 4.

"""

from functools import lru_cache
from math import asin, atan2, cos, degrees, hypot, radians, sin, sqrt, tau
from typing import Any

from klann_ros.kinematics import linkage_from_text, linkage_poses, LinkageLeg
import numpy as np

from .calculation import Calculation
from .klann import Givens
from .variant import kind_of

SLIDER_CRANK = """
name: Slider-crank
units: {{length: mm, angle: deg}}
pivots: {{A: [0, 0], P: [0, {e}]}}
crank: crank
foot: C
bodies:
  crank: {{bars: [{{from: A, to: B, length: {L_2}}}]}}
  rod: {{bars: [{{from: B, to: C, length: {L_3}}}]}}
  piston: {{slides: {{along: ground, from: P, to: C}}}}
start: {{crank: {theta_2}, rod: {rod}, piston: {x}}}
"""
QUICK_RETURN = """
name: Quick return
units: {{length: mm, angle: deg}}
pivots: {{O: [0, 0], A: [0, {d}]}}
crank: crank
foot: D
bodies:
  crank: {{bars: [{{from: A, to: B, length: {L_2}}}]}}
  arm: {{bars: [{{from: O, to: D, length: {L_4}}}]}}
  block: {{slides: {{along: arm, from: O, to: B}}}}
start: {{crank: {theta_2}, arm: {arm}, block: {s}}}
"""
# Crank angles between which the stroke's ends are searched, and halvings there.
COARSE_ANGLES, HALVINGS = 72, 50


def _slider_crank(givens: Givens) -> tuple[LinkageLeg, float]:
    r, l_3, e, theta_2 = (givens[name] for name in ('L_2', 'L_3', 'e', 'theta_2'))
    rod = asin((e - r * sin(radians(theta_2))) / l_3)
    x = r * cos(radians(theta_2)) + l_3 * cos(rod)
    return _made(SLIDER_CRANK.format(**givens, rod=degrees(rod), x=x)), radians(theta_2)


def _quick_return(givens: Givens) -> tuple[LinkageLeg, float]:
    r, d, theta_2 = (givens[name] for name in ('L_2', 'd', 'theta_2'))
    x, y = r * cos(radians(theta_2)), d + r * sin(radians(theta_2))
    text = QUICK_RETURN.format(**givens, arm=degrees(atan2(y, x)), s=hypot(x, y))
    return _made(text), radians(theta_2)


@lru_cache(maxsize=4)
def _made(text: str) -> LinkageLeg:
    return LinkageLeg(linkage_from_text(text, 'exercise'))


def _strokes(leg: Any) -> tuple[float, float, float, float]:
    """Return the least and greatest x of the foot [mm], and the crank angles there [rad]."""
    angles = np.linspace(0.0, tau, COARSE_ANGLES + 1)
    speeds: Any = linkage_poses(leg.linkage, angles, velocities=True).h_1
    ends = []
    for k in np.flatnonzero(np.diff(np.sign(speeds[:, 0]))).tolist():
        low, high = float(angles[k]), float(angles[k + 1])
        for _ in range(HALVINGS):
            middle = (low + high) / 2.0
            speed = leg.velocity(leg.closed_form(middle), 1.0).h[0]
            low, high = (middle, high) if speed * speeds[k, 0] > 0.0 else (low, middle)
        ends.append((1e3 * float(leg.closed_form(low).h[0]), low))
    (least, first), (greatest, last) = min(ends), max(ends)
    return least, greatest, first, last


def _time_ratio(first: float, last: float) -> float:
    forward = abs(last - first) % tau
    return max(forward, tau - forward) / min(forward, tau - forward)


def _work_slider(c: Calculation) -> None:
    r, l_3, e = c.many('L_2', 'L_3', 'e')
    sine = (e - r * c.sin(c['theta_2'])) / l_3
    rod = c.half_turn / 2.0 - c.acos(sine)
    c.answer('phi', c.step('phi', rod, 'deg', 'sin φ = (e - L_2 sin θ_2) / L_3'))
    x = r * c.cos(c['theta_2']) + c.sign() * l_3 * c.cos(rod)
    c.answer('x_C', x, 'mm', 'L_2 cos θ_2 + L_3 cos φ')
    speed = -r * c['omega_2'] * c.sin(c['theta_2'] - rod) / c.cos(rod)
    c.answer('v_C', speed, 'mm/s', '-L_2 ω_2 sin(θ_2 - φ) / cos φ')
    far = c.step('x_max', sqrt((l_3 + r) ** 2 - e**2), 'mm', '√((L_3 + L_2)² - e²)')
    near = c.step('x_min', sqrt((l_3 - r) ** 2 - e**2), 'mm', '√((L_3 - L_2)² - e²)')
    c.answer('stroke', far - near, 'mm', 'x_max - x_min')
    right = c.half_turn / 2.0
    ends = [right - c.acos(e / (l_3 - r)), right - c.acos(e / (l_3 + r))]
    away = c.step('delta', ends[0] - ends[1], 'deg', 'asin(e/(L_3 - L_2)) - asin(e/(L_3 + L_2))')
    ratio = (c.half_turn + away) / (c.half_turn - away)
    c.answer('Q', ratio, '1', 'Q = (180° + δ) / (180° - δ)')


def _key_slider(givens: Givens) -> Givens:
    leg, theta_2 = _slider_crank(givens)
    pose = leg.closed_form(theta_2)
    least, greatest, first, last = _strokes(leg)
    return {
        'phi': degrees(pose.x[0]),
        'x_C': 1e3 * float(pose.h[0]),
        'v_C': 1e3 * float(leg.velocity(pose, givens['omega_2']).h[0]),
        'stroke': greatest - least,
        'Q': _time_ratio(first, last),
    }


def _work_quick(c: Calculation) -> None:
    d, r, l_4 = c.many('d', 'L_2', 'L_4')
    if r >= 0.8 * d:
        raise ValueError('it is no quick return of an arm that oscillates')
    x = c.step('x_B', r * c.cos(c['theta_2']), 'mm', 'L_2 cos θ_2')
    y = c.step('y_B', d + r * c.sin(c['theta_2']), 'mm', 'd + L_2 sin θ_2')
    c.answer('theta_4', c.atan2(y, x), 'deg', 'tan θ_4 = y_B / x_B')
    square = d**2 + r**2 + 2.0 * d * r * c.sin(c['theta_2'])
    far = c.step('s', sqrt(square), 'mm', 's² = d² + L_2² + 2 d L_2 sin θ_2')
    rate = c['omega_2'] * r * (r + d * c.sin(c['theta_2'])) / far**2
    c.answer('s', far)
    c.answer('omega_4', rate, 'rad/s', 'ω_4 = ω_2 L_2 (L_2 + d sin θ_2) / s²')
    half = c.half_turn / 2.0 - c.acos(r / d)
    c.answer('swing', c.step('swing', 2.0 * half, 'deg', '2 asin(L_2 / d)'))
    c.answer('stroke', 2.0 * l_4 * c.sin(half), 'mm', '2 L_4 sin(swing / 2)')
    ratio = (c.half_turn + 2.0 * half) / (c.half_turn - 2.0 * half)
    c.answer('Q', ratio, '1', 'Q = (180° + swing) / (180° - swing)')


def _key_quick(givens: Givens) -> Givens:
    leg, theta_2 = _quick_return(givens)
    pose = leg.closed_form(theta_2)
    least, greatest, first, last = _strokes(leg)
    swing = leg.closed_form(first).x[0] - leg.closed_form(last).x[0]
    return {
        'theta_4': degrees(pose.x[0]),
        's': 1e3 * float(pose.x[1]),
        'omega_4': float(leg.velocity(pose, givens['omega_2']).joints[1]),
        'swing': abs(degrees(swing)),
        'stroke': greatest - least,
        'Q': _time_ratio(first, last),
    }


SLIDER_KINDS = (
    kind_of('slider-crank', _work_slider, _key_slider, _slider_crank),
    kind_of('quick-return', _work_quick, _key_quick, _quick_return),
)
