"""Requirements: the linkages, what may vary, and the figures that are aimed at or limited."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
import json
from math import inf
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from klann_ros.datasheet import Motor, motor_from_file
from klann_ros.export import part_settings
from klann_ros.kinematics import schema_error, Structure
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import preset_names, robot_of, RobotFileError, RobotLeg
from klann_ros.sanitize.text import did_you_mean, printable
from klann_ros.sanitize.units import warn_of_lengths
from klann_ros.sanitize.yaml_text import content_of_file
import numpy as np

from .areas import Area, area_clearance, areas_from
from .figures import FIGURES
from .grow import grown_spaces
from .poses import EXACT_ERROR, poses_from, PoseTarget
from .rounding import FILE_ERROR, Rounding
from .space import RequirementsError, Space, Units, varied_space
from .target import Target, target_from

Loaded = TypeVar('Loaded')
AIMS = ('minimize', 'maximize')
LIMITS = ('at_least', 'at_most')
DEFAULT_COUNT = 24
# The search holds limits with this relative distance: its figures are exact to 1e-4.
LIMIT_MARGIN = 5e-4
DEGREES_HINT = 'for degrees write units: {angle: deg}'


class Aim(NamedTuple):
    """A figure to minimize or maximize, or to bring near a value (SI)."""

    figure: str
    sense: str
    value: float = 0.0

    def loss(self, figures: Any) -> Any:
        """Return the loss, which is minimized."""
        if self.sense == 'near':
            return np.abs(figures - self.value)
        return figures if self.sense == 'minimize' else -figures


class Limit(NamedTuple):
    """A bound of a figure (SI); misses of a bound of 0 are relative to `scale`."""

    figure: str
    sense: str
    value: float
    scale: float = 1.0

    def shortfall(self, figures: Any) -> Any:
        """Return by how much figures miss the bound; 0 or less if they hold it."""
        return self.value - figures if self.sense == 'at_least' else figures - self.value

    def relative_shortfall(self, figures: Any) -> Any:
        """Return the shortfall relative to the bound, with the margin of the search."""
        return self.shortfall(figures) / (abs(self.value) or self.scale) + LIMIT_MARGIN


@dataclass(frozen=True, eq=False)
class Requirements:
    """
    The requirements of a search (SI); made by `requirements_from` or `requirements_from_file`.

    There is at least one aim. `load` is that on the foot in stance [N], `speed` that of the crank
    [rad/s], `tolerance` the half-width of all lengths [m], `count` the greatest number of legs
    returned; `parts` are the settings of the parts by which legs are weighed [m]. A search is
    resumed by `text`, the requirements as given; `units` are theirs, in which answers are shown.
    """

    spaces: tuple[Space, ...]
    aims: tuple[Aim, ...]
    limits: tuple[Limit, ...]
    units: Units
    target: Target | None = None
    poses: PoseTarget | None = None
    areas: tuple[Area, ...] = ()
    rounding: Rounding | None = None
    load: float = 0.0
    speed: float = 2.0 * np.pi
    tolerance: float = 0.0
    motor: Motor | None = None
    motor_file: str = ''
    walker: Mapping[str, Any] | None = None
    parts: Mapping[str, Any] = field(default_factory=dict)
    count: int = DEFAULT_COUNT
    text: str = ''

    def space(self, island: int) -> Space:
        """Return the space of an island."""
        return self.spaces[island % len(self.spaces)]

    @property
    def figures(self) -> tuple[str, ...]:
        """Return the names of the figures that it names."""
        names = [aim.figure for aim in self.aims]
        names += [limit.figure for limit in self.limits]
        return tuple(dict.fromkeys(names))

    def figure_text(self, figure: str, value: float | None) -> str:
        """Return a figure (SI) in its unit, or an empty text."""
        return '' if value is None else self.units.text(value, FIGURES[figure].unit)

    def turn_figures(self, structure: Structure, points: FloatArray) -> dict[str, FloatArray]:
        """Return the figures of all points of n legs at equal steps, shape (n, k, p, 2) [m]."""
        figures = {} if self.poses is None else self.poses.figures(structure, points)
        if self.areas:
            clearances = area_clearance(self.areas, structure, points)
            figures['area_clearance'] = clearances.min(axis=-1)
        return figures

    def without_motion(self) -> 'Requirements':
        """Return the requirements of a leg that is placed on its path already."""
        if self.target is None:
            return self
        return replace(self, target=self.target.fixed)

    @property
    def cheap_aims(self) -> tuple[Aim, ...]:
        """Return the aims that are computed in bulk."""
        return tuple(aim for aim in self.aims if not FIGURES[aim.figure].is_costly)

    @property
    def cheap_limits(self) -> tuple[Limit, ...]:
        """Return the limits that are computed in bulk."""
        return tuple(limit for limit in self.limits if not FIGURES[limit.figure].is_costly)

    @property
    def evolved_limits(self) -> tuple[Limit, ...]:
        """Return the limits of the evolution; one of the path is refined if it is the only aim."""
        is_path_alone = len(self.cheap_aims) == 1 and self.target is not None
        limits = self.cheap_limits
        return tuple(
            limit for limit in limits if not (is_path_alone and limit.figure == 'path_error')
        )


def requirements_from_file(path: str | Path) -> Requirements:
    """
    Return the requirements in a YAML file; `schema.json` is its format.

    Raises
    ------
    RequirementsError
        It cannot be read, or is refused.

    """
    folder = Path(path).parent
    read = partial(requirements_from, folder=folder)
    return content_of_file(path, read, 'requirements', RequirementsError)


def requirements_from(
    content: Mapping[str, Any] | None, folder: Path | None = None
) -> Requirements:
    """
    Return the requirements of a file's content; its files are first sought in `folder`.

    Raises
    ------
    RequirementsError
        It is refused; the text says why.

    """
    # An empty file.
    content = {} if content is None else content
    if problem := schema_error(content, 'klann_ros.design'):
        raise RequirementsError(problem)
    units = Units(**content.get('units', {}))
    folder = folder or Path()
    names = content.get('linkage', [])
    if isinstance(names, str):
        names = [names]
    if not names and 'grow' not in content:
        raise RequirementsError('linkage is missing, or grow in its place')
    legs = [_leg(name, folder) for name in names]
    aims, limits = _aims_and_limits(content.get('figures', {}), units)
    metre = units.size('m')
    target = _target(content, metre, folder, legs)
    spaces: tuple[Space, ...] = ()
    for leg in legs:
        spaces += (varied_space(leg, content, units, several=len(legs) > 1),)
    if 'grow' in content:
        spaces += grown_spaces(content['grow'], units, target)
    poses = poses_from(content['poses'], units) if 'poses' in content else None
    areas = areas_from(content.get('forbidden', ()), metre)
    rounding = Rounding.of(content['round'], units) if 'round' in content else None
    default_aims = {'path_error': target is not None}
    default_aims['pose_error'] = poses is not None and not poses.is_exact.all()
    for figure, is_aim in default_aims.items():
        if is_aim and figure not in {aim.figure for aim in aims}:
            aims = (Aim(figure, 'minimize'), *aims)
    limits = (*limits, *_task_limits(content, poses))
    load = float(content.get('load', 0.0))
    motor_file = _beside(content.get('motor', ''), folder)
    requirements = Requirements(
        spaces=spaces,
        # Without an aim the best leg is the one farthest from jamming.
        aims=aims or (Aim('transmission_angle', 'maximize'),),
        limits=tuple(_scaled(limit, spaces, load) for limit in limits),
        units=units,
        target=target,
        poses=poses,
        areas=areas,
        rounding=rounding,
        load=load,
        speed=units.size('rad/s') * content['speed'] if 'speed' in content else 2.0 * np.pi,
        tolerance=metre * float(content.get('tolerance', 0.0)),
        motor=_loaded('motor: ', motor_from_file, motor_file) if 'motor' in content else None,
        motor_file=str(Path(motor_file).absolute()),
        walker=content.get('walker'),
        parts=_loaded('', part_settings, legs, content.get('parts', {}), metre),
        # A schema's whole numbers may be written as 2.0.
        count=int(content.get('count', DEFAULT_COUNT)),
        text=json.dumps(content, sort_keys=True),
    )
    _check_needs(requirements, content)
    if 'length' not in content.get('units', {}):
        _warn_of_lengths(requirements, content)
    return requirements


def _task_limits(content: Mapping[str, Any], poses: PoseTarget | None) -> Iterator[Limit]:
    if poses is not None and poses.is_exact.any():
        yield Limit('exact_error', 'at_most', EXACT_ERROR)
    if 'forbidden' in content:
        yield Limit('area_clearance', 'at_least', 0.0)
    if 'round' in content:
        yield Limit('rounding_error', 'at_most', FILE_ERROR)


def _scaled(limit: Limit, spaces: Iterable[Space], load: float) -> Limit:
    """Return a limit; one of 0 m or 0 N m is relative to the longest bar, times the load [N]."""
    force = {'m': 1.0, 'N m': load}.get(FIGURES[limit.figure].unit)
    if limit.value or not force:
        return limit
    scales = []
    for space in spaces:
        is_length = [dimension.is_length for dimension in space.linkage.structure.dimensions]
        numbers = space.variants(np.full((1, len(space.names)), 0.5)).numbers
        scales.append(force * float(numbers[is_length].max()))
    return limit._replace(scale=min(scales))


def _warn_of_lengths(requirements: Requirements, content: Mapping[str, Any]) -> None:
    """Warn of lengths that were probably given in millimetres."""
    ranges = {'grow.crank': content.get('grow', {}).get('crank')}
    vary = content.get('vary')
    for space in requirements.spaces:
        for dimension in space.linkage.structure.dimensions:
            if dimension.unit == 'm' and isinstance(vary, Mapping):
                ranges[f'vary.{dimension.name}'] = vary.get(dimension.name)
    lengths = {}
    for name, ends in ranges.items():
        if isinstance(ends, list):
            lengths[name] = max(ends, key=abs)
    bounds: list[Aim | Limit] = [*requirements.aims, *requirements.limits]
    for bound in bounds:
        if FIGURES[bound.figure].unit == 'm':
            lengths[f'figures.{bound.figure}.{bound.sense}'] = bound.value
    lengths['tolerance'] = requirements.tolerance
    lengths['the size of path'] = requirements.target.size if requirements.target else 0.0
    angle = ', angle: deg' if requirements.units.angle == 'deg' else ''
    warn_of_lengths(lengths, f'write units: {{length: mm{angle}}}')


def _check_needs(requirements: Requirements, content: Mapping[str, Any]) -> None:
    """Refuse requirements that lack what others need, or that exclude each other."""
    poses = requirements.poses
    target = requirements.target
    for space in requirements.spaces:
        if poses is not None:
            poses.bar(space.linkage.structure)
    if poses is not None and poses.is_exact.any() and requirements.rounding is not None:
        raise RequirementsError(
            'poses: no rounded leg meets them exactly: leave out exact or round'
        )
    is_moved = target is not None and (target.can_move or target.can_turn or target.can_scale)
    if is_moved and (poses is not None or requirements.areas):
        raise RequirementsError(
            'path: beside poses or forbidden it must have move, turn and scale: false; place '
            'moves the leg'
        )
    for name in requirements.figures:
        needs = FIGURES[name].needs
        if needs and needs not in content:
            raise RequirementsError(f'figures.{name} needs {needs}, which is missing')
    if requirements.motor is not None and not requirements.load:
        raise RequirementsError('motor needs load [N], on the foot in stance, which is missing')


def _target(
    content: Mapping[str, Any], metre: float, folder: Path, legs: Iterable[RobotLeg]
) -> Target | None:
    """Return the path that the foot is to follow, if there is one."""
    if 'path' not in content:
        return None
    target = _loaded('path: ', target_from, content['path'], metre, folder)
    if not all(leg.description for leg in legs):
        raise RequirementsError('path needs a linkage with pivots of its own, such as klann')
    return target


def _loaded(key: str, load: Callable[..., Loaded], *arguments: Any) -> Loaded:
    """Return what a function loads; a RequirementsError that begins with a key if it refuses."""
    try:
        return load(*arguments)
    except (OSError, ValueError) as error:
        raise RequirementsError(f'{key}{getattr(error, "strerror", None) or error}') from error


def _beside(name: str, folder: Path) -> str:
    """Return a file's path, beside the file of requirements if it is there."""
    return str(folder / name) if (folder / name).is_file() else name


def _leg(name: str, folder: Path) -> RobotLeg:
    try:
        legs = robot_of(_beside(name, folder)).legs
    except RobotFileError as error:
        raise RequirementsError(f'linkage: {error}{did_you_mean(name, preset_names())}') from error
    if any(leg.linkage != legs[0].linkage for leg in legs):
        raise RequirementsError(f'linkage: {printable(name)} has several different legs')
    leg = legs[0]
    return RobotLeg('', leg.linkage, masses=leg.masses, description=leg.description)


def _aims_and_limits(
    content: Mapping[str, Any], units: Units
) -> tuple[tuple[Aim, ...], tuple[Limit, ...]]:
    """Return the aims and the limits that the figures of a file name (SI)."""
    aims: list[Aim] = []
    limits: list[Limit] = []
    for name, wanted in content.items():
        if name not in FIGURES:
            listing = f'{", ".join(FIGURES)}{did_you_mean(name, FIGURES)}'
            raise RequirementsError(f'figures: {printable(name)} is none: these are {listing}')
        key = f'figures.{name}'
        senses: Mapping[str, Any] = {wanted: None} if isinstance(wanted, str) else wanted
        for sense, number in senses.items():
            if sense in LIMITS:
                limits.append(Limit(name, sense, _number(name, sense, number, units)))
            elif sense == 'near':
                aims.append(Aim(name, sense, _number(name, sense, number, units)))
            elif sense not in AIMS:
                legal = (*AIMS, *LIMITS, 'near')
                listing = f'{", ".join(legal)}{did_you_mean(sense, legal)}'
                raise RequirementsError(f'{key}: {printable(sense)} must be one of {listing}')
            elif number is None or number is True:
                aims.append(Aim(name, sense))
            else:
                raise RequirementsError(f'{key}.{sense} takes no value')
        bounds = {limit.sense: limit.value for limit in limits if limit.figure == name}
        if bounds.get('at_least', -inf) > bounds.get('at_most', inf):
            raise RequirementsError(f'{key}: at_least is above at_most, which no leg fulfils')
        if [aim.figure for aim in aims].count(name) > 1:
            raise RequirementsError(f'{key}: one of {", ".join(AIMS)} and near, not several')
    return tuple(aims), tuple(limits)


def _number(name: str, sense: str, value: Any, units: Units) -> float:
    """Return the number of an aim or a limit (SI); a RequirementsError if it is out of bounds."""
    kind = FIGURES[name]
    key = f'figures.{name}.{sense}'
    unit = units.name(kind.unit)
    if isinstance(value, bool) or not isinstance(value, int | float):
        unit_text = f' [{unit}]' if unit else ''
        raise RequirementsError(f'{key}: {printable(repr(value))} must be a number{unit_text}')
    number = float(value) * units.size(kind.unit)
    if not kind.min_value <= number <= kind.max_value:
        low = units.text(kind.min_value, kind.unit)
        high = units.text(kind.max_value, kind.unit)
        hint = f'; {DEGREES_HINT}' if kind.unit == 'rad' and units.angle == 'rad' else ''
        text = f'{value:g} {unit}'.rstrip()
        raise RequirementsError(f'{key}: {text} is out of its bounds, {low} to {high}{hint}')
    return number
