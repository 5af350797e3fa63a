"""
The keys of the exercises on synthesis, by the library.

References
----------
A. G. Erdman, G. N. Sandor, Mechanism Design; R. L. Norton, Design of Machinery.

"""

from cmath import phase
from math import degrees, radians, sin, sqrt, tan

from klann_ros.kinematics import FourBar, GeometryError
from klann_ros.synthesis import (
    BurmesterPair,
    dyad_of_pin,
    dyad_of_rotations,
    dyads_of_rotation,
    freudenstein,
    function_generators,
    function_task,
    pins,
    place,
    PlanePose,
    precision_points,
    quick_returns,
    toggle_couplers,
)

from .analysis import four_bar_leg, four_bar_of, Givens, KeysAndLegs


def _key_function(givens: Givens) -> Givens:
    n, start, end = givens['n'], givens['x_0'], givens['x_4']
    travels = radians(givens['dtheta_2']), radians(givens['dtheta_4'])
    task = function_task(lambda x: float(x**n), (start, end), travels)
    theta2 = task.input_rotations + radians(givens['theta_2_0'])
    theta4 = task.output_rotations + radians(givens['theta_4_0'])
    k_1, k_2, k_3 = freudenstein(theta2, theta4).tolist()
    l_1 = givens['L_1']
    l_2, l_4 = l_1 / k_1, l_1 / k_2
    square = l_1**2 + l_2**2 + l_4**2 - 2.0 * l_2 * l_4 * k_3
    found = {f'x_{k}': float(x) for k, x in enumerate(precision_points(start, end, 3), 1)}
    found |= {'K_1': k_1, 'K_2': k_2, 'K_3': k_3, 'L_2': l_2, 'L_4': l_4}
    return {**found, 'L_3': sqrt(square)}


def _key_four_points(givens: Givens) -> Givens:
    inputs, outputs = (
        [0.0, *(radians(givens[f'{name}_{k}']) for k in (2, 3, 4))] for name in ('phi', 'psi')
    )
    start, ground = radians(givens['theta_2_0']), givens['L_1']
    found = {}
    for linkage in function_generators(inputs, outputs, input_start=start, ground=ground):
        _, l_2, l_3, l_4 = linkage.geometry.lengths
        angle = degrees(phase(linkage.b - ground))
        found[tan(radians(angle))] = {'theta_4_0': angle, 'L_2': l_2, 'L_3': l_3, 'L_4': l_4}
    if len(found) < 2:
        raise GeometryError('no two linkages fit these four points')
    return found[max(found)]


def _poses(givens: Givens, count: int) -> list[PlanePose]:
    """Return the poses of the givens, the first one at P_1 = 0."""
    others = range(2, count + 1)
    return [
        PlanePose(0j, 0.0),
        *(PlanePose(_point(givens, f'P{k}'), radians(givens[f'psi_{k}'])) for k in others),
    ]


def _point(givens: Givens, name: str) -> complex:
    return complex(givens[f'x_{name}'], givens[f'y_{name}'])


def _bar(pair: BurmesterPair, pin: str = 'A', pivot: str = 'O2', bar: str = 'L_2') -> Givens:
    found = {f'x_{pin}': pair.pin.real, f'y_{pin}': pair.pin.imag}
    found |= {f'x_{pivot}': pair.pivot.real, f'y_{pivot}': pair.pivot.imag}
    return {**found, bar: abs(pair.pin - pair.pivot)}


def _key_poses(givens: Givens) -> Givens:
    poses, places = _poses(givens, 3), (('A', 'O2', 'L_2'), ('B', 'O4', 'L_4'))
    crank, rocker = (_bar(dyad_of_pin(poses, _point(givens, each[0])), *each) for each in places)
    found = {**crank, **rocker}
    return {name: value for name, value in found.items() if name not in givens}


def _key_path(givens: Givens) -> Givens:
    rotations = [radians(givens[f'beta_{k}']) for k in (2, 3)]
    return _bar(dyad_of_rotations(_poses(givens, 3), rotations))


def _key_four_poses(givens: Givens) -> Givens:
    poses = _poses(givens, 4)
    dyads = dyads_of_rotation(poses, radians(givens['beta_2']))
    if len(dyads) < 2:
        raise GeometryError('no two bars turn by this angle')
    pair = dyads[1]
    first, _, third, _ = (place - pair.pivot for place in pins(poses, pair.pin))
    return {**_bar(pair), 'beta_3': degrees(phase(third / first))}


def _key_cognates(givens: Givens) -> Givens:
    geometry = four_bar_of(givens).geometry
    placed = place(geometry, radians(givens['theta_2']), givens['u'], givens['v'])
    found = {}
    for letter, cognate in zip('ab', placed.cognates(), strict=True):
        for k, length in enumerate(cognate.geometry.lengths, 1):
            found[f'{letter}_{k}'] = length
    return found


def _key_centres(givens: Givens) -> Givens:
    geometry = four_bar_of(givens).geometry
    theta_2 = radians(givens['theta_2'])
    centres = place(geometry, theta_2).instant_centres()
    bar = FourBar(*geometry.lengths)
    moving = bar.velocity(bar.closed_form(theta_2), givens['omega_2'])
    i_13, i_24 = centres['I13'], centres['I24']
    found = {'x_I13': i_13.real, 'y_I13': i_13.imag, 'x_I24': i_24.real}
    return {**found, 'omega_4': float(moving.theta4)}


def _key_toggle(givens: Givens) -> Givens:
    l_1, l_2, l_4 = givens['L_1'], givens['L_2'], givens['L_4']
    found = toggle_couplers(l_1, l_2, l_4, radians(givens['theta_2']))
    lengths = {kind: length for length, kind in reversed(found)}
    z = (lengths['stretched'] + lengths['folded']) / 2.0
    return {'Z': z, 'L_3_S': lengths['stretched'], 'L_3_F': lengths['folded']}


def _key_return(givens: Givens) -> Givens:
    ratio, swing, l_4 = givens['Q'], radians(givens['swing']), givens['L_4']
    found = quick_returns(ratio, swing, l_4, givens['L_2'])
    if not found:
        raise GeometryError('no crank-rocker has these limits')
    # O2 on the side of O4 is nearer to it.
    geometry = min(found, key=lambda each: each.ground)
    angles = {'delta': 180.0 * (ratio - 1.0) / (ratio + 1.0), 'C': 2.0 * l_4 * sin(swing / 2.0)}
    return {**angles, 'L_3': geometry.coupler, 'L_1': geometry.ground}


def _undrawn(_: Givens) -> tuple[None, float]:
    """Return no leg, for it would show the answer."""
    return None, 0.0


SYNTHESIS_KEYS: KeysAndLegs = {
    'function-generation': (_key_function, _undrawn),
    'function-four-points': (_key_four_points, _undrawn),
    'three-poses': (_key_poses, _undrawn),
    'four-poses': (_key_four_poses, _undrawn),
    'timed-path': (_key_path, _undrawn),
    'cognates': (_key_cognates, four_bar_leg),
    'instant-centres': (_key_centres, four_bar_leg),
    'toggle': (_key_toggle, _undrawn),
    'quick-return-design': (_key_return, _undrawn),
}
"""Keys and legs of the drawings of these kinds."""
