"""
Exercises on synthesis: functions, three poses, timed paths, cognates, centres, toggles, returns.

References
----------
A. G. Erdman, G. N. Sandor, Mechanism Design; R. L. Norton, Design of Machinery.

"""

from math import cos, radians, sin, sqrt

from klann_ros.kinematics import FourBar, GeometryError
from klann_ros.synthesis import (
    dyad_of_pin,
    dyad_of_rotations,
    freudenstein,
    function_task,
    place,
    PlanePose,
    precision_points,
    quick_returns,
    toggle_couplers,
)
import numpy as np

from .calculation import Calculation
from .four_bar import analytic, four_bar_of, leg_of, LINKS
from .klann import Givens
from .variant import kind_of

# Bounds of crank and rocker as parts of the ground, so that the sheet can draw the four-bar.
MIN_RATIO, MAX_RATIO = 0.125, 4.0


def _work_function(c: Calculation) -> None:
    n, start, end = c.many('n', 'x_0', 'x_4')
    middle, half = (start + end) / 2.0, (end - start) / 2.0
    crank, rocker = [], []
    for k in (1, 2, 3):
        spacing = half * c.cos((2.0 * k - 1.0) * 30.0)
        x = middle - spacing
        c.answer(f'x_{k}', x, '1', '(x_0 + x_4)/2 - (x_4 - x_0)/2 cos((2k - 1) 30°)')
        along = (x**n - start**n) / (end**n - start**n)
        first = c['theta_2_0'] + c['dtheta_2'] * (x - start) / (end - start)
        crank.append(c.step(f'theta_2_{k}', first, 'deg', 'θ_2,0 + Δθ_2 (x_k - x_0)/(x_4 - x_0)'))
        last = c['theta_4_0'] + c['dtheta_4'] * along
        rocker.append(c.step(f'theta_4_{k}', last, 'deg', 'θ_4,0 + Δθ_4 (y_k - y_0)/(y_4 - y_0)'))
    pairs = [*zip(crank, rocker, strict=True)]
    system = np.array([[c.cos(b), -c.cos(a), 1.0] for a, b in pairs])
    right = np.array([c.cos(a - b) for a, b in pairs])
    found = c.solve(system, right).tolist()
    rule = 'K_1 cos θ_4 - K_2 cos θ_2 + K_3 = cos(θ_2 - θ_4)'
    k_1, k_2, k_3 = (c.step(f'K_{k}', value, '1', rule) for k, value in enumerate(found, 1))
    for k, value in enumerate((k_1, k_2, k_3), 1):
        c.answer(f'K_{k}', value)
    l_1 = c['L_1']
    l_2, l_4 = l_1 / k_1, l_1 / k_2
    if not c.mistake and not MIN_RATIO < min(l_2, l_4) / l_1 <= max(l_2, l_4) / l_1 < MAX_RATIO:
        raise ValueError('a link is negative, or far too long')
    c.answer('L_2', l_2, 'mm', 'K_1 = L_1 / L_2')
    c.answer('L_4', l_4, 'mm', 'K_2 = L_1 / L_4')
    square = l_1**2 + l_2**2 + l_4**2 - 2.0 * l_2 * l_4 * k_3
    c.answer('L_3', sqrt(square), 'mm', 'K_3 = (L_1² + L_2² - L_3² + L_4²) / (2 L_2 L_4)')


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


def _work_poses(c: Calculation) -> None:
    for pin, pivot in (('A', 'O2'), ('B', 'O4')):
        x, y = c.many(f'x_{pin}', f'y_{pin}')
        places = [(x, y)]
        for k in (2, 3):
            angle = c[f'psi_{k}']
            place_x = c[f'x_P{k}'] + x * c.cos(angle) - y * c.sin(angle)
            place_y = c[f'y_P{k}'] + x * c.sin(angle) + y * c.cos(angle)
            rule = f'P_{k} + R(ψ_{k}) {pin}_1'
            place_x = c.step(f'x_{pin}{k}', place_x, 'mm', rule)
            places.append((place_x, c.step(f'y_{pin}{k}', place_y, 'mm', rule)))
        rows = [(2.0 * (p - x), 2.0 * (q - y)) for p, q in places[1:]]
        sums = [p**2 + q**2 - x**2 - y**2 for p, q in places[1:]]
        matrix = np.array(rows)
        if not c.mistake and abs(np.linalg.det(matrix)) < 0.2 * np.prod(
            np.linalg.norm(matrix, axis=1)
        ):
            raise ValueError('the three places of the pin are nearly in line')
        centre = c.solve(matrix, np.array(sums)).tolist()
        rule = f'|{pin}_1 {pivot}| = |{pin}_2 {pivot}| = |{pin}_3 {pivot}|'
        for name, value in zip('xy', centre, strict=True):
            c.answer(f'{name}_{pivot}', c.step(f'{name}_{pivot}', value, 'mm', rule))
        length = sqrt((x - centre[0]) ** 2 + (y - centre[1]) ** 2)
        bar = 'L_2' if pin == 'A' else 'L_4'
        c.answer(bar, length, 'mm', f'|{pin}_1 {pivot}|')


def _key_poses(givens: Givens) -> Givens:
    poses = [PlanePose(complex(givens['x_P1'], givens['y_P1']), 0.0)]
    for k in (2, 3):
        at = complex(givens[f'x_P{k}'], givens[f'y_P{k}'])
        poses.append(PlanePose(at, radians(givens[f'psi_{k}'])))
    found: dict[str, float] = {}
    for pin, pivot, bar in (('A', 'O2', 'L_2'), ('B', 'O4', 'L_4')):
        pair = dyad_of_pin(poses, complex(givens[f'x_{pin}'], givens[f'y_{pin}']))
        found |= {f'x_{pivot}': pair.pivot.real, f'y_{pivot}': pair.pivot.imag}
        found[bar] = abs(pair.pin - pair.pivot)
    return found


def _work_path(c: Calculation) -> None:
    # w (e^(i beta) - 1) + z (e^(i psi) - 1) = P_k, real and imaginary parts, x = (w, z).
    rows, right = [], []
    for k in (2, 3):
        terms = []
        for angle in (c[f'beta_{k}'], c[f'psi_{k}']):
            real = c.step('cos - 1', c.cos(angle) - 1.0, '1', f'cos {angle:g}° - 1')
            terms.append((real, c.step('sin', c.sin(angle), '1', f'sin {angle:g}°')))
        rows.append([terms[0][0], -terms[0][1], terms[1][0], -terms[1][1]])
        rows.append([terms[0][1], terms[0][0], terms[1][1], terms[1][0]])
        right += [c[f'x_P{k}'], c[f'y_P{k}']]
    found = c.solve(np.array(rows), np.array(right))
    rule = 'w (e^(iβ_k) - 1) + z (e^(iψ_k) - 1) = P_k - P_1'
    names = ('w_x', 'w_y', 'z_x', 'z_y')
    w_x, w_y, z_x, z_y = (
        c.step(name, value, 'mm', rule) for name, value in zip(names, found.tolist(), strict=True)
    )
    c.answer('L_2', sqrt(w_x**2 + w_y**2), 'mm', '|w|')
    for name, value in (('x_A', -z_x), ('y_A', -z_y)):
        c.answer(name, value, 'mm', 'A = P_1 - z')
    for name, value in (('x_O2', -z_x - w_x), ('y_O2', -z_y - w_y)):
        c.answer(name, value, 'mm', 'O2 = A - w')
    if not c.mistake and max(map(abs, found.tolist())) > 500.0:
        raise ValueError('it is far larger than its path')


def _key_path(givens: Givens) -> Givens:
    poses = [PlanePose(0j, 0.0)]
    for k in (2, 3):
        at = complex(givens[f'x_P{k}'], givens[f'y_P{k}'])
        poses.append(PlanePose(at, radians(givens[f'psi_{k}'])))
    pair = dyad_of_rotations(poses, [radians(givens[f'beta_{k}']) for k in (2, 3)])
    found = {'L_2': abs(pair.pin - pair.pivot), 'x_A': pair.pin.real, 'y_A': pair.pin.imag}
    return {**found, 'x_O2': pair.pivot.real, 'y_O2': pair.pivot.imag}


def _work_cognates(c: Calculation) -> None:
    l_3, u, v = c.many('L_3', 'u', 'v')
    # A triangle similar to that of the coupler stands on each bar.
    to_a = c.step('AP', sqrt(u**2 + v**2), 'mm', '√(u² + v²)')
    to_b = c.step('BP', sqrt((l_3 - u) ** 2 + v**2), 'mm', '√((L_3 - u)² + v²)')
    cognates = (('a', 'AP', to_a, (1, 3, 2, 4)), ('b', 'BP', to_b, (1, 2, 4, 3)))
    for letter, side, bar, order in cognates:
        for k, link in enumerate(order, 1):
            rule = f'L_{link} {side} / L_3'
            c.answer(f'{letter}_{k}', c[f'L_{link}'] * bar / l_3, 'mm', rule)


def _key_cognates(givens: Givens) -> Givens:
    geometry = four_bar_of(givens).geometry
    placed = place(geometry, radians(givens['theta_2']), givens['u'], givens['v'])
    found = {}
    for letter, cognate in zip('ab', placed.cognates(), strict=True):
        for k, length in enumerate(cognate.geometry.lengths, 1):
            found[f'{letter}_{k}'] = length
    return found


def _work_centres(c: Calculation) -> None:
    theta_3, theta_4 = analytic(c)
    l_1, l_2, l_3, _ = c.many(*LINKS)
    a = l_2 * c.cos(c['theta_2']), l_2 * c.sin(c['theta_2'])
    # O2 A and O4 B meet in I13; A B meets the ground in I24.
    far = l_1 * c.sin(theta_4) / c.sin(theta_4 - c['theta_2'])
    rule = '|O2 I13| = L_1 sin θ_4 / sin(θ_4 - θ_2)'
    c.answer('x_I13', far * c.cos(c['theta_2']), 'mm', rule)
    c.answer('y_I13', far * c.sin(c['theta_2']), 'mm', rule)
    ground = a[0] - a[1] * c.cos(theta_3) / c.sin(theta_3)
    c.answer('x_I24', c.step('x_I24', ground, 'mm', 'x_A - y_A / tan θ_3'))
    rate = c['omega_2'] * ground / (ground - l_1)
    c.answer('omega_4', rate, 'rad/s', 'ω_4 = ω_2 |I12 I24| / |I14 I24|')
    if not c.mistake and max(abs(far), abs(ground)) > 20.0 * l_3:
        raise ValueError('a centre is far away')


def _key_centres(givens: Givens) -> Givens:
    geometry = four_bar_of(givens).geometry
    theta_2 = radians(givens['theta_2'])
    centres = place(geometry, theta_2).instant_centres()
    bar = FourBar(*geometry.lengths)
    moving = bar.velocity(bar.closed_form(theta_2), givens['omega_2'])
    i_13, i_24 = centres['I13'], centres['I24']
    found = {'x_I13': i_13.real, 'y_I13': i_13.imag, 'x_I24': i_24.real}
    return {**found, 'omega_4': float(moving.theta4)}


def _work_toggle(c: Calculation) -> None:
    l_1, l_2, l_4 = c.many('L_1', 'L_2', 'L_4')
    square = l_1**2 + l_2**2 - 2.0 * l_1 * l_2 * c.cos(c['theta_2'])
    z = c.step('Z', sqrt(square), 'mm', 'Z² = L_1² + L_2² - 2 L_1 L_2 cos θ_2')
    c.answer('Z', z)
    if not c.mistake and z <= 1.1 * l_4:
        raise ValueError('there is no stretched dead point')
    c.answer('L_3_S', z - l_4, 'mm', 'L_3 + L_4 = Z')
    c.answer('L_3_F', z + l_4, 'mm', 'L_3 - L_4 = Z')


def _key_toggle(givens: Givens) -> Givens:
    l_1, l_2, l_4 = givens['L_1'], givens['L_2'], givens['L_4']
    found = toggle_couplers(l_1, l_2, l_4, radians(givens['theta_2']))
    lengths = {kind: length for length, kind in reversed(found)}
    z = (lengths['stretched'] + lengths['folded']) / 2.0
    return {'Z': z, 'L_3_S': lengths['stretched'], 'L_3_F': lengths['folded']}


def _work_return(c: Calculation) -> None:
    ratio, swing, l_4, l_2 = c.many('Q', 'swing', 'L_4', 'L_2')
    angle = c.half_turn * (ratio - 1.0) / (ratio + 1.0)
    c.answer('delta', c.step('delta', angle, 'deg', 'δ = 180° (Q - 1) / (Q + 1)'))
    chord = c.step('C', 2.0 * l_4 * c.sin(swing / 2.0), 'mm', '2 L_4 sin(swing / 2)')
    c.answer('C', chord)
    cosine = c.cos(angle)
    square = (chord**2 / 2.0 - l_2**2 * (1.0 + cosine)) / (1.0 - cosine)
    rule = 'C² = (L_3 + L_2)² + (L_3 - L_2)² - 2 (L_3² - L_2²) cos δ'
    l_3 = c.step('L_3', sqrt(square), 'mm', rule)
    c.answer('L_3', l_3)
    # O2 from the middle of the chord, along it and across; O4 is on the same side, at height h.
    along = (l_3 + l_2) ** 2 - (l_3 - l_2) ** 2
    along = c.step('y', along / (2.0 * chord), 'mm', '2 L_2 L_3 / C')
    across = sqrt((l_3 - l_2) ** 2 - (chord / 2.0 - along) ** 2)
    across = c.step('x', across, 'mm', 'x² + (C/2 - y)² = (L_3 - L_2)²')
    height = c.step('h', l_4 * c.cos(swing / 2.0), 'mm', 'L_4 cos(swing / 2)')
    ground = sqrt((height - c.sign() * across) ** 2 + along**2)
    c.answer('L_1', ground, 'mm', '|O2 O4|')


def _key_return(givens: Givens) -> Givens:
    ratio, swing = givens['Q'], radians(givens['swing'])
    found = quick_returns(ratio, swing, givens['L_4'], givens['L_2'])
    chord = 2.0 * givens['L_4'] * sin(swing / 2.0)
    height = givens['L_4'] * cos(swing / 2.0)
    for geometry in found:
        l_3, l_2 = geometry.coupler, geometry.crank
        along = 2.0 * l_3 * l_2 / chord
        across = sqrt((l_3 - l_2) ** 2 - (chord / 2.0 - along) ** 2)
        if abs(abs(complex(height - across, along)) - geometry.ground) < 1e-9 * l_3:
            delta = 180.0 * (ratio - 1.0) / (ratio + 1.0)
            return {'delta': delta, 'C': chord, 'L_3': l_3, 'L_1': geometry.ground}
    raise GeometryError('no crank-rocker has these limits with O2 on the side of O4')


SYNTHESIS_KINDS = (
    kind_of('function-generation', _work_function, _key_function),
    kind_of('three-poses', _work_poses, _key_poses),
    kind_of('timed-path', _work_path, _key_path),
    kind_of('cognates', _work_cognates, _key_cognates, leg_of),
    kind_of('instant-centres', _work_centres, _key_centres, leg_of),
    kind_of('toggle', _work_toggle, _key_toggle),
    kind_of('quick-return-design', _work_return, _key_return),
)
