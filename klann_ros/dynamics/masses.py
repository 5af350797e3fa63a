"""Masses of a linkage: mass, centre and inertia of every body, and springs."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from math import isfinite
from typing import Any, NamedTuple

from klann_ros.kinematics import (
    as_linkage,
    bodies_of,
    body_points,
    FIXED,
    GROUND,
    Linkage,
    Structure,
    units_of,
)
from klann_ros.sanitize.text import counted, did_you_mean, printable, refusal
from klann_ros.sanitize.yaml_text import parse
import numpy as np


class MassError(ValueError):
    """Invalid masses; the text says which and why."""


class BodyMass(NamedTuple):
    """
    The mass of a body [kg], >= 0, its centre, and its inertia about the centre [kg m^2], >= 0.

    `centre` is x + i y from the body's first point, x along its angle [m].
    """

    mass: float = 0.0
    centre: complex = 0j
    inertia: float = 0.0

    def plus(self, added: 'BodyMass') -> 'BodyMass':
        """Return the sum, by the parallel axis theorem."""
        mass = self.mass + added.mass
        if not mass:
            return BodyMass(0.0, 0j, self.inertia + added.inertia)
        centre = (self.mass * self.centre + added.mass * added.centre) / mass
        offset_inertia = sum(m.mass * abs(m.centre - centre) ** 2 for m in (self, added))
        return BodyMass(mass, centre, self.inertia + added.inertia + offset_inertia)


@dataclass(frozen=True)
class Spring:
    """
    A spring between two points: of the linkage, or fixed places (x, y) [m].

    `stiffness` is >= 0 [N/m], `free_length` the length without force, >= 0 [m].
    """

    ends: tuple[Any, Any]
    stiffness: float
    free_length: float = 0.0

    def __post_init__(self) -> None:
        _not_negative('stiffness', self.stiffness, 'N/m')
        _not_negative('free_length', self.free_length, 'm')


@dataclass(frozen=True)
class TorsionSpring:
    """
    A torsion spring at a joint of two bodies, named like their angles, or 'ground'.

    Its deflection, within half a turn, is the direction of the second body less that of the first,
    counter-clockwise, less `rest_angle` [rad]; a body has the direction of its angle. `stiffness`
    is >= 0 [N m/rad].
    """

    joint: str
    bodies: tuple[str, str]
    stiffness: float
    rest_angle: float = 0.0

    def __post_init__(self) -> None:
        _not_negative('stiffness', self.stiffness, 'N m/rad')

    def body_indices(self, structure: Structure) -> list[int]:
        """Return the indices of its bodies, FIXED for the ground; a MassError if it has none."""
        owners = {}
        for j in structure.owners.get(self.joint, ()):
            owners[GROUND if j == FIXED else structure.angles[j]] = j
        if len({*self.bodies} & owners.keys()) != 2:
            names = f'{self.joint} joins {", ".join(owners) or "nothing"}'
            bodies = ', '.join(map(printable, self.bodies))
            raise MassError(f'torsion spring between {bodies}: {names}; two of these are needed')
        return [owners[name] for name in self.bodies]

    def deflection(self, structure: Structure, u: Any) -> Any:
        """Return its deflection by the bodies' vectors, of one pose or of many [rad]."""
        # The ground's frame is behind those of the bodies, by the index FIXED.
        frames = (*structure.frames, FIXED)
        places = [frames[j] for j in self.body_indices(structure)]
        first, second = (1.0 if frame == FIXED else u[frame] for frame in places)
        return np.angle(second * np.conj(first) * np.exp(-1j * self.rest_angle))


# Density of the bars in every file that is shipped or made by `design`: nobody measured it [kg/m].
ASSUMED_DENSITY = 1.0


class MassBasis(Enum):
    """What masses were computed from; the texts take a density [kg/m]."""

    BODIES = 'by body, from the file'
    RODS = 'as rods of the given {0:g} kg/m'
    ASSUMED_RODS = 'assumed, not measured: rods of {0:g} kg/m'


@dataclass(frozen=True)
class Masses:
    """
    The masses of a linkage's bodies, the crank's first, and its springs.

    `basis` says what they were computed from, by a `density`; `foot_mass` is the part of a foot
    that was added to a body [kg]; `source` is what the file says about masses by body.
    """

    bodies: tuple[BodyMass, ...]
    springs: tuple[Spring, ...] = ()
    torsion_springs: tuple[TorsionSpring, ...] = ()
    basis: MassBasis = MassBasis.BODIES
    density: float = 0.0
    foot_mass: float = 0.0
    source: str = ''

    def __post_init__(self) -> None:
        for number, body in enumerate(self.bodies):
            if not isinstance(body, BodyMass):
                raise MassError(refusal(f'mass of body {number}', body, 'a BodyMass'))
            _not_negative(f'mass of body {number}', body.mass, 'kg')
            _not_negative(f'inertia of body {number}', body.inertia, 'kg m^2')
            if not (isfinite(body.centre.real) and isfinite(body.centre.imag)):
                raise MassError(f'centre of body {number} is refused: it must be finite')

    @property
    def origin(self) -> str:
        """Return what they were computed from, as words behind a mass."""
        count = len(self.springs) + len(self.torsion_springs)
        springs = f', with {counted(count, "spring")}' if count else ''
        return (printable(self.source) or self.basis.value.format(self.density)) + springs

    @property
    def by_file(self) -> 'Masses':
        """Return the masses of rods by the density of a file, which may be an assumption."""
        is_assumed = self.density == ASSUMED_DENSITY
        return replace(self, basis=MassBasis.ASSUMED_RODS if is_assumed else MassBasis.RODS)

    @property
    def total(self) -> float:
        """Return the total mass [kg]."""
        return sum(body.mass for body in self.bodies)

    def with_mass(self, j: int, added: BodyMass) -> 'Masses':
        """Return the masses with another one added to a body, such as a foot's."""
        bodies = list(self.bodies)
        bodies[j] = bodies[j].plus(added)
        return replace(self, bodies=tuple(bodies))


def rods(
    linkage: Any, density: float, *, foot_mass: float = 0.0, slider_length: float = 0.0
) -> Masses:
    """
    Return the masses of slender rods: every bar and brace by its length.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.
    density : float
        The density of all bars [kg/m].
    foot_mass : float
        A point mass at the foot, on the first body that has it [kg].
    slider_length : float
        Length of a rod in the place of each sliding body without bars, in sizes of the linkage.

    Raises
    ------
    MassError
        A number is negative or not finite.

    """
    linkage = as_linkage(linkage)
    structure = linkage.structure
    _not_negative('density', density, 'kg/m')
    places = body_points(structure, linkage.bars)
    bodies = []
    for j, body in enumerate(structure.bodies):
        body_mass = BodyMass() if body.rigid else _rod(density, 0j, slider_length * linkage.size)
        for bar in body.rigid:
            starts = (bar.start, bar.brace.start) if bar.brace else (bar.start,)
            for start in starts:
                p = places[j, start]
                q = places[j, bar.end]
                body_mass = body_mass.plus(_rod(density, (p + q) / 2.0, abs(q - p)))
        bodies.append(body_mass)
    masses = Masses(tuple(bodies), basis=MassBasis.RODS, density=float(density))
    return with_foot(masses, linkage, foot_mass)


def with_foot(masses: Masses, linkage: Linkage, foot_mass: float) -> Masses:
    """Return masses with a point mass at the foot, on the first body that has it [kg]."""
    _not_negative('foot_mass', foot_mass, 'kg')
    if not foot_mass:
        return masses
    structure = linkage.structure
    owner = structure.first_owner(structure.foot)
    place = body_points(structure, linkage.bars)[owner, structure.foot]
    masses = masses.with_mass(owner, BodyMass(foot_mass, place))
    return replace(masses, foot_mass=float(foot_mass))


def with_rods(
    masses: Masses | None, linkage: Linkage, density: float, *, slider_length: float = 0.0
) -> Masses:
    """
    Return the masses of slender rods [kg/m] in place of those of bars; parameters as `rods`.

    Sliding bodies without bars keep their masses; the mass of a foot and springs remain.
    """
    if masses is None:
        return rods(linkage, density, slider_length=slider_length)
    foot_mass = masses.foot_mass
    rod_masses = rods(linkage, density, foot_mass=foot_mass, slider_length=slider_length)
    bodies = list(rod_masses.bodies)
    for j, body in enumerate(linkage.structure.bodies):
        if not body.rigid and max(masses.bodies[j].mass, masses.bodies[j].inertia) > 0.0:
            bodies[j] = masses.bodies[j]
    springs = masses.springs, masses.torsion_springs
    return Masses(tuple(bodies), *springs, MassBasis.RODS, rod_masses.density, foot_mass)


def _rod(density: float, centre: complex, length: float) -> BodyMass:
    mass = density * length
    return BodyMass(mass, centre, mass * length**2 / 12.0)


def masses_from_text(
    text: str, linkage: Linkage, name: str, *, density: float | None = None
) -> Masses | None:
    """
    Return the masses in the YAML text of a valid linkage; None without any.

    Each of its bodies may have `mass` [kg], `centre` [x, y] in the body and `inertia` about it
    [kg m^2]; or the file has one `density` for all bars [kg/m], and masses for sliding bodies
    without a bar. `springs` are a list of `{from, to, stiffness, free_length}`, `torsion_springs`
    one of `{joint, between, stiffness, rest_angle}`. A `density` wins over the file's masses.
    Bodies with `parts` of a material have none before `export` weighs them.

    Raises
    ------
    MassError
        Some masses are missing or invalid; the text says which.

    """
    settings = parse(text)
    metre, radian = units_of(settings)
    tension = tuple(_spring(spring, linkage, metre) for spring in settings.get('springs', ()))
    torsion = tuple(_torsion_springs(settings, linkage, radian))
    bodies = bodies_of(settings)
    missing = [angle for angle in linkage.joint_names if 'mass' not in bodies[angle]]
    body_masses = tuple(_body(bodies[angle], metre) for angle in linkage.joint_names)
    has_parts = 'material' in settings.get('parts', ())
    masses = Masses(body_masses, tension, torsion, source=settings.get('mass_source', ''))
    if density is None and 'density' in settings:
        with_bars = [body.angle for body in linkage.structure.bodies if body.rigid]
        if has_parts or any('mass' in bodies[angle] for angle in with_bars):
            both = f'density and {"parts.material" if has_parts else "masses"}'
            raise MassError(f'{printable(name)} has both {both}: leave one of them out')
        density = settings['density']
    if density is not None:
        return with_rods(masses, linkage, density).by_file
    if len(missing) == len(bodies) or (missing and has_parts):
        return None
    if missing:
        raise MassError(f'{printable(name)}: {", ".join(missing)} without mass; 0 is allowed')
    return masses


def _body(settings: Mapping[str, Any], metre: float) -> BodyMass:
    centre = metre * complex(*settings.get('centre', (0.0, 0.0)))
    return BodyMass(float(settings.get('mass', 0.0)), centre, float(settings.get('inertia', 0.0)))


def _spring(settings: Mapping[str, Any], linkage: Linkage, metre: float) -> Spring:
    def end(place: Any) -> Any:
        if isinstance(place, str):
            points = linkage.structure.points
            if place not in points:
                names = f'{", ".join(points)}{did_you_mean(place, points)}'
                raise MassError(f'springs: {place} is none of the points: {names}')
            return place
        x, y = place
        return metre * x, metre * y

    ends = end(settings['from']), end(settings['to'])
    return Spring(ends, float(settings['stiffness']), metre * settings.get('free_length', 0.0))


def _torsion_springs(
    settings: Mapping[str, Any], linkage: Linkage, radian: float
) -> Iterator[TorsionSpring]:
    for spring in settings.get('torsion_springs', ()):
        rest_angle = radian * spring.get('rest_angle', 0.0)
        bodies = tuple(spring['between'])
        torsion_spring = TorsionSpring(spring['joint'], bodies, spring['stiffness'], rest_angle)
        torsion_spring.body_indices(linkage.structure)
        yield torsion_spring


def _not_negative(name: str, number: Any, unit: str) -> None:
    if not isinstance(number, int | float) or not isfinite(number) or number < 0.0:
        raise MassError(f'{name} = {number!r} {unit} is refused: it must be a number >= 0')
