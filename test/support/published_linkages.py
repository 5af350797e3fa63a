"""
Numbers that others have published about the shipped linkages, and the same numbers of ours.

`published.yaml` has the published ones. Run this to write the tables, which the site shows in
docs/published_linkages.md.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
import math
from pathlib import Path
from typing import Any

from klann_ros.dynamics import Dynamics, masses_from_text, simulate
from klann_ros.kinematics import foot_path, LinkageLeg, LinkagePose, shipped_linkage
from klann_ros.kinematics.linkage.file import SHIPPED
import numpy as np
from yaml_tables import read_table

TABLES = Path(__file__).with_suffix('.md')
DATA = read_table(Path(__file__).with_suffix('.yaml'))
Values = tuple[float, ...]

# A shipped linkage without a published number, and the reason.
WITHOUT: Mapping[str, str] = DATA['without']


@dataclass(frozen=True)
class Source:
    """A publication: its title, its place, and the precision of its numbers."""

    title: str
    at: str
    exact: str


SOURCES = {key: Source(**source) for key, source in DATA['sources'].items()}


@dataclass(frozen=True)
class Cited:
    """A published number of a linkage, or a few that belong together."""

    linkage: str
    quantity: str
    values: Values
    unit: str
    error: float
    source: str
    # The function below that computes ours, and its arguments.
    find: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    # The subject of the number, where it is not the pose of the shipped file alone.
    note: str = ''

    def __str__(self) -> str:
        """Return the linkage and the quantity."""
        return f'{self.linkage}: {self.quantity}'

    @property
    def ours(self) -> Values:
        """Return the same numbers of the shipped linkage."""
        numbers: Values = FIND[self.find](self.linkage, **self.arguments)
        if self.unit == 'rad' and not self.quantity.startswith('beta'):
            # The source counts turns of all angles; ours does of the crank's alone.
            turns = np.round((np.array(numbers) - self.values) / math.tau)
            return tuple((numbers - math.tau * turns).tolist())
        return numbers

    @property
    def deviation(self) -> float:
        """Return the largest difference of a number of ours from the cited one."""
        return max(abs(a - b) for a, b in zip(self.values, self.ours, strict=True))


def cited() -> Iterator[Cited]:
    """Yield the published numbers: a group's common fields, then the columns of each row."""
    for group in DATA['numbers']:
        common = dict(group['head'])
        columns = common.pop('columns', ())
        for quantity, numbers, *cells in group['rows']:
            arguments = {**common, **dict(zip(columns, cells, strict=True))}
            fields = {}
            for name in ('linkage', 'unit', 'error', 'source', 'find', 'note'):
                if name in arguments:
                    fields[name] = arguments.pop(name)
            yield Cited(quantity=quantity, values=tuple(numbers), arguments=arguments, **fields)


@cache
def leg(name: str) -> LinkageLeg:
    """Return a shipped linkage's leg."""
    return LinkageLeg(shipped_linkage(name))


def pose_at(name: str, crank: float) -> LinkagePose:
    """Return a pose at a crank angle [deg]."""
    return leg(name).solve(math.radians(crank))


def points_of(name: str, pose: LinkagePose) -> Mapping[str, complex]:
    """Return a pose's points by name [m]."""
    names = leg(name).linkage.structure.points
    return {name: complex(*place) for name, place in zip(names, pose.points, strict=True)}


def angles_of(machine: LinkageLeg, pose: LinkagePose) -> Mapping[str, float]:
    """Return a pose's angles by name [rad]."""
    return dict(zip(machine.joint_names, pose.joints, strict=True))


def degrees(radians: Sequence[float]) -> Values:
    """Return angles in degrees."""
    return tuple(np.degrees(radians).tolist())


def newton(name: str, guess: Sequence[float], index: int) -> Values:
    """Return an iterate at a crank angle of 60 deg [deg]."""
    return degrees(leg(name).newton(math.radians(60.0), np.radians(guess))[index])


def drawing(  # noqa: PLR0917 - the data of a drawing
    name: str,
    axle: Sequence[float],
    scale: float,
    pin: Sequence[float],
    joint: str,
    mirrored: bool = False,
) -> Values:
    """Return a joint's place on a drawing, with the crank towards its pin; a unit is scale m."""
    side = -1 if mirrored else 1
    pose = leg(name).solve(math.atan2(pin[1] - axle[1], side * (pin[0] - axle[0])))
    place = points_of(name, pose)[joint] / scale
    return side * place.real + axle[0], place.imag + axle[1]


def left_foot(name: str, axis: str) -> Values:
    """Return the left leg's range of x or y in the plan's frame, whose axle is at (10, 10)."""
    low, high = getattr(foot_path(leg(name)), f'{axis}_range')
    ends = (-high, -low) if axis == 'x' else (low, high)
    return tuple(10 + end / 0.01 for end in ends)


def flatness(name: str) -> Values:
    """Return lift over stride."""
    path = foot_path(leg(name))
    return (path.lift / path.stride,)


def straight_line(
    name: str, turn: float, scale: float, axis: int, changes: Mapping[str, float] | None = None
) -> Values:
    """Return the foot's extent over a part of the turn about 180 deg."""
    machine = LinkageLeg(shipped_linkage(name).varied(changes))
    crank = np.radians(np.linspace(180 - turn / 2, 180 + turn / 2, 721))
    feet = np.array([machine.solve(angle).h for angle in crank.tolist()])
    return (float(np.ptp(feet, axis=0)[axis]) / scale,)


@cache
def six_bar_notebook() -> Mapping[str, float]:
    """Return the numbers of the six-bar in the lengths of its notebook."""
    lengths = {'Q.x': 1.9, 'A-C': 2.3, 'A-D': 4.65, 'Q-C': 2.35, 'A2-E': 4.65, 'D-E': 3.65}
    changes = {name: 0.01 * length for name, length in lengths.items()}
    machine = LinkageLeg(shipped_linkage('watt_six_bar').varied(changes))
    poses = [machine.solve(math.radians(k)) for k in range(361)]
    feet = np.array([pose.h for pose in poses]) / 0.01
    level = np.array([angles_of(machine, pose)['R5'] for pose in poses]) % (2 * math.pi)
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


def andrews_coordinates(joints: Mapping[str, float], constants: float = 1.0) -> Values:
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


@cache
def andrews_solution(name: str) -> Values:
    """Return beta and the angles at 0.03 s, simulated from the start."""
    machine, text = leg(name), (SHIPPED / f'{name}.yaml').read_text(encoding='utf-8')
    masses = masses_from_text(text, machine.linkage, name)
    dynamics = Dynamics(machine.linkage, masses, gravity=(0.0, 0.0))
    start = -0.0617138900142764496
    # With a tolerance of 1e-10 the rounding of its steps decides the ninth digit.
    limits: dict[str, float] = {'alpha': start, 'tolerance': 1e-11}
    beta = float(simulate(dynamics, 0.033, [0.0, 0.03], **limits).alpha[-1])
    return beta, *andrews_coordinates(angles_of(machine, machine.closed_form(beta)))


def andrews_rate(name: str, index: int) -> Values:
    """Return an angle's rate at 0.03 s."""
    machine = leg(name)
    motion = machine.velocity(machine.solve(15.81077119629904), 1139.920302151208)
    joints = dict(zip(machine.joint_names, motion.joints, strict=True))
    return (andrews_coordinates(joints, constants=0.0)[index],)


def foot(name: str, crank: float, axis: int | None = None) -> Values:
    """Return the foot [cm], or one of its coordinates."""
    x, y = pose_at(name, crank).h
    place = x / 0.01, y / 0.01
    return place if axis is None else (place[axis],)


def coupler_direction(name: str, crank: float) -> Values:
    """Return the direction of the body `link` [deg]."""
    return (math.degrees(angles_of(leg(name), pose_at(name, crank))['link'] % math.pi),)


def line_crossings(name: str) -> Values:
    """Return how often the foot is on the line amid its nearly straight part."""
    path = foot_path(leg(name))
    # The straight part is the half turn about a crank that points away from the rocker's pivot.
    heights = [pose_at(name, k / 4).h[1] for k in range(-360, 361)]
    return (float(len(path.crank_angles_at_height((min(heights) + max(heights)) / 2))),)


def roberts_height(name: str, crank: float) -> Values:
    """Return the distance of the triangle's tip from its base, when that is level."""
    places = points_of(name, pose_at(name, crank))
    return ((places['C'].imag - places['P'].imag) / abs(places['D'] - places['C']),)


def inversor_product(name: str, crank: float) -> Values:
    """Return OB OD [cm^2]."""
    places = points_of(name, pose_at(name, crank))
    return (abs(places['B']) * abs(places['D']) / 0.01**2,)


FIND: Mapping[str, Any] = {
    'newton': newton,
    'theta4': lambda name, crank: degrees([pose_at(name, crank).x[1]]),
    'transmission_angle': lambda name, crank: degrees(pose_at(name, crank).transmission_angles),
    'drawing': drawing,
    'foot_path': lambda name, figure: (getattr(foot_path(leg(name)), figure) / 0.01,),
    'left_foot_x': lambda name: left_foot(name, 'x'),
    'left_foot_y': lambda name: left_foot(name, 'y'),
    'flatness': flatness,
    'straight_line': straight_line,
    'six_bar_notebook': lambda _, figure: (six_bar_notebook()[figure],),
    'andrews_angles': lambda name, beta, index: (
        andrews_coordinates(angles_of(leg(name), leg(name).solve(beta)))[index],
    ),
    'andrews_simulated': lambda name, index: (andrews_solution(name)[index],),
    'andrews_rates': andrews_rate,
    'foot': foot,
    'coupler_direction': coupler_direction,
    'line_crossings': line_crossings,
    'reachable_arc': lambda name: degrees(leg(name).reachable_arcs()[0]),
    'roberts_height': roberts_height,
    'inversor_product': inversor_product,
}
CITED = tuple(cited())


# The tables.


def written(values: Values, error: float) -> str:
    """Return numbers with one digit more than their error has, and no digit of rounding."""
    decimals = min(12, max(0, 1 - math.floor(math.log10(error)))) if error else 0
    # No negative zeros.
    texts = [f'{round(value, decimals) + 0.0:.{decimals}f}' for value in values]
    return ', '.join(texts)


def tables() -> str:
    """Return the tables of all linkages, and of their sources."""
    linkages = list(dict.fromkeys(row.linkage for row in CITED))
    numbers = sum(len(row.values) for row in CITED)
    lines = [f'{len(linkages)} of the shipped linkages, {numbers} published numbers.']
    lines += ['', '| no published numbers | |', '|---|---|']
    lines += [f'| `{name}` | {why} |' for name, why in WITHOUT.items()]
    for name in linkages:
        rows = [row for row in CITED if row.linkage == name]
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
    TABLES.write_text(tables(), encoding='utf-8')
