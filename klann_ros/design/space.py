"""The dimensions of a linkage that vary, and their ranges; units, and the error."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import radians
from typing import Any, NamedTuple

from klann_ros.kinematics import LENGTH_UNITS, Linkage, moved_numbers, Variants
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import RobotLeg
from klann_ros.sanitize.text import did_you_mean, printable
import numpy as np

DEFAULT_PERCENT = 20.0
# Variables of the motion of a whole linkage in its plane, which is scaled first.
PLACE = ('place.x', 'place.y', 'place.turn')
MOTION = ('scale', *PLACE)


class RequirementsError(ValueError):
    """Requirements that are refused; the text says why."""


class Units(NamedTuple):
    """Names of the units of requirements, and their sizes in m and rad."""

    length: str = 'm'
    angle: str = 'rad'

    def size(self, unit: str) -> float:
        """Return the size of its unit for an SI unit."""
        if unit in {'m', 'm/s'}:
            return LENGTH_UNITS[self.length]
        return radians(1.0) if unit in {'rad', 'rad/s'} and self.angle == 'deg' else 1.0

    def name(self, unit: str) -> str:
        """Return the name of its unit for an SI unit."""
        base, *per_second = unit.split('/')
        return '/'.join([{'m': self.length, 'rad': self.angle}.get(base, base), *per_second])

    def text(self, value: float, unit: str) -> str:
        """Return a value (SI) in its unit."""
        return f'{value / self.size(unit):.4g} {self.name(unit)}'.rstrip()


@dataclass(frozen=True, eq=False)
class Space:
    """
    The dimensions of one linkage that vary.

    `names` are the variables: dimensions, and 'scale' for a common factor of all lengths; `low`
    and `high` their ranges [m, rad], shape (d,). `ties` are dimensions that equal another one,
    times +1 or -1. The last `dyads` variables are assembly modes, by their signs. `draw` returns
    random candidates that are likely to turn, shape (n, d); uniform by default.
    """

    leg: RobotLeg
    names: tuple[str, ...]
    low: FloatArray
    high: FloatArray
    ties: Mapping[str, tuple[str, int]] = field(default_factory=dict)
    dyads: int = 0
    draw: Callable[['Space', np.random.Generator, int], FloatArray] | None = None

    @property
    def linkage(self) -> Linkage:
        """Return the linkage."""
        return self.leg.linkage

    def variants(self, x: FloatArray) -> Variants:
        """Return candidates, x of shape (n, d) in [0, 1]."""
        numbers = self.low + x * (self.high - self.low)
        columns: dict[str, Any] = dict(zip(self.names, numbers.T, strict=True))
        first_mode = len(self.names) - self.dyads
        signs = [np.copysign(1.0, columns.pop(name)) for name in self.names[first_mode:]]
        drawn = self.linkage.dimensions
        for name, (leader, sign) in self.ties.items():
            columns[name] = sign * columns.get(leader, np.full(len(x), drawn[leader]))
        motion = {name: columns.pop(name) for name in MOTION if name in columns}
        if motion:
            dimensions = {**drawn, **columns}
            x, y, turn = (motion.get(name, 0.0) for name in PLACE)
            factor = motion.get('scale', 1.0) * np.exp(1j * turn)
            structure = self.linkage.structure
            moved = moved_numbers(structure, [*dimensions.values()], factor, x + 1j * y)
            columns = dict(zip(dimensions, moved, strict=True))
        return Variants(self.linkage, columns, assembly=signs or None)

    def sample(self, random: np.random.Generator, count: int) -> FloatArray:
        """Return random candidates, shape (n, d); the first is the linkage as drawn."""
        if self.draw is not None:
            return self.draw(self, random, count)
        x = random.uniform(size=(count, len(self.names)))
        neutral = {'scale': 1.0, **dict.fromkeys(PLACE, 0.0), **self.linkage.dimensions}
        drawn = np.array([neutral[name] for name in self.names])
        x[0] = np.clip((drawn - self.low) / (self.high - self.low), 0.0, 1.0)
        return x


def varied_space(
    leg: RobotLeg, content: Mapping[str, Any], units: Units, *, several: bool
) -> Space:
    """
    Return the space of a linkage by the keys `vary`, `tie` and `scale` of requirements.

    With `several` linkages a name need not be a dimension of this one. Raises a RequirementsError
    for an empty range or an unknown dimension.
    """
    vary = content.get('vary', DEFAULT_PERCENT)
    ranges = dict(vary) if isinstance(vary, Mapping) else {'all': vary}
    dimensions = {d.name: d for d in leg.linkage.structure.dimensions}
    ties = dict(_ties(content.get('tie', {}), dimensions, several=several))
    for name in ranges:
        if name != 'all' and name not in dimensions and not several:
            raise RequirementsError(f'vary: {_unknown(name, dimensions)}')
    free_ranges = {}
    for name, dimension in dimensions.items():
        drawn = leg.linkage.dimensions[name]
        wanted_range = ranges.get(name, ranges.get('all'))
        if wanted_range is None or name in ties:
            continue
        low, high = _range(dimension, drawn, wanted_range, units)
        if low < high:
            free_ranges[name] = low, high
    free_ranges |= _motion_ranges(content, leg, units)
    if not free_ranges:
        raise RequirementsError('vary leaves nothing to vary: give a percentage > 0, or ranges')
    ends = np.array([*free_ranges.values()], dtype=np.float64)
    return Space(leg, tuple(free_ranges), ends[:, 0], ends[:, 1], ties)


def _motion_ranges(
    content: Mapping[str, Any], leg: RobotLeg, units: Units
) -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield the variables that scale and place a whole linkage, and their ranges [m, rad]."""
    motion = {f'place.{key}': ends for key, ends in content.get('place', {}).items()}
    if motion and not leg.description:
        raise RequirementsError('place needs a linkage with pivots of its own, such as klann')
    # Their branch is known where the linkage is drawn.
    has_branch = not leg.linkage.is_dyadic or leg.linkage.change_points
    if 'place.turn' in motion and has_branch:
        raise RequirementsError(
            'place.turn: linkages with coupled loops or change points are only moved'
        )
    if 'scale' in content:
        motion['scale'] = content['scale']
    for name, (low, high) in motion.items():
        if not low < high:
            raise RequirementsError(f'{name}: the range [{low:g}, {high:g}] is empty')
        size = units.size({'scale': '', 'place.turn': 'rad'}.get(name, 'm'))
        yield name, (size * low, size * high)


def _range(dimension: Any, drawn: float, wanted: Any, units: Units) -> tuple[float, float]:
    """Return the range of a dimension [m, rad]: a list of both ends, or a percentage."""
    if not isinstance(wanted, list):
        ends = drawn * (1.0 - wanted / 100.0), drawn * (1.0 + wanted / 100.0)
        return min(ends), max(ends)
    name = dimension.name
    size = units.size(dimension.unit)
    low, high = size * wanted[0], size * wanted[1]
    text = f'[{wanted[0]:g}, {wanted[1]:g}] {units.name(dimension.unit)}'
    if not low < high:
        raise RequirementsError(f'vary.{name}: the range {text} is empty')
    if dimension.is_length and low <= 0.0:
        raise RequirementsError(f'vary.{name}: a length must be > 0, but the range is {text}')
    return low, high


def _ties(
    texts: Mapping[str, str], dimensions: Iterable[str], *, several: bool
) -> Iterable[tuple[str, tuple[str, int]]]:
    for name, text in texts.items():
        sign = -1 if text.startswith('-') else 1
        leader = text[1:].strip() if sign < 0 else text
        missing = [end for end in (name, leader) if end not in dimensions]
        if missing and several:
            continue
        if missing:
            raise RequirementsError(f'tie: {_unknown(missing[0], dimensions)}')
        if leader == name or leader in texts:
            raise RequirementsError(f'tie.{printable(name)}: {printable(leader)} is tied itself')
        yield name, (leader, sign)


def _unknown(name: str, dimensions: Iterable[str]) -> str:
    names = [*dimensions]
    hint = did_you_mean(name, names)
    return f'{printable(name)} is no dimension: these are {", ".join(names)}{hint}'
