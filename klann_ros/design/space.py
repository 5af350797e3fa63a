"""The dimensions of a linkage that vary, and their ranges; units, and the error."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from math import radians
from typing import Any, NamedTuple

from klann_ros.kinematics import LENGTH_UNITS, Linkage, Variants
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import RobotLeg
from klann_ros.sanitize.text import did_you_mean, printable
import numpy as np

DEFAULT_PERCENT = 20.0


class RequirementsError(ValueError):
    """Requirements that are refused; the text says why."""


class Units(NamedTuple):
    """Names of the units of requirements, and their sizes in m and rad."""

    length: str = 'm'
    angle: str = 'rad'

    def size(self, unit: str) -> float:
        """Return the size of its unit for an SI unit."""
        if unit == 'm':
            return LENGTH_UNITS[self.length]
        return radians(1.0) if unit == 'rad' and self.angle == 'deg' else 1.0

    def name(self, unit: str) -> str:
        """Return the name of its unit for an SI unit."""
        return {'m': self.length, 'rad': self.angle}.get(unit, unit)

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
        values = self.low + x * (self.high - self.low)
        columns = dict(zip(self.names, values.T, strict=True))
        modes = self.names[slice(len(self.names) - self.dyads, None)]
        signs = [np.copysign(1.0, columns.pop(name)) for name in modes]
        scale = columns.pop('scale', None)
        own = self.linkage.dimensions
        for name, (other, sign) in self.ties.items():
            columns[name] = sign * columns.get(other, np.full(len(x), own[other]))
        if scale is not None:
            lengths = [d.name for d in self.linkage.structure.dimensions if d.unit == 'm']
            columns |= {name: scale * columns.get(name, own[name]) for name in lengths}
        return Variants(self.linkage, columns, assembly=signs or None)

    def sample(self, random: np.random.Generator, count: int) -> FloatArray:
        """Return random candidates, shape (n, d); the first is the linkage as drawn."""
        if self.draw is not None:
            return self.draw(self, random, count)
        x = random.uniform(size=(count, len(self.names)))
        own = np.array([self.linkage.dimensions.get(name, 1.0) for name in self.names])
        x[0] = np.clip((own - self.low) / (self.high - self.low), 0.0, 1.0)
        return x


def varied_space(
    leg: RobotLeg, content: Mapping[str, Any], units: Units, *, several: bool
) -> Space:
    """
    Return the space of a linkage by the keys `vary`, `tie` and `scale` of requirements.

    With `several` linkages a name need not be a dimension of this one.

    Raises
    ------
    RequirementsError
        A range is empty, or a dimension unknown.

    """
    vary = content.get('vary', DEFAULT_PERCENT)
    ranges = dict(vary) if isinstance(vary, Mapping) else {'all': vary}
    dimensions = {d.name: d for d in leg.linkage.structure.dimensions}
    ties = dict(_ties(content.get('tie', {}), dimensions, several=several))
    for name in ranges:
        if name != 'all' and name not in dimensions and not several:
            raise RequirementsError(f'vary: {_unknown(name, dimensions)}')
    found = {}
    for name, dimension in dimensions.items():
        own = leg.linkage.dimensions[name]
        given = ranges.get(name, ranges.get('all'))
        if given is None or name in ties:
            continue
        low, high = _range(dimension, own, given, units)
        if low < high:
            found[name] = low, high
    if 'scale' in content:
        low, high = content['scale']
        if not low < high:
            raise RequirementsError(f'scale: the range [{low:g}, {high:g}] is empty')
        found['scale'] = low, high
    if not found:
        raise RequirementsError('vary leaves nothing to vary: give a percentage > 0, or ranges')
    ends = np.array([*found.values()], dtype=np.float64)
    return Space(leg, tuple(found), ends[:, 0], ends[:, 1], ties)


def _range(dimension: Any, own: float, given: Any, units: Units) -> tuple[float, float]:
    """Return the range of a dimension [m, rad]: its own, or a percentage of its value."""
    if not isinstance(given, list):
        ends = own * (1.0 - given / 100.0), own * (1.0 + given / 100.0)
        return min(ends), max(ends)
    size, name = units.size(dimension.unit), dimension.name
    low, high = size * given[0], size * given[1]
    shown = f'[{given[0]:g}, {given[1]:g}] {units.name(dimension.unit)}'
    if not low < high:
        raise RequirementsError(f'vary.{name}: the range {shown} is empty')
    if dimension.is_length and low <= 0.0:
        raise RequirementsError(f'vary.{name}: a length must be > 0, but the range is {shown}')
    return low, high


def _ties(
    given: Mapping[str, str], dimensions: Iterable[str], *, several: bool
) -> Iterable[tuple[str, tuple[str, int]]]:
    for name, text in given.items():
        other, sign = (text[1:].strip(), -1) if text.startswith('-') else (text, 1)
        missing = [each for each in (name, other) if each not in dimensions]
        if missing and several:
            continue
        if missing:
            raise RequirementsError(f'tie: {_unknown(missing[0], dimensions)}')
        if other == name or other in given:
            raise RequirementsError(f'tie.{printable(name)}: {printable(other)} is tied itself')
        yield name, (other, sign)


def _unknown(name: str, known: Iterable[str]) -> str:
    names = [*known]
    hint = did_you_mean(name, names)
    return f'{printable(name)} is no dimension: these are {", ".join(names)}{hint}'
