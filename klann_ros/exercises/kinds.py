"""
The kinds of exercises: the key of each by the library, and the leg of its drawing.

References
----------
R. Nicoletti, SEM 104 Mecanismos, lecture 7.
"Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples.
R. L. Norton, Design of Machinery; A. G. Erdman, G. N. Sandor, Mechanism Design.

"""

from cmath import phase
from collections.abc import Callable, Mapping
from functools import cache, partial
from math import degrees, pi, radians, sin, sqrt, tan
from pathlib import Path
from typing import Any

from klann_ros import synthesis
from klann_ros.kinematics import (
    foot_path,
    FourBar,
    FourBarGeometry,
    GeometryError,
    KlannGeometry,
    KlannLeg,
    linkage_from_file,
    LinkageLeg,
)
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .calculation import Answer, data, figure_of
from .variant import Kind

Givens = Mapping[str, float]
Key = dict[str, Answer]
MM = 1e3
KLANN_ANGLES, FOUR_BAR_ANGLES = ('gamma', 'beta', 'delta', 'theta'), ('theta_3', 'theta_4')
LINKS = ('L_1', 'L_2', 'L_3', 'L_4')
# The crank angle of a drawing where none is given [deg].
DRAWN_ANGLE = 60.0


def _klann(givens: Givens) -> tuple[KlannLeg, float]:
    numbers: dict[str, Any] = {
        name.lower(): radians(value) if name.startswith('angle') else value / MM
        for name, value in givens.items()
        if name.startswith(('L_', 'x_', 'y_', 'angle_'))
    }
    return KlannLeg(KlannGeometry(**numbers)), radians(givens.get('alpha', DRAWN_ANGLE))


def _klann_pose(leg: KlannLeg, alpha: float, givens: Givens) -> Key:
    """Return position, velocity, acceleration and torque; at 1 rad/s if no speed is given."""
    omega, epsilon = givens.get('omega', 1.0), givens.get('epsilon', 0.0)
    pose = leg.closed_form(alpha)
    moving, changing = leg.velocity(pose, omega), leg.acceleration(pose, omega, epsilon)
    force = givens.get('F_x', 0.0), givens.get('F_y', 0.0)
    found: Key = {'T': leg.crank_torque(pose, force)}
    for name in KLANN_ANGLES:
        found[name] = degrees(getattr(pose, name))
        found[f'omega_{name}'] = getattr(moving, name)
        found[f'epsilon_{name}'] = getattr(changing, name)
    vectors = {'{}_H': pose.h, 'v_H{}': moving.h, 'h_{}': moving.h, 'a_H{}': changing.h}
    for name, vector in vectors.items():
        found |= {name.format(axis): MM * float(vector[k]) for k, axis in enumerate('xy')}
    return found


def _klann_foot(leg: KlannLeg, _alpha: float, _givens: Givens) -> Key:
    path = foot_path(leg)
    return {'stride': MM * path.stride, 'lift': MM * path.lift}


def _newton(leg: KlannLeg | FourBar, angle: float, givens: Givens) -> Key:
    """Return f and Phi at the guess, the second iterate, the root and the iterations."""
    # Lengths of a four-bar are in mm.
    is_klann = isinstance(leg, KlannLeg)
    names, unit = (KLANN_ANGLES, MM) if is_klann else (FOUR_BAR_ANGLES, 1.0)
    guess = [radians(givens[f'{name}_1']) for name in names]
    f, phi, run = leg.f(angle, guess), leg.phi(angle, guess), np.degrees(leg.newton(angle, guess))
    moved = np.abs(np.diff(run, axis=0)).max(axis=1)
    return {
        **{f'f_{k}': unit * value for k, value in enumerate(f.tolist(), 1)},
        'Phi_12': unit * float(phi[0, 1]),
        'Phi_21': unit * float(phi[1, 0]),
        **dict(zip([f'{name}_2' for name in names], run[1].tolist(), strict=True)),
        **dict(zip(names, run[-1].tolist(), strict=True)),
        'iterations': float(np.argmax(moved <= data()['iterations']['stop']) + 1),
    }


def _four_bar(givens: Givens) -> tuple[FourBar, float]:
    """Return the four-bar, open, and its crank angle."""
    l_1, l_2, l_3, l_4 = (givens[name] for name in LINKS)
    return FourBar(l_1, l_2, l_3, l_4), radians(givens.get('theta_2', DRAWN_ANGLE))


def _four_bar_pose(bar: FourBar, theta_2: float, givens: Givens) -> Key:
    pose, extremes = bar.closed_form(theta_2), bar.transmission_extremes
    angles = {'theta_3': pose.theta3, 'theta_4': pose.theta4, 'alpha': pose.alpha}
    angles |= {'beta': pose.beta, 'mu': pose.transmission_angle}
    angles |= {'mu_min': extremes.least, 'mu_max': extremes.greatest}
    ratio = bar.mechanical_advantage(theta_2)
    centres = synthesis.place(bar.geometry, theta_2).instant_centres()
    return {
        **{name: degrees(angle) for name, angle in angles.items()},
        **_xy('I13', centres['I13']),
        **_xy('I24', centres['I24']),
        'Z': pose.z,
        'MA': ratio,
        'T_4': ratio * givens.get('T_2', 0.0),
        'omega_4': bar.velocity(pose, givens.get('omega_2', 1.0)).theta4,
    }


def _four_bar_range(bar: FourBar, _theta_2: float, _givens: Givens) -> Key:
    """Return what the lengths alone decide: Grashof's law, limits and dead points."""
    limits, grashof = bar.rocker_limits, bar.grashof
    s, p, q, longest = sorted(bar.geometry.lengths)
    found: Key = {'s_l': s + longest, 'p_q': p + q}
    found |= {'grashof': grashof.class_, 'motion': grashof.motion}
    found |= {'swing': degrees(limits.swing), 'Q': limits.time_ratio}
    points = {'S': limits.stretched, 'F': limits.folded}
    for name, driver in (('C', 'crank'), ('R', 'rocker')):
        for point in bar.dead_points(driver):
            if point.kind == 'stretched' and point.angle > 0.0:
                points[name] = point
    for name, each in points.items():
        if each:
            found[f'theta_2_{name}'] = degrees(each.theta2)
            found[f'theta_4_{name}'] = degrees(each.theta4)
    return found


def _cognates(bar: FourBar, theta_2: float, givens: Givens) -> Key:
    pair = synthesis.place(bar.geometry, theta_2, givens['u'], givens['v']).cognates()
    return {
        f'{letter}_{k}': length
        for letter, cognate in zip('ab', pair, strict=True)
        for k, length in enumerate(cognate.geometry.lengths, 1)
    }


@cache
def _drawn(name: str) -> Any:
    return linkage_from_file(Path(__file__).parent / 'static' / f'{name}.yaml')


def _slider(file: str, names: Mapping[str, str], givens: Givens) -> tuple[LinkageLeg, float]:
    """Return a linkage with a slider, with the dimensions of these givens."""
    changes = {dimension: givens[name] / MM for dimension, name in names.items()}
    return LinkageLeg(_drawn(file).varied(changes)), radians(givens['theta_2'])


def _sliding(leg: LinkageLeg, theta_2: float, givens: Givens) -> Key:
    """Return the angle of the rod, phi, or of the arm, theta_4, and the motion of the foot."""
    pose, path = leg.closed_form(theta_2), foot_path(leg)
    moving = leg.velocity(pose, givens['omega_2'])
    first, last = (path.crank_angles_at_x(x)[0] for x in path.x_range)
    forward, swing = abs(last - first), leg.closed_form(first).x[0] - leg.closed_form(last).x[0]
    strokes, angle = (forward, 2.0 * pi - forward), degrees(pose.x[0])
    found: Key = {'phi': angle, 'theta_4': angle, 's': MM * float(pose.x[1])}
    found |= {'omega_4': float(moving.joints[1]), 'swing': abs(degrees(swing))}
    found |= {'x_C': MM * float(pose.h[0]), 'v_C': MM * float(moving.h[0])}
    return {**found, 'stroke': MM * path.stride, 'Q': max(strokes) / min(strokes)}


def _function(givens: Givens) -> Key:
    """Return the linkage of the greatest tan theta_4_0, and the precision points."""
    found: Key = {}
    if 'n' in givens:
        found, inputs, outputs = _power(givens, 3)
    else:
        inputs, outputs = (
            np.radians([0.0, *(givens[f'{name}_{k}'] for k in (2, 3, 4))])
            for name in ('phi', 'psi')
        )
    starts = {'input_start': 'theta_2_0', 'output_start': 'theta_4_0'}
    known = {name: radians(givens[angle]) for name, angle in starts.items() if angle in givens}
    fitting = synthesis.function_generators(inputs, outputs, **known, ground=givens['L_1'])
    angles = [phase(x.positions[0].b - x.o4) - float(outputs[0]) for x in fitting]
    if not angles:
        raise GeometryError('no linkage fits these points')
    angle, best = max(zip(angles, fitting, strict=True), key=lambda each: tan(each[0]))
    l_1, l_2, l_3, l_4 = best.geometry.lengths
    k_3 = (l_1**2 + l_2**2 - l_3**2 + l_4**2) / (2.0 * l_2 * l_4)
    found |= {'theta_4_0': degrees(angle), 'K_1': l_1 / l_2, 'K_2': l_1 / l_4, 'K_3': k_3}
    return {**found, **_lengths(best.geometry)}


def _least_squares(givens: Givens) -> Key:
    found, inputs, outputs = _power(givens, 5)
    starts = radians(givens['theta_2_0']), radians(givens['theta_4_0'])
    k = synthesis.freudenstein(inputs + starts[0], outputs + starts[1]).tolist()
    l_1, l_2, l_4 = (givens['L_1'] / each for each in (1.0, *k[:2]))
    found |= {f'K_{n}': each for n, each in enumerate(k, 1)}
    l_3 = sqrt(l_1**2 + l_2**2 + l_4**2 - 2.0 * l_2 * l_4 * k[2])
    return {**found, 'L_2': l_2, 'L_3': l_3, 'L_4': l_4}


def _power(givens: Givens, count: int) -> tuple[Key, FloatArray, FloatArray]:
    """Return the precision points of y = x^n, and the rotations of crank and rocker there."""
    domain, n = (givens['x_0'], givens[f'x_{count + 1}']), givens['n']
    travels = radians(givens['dtheta_2']), radians(givens['dtheta_4'])
    task = synthesis.function_task(lambda x: float(x**n), domain, travels, count)
    points: Key = {f'x_{k}': float(x) for k, x in enumerate(task.x, 1)}
    return points, task.input_rotations, task.output_rotations


def _lengths(geometry: FourBarGeometry) -> Key:
    return dict(zip(LINKS, geometry.lengths, strict=True))


def _poses(givens: Givens) -> list[synthesis.PlanePose]:
    """Return the poses of the givens, the first one at P_1 = 0."""
    others = [name for name in ('P2', 'P3', 'P4') if f'x_{name}' in givens]
    turns = [radians(givens[f'psi_{name[1]}']) for name in others]
    places = [_point(givens, name) for name in others]
    return [*map(synthesis.PlanePose, (0j, *places), (0.0, *turns))]


def _point(givens: Givens, name: str) -> complex:
    return complex(givens[f'x_{name}'], givens[f'y_{name}'])


def _xy(name: str, point: complex) -> Key:
    return {f'x_{name}': point.real, f'y_{name}': point.imag}


def _bar(pair: Any, pin: str = 'A', pivot: str = 'O2', bar: str = 'L_2') -> Key:
    """Return the answers on the bar of a Burmester pair."""
    return {**_xy(pin, pair.pin), **_xy(pivot, pair.pivot), bar: abs(pair.pin - pair.pivot)}


def _three_poses(givens: Givens) -> Key:
    poses, bars = _poses(givens), (('A', 'O2', 'L_2'), ('B', 'O4', 'L_4'))
    given, make = (0, synthesis.dyad_of_pin) if 'x_A' in givens else (1, synthesis.dyad_of_pivot)
    pairs = [make(poses, _point(givens, names[given])) for names in bars]
    return _bar(pairs[0], *bars[0]) | _bar(pairs[1], *bars[1])


def _four_poses(givens: Givens) -> Key:
    poses = _poses(givens)
    dyads = synthesis.dyads_of_rotation(poses, radians(givens['beta_2']))
    if len(dyads) < 2:
        raise GeometryError('no two bars turn by this angle')
    first, _, third, _ = (x - dyads[1].pivot for x in synthesis.pins(poses, dyads[1].pin))
    return {**_bar(dyads[1]), 'beta_3': degrees(phase(third / first))}


def _timed_path(givens: Givens) -> Key:
    rotations = [radians(givens[f'beta_{k}']) for k in (2, 3)]
    return _bar(synthesis.dyad_of_rotations(_poses(givens), rotations))


def _toggle(givens: Givens) -> Key:
    l_1, l_2, l_4 = givens['L_1'], givens['L_2'], givens['L_4']
    found = synthesis.toggle_couplers(l_1, l_2, l_4, radians(givens['theta_2']))
    lengths = {kind: length for length, kind in reversed(found)}
    z = (lengths['stretched'] + lengths['folded']) / 2.0
    return {'Z': z, 'L_3_S': lengths['stretched'], 'L_3_F': lengths['folded']}


def _quick_return_design(givens: Givens) -> Key:
    ratio, swing, l_4 = givens['Q'], radians(givens['swing']), givens['L_4']
    found = synthesis.quick_returns(ratio, swing, l_4, givens['L_2'])
    if not found:
        raise GeometryError('no crank-rocker has these limits')
    # O2 on the side of O4 is nearer to it.
    geometry = min(found, key=lambda each: each.ground)
    angles = {'delta': 180.0 * (ratio - 1.0) / (ratio + 1.0), 'C': 2.0 * l_4 * sin(swing / 2.0)}
    return {**angles, **_lengths(geometry)}


_KEYS: dict[str, Callable[..., Key]] = {
    'newton four-bar-newton': _newton,
    'klann-position velocity acceleration torque': _klann_pose,
    'foot-path': _klann_foot,
    'four-bar-position transmission mechanical-advantage instant-centres': _four_bar_pose,
    'grashof limits dead-points': _four_bar_range,
    'cognates': _cognates,
    'slider-crank quick-return': _sliding,
    'function-generation function-four-points': _function,
    'function-least-squares': _least_squares,
    'three-poses three-poses-pivots': _three_poses,
    'four-poses': _four_poses,
    'timed-path': _timed_path,
    'toggle': _toggle,
    'quick-return-design': _quick_return_design,
}
# By figure; a design has no leg, which would show the answer.
_LEGS: dict[str, Callable[[Givens], tuple[Any, float]]] = {
    'klann': _klann,
    'four-bar': _four_bar,
    'slider-crank': partial(_slider, 'slider_crank', {'A-B': 'L_2', 'B-C': 'L_3', 'P.y': 'e'}),
    'quick-return': partial(_slider, 'quick_return', {'A-B': 'L_2', 'O-D': 'L_4', 'A.y': 'd'}),
}
_OF_KINDS = {name: solve for names, solve in _KEYS.items() for name in names.split()}
KINDS = {name: Kind(name, _OF_KINDS[name], _LEGS.get(figure_of(name))) for name in data()['kinds']}
"""The kinds of exercises by their name."""
