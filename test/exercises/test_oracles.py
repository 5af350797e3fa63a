"""
The key of every kind, held against an oracle that shares no code with it.

Numbers have 18 digits (x87 long double). Positions are intersections of circles, derivatives are
central differences of the order 8, extremes are roots of these derivatives by bisection.

=========================  =======================================================================
newton, four-bar-newton    loops in the complex plane, Jacobian by differences
klann-position             two circle intersections; likewise four-bar-position
velocity, acceleration     differences of the positions by the crank angle, once and twice
foot-path                  extremes of the foot's coordinates
torque                     virtual work: differences of the foot's path
grashof                    full rotation of each link by the triangle inequality
limits                     extremes of the rocker's angle
dead-points                reach of two links in one line, by bisection
transmission               angle at B; its extremes by samples of a turn
mechanical-advantage       differences of the rocker's angle
slider-crank               the height of the pin over the rod; extremes of the slide
quick-return               direction of the pin from O; extremes of the arm's angle
function-generation        roots of Chebyshev's polynomial; coupler's length at each point
function-four-points       coupler's length at each point
function-least-squares     residuals orthogonal to the columns; the loop of the lengths
three-poses, four-poses    lengths of the bars in each pose; likewise timed-path, with pivots
synthesis-defects          the crank turned by steps through the poses; likewise all designs
cognates                   each cognate closes at points of the path of the given four-bar
instant-centres            points without velocity, and with equal velocities, by differences
toggle                     crank pin, B and O4 in one line
quick-return-design        extremes of the rocker's angle of the designed four-bar
=========================  =======================================================================
"""

from collections.abc import Callable, Mapping
from itertools import pairwise, product
from typing import Any

from klann_ros.exercises import KINDS, make_variant
from klann_ros.exercises.variant import difference
import numpy as np
import pytest

STUDENTS = 3
PI = np.arccos(np.longdouble(-1.0))
Real, Point = np.longdouble, np.clongdouble
Givens = Mapping[str, Any]


def radians(degrees: float) -> Real:
    return Real(degrees) * PI / 180


def turned(angle: Real) -> Point:
    """Return e^(i angle)."""
    return np.cos(angle) + 1j * np.sin(angle)


def degrees(vector: Point) -> Real:
    return np.arctan2(vector.imag, vector.real) * 180 / PI


def cross(u: Point, v: Point) -> Real:
    return (np.conj(u) * v).imag


def derivative(f: Callable[[Real], Any], x: Real, h: float = 2e-3) -> Any:
    weights = (Real(4) / 5, -Real(1) / 5, Real(4) / 105, -Real(1) / 280)
    return sum(w * (f(x + k * h) - f(x - k * h)) for k, w in enumerate(weights, 1)) / h


def turning(f: Callable[[Real], Point], x: Real) -> Real:
    """Return the rate of a vector's direction."""
    vector = f(x)
    return cross(vector, derivative(f, x)) / abs(vector) ** 2


def roots(f: Callable[[Real], Real], start: Real, end: Real, count: int = 180) -> list[Real]:
    """Return the roots of a function by samples and bisection."""
    ends = [start + (end - start) * k / count for k in range(count + 1)]
    values = [f(x) for x in ends]
    spans = zip(pairwise(ends), pairwise(values), strict=True)
    return [bisected(f, *span) for span, (a, b) in spans if a * b <= 0 and a != b]


def bisected(f: Callable[[Real], Real], low: Real, high: Real) -> Real:
    first = f(low)
    for _ in range(62):
        middle = (low + high) / 2
        low, high = (middle, high) if f(middle) * first > 0 else (low, middle)
    return low


def meeting(p: Point, r: Real, q: Point, s: Real, *, left: bool = True) -> Point:
    """Return where the circles (p, r) and (q, s) meet, to the left of p to q or to the right."""
    p_to_q = q - p
    along = (abs(p_to_q) ** 2 + r**2 - s**2) / (2 * abs(p_to_q))
    across = np.sqrt(Real(r**2 - along**2))
    return p + p_to_q / abs(p_to_q) * (along + (1j if left else -1j) * across)


class Leg:
    """The Klann leg of givens, in mm."""

    def __init__(self, givens: Givens) -> None:
        self.g = {name: Real(value) for name, value in givens.items()}
        self.d, self.e = Point(self.g['x_D']), self.g['x_E'] + 1j * self.g['y_E']

    def points(self, alpha: Real) -> tuple[Point, ...]:
        """Return B, C, G, F and H."""
        g = self.g
        b = 1j * g['y_A'] + g['L_AB'] * turned(alpha)
        c = meeting(b, g['L_BC'], self.d, g['L_DC'])
        corner = turned(radians(g['angle_BCG']))
        g_ = c + (c - b) / g['L_BC'] * corner * g['L_CG']
        f = meeting(self.e, g['L_EF'], g_, g['L_FG'])
        bend = turned(-radians(g['angle_FGH']))
        return b, c, g_, f, g_ + (g_ - f) / g['L_FG'] * bend * g['L_GH']

    def directions(self, alpha: Real) -> np.ndarray:
        """Return the directions gamma, beta, delta, theta, the first and the last clockwise."""
        b, c, g, f, _ = self.points(alpha)
        return np.array([np.conj(c - b), c - self.d, f - self.e, np.conj(g - f)])

    def rates(self, alpha: Real) -> np.ndarray:
        vectors = self.directions(alpha)
        derivatives = derivative(self.directions, alpha)
        return (np.conj(vectors) * derivatives).imag / np.abs(vectors) ** 2

    def loops(self, alpha: Real, x: np.ndarray) -> np.ndarray:
        gamma, beta, delta, theta = x
        g = self.g
        c = self.d + g['L_DC'] * turned(beta)
        end = 1j * g['y_A'] + g['L_AB'] * turned(alpha) + g['L_BC'] * turned(-gamma)
        g_ = c + g['L_CG'] * turned(radians(g['angle_BCG']) - gamma)
        f = self.e + g['L_EF'] * turned(delta) + g['L_FG'] * turned(-theta)
        return np.array([(end - c).real, (end - c).imag, (f - g_).real, (f - g_).imag])


class Bars:
    """The four-bar of givens, open: sin(theta_4 - theta_3) > 0."""

    def __init__(self, lengths: list[Any]) -> None:
        self.lengths = [Real(length) for length in lengths]

    def pins(self, theta: Real) -> tuple[Point, Point]:
        l_1, l_2, l_3, l_4 = self.lengths
        a = l_2 * turned(theta)
        return a, meeting(a, l_3, Point(l_1), l_4)

    def coupler(self, theta: Real) -> Point:
        a, b = self.pins(theta)
        return b - a

    def rocker(self, theta: Real) -> Point:
        return self.pins(theta)[1] - self.lengths[0]

    def loops(self, theta: Real, x: np.ndarray) -> np.ndarray:
        l_1, l_2, l_3, l_4 = self.lengths
        gap = l_1 + l_4 * turned(x[1]) - l_2 * turned(theta) - l_3 * turned(x[0])
        return np.array([gap.real, gap.imag])

    def limits(self) -> list[Real]:
        """Return the crank angles of the rocker's limits, the stretched one first."""
        angles = roots(lambda x: turning(self.rocker, x), Real(0.001), Real(0.001) + 2 * PI)
        assert len(angles) == 2
        return sorted(angles, key=lambda x: -abs(self.pins(x)[1]))


def bars(g: Givens) -> Bars:
    return Bars([g[f'L_{k}'] for k in range(1, 5)])


def newton(loops: Callable[[np.ndarray], np.ndarray], guess: list[float], names: list[str]) -> Any:
    x = np.array([radians(angle) for angle in guess])

    def jacobian(x: np.ndarray) -> np.ndarray:
        units = np.eye(len(x))
        return np.array([derivative(lambda t, u=u: loops(x + t * u), Real(0)) for u in units]).T

    phi = jacobian(x)
    steps = []
    answers = {f'f_{k}': value for k, value in enumerate(loops(x), 1)}
    answers |= {'Phi_12': phi[0, 1], 'Phi_21': phi[1, 0]}
    for _ in range(12):
        solved = np.linalg.solve(jacobian(x).astype(float), loops(x).astype(float))
        x, steps = x - solved, [*steps, np.abs(solved).max() * 180 / PI]
        if len(steps) == 1:
            answers |= {
                f'{name}_2': angle * 180 / PI for name, angle in zip(names, x, strict=True)
            }
    answers |= {name: angle * 180 / PI for name, angle in zip(names, x, strict=True)}
    return {**answers, 'iterations': float(next(k for k, s in enumerate(steps, 1) if s <= 0.01))}


ANGLES = ['gamma', 'beta', 'delta', 'theta']


def klann_newton(g: Givens) -> Any:
    leg = Leg(g)
    alpha = radians(g['alpha'])
    return newton(lambda x: leg.loops(alpha, x), [g[f'{name}_1'] for name in ANGLES], ANGLES)


def klann_position(g: Givens) -> Any:
    leg = Leg(g)
    alpha = radians(g['alpha'])
    h = leg.points(alpha)[4]
    angles = map(degrees, leg.directions(alpha))
    return {**dict(zip(ANGLES, angles, strict=True)), 'x_H': h.real, 'y_H': h.imag}


def klann_velocity(g: Givens) -> Any:
    leg = Leg(g)
    alpha = radians(g['alpha'])
    omega = g['omega']
    h = omega * derivative(lambda x: leg.points(x)[4], alpha)
    rates = zip(ANGLES, omega * leg.rates(alpha), strict=True)
    return {**{f'omega_{name}': rate for name, rate in rates}, 'v_Hx': h.real, 'v_Hy': h.imag}


def klann_acceleration(g: Givens) -> Any:
    leg = Leg(g)
    alpha = radians(g['alpha'])
    omega = g['omega']
    epsilon = g['epsilon']

    def motion(x: Real) -> np.ndarray:
        return np.array([*leg.rates(x), derivative(lambda y: leg.points(y)[4], x)])

    *rates, h = omega**2 * derivative(motion, alpha) + epsilon * motion(alpha)
    answers = {f'epsilon_{name}': rate.real for name, rate in zip(ANGLES, rates, strict=True)}
    return {**answers, 'a_Hx': h.real, 'a_Hy': h.imag}


def foot_path(g: Givens) -> Any:
    leg = Leg(g)

    def extent(part: Callable[[Point], Real]) -> Real:
        def coordinate(x: Real) -> Real:
            return part(leg.points(x)[4])

        turns = roots(lambda x: derivative(coordinate, x), Real(0), 2 * PI, 120)
        return np.ptp([coordinate(x) for x in turns])

    return {'stride': extent(lambda h: h.real), 'lift': extent(lambda h: h.imag)}


def torque(g: Givens) -> Any:
    leg = Leg(g)
    h = derivative(lambda x: leg.points(x)[4], radians(g['alpha']))
    return {'h_x': h.real, 'h_y': h.imag, 'T': -(g['F_x'] * h.real + g['F_y'] * h.imag) / 1e3}


def grashof(g: Givens) -> Any:
    l_1, l_2, l_3, l_4 = (round(g[f'L_{k}']) for k in range(1, 5))

    def turns(crank: int, ground: int, p: int, q: int) -> bool:
        return crank + ground <= p + q and abs(crank - ground) >= abs(p - q)

    crank, rocker = turns(l_2, l_1, l_3, l_4), turns(l_4, l_1, l_3, l_2)
    coupler = turns(l_3, l_2, l_4, l_1) and turns(l_3, l_4, l_2, l_1)
    kinds = {(True, True): 'double crank', (True, False): 'crank-rocker'}
    kinds |= {(False, True): 'rocker-crank'}
    kinds[False, False] = 'double rocker' if coupler else 'triple rocker'
    flat = any(l_1 + x * l_2 + y * l_3 + z * l_4 == 0 for x, y, z in product((1, -1), repeat=3))
    s, p, q, longest = sorted((l_1, l_2, l_3, l_4))
    sums = {'s_l': float(s + longest), 'p_q': float(p + q)}
    kind = 'III' if flat else 'I' if crank or rocker or coupler else 'II'
    return {**sums, 'grashof': kind, 'motion': kinds[crank, rocker]}


def position(g: Givens) -> Any:
    linkage = bars(g)
    theta = radians(g['theta_2'])
    a, b = linkage.pins(theta)
    o_4 = linkage.lengths[0]
    answers = {'theta_3': degrees(b - a), 'theta_4': degrees(b - o_4), 'Z': abs(a - o_4)}
    answers['mu'] = abs(degrees((a - b) / (o_4 - b)))
    # At O4: alpha from A to B, beta from the ground to A.
    answers['alpha'] = abs(degrees((b - o_4) / (a - o_4)))
    return {**answers, 'beta': degrees(-1 / (a - o_4))}


def four_bar_newton(g: Givens) -> Any:
    linkage = bars(g)
    theta = radians(g['theta_2'])
    names = ['theta_3', 'theta_4']
    return newton(lambda x: linkage.loops(theta, x), [g[f'{name}_1'] for name in names], names)


def limits(g: Givens) -> Any:
    linkage = bars(g)
    angles = linkage.limits()
    rockers = [degrees(linkage.rocker(x)) for x in angles]
    answers = {'swing': abs(rockers[0] - rockers[1]), 'Q': time_ratio(angles[1] - angles[0])}
    for name, theta, rocker in zip('SF', angles, rockers, strict=True):
        answers |= {f'theta_2_{name}': theta * 180 / PI, f'theta_4_{name}': rocker}
    return answers


def dead_points(g: Givens) -> Any:
    l_1, l_2, l_3, l_4 = bars(g).lengths

    def crank(x: Real) -> Real:
        return abs(l_2 * turned(x) - l_1) - l_3 - l_4

    def rocker(x: Real) -> Real:
        return abs(l_1 + l_4 * turned(x)) - l_2 - l_3

    (theta_2,), (theta_4,) = roots(crank, Real(0), PI), roots(rocker, Real(0), PI)
    answers = {'theta_2_C': theta_2 * 180 / PI, 'theta_4_R': theta_4 * 180 / PI}
    answers['theta_4_C'] = degrees(l_2 * turned(theta_2) - l_1)
    return {**answers, 'theta_2_R': degrees(l_1 + l_4 * turned(theta_4))}


def transmission(g: Givens) -> Any:
    linkage = bars(g)

    def angle(theta: Real) -> Real:
        a, b = linkage.pins(theta)
        return abs(degrees((a - b) / (linkage.lengths[0] - b)))

    samples = [angle(radians(k)) for k in range(361)]
    return {'mu': angle(radians(g['theta_2'])), 'mu_min': min(samples), 'mu_max': max(samples)}


def advantage(g: Givens) -> Any:
    linkage = bars(g)
    theta = radians(g['theta_2'])
    ratio = 1 / turning(linkage.rocker, theta)
    answers = {name: position(g)[name] for name in ('theta_3', 'theta_4')}
    return {**answers, 'MA': ratio, 'T_4': ratio * g['T_2']}


def centres(g: Givens) -> Any:
    linkage = bars(g)
    theta = radians(g['theta_2'])
    omega = g['omega_2']
    a = linkage.pins(theta)[0]
    speed = derivative(lambda x: linkage.pins(x)[0], theta)
    i_13 = a + 1j * speed / turning(linkage.coupler, theta)
    rate = turning(linkage.rocker, theta)
    answers = {'x_I13': i_13.real, 'y_I13': i_13.imag, 'omega_4': omega * rate}
    return {**answers, 'x_I24': rate * linkage.lengths[0] / (rate - 1)}


def time_ratio(angle: Real) -> Real:
    """Return the time ratio of the strokes, by the crank angle between their limits."""
    return max(abs(angle), 2 * PI - abs(angle)) / min(abs(angle), 2 * PI - abs(angle))


def strokes(place: Callable[[Real], Real]) -> tuple[Real, Real]:
    """Return the stroke and the time ratio of a place that goes there and back once a turn."""
    first, last = roots(lambda x: derivative(place, x), Real(0.001), Real(0.001) + 2 * PI)
    return abs(place(first) - place(last)), time_ratio(last - first)


def slider_crank(g: Givens) -> Any:
    r, rod, e = Real(g['L_2']), Real(g['L_3']), Real(g['e'])

    def place(theta: Real) -> Real:
        return r * np.cos(theta) + np.sqrt(rod**2 - (e - r * np.sin(theta)) ** 2)

    theta, (stroke, ratio) = radians(g['theta_2']), strokes(place)
    pin = r * turned(theta)
    answers = {'phi': degrees(place(theta) + 1j * e - pin), 'x_C': place(theta), 'Q': ratio}
    return {**answers, 'v_C': g['omega_2'] * derivative(place, theta), 'stroke': stroke}


def quick_return(g: Givens) -> Any:
    arm = Real(g['L_4'])
    theta = radians(g['theta_2'])

    def pin(x: Real) -> Point:
        return 1j * Real(g['d']) + Real(g['L_2']) * turned(x)

    stroke, ratio = strokes(lambda x: arm * pin(x).real / abs(pin(x)))
    swing = strokes(lambda x: degrees(pin(x)))[0]
    answers = {'theta_4': degrees(pin(theta)), 's': abs(pin(theta)), 'swing': swing, 'Q': ratio}
    return {**answers, 'omega_4': g['omega_2'] * turning(pin, theta), 'stroke': stroke}


def toggle(g: Givens) -> Any:
    z = abs(Real(g['L_2']) * turned(radians(g['theta_2'])) - g['L_1'])
    return {'Z': z, 'L_3_S': z - g['L_4'], 'L_3_F': z + g['L_4']}


ORACLES: dict[str, Callable[[Givens], Any]] = {
    'newton': klann_newton,
    'klann-position': klann_position,
    'velocity': klann_velocity,
    'acceleration': klann_acceleration,
    'foot-path': foot_path,
    'torque': torque,
    'grashof': grashof,
    'four-bar-position': position,
    'four-bar-newton': four_bar_newton,
    'limits': limits,
    'dead-points': dead_points,
    'transmission': transmission,
    'mechanical-advantage': advantage,
    'instant-centres': centres,
    'slider-crank': slider_crank,
    'quick-return': quick_return,
    'toggle': toggle,
    'synthesis-defects': lambda g: design(g, {}),
}


@pytest.mark.parametrize('student', range(STUDENTS))
@pytest.mark.parametrize('name', ORACLES)
def test_the_key_is_that_of_the_oracle(name: str, student: int) -> None:
    variant = make_variant(KINDS[name], f'oracle {student}')
    expected_answers = ORACLES[name](variant.givens)
    # The foot's extremes are interpolated: 1e-6 of the stride.
    tolerance = 1e-6 if name == 'foot-path' else 1e-9
    for question in variant.kind.questions:
        right = variant.answers[question.name]
        expected = expected_answers[question.name]
        if isinstance(expected, str) or isinstance(right, str):
            assert right == expected, question.name
        else:
            error = difference(question, right, float(expected))
            assert error <= tolerance * max(1.0, abs(right)), (question.name, right, expected)


def test_every_kind_has_an_oracle() -> None:
    assert {*ORACLES, *DESIGNS} == {*KINDS}
    assert not {*ORACLES} & {*DESIGNS}


def function_generator(g: Givens, a: Givens) -> list[Real]:
    middle, half = (g['x_0'] + g['x_4']) / 2, (g['x_4'] - g['x_0']) / 2
    spaced = np.sort(np.polynomial.Chebyshev.basis(3).roots())
    misfits = [a[f'x_{k}'] - middle - half * x for k, x in enumerate(spaced, 1)]
    start, end = g['x_0'] ** Real(g['n']), g['x_4'] ** Real(g['n'])
    for k in (1, 2, 3):
        x = Real(middle + half * spaced[k - 1])
        along = (x - g['x_0']) / (2 * half)
        crank = radians(g['theta_2_0'] + g['dtheta_2'] * along)
        rocker = radians(
            g['theta_4_0'] + g['dtheta_4'] * (x ** Real(g['n']) - start) / (end - start)
        )
        pins = a['L_2'] * turned(crank), g['L_1'] + a['L_4'] * turned(rocker)
        misfits.append((abs(pins[1] - pins[0]) - a['L_3']) / g['L_1'])
    sizes = a['K_1'] * a['L_2'] - g['L_1'], a['K_2'] * a['L_4'] - g['L_1']
    squares = g['L_1'] ** 2 + a['L_2'] ** 2 - a['L_3'] ** 2 + a['L_4'] ** 2
    return [*misfits, *sizes, a['K_3'] * 2 * a['L_2'] * a['L_4'] / squares - 1]


def least_squares(g: Givens, a: Givens) -> list[Real]:
    middle, half = (g['x_0'] + g['x_6']) / 2, (g['x_6'] - g['x_0']) / 2
    x = middle + half * np.sort(np.polynomial.Chebyshev.basis(5).roots()).astype(Real)
    y = (x ** Real(g['n']) - g['x_0'] ** Real(g['n'])) / (g['x_6'] ** Real(g['n']) - 1)
    crank = radians(g['theta_2_0'] + g['dtheta_2'] * (x - g['x_0']) / (2 * half))
    rocker = radians(g['theta_4_0'] + g['dtheta_4'] * y)
    columns = np.array([np.cos(rocker), -np.cos(crank), np.ones(5)])
    residuals = Real(a['K_1']), Real(a['K_2']), Real(a['K_3'])
    residuals = residuals @ columns - np.cos(crank - rocker)
    # The residuals of the least squares are orthogonal to the columns.
    misfits = [*(columns @ residuals), a['x_1'] - x[0], a['x_5'] - x[4]]
    pins = a['L_2'] * turned(Real(1)), g['L_1'] + a['L_4'] * turned(Real(2))
    gap = (abs(pins[1] - pins[0]) ** 2 - a['L_3'] ** 2) / (2 * a['L_2'] * a['L_4'])
    k = [a[f'K_{n}'] for n in (1, 2, 3)]
    loop = k[0] * np.cos(Real(2)) - k[1] * np.cos(Real(1)) + k[2] - np.cos(Real(1))
    return [*misfits, loop - gap]


def three_poses(g: Givens, a: Givens) -> list[Real]:
    misfits = []
    all_numbers = {**g, **a}
    for pin, pivot, bar in (('A', 'O2', 'L_2'), ('B', 'O4', 'L_4')):
        arm, centre = (all_numbers[f'x_{n}'] + 1j * all_numbers[f'y_{n}'] for n in (pin, pivot))
        arm -= g['x_P1'] + 1j * g['y_P1']
        for k in (1, 2, 3):
            psi = radians(g[f'psi_{k}']) if k > 1 else Real(0)
            place = g[f'x_P{k}'] + 1j * g[f'y_P{k}'] + arm * turned(psi)
            misfits.append(abs(place - centre) / a[bar] - 1)
    return misfits


def four_points(g: Givens, a: Givens) -> list[Real]:
    rotations = [(Real(0), Real(0)), *((g[f'phi_{k}'], g[f'psi_{k}']) for k in (2, 3, 4))]
    misfits = []
    for phi, psi in rotations:
        crank = a['L_2'] * turned(radians(g['theta_2_0'] + phi))
        rocker = g['L_1'] + a['L_4'] * turned(radians(a['theta_4_0'] + psi))
        misfits.append(abs(rocker - crank) / a['L_3'] - 1)
    return misfits


def timed_path(g: Givens, a: Givens) -> list[Real]:
    pivot, pin = (a[f'x_{name}'] + 1j * a[f'y_{name}'] for name in ('O2', 'A'))
    misfits = [abs(pin - pivot) / a['L_2'] - 1]
    assert 0 < g['beta_2'] < g['beta_3']
    for k in (2, 3):
        crank, coupler = turned(radians(g[f'beta_{k}'])), turned(radians(g[f'psi_{k}']))
        place = pivot + (pin - pivot) * crank - pin * coupler
        misfits.append(abs(place - g[f'x_P{k}'] - 1j * g[f'y_P{k}']) / a['L_2'])
    return misfits


def four_poses(g: Givens, a: Givens) -> list[Real]:
    pivot, pin = (a[f'x_{name}'] + 1j * a[f'y_{name}'] for name in ('O2', 'A'))
    arms = [pin - pivot]
    for k in (2, 3, 4):
        place = g[f'x_P{k}'] + 1j * g[f'y_P{k}'] + pin * turned(radians(g[f'psi_{k}']))
        arms.append(place - pivot)
    turns = (degrees(arms[1] / arms[0]) - g['beta_2'], degrees(arms[2] / arms[0]) - a['beta_3'])
    # One way through the poses.
    assert sorted(rotations := [degrees(arm / arms[0]) for arm in arms]) == rotations
    # The triangle that is asked for, of both.
    two, three, four = (turned(radians(g[f'psi_{k}'])) - 1 for k in (2, 3, 4))
    p, q, r = (g[f'x_P{k}'] + 1j * g[f'y_P{k}'] for k in (2, 3, 4))
    sides = [three * r - four * q, four * p - two * r, two * q - three * p]
    closing = sides[0] * arms[1] / arms[0] - sum(sides)
    assert cross(-closing, sides[1] * arms[2] / arms[0]) > 0
    return [*(abs(arm) / a['L_2'] - 1 for arm in arms), *turns]


def cognates(g: Givens, a: Givens) -> list[Real]:
    linkage = bars(g)
    l_1, l_2, l_3, l_4 = linkage.lengths
    v = (Real(g['u']) + 1j * Real(g['v'])) / l_3
    third = v * l_1
    misfits = [a['a_1'] / abs(third) - 1, a['b_1'] / abs(l_1 - third) - 1]
    for k in range(-3, 4):
        pin, rocker = linkage.pins(radians(g['theta_2'] + 2.0 * k))
        p = pin + v * (rocker - pin)
        # Bars of the coupler triangle about P, by similarity: along both of its sides.
        for letter, pivots, arms in (
            ('a', (Point(0), third), (l_2, abs(1 - v) * l_2)),
            ('b', (third, Point(l_1)), (abs(v) * l_4, l_4)),
        ):
            places = [
                [meeting(pivot, a[f'{letter}_{bar}'], p, arm, left=left) for left in (True, False)]
                for pivot, bar, arm in zip(pivots, (2, 4), arms, strict=True)
            ]
            bar = a[f'{letter}_3']
            misfits.append(min((abs(abs(x - y) / bar - 1) for x, y in product(*places))))
    return misfits


def pose_pins(g: Givens, a: Givens) -> list[tuple[Point, Point]]:
    """Return the pins A and B in each pose."""
    numbers = {**g, 'psi_1': 0.0, **a}
    pins = []
    for k in (1, 2, 3):
        place = numbers[f'x_P{k}'] + 1j * numbers[f'y_P{k}']
        turn = turned(radians(numbers[f'psi_{k}']))
        arms = (Point(numbers[f'x_{pin}'] + 1j * numbers[f'y_{pin}']) for pin in 'AB')
        pins.append(tuple(place + arm * turn for arm in arms))
    return pins


def centre(p: Point, q: Point, r: Point) -> Point:
    """Return where the perpendicular bisectors of two chords meet."""
    share = (np.conj(r - q) * (r - p)).real / cross(q - p, r - q)
    return (p + q) / 2 + 1j * (q - p) * share / 2


def point_pins(g: Givens, a: Givens) -> list[tuple[Point, Point]]:
    """Return the pins A and B of a function generator at each point, and at the range's ends."""
    if 'n' in g:
        x_0, x_n = g['x_0'], g.get('x_4', g.get('x_6'))
        x = [x_0, *(a[name] for name in ('x_1', 'x_2', 'x_3', 'x_5') if name in a), x_n]
        phi = [g['dtheta_2'] * (each - x_0) / (x_n - x_0) for each in x]
        y_0, y_n = x_0 ** g['n'], x_n ** g['n']
        psi = [g['dtheta_4'] * (each ** g['n'] - y_0) / (y_n - y_0) for each in x]
    else:
        phi, psi = ([0, *(g[f'{name}_{k}'] for k in (2, 3, 4))] for name in ('phi', 'psi'))
    start = {**g, **a}['theta_4_0']
    cranks = [a['L_2'] * turned(radians(g['theta_2_0'] + each)) for each in phi]
    rockers = [g['L_1'] + a['L_4'] * turned(radians(start + each)) for each in psi]
    return list(zip(cranks, rockers, strict=True))


def followed(
    o2: Point, o4: Point, coupler: Real, rocker: Real, pins: list[tuple[Point, Point]]
) -> dict[str, Any]:
    """Turn the crank both ways from the first position, by steps of 0.1 deg."""
    arm = pins[0][0] - o2
    cranks = [degrees((a - o2) / (o4 - o2)) for a, _ in pins]
    mu = [degrees((b - o4) / (b - a)) for a, b in pins]
    positive = [angle > 0 for angle in mu]
    usual = 2 * sum(positive) > len(pins)
    odd = [str(k) for k, sign in enumerate(positive, 1) if sign != usual]
    steps = np.arange(3600) * 0.1
    is_met, is_near = False, np.zeros(len(pins), bool)
    for sense in (1, -1):
        z = abs(o2 + arm * turned(radians(sense * steps)) - o4)
        is_open = (z < abs(coupler - rocker)) | (z > coupler + rocker)
        reach = steps[is_open.argmax()] if is_open.any() else 360
        turns = [sense * (crank - cranks[0]) % 360 for crank in cranks]
        is_met |= turns == sorted(turns) and turns[-1] < reach
        is_near |= np.array(turns) < reach
    # Each mode of a crank that turns fully is a circuit.
    is_one = not odd if reach == 360 else is_near.all()
    answers = {f'theta_2_{k}': crank for k, crank in enumerate(cranks, 1)}
    answers |= {f'mu_{k}': angle for k, angle in enumerate(mu, 1)}
    answers |= {'mode': ', '.join(odd) or 'none', 'circuit': 'one' if is_one else 'two'}
    return {**answers, 'order': 'yes' if is_met else 'no'}


def design(g: Givens, a: Givens) -> dict[str, Any]:
    """Follow the design of a task through its positions."""
    if 'L_1' in g:
        l_1 = Point(g['L_1'])
        return followed(Point(0), l_1, Real(a['L_3']), Real(a['L_4']), point_pins(g, a))
    pins = pose_pins(g, a)
    o2, o4 = (centre(*places) for places in zip(*pins, strict=True))
    a_1, b_1 = pins[0]
    return followed(o2, o4, abs(b_1 - a_1), abs(b_1 - o4), pins)


def quick_return_design(g: Givens, a: Givens) -> list[Real]:
    linkage = Bars([a['L_1'], g['L_2'], a['L_3'], g['L_4']])
    stretched, folded = linkage.limits()
    ends = [linkage.rocker(x) for x in (stretched, folded)]
    chord = ends[1] - ends[0]
    delta = 180 * abs(abs(stretched - folded) / PI - 1)
    # O2 and O4 are on one side of the chord.
    assert cross(chord, -ends[0]) * cross(chord, -linkage.lengths[0] - ends[0]) > 0
    swing = abs(degrees(ends[1] / ends[0]))
    designed = np.array([swing, time_ratio(stretched - folded), abs(chord), delta])
    return list(designed / [g['swing'], g['Q'], a['C'], a['delta']] - 1)


DESIGNS: dict[str, Callable[[Givens, Givens], list[Real]]] = {
    'function-generation': function_generator,
    'function-least-squares': least_squares,
    'three-poses': three_poses,
    'three-poses-pivots': three_poses,
    'function-four-points': four_points,
    'four-poses': four_poses,
    'timed-path': timed_path,
    'cognates': cognates,
    'quick-return-design': quick_return_design,
}


@pytest.mark.parametrize('student', range(STUDENTS))
@pytest.mark.parametrize('name', DESIGNS)
def test_the_design_does_what_its_task_says(name: str, student: int) -> None:
    variant = make_variant(KINDS[name], f'oracle {student}')
    misfits = DESIGNS[name](variant.givens, variant.answers)
    assert max(map(abs, misfits)) <= 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    'name',
    ['three-poses', 'three-poses-pivots', *(k for k in KINDS if k.startswith('function'))],
)
def test_a_design_moves_through_its_task(name: str) -> None:
    for student in range(20):
        variant = make_variant(KINDS[name], f'design {student}')
        motion = design(variant.givens, variant.answers)
        verdict = [motion[name] for name in ('mode', 'circuit', 'order')]
        assert verdict == ['none', 'one', 'yes'], student


@pytest.mark.parametrize('name', ['four-poses', 'timed-path'])
def test_the_bar_of_a_dyad_turns_one_way(name: str) -> None:
    for student in range(20):
        variant = make_variant(KINDS[name], f'design {student}')
        assert max(map(abs, DESIGNS[name](variant.givens, variant.answers))) <= 1e-9
