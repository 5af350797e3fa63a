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
    numbers: dict[str, Any] = {}
    for name, number in givens.items():
        if name.startswith('angle_'):
            numbers[name.lower()] = radians(number)
        elif name.startswith(('L_', 'x_', 'y_')):
            numbers[name.lower()] = number / MM
    return KlannLeg(KlannGeometry(**numbers)), radians(givens.get('alpha', DRAWN_ANGLE))


def _klann_pose(leg: KlannLeg, alpha: float, givens: Givens) -> Key:
    """Return position, velocity, acceleration and torque; at 1 rad/s if no speed is given."""
    omega = givens.get('omega', 1.0)
    pose = leg.closed_form(alpha)
    velocity = leg.velocity(pose, omega)
    acceleration = leg.acceleration(pose, omega, givens.get('epsilon', 0.0))
    force = givens.get('F_x', 0.0), givens.get('F_y', 0.0)
    key: Key = {'T': leg.crank_torque(pose, force)}
    for name in KLANN_ANGLES:
        key[name] = degrees(getattr(pose, name))
        key[f'omega_{name}'] = getattr(velocity, name)
        key[f'epsilon_{name}'] = getattr(acceleration, name)
    for k, axis in enumerate('xy'):
        key[f'{axis}_H'] = MM * float(pose.h[k])
        key[f'v_H{axis}'] = key[f'h_{axis}'] = MM * float(velocity.h[k])
        key[f'a_H{axis}'] = MM * float(acceleration.h[k])
    return key


def _klann_foot(leg: KlannLeg, _alpha: float, _givens: Givens) -> Key:
    path = foot_path(leg)
    return {'stride': MM * path.stride, 'lift': MM * path.lift}


def _newton(leg: KlannLeg | FourBar, angle: float, givens: Givens) -> Key:
    """Return f and Phi at the guess, the second iterate, the root and the iterations."""
    # Lengths of a four-bar are in mm.
    names, unit = (KLANN_ANGLES, MM) if isinstance(leg, KlannLeg) else (FOUR_BAR_ANGLES, 1.0)
    guess = [radians(givens[f'{name}_1']) for name in names]
    f = leg.f(angle, guess)
    phi = leg.phi(angle, guess)
    iterates = np.degrees(leg.newton(angle, guess))
    corrections = np.abs(np.diff(iterates, axis=0)).max(axis=1)
    key: Key = {'Phi_12': unit * float(phi[0, 1]), 'Phi_21': unit * float(phi[1, 0])}
    for n, name in enumerate(names):
        key[f'f_{n + 1}'] = unit * float(f[n])
        key[f'{name}_2'] = float(iterates[1, n])
        key[name] = float(iterates[-1, n])
    key['iterations'] = float(np.argmax(corrections <= data()['iterations']['stop']) + 1)
    return key


def _four_bar(givens: Givens) -> tuple[FourBar, float]:
    """Return the four-bar, open, and its crank angle."""
    l_1, l_2, l_3, l_4 = (givens[name] for name in LINKS)
    return FourBar(l_1, l_2, l_3, l_4), radians(givens.get('theta_2', DRAWN_ANGLE))


def _four_bar_pose(bar: FourBar, theta_2: float, givens: Givens) -> Key:
    pose = bar.closed_form(theta_2)
    extremes = bar.transmission_extremes
    ratio = bar.mechanical_advantage(theta_2)
    centres = synthesis.place(bar.geometry, theta_2).instant_centres()
    return {
        'theta_3': degrees(pose.theta3),
        'theta_4': degrees(pose.theta4),
        'alpha': degrees(pose.alpha),
        'beta': degrees(pose.beta),
        'mu': degrees(pose.transmission_angle),
        'mu_min': degrees(extremes.least),
        'mu_max': degrees(extremes.greatest),
        **_xy('I13', centres['I13']),
        **_xy('I24', centres['I24']),
        'Z': pose.z,
        'MA': ratio,
        'T_4': ratio * givens.get('T_2', 0.0),
        'omega_4': bar.velocity(pose, givens.get('omega_2', 1.0)).theta4,
    }


def _four_bar_range(bar: FourBar, _theta_2: float, _givens: Givens) -> Key:
    """Return what the lengths alone decide: Grashof's law, limits and dead points."""
    limits = bar.rocker_limits
    s, p, q, longest = sorted(bar.geometry.lengths)
    points = {'S': limits.stretched, 'F': limits.folded}
    for name, driver in (('C', 'crank'), ('R', 'rocker')):
        for dead_point in bar.dead_points(driver):
            if dead_point.kind == 'stretched' and dead_point.angle > 0.0:
                points[name] = dead_point
    key: Key = {
        's_l': s + longest,
        'p_q': p + q,
        'grashof': bar.grashof.class_,
        'motion': bar.grashof.motion,
        'swing': degrees(limits.swing),
        'Q': limits.time_ratio,
    }
    for name, point in points.items():
        if point:
            key[f'theta_2_{name}'] = degrees(point.theta2)
            key[f'theta_4_{name}'] = degrees(point.theta4)
    return key


def _cognates(bar: FourBar, theta_2: float, givens: Givens) -> Key:
    four_bar = synthesis.place(bar.geometry, theta_2, givens['u'], givens['v'])
    key: Key = {}
    for letter, cognate in zip('ab', four_bar.cognates(), strict=True):
        for k, length in enumerate(cognate.geometry.lengths, 1):
            key[f'{letter}_{k}'] = length
    return key


@cache
def _drawn(name: str) -> Any:
    return linkage_from_file(Path(__file__).parent / 'static' / f'{name}.yaml')


def _slider(file: str, names: Mapping[str, str], givens: Givens) -> tuple[LinkageLeg, float]:
    """Return a linkage with a slider, with the dimensions of these givens."""
    changes = {dimension: givens[name] / MM for dimension, name in names.items()}
    return LinkageLeg(_drawn(file).varied(changes)), radians(givens['theta_2'])


def _sliding(leg: LinkageLeg, theta_2: float, givens: Givens) -> Key:
    """Return the angle of the rod, phi, or of the arm, theta_4, and the motion of the foot."""
    pose = leg.closed_form(theta_2)
    path = foot_path(leg)
    velocity = leg.velocity(pose, givens['omega_2'])
    first, last = (path.crank_angles_at_x(x)[0] for x in path.x_range)
    forward = abs(last - first)
    swing = leg.closed_form(first).x[0] - leg.closed_form(last).x[0]
    strokes = (forward, 2.0 * pi - forward)
    angle = degrees(pose.x[0])
    return {
        'phi': angle,
        'theta_4': angle,
        's': MM * float(pose.x[1]),
        'omega_4': float(velocity.joints[1]),
        'swing': abs(degrees(swing)),
        'x_C': MM * float(pose.h[0]),
        'v_C': MM * float(velocity.h[0]),
        'stroke': MM * path.stride,
        'Q': max(strokes) / min(strokes),
    }


def _function(givens: Givens) -> Key:
    """Return the linkage of the greatest tan theta_4_0, and the precision points."""
    key: Key = {}
    if 'n' in givens:
        key, inputs, outputs = _power(givens, 3)
    else:
        inputs = np.radians([0.0, *[givens[f'phi_{k}'] for k in (2, 3, 4)]])
        outputs = np.radians([0.0, *[givens[f'psi_{k}'] for k in (2, 3, 4)]])
    starts = {'input_start': radians(givens['theta_2_0'])}
    if 'theta_4_0' in givens:
        starts['output_start'] = radians(givens['theta_4_0'])
    designs = synthesis.function_generators(inputs, outputs, **starts, ground=givens['L_1'])
    angles = [phase(x.positions[0].b - x.o4) - float(outputs[0]) for x in designs]
    if not angles:
        raise GeometryError('no linkage fits these points')
    angle, best = max(zip(angles, designs, strict=True), key=lambda pair: tan(pair[0]))
    l_1, l_2, l_3, l_4 = best.geometry.lengths
    k_3 = (l_1**2 + l_2**2 - l_3**2 + l_4**2) / (2.0 * l_2 * l_4)
    key |= {'theta_4_0': degrees(angle), 'K_1': l_1 / l_2, 'K_2': l_1 / l_4, 'K_3': k_3}
    return {**key, **_lengths(best.geometry)}


def _least_squares(givens: Givens) -> Key:
    key, inputs, outputs = _power(givens, 5)
    theta_2 = inputs + radians(givens['theta_2_0'])
    theta_4 = outputs + radians(givens['theta_4_0'])
    k_1, k_2, k_3 = synthesis.freudenstein(theta_2, theta_4).tolist()
    l_1 = givens['L_1']
    l_2 = l_1 / k_1
    l_4 = l_1 / k_2
    l_3 = sqrt(l_1**2 + l_2**2 + l_4**2 - 2.0 * l_2 * l_4 * k_3)
    return {**key, 'K_1': k_1, 'K_2': k_2, 'K_3': k_3, 'L_2': l_2, 'L_3': l_3, 'L_4': l_4}


def _power(givens: Givens, count: int) -> tuple[Key, FloatArray, FloatArray]:
    """Return the precision points of y = x^n, and the rotations of crank and rocker there."""
    n = givens['n']
    domain = (givens['x_0'], givens[f'x_{count + 1}'])
    travels = radians(givens['dtheta_2']), radians(givens['dtheta_4'])
    task = synthesis.function_task(lambda x: float(x**n), domain, travels, count)
    points: Key = {f'x_{k}': float(x) for k, x in enumerate(task.x, 1)}
    return points, task.input_rotations, task.output_rotations


def _lengths(geometry: FourBarGeometry) -> Key:
    return dict(zip(LINKS, geometry.lengths, strict=True))


def _poses(givens: Givens) -> list[synthesis.PlanePose]:
    """Return the poses of the givens, the first one at P_1 = 0."""
    poses = [synthesis.PlanePose(0j, 0.0)]
    for k in (2, 3, 4):
        if f'x_P{k}' in givens:
            rotation = radians(givens[f'psi_{k}'])
            poses.append(synthesis.PlanePose(_point(givens, f'P{k}'), rotation))
    return poses


def _point(givens: Givens, name: str) -> complex:
    return complex(givens[f'x_{name}'], givens[f'y_{name}'])


def _xy(name: str, point: complex) -> Key:
    return {f'x_{name}': point.real, f'y_{name}': point.imag}


def _bar(dyad: Any, pin: str = 'A', pivot: str = 'O2', bar: str = 'L_2') -> Key:
    """Return the answers on the bar of a Burmester pair."""
    return {**_xy(pin, dyad.pin), **_xy(pivot, dyad.pivot), bar: abs(dyad.pin - dyad.pivot)}


def _three_poses(givens: Givens) -> Key:
    """Return both bars, and the angles and defects of the four-bar."""
    poses = _poses(givens)
    key: Key = {}
    dyads = []
    for pin, pivot, bar in (('A', 'O2', 'L_2'), ('B', 'O4', 'L_4')):
        if 'x_A' in givens:
            dyad = synthesis.dyad_of_pin(poses, _point(givens, pin))
        else:
            dyad = synthesis.dyad_of_pivot(poses, _point(givens, pivot))
        key |= _bar(dyad, pin, pivot, bar)
        dyads.append(dyad)
    # The first dyad drives.
    design = synthesis.motion_generators(poses, dyads)[0]
    mus = [phase((b - design.o4) / (b - a)) for a, b, _ in design.positions]
    signs = [mu > 0.0 for mu in mus]
    odd_pose = signs.index(signs.count(True) == 1) + 1 if design.defects.branch else 'none'
    key |= {'mode': str(odd_pose), 'circuit': 'two' if design.defects.circuit else 'one'}
    key['order'] = 'no' if design.defects.order else 'yes'
    for k, (theta_2, mu) in enumerate(zip(design.thetas, mus, strict=True), 1):
        key |= {f'theta_2_{k}': degrees(theta_2), f'mu_{k}': degrees(mu)}
    return key


def _four_poses(givens: Givens) -> Key:
    poses = _poses(givens)
    dyads = synthesis.dyads_of_rotation(poses, radians(givens['beta_2']))
    if len(dyads) < 2:
        raise GeometryError('no two bars turn by this angle')
    first, _, third, _ = [pin - dyads[1].pivot for pin in synthesis.pins(poses, dyads[1].pin)]
    return {**_bar(dyads[1]), 'beta_3': degrees(phase(third / first))}


def _timed_path(givens: Givens) -> Key:
    rotations = [radians(givens[f'beta_{k}']) for k in (2, 3)]
    return _bar(synthesis.dyad_of_rotations(_poses(givens), rotations))


def _toggle(givens: Givens) -> Key:
    bars = givens['L_1'], givens['L_2'], givens['L_4']
    couplers = synthesis.toggle_couplers(*bars, radians(givens['theta_2']))
    lengths = {kind: length for length, kind in reversed(couplers)}
    stretched, folded = lengths['stretched'], lengths['folded']
    return {'Z': (stretched + folded) / 2.0, 'L_3_S': stretched, 'L_3_F': folded}


def _quick_return_design(givens: Givens) -> Key:
    ratio = givens['Q']
    swing = radians(givens['swing'])
    l_4 = givens['L_4']
    geometries = synthesis.quick_returns(ratio, swing, l_4, givens['L_2'])
    if not geometries:
        raise GeometryError('no crank-rocker has these limits')
    # O2 on the side of O4 is nearer to it.
    nearest = min(geometries, key=lambda geometry: geometry.ground)
    delta = 180.0 * (ratio - 1.0) / (ratio + 1.0)
    return {'delta': delta, 'C': 2.0 * l_4 * sin(swing / 2.0), **_lengths(nearest)}


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
    'three-poses three-poses-pivots synthesis-defects': _three_poses,
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
