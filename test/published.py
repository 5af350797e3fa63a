"""
Numbers that others have published about the shipped linkages, and the same numbers of ours.

Run it to write docs/published_linkages.md.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
import math
from pathlib import Path

from klann_ros.dynamics import Dynamics, masses_from_text, simulate
from klann_ros.kinematics import foot_path, LinkageLeg, LinkagePose, shipped_linkage
from klann_ros.kinematics.linkage.file import SHIPPED
import numpy as np

PAGE = Path(__file__).parents[1] / 'docs/published_linkages.md'
Values = tuple[float, ...]

# A shipped linkage without a number of others, and why.
WITHOUT = dict.fromkeys(
    ['quick_return', 'scotch_yoke', 'slider_crank', 'stephenson'],
    'Its dimensions are from klann_ros.',
)


@dataclass(frozen=True)
class Source:
    """Who published numbers, where, and how exact they are."""

    title: str
    at: str
    exact: str


SOURCES = {
    'SEM 104': Source(
        'R. Nicoletti, SEM 104 Mecanismos, lecture 7',
        'the course',
        'Angles are rounded to 4 decimals of a radian (0.00286°), then to 4 decimals of a degree.',
    ),
    'PUC Minas': Source(
        'Cinemática dos Mecanismos, unit 3, examples 1 and 2',
        'the course',
        'Half the last digit; iterates carry corrections of 4 decimals of a radian (0.00286°),'
        ' the last one what Newton-Raphson still missed (0.0001°).',
    ),
    'US 6,260,862': Source(
        'J. Klann, Walking Device, 2001: coordinates of the joints',
        'https://patents.google.com/patent/US6260862B1/en',
        "The file has DIY Walkers' lengths, whose pivot (2.6, 6.9) is rounded to 0.1 for a crank"
        ' of 3: half of that is 0.0045 of the patent, which prints 3 decimals.',
    ),
    'Klann charts': Source(
        "DIY Walkers, charts of the foot's paths of Klann's linkage and its variants",
        'https://www.diywalkers.com/klanns-linkage-plans.html',
        'A chart has 9 of its units per unit of the plan and reads to 1.5 of them.',
    ),
    'High-step trace': Source(
        'DIY Walkers, Klann High-Step Mod, the simulated paths traced in their picture',
        'https://www.diywalkers.com/klann-high-step-mod.html',
        "The line's thickness, 0.2 of a unit.",
    ),
    'Klann plans': Source(
        "DIY Walkers, Klann's Linkage Plans, joints read in the pictures by J. Reddy's spiderpig",
        'https://github.com/jaywreddy/spiderpig',
        'A marker reads to 0.1 of a unit, a foot, where long bars end, to 0.25. Left legs are'
        " mirrored about the crank's axle (10, 10).",
    ),
    'TrotBot plans': Source(
        "DIY Walkers, TrotBot's plans with heel and toe, joints read by J. Reddy's spiderpig",
        'https://www.diywalkers.com/trotbot-linkage-plans.html',
        'A marker reads to 0.1 of a unit.',
    ),
    'Walker maps': Source(
        "DIY Walkers, maps of the four-bar's and the six-bar's joints, read by spiderpig",
        'https://github.com/jaywreddy/spiderpig',
        'Half a unit of the simulator (the crank is 40).',
    ),
    'spiderpig, Strider': Source(
        "J. Reddy, spiderpig, walk_reference_strider.json: the foot's path by another solver",
        'https://github.com/jaywreddy/spiderpig',
        'Half the last of 6 decimals of a millimetre; a unit of the plan is 6.5 mm there.',
    ),
    'spiderpig, Hoecken': Source(
        "J. Reddy, spiderpig, test_mechanisms.py: Hoecken's linkage with a crank of 16 mm",
        'https://github.com/jaywreddy/spiderpig',
        'Half the last digit.',
    ),
    'Norton': Source(
        "R. L. Norton, Design of Machinery, table 3-1, the row of 140°, in a forum's thread",
        'https://www.physicsforums.com/threads/straight-line-mechanism.157501/',
        'Half the last digit.',
    ),
    'GIBBON': Source(
        'K. M. Moerman, GIBBON, DEMO_Jansen_linkage_animation_01: vertices with the crank upwards',
        'https://github.com/gibbonCode/GIBBON',
        'Half the last of 4 decimals.',
    ),
    'Six-bar notebook': Source(
        'T. Checketts, J. Payne, M. Duke and K. Aycock, Six-Bar-Walking-Mechanism, the notebook'
        " (R1 1.9, R3 4.65, R3' 2.3, R4 2.35, R5 3.65, R6 4.65)",
        'https://github.com/kenaycock/Six-Bar-Walking-Mechanism',
        'Half the last printed digit; plots read to 0.03 (x), 0.05 (y and angles) and'
        ' 5° of the crank.',
    ),
    'Wikibooks': Source(
        'Wikibooks, Comparison of crank based leg mechanism, as HugoFara/leggedsnake cites it',
        'https://en.wikibooks.org/wiki/Comparison_of_crank_based_leg_mechanism/Table',
        'The comparison has 36 steps a turn and calls its numbers good to 1/36, about 0.03.',
    ),
    'IVP test set': Source(
        "Test Set for Initial Value Problem Solvers, Andrews' squeezing mechanism: the start"
        ' and the solution at 0.03 s',
        'https://archimede.uniba.it/~testset/',
        'Positions are printed to 16 digits: 1e-14. Velocities are those of an index-3 solution,'
        ' here 1e-7 of themselves. Simulated angles'
        ' agree to 5e-10 of themselves, the error of our integration.',
    ),
    'Wikipedia, Chebyshev': Source(
        'Wikipedia, Chebyshev linkage',
        'https://en.wikipedia.org/wiki/Chebyshev_linkage',
        'Half the last digit of the angles; where the foot is on its line is exact.',
    ),
    'Wikipedia, lambda': Source(
        'Wikipedia, Chebyshev lambda linkage',
        'https://en.wikipedia.org/wiki/Chebyshev_lambda_linkage',
        'Counts.',
    ),
    'Bright Hub': Source(
        "Bright Hub Engineering, Robert's straight line mechanism",
        'https://www.brighthubengineering.com/',
        'Half the last digit of the height; where the foot is on its line is exact.',
    ),
    'Peaucellier': Source(
        "Wikipedia, Peaucellier-Lipkin linkage: OB · OD = OA² - AB², and D's line is straight",
        'https://en.wikipedia.org/wiki/Peaucellier%E2%80%93Lipkin_linkage',
        'Exact; rounding is allowed 1e-9.',
    ),
}


@dataclass(frozen=True)
class Cited:
    """A number, or a few that belong together, that somebody has published about a linkage."""

    linkage: str
    quantity: str
    values: Values
    unit: str
    error: float
    source: str
    find: Callable[[], Values]
    # What the number tests, where it is not the pose of the shipped file alone.
    note: str = ''

    def __str__(self) -> str:
        """Return the linkage and the quantity."""
        return f'{self.linkage}: {self.quantity}'

    @property
    def ours(self) -> Values:
        """Return the same numbers of the shipped linkage."""
        return self.find()

    @property
    def deviation(self) -> float:
        """Return the largest difference of a number of ours from the cited one."""
        return max(abs(a - b) for a, b in zip(self.values, self.ours, strict=True))


@cache
def leg(name: str) -> LinkageLeg:
    """Return a shipped linkage's leg."""
    return LinkageLeg(shipped_linkage(name))


def points_of(machine: LinkageLeg, pose: LinkagePose) -> Mapping[str, complex]:
    """Return a pose's points by name [m]."""
    names = machine.linkage.structure.points
    return {name: complex(*place) for name, place in zip(names, pose.points, strict=True)}


def angles_of(machine: LinkageLeg, pose: LinkagePose) -> Mapping[str, float]:
    """Return a pose's angles by name [rad]."""
    return dict(zip(machine.joint_names, pose.joints, strict=True))


def degrees(radians: Sequence[float]) -> Values:
    """Return angles in degrees."""
    return tuple(np.degrees(radians).tolist())


def part(values: Callable[[], Values], *indices: int) -> Callable[[], Values]:
    """Return some of a few numbers."""
    return lambda: tuple(values()[i] for i in indices)


# The two courses' own numbers.


def courses() -> Iterator[Cited]:
    """Yield what the courses print of their two examples."""
    guesses = {'klann': [15.0, 60.0, 45.0, 60.0], 'four_bar': [15.0, 80.0]}

    def iterate(name: str, index: int) -> Callable[[], Values]:
        guess = np.radians(guesses[name])
        return lambda: degrees(leg(name).newton(math.radians(60.0), guess)[index])

    for index, values in enumerate(
        [
            (10.5138, 67.0074, 36.7323, 45.7048),
            (10.6570, 67.3283, 34.4691, 45.7564),
            (10.6570, 67.3283, 34.4634, 45.7220),
        ],
        start=1,
    ):
        yield Cited(
            'klann',
            f'gamma, beta, delta, theta at 60°, iterate {index}',
            values,
            '°',
            math.degrees(0.5e-4) + 0.5e-4,
            'SEM 104',
            iterate('klann', index),
        )
    for index, values, error in (
        (1, (21.812, 71.864), math.degrees(0.5e-4) + 0.5e-3),
        (2, (21.560, 72.139), math.degrees(0.5e-4) + 0.5e-3),
        (3, (21.5577, 72.1377), 1e-4),
    ):
        yield Cited(
            'four_bar',
            f'theta3, theta4 at 60°, iterate {index}',
            values,
            '°',
            error,
            'PUC Minas',
            iterate('four_bar', index),
        )
    for what, value, find in (
        ('theta4', 72.14, lambda pose: pose.x[1]),
        ('transmission angle', 50.58, lambda pose: pose.transmission_angles[0]),
    ):
        yield Cited(
            'four_bar',
            f'{what} at 60°',
            (value,),
            '°',
            0.005,
            'PUC Minas',
            lambda find=find: degrees([find(leg('four_bar').solve(math.radians(60.0)))]),
        )


# Poses on plans.


@dataclass(frozen=True)
class Plan:
    """A drawing of a linkage: where its crank's axle is, and how long a unit is."""

    linkage: str
    source: str
    axle: complex = 0j
    unit: float = 0.01
    mirrored: bool = False
    error: float = 0.1
    foot_error: float | None = None

    def find(self, pin: complex, joint: str) -> Values:
        """Return where a joint is on the drawing, with the crank towards its pin."""
        side = -1 if self.mirrored else 1
        towards = pin - self.axle
        machine = leg(self.linkage)
        pose = machine.solve(math.atan2(towards.imag, side * towards.real))
        place = points_of(machine, pose)[joint] / self.unit
        return side * place.real + self.axle.real, place.imag + self.axle.imag

    def cited(self, title: str, pin: Values, **joints: Values) -> Iterator[Cited]:
        """Yield the joints that are drawn with the crank's pin at a place."""
        for joint, place in joints.items():
            foot = joint == leg(self.linkage).linkage.structure.foot
            yield Cited(
                self.linkage,
                f'{joint} {title}',
                place,
                '',
                self.foot_error if foot and self.foot_error else self.error,
                self.source,
                lambda joint=joint: self.find(complex(*pin), joint),
            )


def poses() -> Iterator[Cited]:
    """Yield joints of poses that are drawn or listed."""
    scale = 0.268  # of the patent, for a crank of 3
    patent = Plan('klann_patent', 'US 6,260,862', 1.599 + 0.75j, 0.03 / scale, True, 0.0045)
    yield from patent.cited(
        "in the patent's pose",
        (1.331, 0.75),
        C=(0.741, 0.750),
        D=(0.232, 0.866),
        E=(0.866, 1.500),
        F=(0.000, 0.000),
    )

    def klann(variant: str, mirrored: bool = False) -> Plan:
        return Plan(
            f'klann_{variant}', 'Klann plans', 10 + 10j, mirrored=mirrored, foot_error=0.25
        )

    low, up = (7.56, 11.69), (10.0, 13.0)
    yield from klann('patent', True).cited(
        'of the plan',
        (7.39, 11.44),
        C=(0.89, 10.63),
        D=(-4.95, 11.03),
        E=(1.82, 18.37),
        F=(-7.15, 1.37),
    )
    right, left = 'of the right leg, crank', 'of the left leg, crank'
    for variant, mirrored, pin, title, places in (
        ('lego', False, up, f'{right} up', '16.92 12.02 22.85 11.16 18.22 19.99 22.82 1.15'),
        ('lego', True, up, f'{left} up', '3.11 12.02 -2.84 11.15 1.81 20.0 -2.78 1.15'),
        ('lego', False, low, f'{right} at 145°', '14.55 11.15 20.51 10.65 18.01 20.32 18.18 0.91'),
        ('lego', True, low, f'{left} at 145°', '0.59 11.17 -5.38 10.68 1.16 18.24 -7.61 0.93'),
        ('long_legs', False, up, f'{right} up', '16.91 12.0 22.89 11.13 18.21 19.99 22.59 -2.87'),
        ('long_legs', True, up, f'{left} up', '3.09 11.99 -2.89 11.12 1.78 19.99 -2.6 -2.88'),
        ('high_step', False, up, f'{right} up', '16.0 11.96 22.8 10.82 18.3 19.79 22.27 -3.16'),
        ('high_step', True, up, f'{left} up', '4.06 11.99 -2.8 10.83 1.67 19.78 -2.28 -3.17'),
    ):
        x_y = list(map(float, places.split()))
        joints = dict(zip('CDEF', zip(x_y[::2], x_y[1::2], strict=True), strict=True))
        yield from klann(variant, mirrored).cited(title, pin, **joints)

    yield from Plan('trotbot', 'TrotBot plans', 10j).cited(
        'of the plan with a heel',
        (-2.74, 7.06),
        J2=(0.14, 12.34),
        J4=(-8.77, 16.92),
        J5=(-12.50, 12.17),
        J6=(-13.71, 10.59),
        J7=(-13.25, 2.61),
        J8=(-5.72, 7.52),
        J9=(-3.23, 6.17),
        J10=(-11.05, 4.06),
        J11=(-9.22, 2.22),
        J12=(-8.49, 1.52),
    )
    yield from Plan('trotbot', 'TrotBot plans', 10 + 10j).cited(
        'of the plan with a toe',
        (12.13, 13.38),
        J2=(10.39, 19.09),
        J4=(1.15, 15.22),
        J5=(1.93, 9.29),
        J6=(2.18, 7.31),
        J7=(8.72, 2.66),
        J8=(9.75, 11.60),
        J9=(12.45, 12.41),
        J10=(9.00, 5.29),
        J11=(11.56, 5.29),
        J12=(12.56, 5.29),
        J13=(5.45, 5.01),
        J14=(8.04, 5.32),
        J15=(7.30, 1.67),
    )
    yield from Plan('walker_four_bar', 'Walker maps', unit=0.001, error=0.5).cited(
        'of the map', (-40.2, 0.0), K=(-113.0, 32.8), F=(-142.5, -62.5)
    )
    yield from Plan('walker_six_bar', 'Walker maps', unit=0.001, error=0.5).cited(
        'of the map',
        (-39.5, -6.9),
        K=(-111.0, 28.6),
        P=(-128.1, 18.0),
        Q=(-57.3, 1.9),
        F=(-139.5, -70.9),
    )
    # The demo's origin is Jansen's Y.
    yield from Plan('jansen', 'GIBBON', 38 + 7.8j, error=0.5e-4).cited(
        'with the crank upwards',
        (38, 22.8),
        W=(-8.7357, 40.5702),
        V=(-39.6678, -5.8717),
        T=(-19.4476, -39.6874),
        U=(17.0047, -35.4306),
        S=(30.3109, -82.5894),
    )
    strider = Plan('strider', 'spiderpig, Strider', unit=0.01 / 6.5, error=0.5e-6)
    for angle, place in {
        0: (-53.906185, -63.310086),
        1: (-53.402592, -63.276511),
        68: (-21.861550, -39.169890),
        125: (-71.183448, -34.204144),
        155: (-110.580961, -30.619308),
        193: (-122.931369, -39.664444),
    }.items():
        pin = (math.cos(math.radians(angle)), math.sin(math.radians(angle)))
        yield from strider.cited(f'at {angle}° [mm]', pin, J4=place)


# Paths of feet.


def paths() -> Iterator[Cited]:
    """Yield strides, lifts and extents of feet."""
    for variant, stride, lift, error, source in (
        ('patent', 11.333, 5.889, 0.17, 'Klann charts'),
        ('lego', 11.467, 5.500, 0.17, 'Klann charts'),
        ('long_legs', 13.689, 5.556, 0.17, 'Klann charts'),
        ('high_step', 13.75, 8.27, 0.2, 'High-step trace'),
    ):
        for what, value in (('stride', stride), ('lift', lift)):

            def find(name: str = f'klann_{variant}', what: str = what) -> Values:
                return (getattr(foot_path(leg(name)), what) / 0.01,)

            yield Cited(f'klann_{variant}', what, (value,), 'units', error, source, find)
    for variant, x, y in (
        ('long_legs', (-9.87, 3.86), (-3.07, 2.56)),
        ('high_step', (-9.89, 3.86), (-3.29, 4.98)),
    ):

        def find_x(name: str = f'klann_{variant}') -> Values:
            # Of the left leg, in the plan's frame: the axle is at (10, 10).
            near, far = foot_path(leg(name)).x_range
            return 10 - far / 0.01, 10 - near / 0.01

        def find_y(name: str = f'klann_{variant}') -> Values:
            low, high = foot_path(leg(name)).y_range
            return 10 + low / 0.01, 10 + high / 0.01

        name = f'klann_{variant}'
        yield Cited(name, 'x of the foot, ends', x, 'units', 0.2, 'High-step trace', find_x)
        yield Cited(name, 'y of the foot, ends', y, 'units', 0.2, 'High-step trace', find_y)

    yield from hoecken()
    yield from watt_six_bar()

    def flatness() -> Values:
        path = foot_path(leg('ghassaei'))
        return (path.lift / path.stride,)

    yield Cited('ghassaei', 'lift over stride', (0.24,), '', 0.03, 'Wikibooks', flatness)


def hoecken() -> Iterator[Cited]:
    """Yield lengths of Hoecken's straight line."""

    def straight(changes: Mapping[str, float], turn: float, unit: float) -> Values:
        machine = LinkageLeg(shipped_linkage('hoecken').varied(changes))
        crank = np.radians(np.linspace(180 - turn / 2, 180 + turn / 2, 721))
        feet = np.array([machine.solve(angle).h for angle in crank.tolist()])
        return tuple((np.ptp(feet, axis=0) / unit).tolist())

    def find() -> Values:
        return straight({}, 180.0, 0.1 / 16)

    yield Cited(
        'hoecken',
        'stroke over 180° of the crank',
        (66.89,),
        'mm',
        0.005,
        'spiderpig, Hoecken',
        part(find, 0),
    )
    yield Cited(
        'hoecken',
        'width of the line over 180°',
        (0.0644,),
        'mm',
        0.00005,
        'spiderpig, Hoecken',
        part(find, 1),
    )
    row = {'O4.x': 0.25, 'A-B': 0.325, 'B-P': 0.325, 'O4-B': 0.325}
    yield Cited(
        'hoecken',
        'stroke over 140°, with ground 2.5 and coupler 3.25',
        (3.623,),
        'cranks',
        0.0005,
        'Norton',
        part(lambda: straight(row, 140.0, 0.1), 0),
        "Norton's lengths, not the file's",
    )


@cache
def six_bar_notebook() -> Mapping[str, float]:
    """Return the numbers of the six-bar in the lengths of its notebook."""
    lengths = {'Q.x': 1.9, 'A-C': 2.3, 'A-D': 4.65, 'Q-C': 2.35, 'A2-E': 4.65, 'D-E': 3.65}
    changes = {name: 0.01 * length for name, length in lengths.items()}
    machine = LinkageLeg(shipped_linkage('watt_six_bar').varied(changes))
    found = [machine.solve(math.radians(k)) for k in range(361)]
    feet = np.array([pose.h for pose in found]) / 0.01
    level = np.array([angles_of(machine, pose)['R5'] for pose in found]) % (2 * math.pi)
    height = 2 * float(np.sum((2.70 - feet[80:301, 1]) ** 2))
    tilt = float(np.sum((math.pi - level) ** 2))
    return {
        'straight': 1 / height,
        'level': 1 / tilt,
        'both': height + tilt,
        'x min': float(feet[:, 0].min()),
        'x max': float(feet[:, 0].max()),
        'y min': float(feet[:, 1].min()),
        'y max': float(feet[:, 1].max()),
        'theta5(0)': math.degrees(level[0]),
        'theta5 max': math.degrees(level.max()),
        'theta5 max at': float(level.argmax()),
        'theta5 min': math.degrees(level.min()),
        'theta5 min at': float(level.argmin()),
    }


def watt_six_bar() -> Iterator[Cited]:
    """Yield what the notebook of the Watt six-bar prints and plots."""
    for key, title, value, unit, error in (
        ('straight', '1 / (2 Σ (2.70 - y)²), crank 80° to 300°', 21.5479, '', 0.5e-4),
        ('level', '1 / Σ (π - θ5)², crank 0° to 360°', 7.0509, '', 0.5e-4),
        ('both', 'both sums together', 0.188234, '', 0.5e-6),
        ('x min', 'least x of the foot', -2.3, 'cranks', 0.03),
        ('x max', 'greatest x of the foot', 2.4, 'cranks', 0.03),
        ('y min', 'least y of the foot', 2.67, 'cranks', 0.05),
        ('y max', 'greatest y of the foot', 3.58, 'cranks', 0.05),
        ('theta5(0)', 'θ5 at 0°', 181.0, '°', 0.05),
        ('theta5 max', 'greatest θ5', 182.02, '°', 0.05),
        ('theta5 max at', 'crank at the greatest θ5', 41.0, '°', 5.0),
        ('theta5 min', 'least θ5', 178.70, '°', 0.05),
        ('theta5 min at', 'crank at the least θ5', 250.0, '°', 5.0),
    ):
        yield Cited(
            'watt_six_bar',
            title,
            (value,),
            unit,
            error,
            'Six-bar notebook',
            lambda key=key: (six_bar_notebook()[key],),
            "the notebook's lengths, not the file's",
        )


# Andrews' squeezing mechanism.


def andrews_angles(joints: Mapping[str, float], constants: float = 1.0) -> Values:
    """Return the test set's angles, or their rates without the constants, from ours."""
    half = constants * math.pi / 2
    return (
        joints['K2'] - joints['K1'] - 2 * half,
        joints['K3'] + half,
        joints['K4'] - joints['K5'] + half,
        joints['K5'],
        joints['K6'] - joints['K7'] - half,
        joints['K7'] + half,
    )


def andrews() -> Iterator[Cited]:
    """Yield the start and the solution of the test set, and the velocities there."""
    names = ('Theta', 'gamma', 'Phi', 'delta', 'Omega', 'epsilon')
    start = -0.0617138900142764496
    end = 15.81077119629904

    def at(beta: float, values: Values) -> Callable[[], Values]:
        def find() -> Values:
            machine = leg('andrews')
            ours = andrews_angles(angles_of(machine, machine.solve(beta)))
            # Modulo a turn: the test set counts them.
            pairs = zip(ours, values, strict=True)
            return tuple(value + math.remainder(own - value, 2 * math.pi) for own, value in pairs)

        return find

    for title, beta, values in (
        (
            'at the start',
            start,
            (
                0.0,
                0.455279819163070380,
                0.222668390165885884,
                0.487364979543842550,
                -0.222668390165885884,
                1.23054744454982119,
            ),
        ),
        (
            'at 0.03 s',
            end,
            (
                -15.75637105984298,
                0.04082224013073101,
                -0.5347301163226948,
                0.5244099658805304,
                0.5347301163226948,
                1.048080741042263,
            ),
        ),
    ):
        find = at(beta, values)
        for i, name in enumerate(names):
            yield Cited(
                'andrews',
                f'{name} {title}',
                (values[i],),
                'rad',
                1e-14,
                'IVP test set',
                part(find, i),
                'kinematics, at the published beta',
            )

    def simulated() -> Values:
        machine, text = leg('andrews'), (SHIPPED / 'andrews.yaml').read_text(encoding='utf-8')
        masses = masses_from_text(text, machine.linkage, 'andrews')
        dynamics = Dynamics(machine.linkage, masses, gravity=(0.0, 0.0))
        moved = simulate(dynamics, 0.033, [0.0, 0.03], alpha=start)
        beta = float(moved.alpha[-1])
        ours = andrews_angles(angles_of(machine, machine.closed_form(beta)))
        pairs = zip(ours, values, strict=True)
        turned = (value + math.remainder(own - value, 2 * math.pi) for own, value in pairs)
        return beta, *turned

    found = cache(simulated)
    for i, (name, value) in enumerate(zip(('beta', *names), (end, *values), strict=True)):
        yield Cited(
            'andrews',
            f'{name} at 0.03 s, simulated',
            (value,),
            'rad',
            5e-10 * max(1.0, abs(value)),
            'IVP test set',
            part(found, i),
            'dynamics, from the start',
        )

    def rates() -> Values:
        machine = leg('andrews')
        motion = machine.velocity(machine.solve(end), 1139.920302151208)
        joints = dict(zip(machine.joint_names, motion.joints, strict=True))
        return andrews_angles(joints, constants=0.0)

    velocities = (
        -1424.379294994111,
        11.03291221937134,
        19.29337464421385,
        0.5735699284790808,
        -19.29337464421385,
        0.3231791658026955,
    )
    for i, (name, value) in enumerate(zip(names, velocities, strict=True)):
        yield Cited(
            'andrews',
            f"{name}' at 0.03 s",
            (value,),
            'rad/s',
            1e-7 * abs(value),
            'IVP test set',
            part(rates, i),
            'kinematics, at the published beta and its rate',
        )


# Straight lines.


def straight_lines() -> Iterator[Cited]:
    """Yield where the published straight lines are met exactly, and how far they reach."""

    def foot(name: str, crank: float) -> Values:
        x, y = leg(name).solve(math.radians(crank)).h
        return x / 0.01, y / 0.01

    def coupler(crank: float) -> Values:
        machine = leg('chebyshev')
        pose = machine.solve(math.radians(crank))
        return (math.degrees(angles_of(machine, pose)['link'] % math.pi),)

    yield Cited(
        'chebyshev',
        "ends of the crank's arc",
        (36.8699, 101.537),
        '°',
        0.0005,
        'Wikipedia, Chebyshev',
        lambda: degrees(leg('chebyshev').reachable_arcs()[0]),
    )
    level = math.degrees(math.acos(0.6))
    for title, crank, place in (
        # At the very end of its arc the crank is singular.
        ('right end', math.degrees(math.acos(0.8)) + 1e-9, (20.0, 20.0)),
        ('middle', level, (10.0, 20.0)),
        ('left end', 90.0, (0.0, 20.0)),
    ):
        yield Cited(
            'chebyshev',
            f'foot at the {title} of its line',
            place,
            'cm',
            1e-3,
            'Wikipedia, Chebyshev',
            lambda crank=crank: foot('chebyshev', crank),
        )
        if title != 'middle':
            yield Cited(
                'chebyshev',
                f'direction of the coupler at the {title}, upright',
                (90.0,),
                '°',
                1e-3,
                'Wikipedia, Chebyshev',
                lambda crank=crank: coupler(crank),
            )
    yield Cited(
        'chebyshev_lambda',
        'intersections of the foot path with the ideal line',
        (6.0,),
        '',
        0.0,
        'Wikipedia, lambda',
        lambda: (lambda_crossings(),),
    )
    # Upright, and with a side of the triangle along an arm.
    arm, side = math.degrees(math.acos(5 / 12)), math.degrees(math.acos(5 / 6))
    yield Cited(
        'roberts',
        'height over a base of 1, arms 1.2',
        (1.09,),
        '',
        0.005,
        'Bright Hub',
        lambda: (height_of_roberts(arm),),
    )
    for title, crank, place in (
        ('at the left pivot', side + 2 * math.degrees(math.asin(5 / 12)), (0.0, 0.0)),
        ('in the middle', arm, (10.0, 0.0)),
        ('at the right pivot', side, (20.0, 0.0)),
    ):
        yield Cited(
            'roberts',
            f'foot {title}',
            place,
            'cm',
            1e-3,
            'Bright Hub',
            lambda crank=crank: foot('roberts', crank),
        )
    for crank in (-60.0, 10.0, 60.0):
        yield Cited(
            'peaucellier',
            f'OB · OD at {crank:.0f}°',
            (65.0**2 - 25.0**2,),
            'cm²',
            1e-9,
            'Peaucellier',
            lambda crank=crank: (peaucellier_product(crank),),
        )
        yield Cited(
            'peaucellier',
            f'x of D at {crank:.0f}°',
            (72.0,),
            'cm',
            1e-9,
            'Peaucellier',
            part(lambda crank=crank: foot('peaucellier', crank), 0),
        )


def lambda_crossings() -> float:
    """Return how often the lambda's foot is on the line amid its nearly straight part."""
    path = foot_path(leg('chebyshev_lambda'))
    # The straight part is the half turn about a crank that points away from the rocker's pivot.
    heights = [leg('chebyshev_lambda').solve(math.radians(k / 4)).h[1] for k in range(-360, 361)]
    return float(len(path.crank_angles_at_height((min(heights) + max(heights)) / 2)))


def height_of_roberts(crank: float) -> float:
    """Return how far the triangle's tip is from its base, when that is level."""
    machine = leg('roberts')
    places = points_of(machine, machine.solve(math.radians(crank)))
    return (places['C'].imag - places['P'].imag) / abs(places['D'] - places['C'])


def peaucellier_product(crank: float) -> float:
    """Return OB OD [cm^2]."""
    machine = leg('peaucellier')
    places = points_of(machine, machine.solve(math.radians(crank)))
    return abs(places['B']) * abs(places['D']) / 0.01**2


CITED = (*courses(), *poses(), *paths(), *andrews(), *straight_lines())


# The page.


def written(values: Values, error: float) -> str:
    """Return numbers with one digit more than their error has, and no digit of rounding."""
    decimals = min(12, max(0, 1 - math.floor(math.log10(error)))) if error else 0
    # No negative zeros.
    texts = [f'{round(value, decimals) + 0.0:.{decimals}f}' for value in values]
    return ', '.join(texts)


def page() -> str:
    """Return docs/published_linkages.md."""
    linkages = list(dict.fromkeys(cited.linkage for cited in CITED))
    numbers = sum(len(cited.values) for cited in CITED)
    lines = [
        '# Published linkages',
        '',
        f'{len(linkages)} of the shipped linkages against {numbers} published numbers. Ours come',
        'from the files in `klann_ros/linkages/` and agree within the reading error of the',
        'source; rows with other lengths than the file state this. The numbers and this page are',
        'tested by `test/kinematics/test_published.py` and written by `python test/published.py`.',
        '',
        'A pose on a plan is compared at the crank angle of its drawn crank pin, which is not',
        "counted itself. The numbers are in the plan's units and frame.",
        '',
        'Linkages without published numbers:',
        '',
        *(f'- `{name}`: {why}' for name, why in WITHOUT.items()),
    ]
    for name in linkages:
        rows = [cited for cited in CITED if cited.linkage == name]
        lines += ['', f'## {shipped_linkage(name).name} (`{name}`)', '']
        lines += ['| number | published | reading error | ours | source |']
        lines += ['|---|---|---|---|---|']
        for row in rows:
            unit = f' {row.unit}' if row.unit not in {'', '°'} else row.unit
            published = ', '.join(f'{value!r}'.removesuffix('.0') for value in row.values)
            error = f'{row.error:.2g}{unit}' if row.error else 'none'
            ours = written(row.ours, row.error)
            quantity = f'{row.quantity} ({row.note})' if row.note else row.quantity
            lines += [f'| {quantity} | {published}{unit} | {error} | {ours} | {row.source} |']
    lines += ['', '## Sources', '', '| | what | reading error |', '|---|---|---|']
    for key, source in SOURCES.items():
        title = f'[{source.title}]({source.at})' if '://' in source.at else source.title
        lines += [f'| {key} | {title} | {source.exact} |']
    return '\n'.join(lines) + '\n'


if __name__ == '__main__':
    PAGE.write_text(page(), encoding='utf-8')
