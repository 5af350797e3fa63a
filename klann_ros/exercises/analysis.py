"""
The keys of the exercises on analysis, by the library: Klann leg, four-bar, sliding linkages.

References
----------
R. Nicoletti, SEM 104 Mecanismos, lecture 7.
"Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples.
R. L. Norton, Design of Machinery, sections 2.11 and 4.

"""

from collections.abc import Callable, Mapping
from functools import lru_cache
from math import asin, atan2, cos, degrees, hypot, radians, sin, tau
from typing import Any

from klann_ros.kinematics import (
    foot_path,
    FourBar,
    KlannGeometry,
    KlannLeg,
    linkage_from_text,
    linkage_poses,
    LinkageLeg,
)
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .calculation import Answer, STOP_STEP

Givens = Mapping[str, float]
Key = Callable[[Givens], Mapping[str, Answer]]
KeysAndLegs = dict[str, tuple[Key, Callable[[Givens], tuple[Any, float]]]]
MM = 1e3
BARS, PIVOTS = ('AB', 'BC', 'DC', 'CG', 'EF', 'FG', 'GH'), ('x_D', 'y_A', 'x_E', 'y_E')
KLANN_LENGTHS = (*(f'L_{bar}' for bar in BARS), *PIVOTS)
KLANN_ANGLES, FOUR_BAR_ANGLES = ('gamma', 'beta', 'delta', 'theta'), ('theta_3', 'theta_4')
BENDS = ('angle_BCG', 'angle_FGH')
LINKS = ('L_1', 'L_2', 'L_3', 'L_4')
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


def _klann(givens: Givens) -> tuple[KlannLeg, float]:
    """Return the Klann leg of the givens and its crank angle, 60 deg where none is given."""
    lengths: dict[str, Any] = {name.lower(): givens[name] / MM for name in KLANN_LENGTHS}
    bends: dict[str, Any] = {name.lower(): radians(givens[name]) for name in BENDS}
    return KlannLeg(KlannGeometry(**lengths, **bends)), radians(givens.get('alpha', 60.0))


def _run_key(run: FloatArray, f: FloatArray, phi: FloatArray, names: tuple[str, ...]) -> Givens:
    """Return the answers of a run of the library's Newton, iterates in rad, f and Phi in mm."""
    moved = np.abs(np.degrees(np.diff(run, axis=0))).max(axis=1)
    found = {f'f_{k}': value for k, value in enumerate(f.tolist(), 1)}
    found |= {'Phi_12': float(phi[0, 1]), 'Phi_21': float(phi[1, 0])}
    found |= {f'{name}_2': degrees(value) for name, value in zip(names, run[1], strict=True)}
    found |= {name: degrees(value) for name, value in zip(names, run[-1], strict=True)}
    return {**found, 'iterations': float(np.argmax(moved <= STOP_STEP) + 1)}


def _klann_newton(givens: Givens) -> Givens:
    leg, alpha = _klann(givens)
    guess = [radians(givens[f'{name}_1']) for name in KLANN_ANGLES]
    f, phi = MM * leg.f(alpha, guess), MM * leg.phi(alpha, guess)
    return _run_key(leg.newton(alpha, guess), f, phi, KLANN_ANGLES)


def _klann_position(givens: Givens) -> Givens:
    leg, alpha = _klann(givens)
    pose = leg.closed_form(alpha)
    angles = {name: degrees(getattr(pose, name)) for name in KLANN_ANGLES}
    return {**angles, 'x_H': MM * pose.h[0], 'y_H': MM * pose.h[1]}


def _klann_velocity(givens: Givens) -> Givens:
    leg, alpha = _klann(givens)
    moving = leg.velocity(leg.closed_form(alpha), givens['omega'])
    rates = {f'omega_{name}': float(getattr(moving, name)) for name in KLANN_ANGLES}
    return {**rates, 'v_Hx': MM * moving.h[0], 'v_Hy': MM * moving.h[1]}


def _klann_acceleration(givens: Givens) -> Givens:
    leg, alpha = _klann(givens)
    changing = leg.acceleration(leg.closed_form(alpha), givens['omega'], givens['epsilon'])
    rates = {f'epsilon_{name}': float(getattr(changing, name)) for name in KLANN_ANGLES}
    return {**rates, 'a_Hx': MM * changing.h[0], 'a_Hy': MM * changing.h[1]}


def _klann_foot(givens: Givens) -> Givens:
    path = foot_path(_klann(givens)[0])
    return {'stride': MM * path.stride, 'lift': MM * path.lift}


def _klann_torque(givens: Givens) -> Givens:
    leg, alpha = _klann(givens)
    pose = leg.closed_form(alpha)
    h_x, h_y = leg.velocity(pose, 1.0).h
    torque = leg.crank_torque(pose, (givens['F_x'], givens['F_y']))
    return {'h_x': MM * h_x, 'h_y': MM * h_y, 'T': torque}


def four_bar_of(givens: Givens) -> FourBar:
    """Return the four-bar of the givens, in the open assembly, +1."""
    l_1, l_2, l_3, l_4 = (givens[name] for name in LINKS)
    return FourBar(l_1, l_2, l_3, l_4)


def four_bar_leg(givens: Givens) -> tuple[Any, float]:
    """Return the four-bar and its crank angle, 60 deg where none is given."""
    return four_bar_of(givens), radians(givens.get('theta_2', 60.0))


def _four_bar_position(givens: Givens) -> Givens:
    pose = four_bar_of(givens).closed_form(radians(givens['theta_2']))
    names = {'mu': pose.transmission_angle, 'alpha': pose.alpha, 'beta': pose.beta}
    angles = {**names, 'theta_3': pose.theta3, 'theta_4': pose.theta4}
    return {'Z': pose.z, **{name: degrees(value) for name, value in angles.items()}}


def _four_bar_newton(givens: Givens) -> Givens:
    bar, theta_2 = four_bar_of(givens), radians(givens['theta_2'])
    guess = [radians(givens[f'{name}_1']) for name in FOUR_BAR_ANGLES]
    f, phi = bar.f(theta_2, guess), bar.phi(theta_2, guess)
    return _run_key(bar.newton(theta_2, guess), f, phi, FOUR_BAR_ANGLES)


def _four_bar_grashof(givens: Givens) -> dict[str, Answer]:
    grashof, lengths = four_bar_of(givens).grashof, sorted(givens[name] for name in LINKS)
    sums = {'s_l': lengths[0] + lengths[3], 'p_q': lengths[1] + lengths[2]}
    return {**sums, 'grashof': grashof.class_, 'motion': grashof.motion}


def _four_bar_limits(givens: Givens) -> Givens:
    limits = four_bar_of(givens).rocker_limits
    found = {'swing': degrees(limits.swing), 'Q': limits.time_ratio}
    for name, point in (('S', limits.stretched), ('F', limits.folded)):
        if point:
            found[f'theta_2_{name}'] = degrees(point.theta2)
            found[f'theta_4_{name}'] = degrees(point.theta4)
    return found


def _four_bar_dead_points(givens: Givens) -> Givens:
    bar, found = four_bar_of(givens), {}
    for name, driver in (('C', 'crank'), ('R', 'rocker')):
        for point in bar.dead_points(driver):
            if point.kind == 'stretched' and point.angle > 0.0:
                found[f'theta_2_{name}'] = degrees(point.theta2)
                found[f'theta_4_{name}'] = degrees(point.theta4)
    return found


def _four_bar_transmission(givens: Givens) -> Givens:
    bar, theta_2 = four_bar_of(givens), radians(givens['theta_2'])
    extremes = bar.transmission_extremes
    angles = {'mu_min': extremes.least, 'mu_max': extremes.greatest}
    angles['mu'] = bar.transmission_angle(theta_2)
    return {name: degrees(value) for name, value in angles.items()}


def _four_bar_advantage(givens: Givens) -> Givens:
    ratio = four_bar_of(givens).mechanical_advantage(radians(givens['theta_2']))
    position = _four_bar_position(givens)
    angles = {name: position[name] for name in FOUR_BAR_ANGLES}
    return {**angles, 'MA': ratio, 'T_4': ratio * givens['T_2']}


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


def _slider_key(givens: Givens) -> Givens:
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


def _quick_return_key(givens: Givens) -> Givens:
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


ANALYSIS_KEYS: KeysAndLegs = {
    'newton': (_klann_newton, _klann),
    'klann-position': (_klann_position, _klann),
    'velocity': (_klann_velocity, _klann),
    'acceleration': (_klann_acceleration, _klann),
    'foot-path': (_klann_foot, _klann),
    'torque': (_klann_torque, _klann),
    'grashof': (_four_bar_grashof, four_bar_leg),
    'four-bar-position': (_four_bar_position, four_bar_leg),
    'four-bar-newton': (_four_bar_newton, four_bar_leg),
    'limits': (_four_bar_limits, four_bar_leg),
    'dead-points': (_four_bar_dead_points, four_bar_leg),
    'transmission': (_four_bar_transmission, four_bar_leg),
    'mechanical-advantage': (_four_bar_advantage, four_bar_leg),
    'slider-crank': (_slider_key, _slider_crank),
    'quick-return': (_quick_return_key, _quick_return),
}
"""Keys and legs of the drawings of these kinds."""
