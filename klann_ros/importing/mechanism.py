"""A mechanism as joints and links, as other programs describe it, and its linkage file."""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import floor, log10
import re
from typing import Any, NamedTuple
from unicodedata import normalize

from klann_ros.kinematics import GROUND
from klann_ros.sanitize.text import did_you_mean, listed

PIN, SLIDER, PIN_IN_SLOT = 'R', 'P', 'RP'
MAX_JOINTS, MAX_LINKS, MAX_NAME_LENGTH = 200, 60, 50
# Words that name the ground, or that YAML reads as no text.
RESERVED_NAMES = {GROUND, 'y', 'n', 'yes', 'no', 'on', 'off', 'true', 'false', 'null'}
# Maximum distances, as parts of the size, of points in one place, and of a point from a line.
SAME_PLACE, LINE_TOLERANCE = 1e-7, 1e-12


class MechanismError(ValueError):
    """A text that holds no mechanism, or a mechanism that is no linkage with one crank."""


@dataclass(frozen=True)
class Joint:
    """A joint of links, or a point of one link, in the pose of its text."""

    name: str
    position: complex
    # The first link of a slider, and of a pin in a slot, has the line.
    links: tuple[str, ...]
    kind: str = PIN
    # The direction of the line, a unit vector.
    direction: complex = 1 + 0j
    # The links that a motor at the joint turns.
    driven: tuple[str, ...] = ()
    is_traced: bool = False

    @property
    def pinned(self) -> tuple[str, ...]:
        """Return the links that have the joint as a point."""
        return self.links if self.kind == PIN else self.links[1:]

    def renamed(self, names: Mapping[str, str]) -> 'Joint':
        """Return the joint with other names of links; a slider on a single link is a point."""
        links = tuple(dict.fromkeys(names.get(link, link) for link in self.links))
        driven = tuple(names.get(link, link) for link in self.driven)
        kind = PIN if len(links) == 1 else self.kind
        return replace(self, links=links, driven=driven, kind=kind)


class Mechanism(NamedTuple):
    """The joints in a text, its form, and its unit of length [mm]."""

    joints: Sequence[Joint]
    form: str
    unit: float = 1.0


def linkage_content(mechanism: Mechanism, crank: str, foot: str, unit: float) -> dict[str, Any]:
    """
    Return the content of a linkage file, by points in mm.

    Crank and foot, where they are not empty, and the unit [mm], where it is not 0, replace those
    of the text. A MechanismError says why it is no linkage with one crank on the ground.
    """
    links: dict[str, None] = {}
    for joint in mechanism.joints[:MAX_JOINTS]:
        links |= dict.fromkeys(joint.links)
    if not 0 < len(mechanism.joints) <= MAX_JOINTS or len(links) > MAX_LINKS:
        raise MechanismError(f'1 to {MAX_JOINTS} joints of at most {MAX_LINKS} links are read')
    names = valid_names([joint.name for joint in mechanism.joints], 'P')
    link_names = valid_names(links, 'link')
    joints = []
    for joint in mechanism.joints:
        position = (unit or mechanism.unit) * joint.position
        placed = replace(joint, name=names[joint.name], position=position)
        joints.append(placed.renamed(link_names))
    joints = _merge_rigid_links(joints)
    pivot, crank = _pivot_and_crank(joints, link_names.get(crank, crank))
    return _Builder(joints, pivot, crank).content(names.get(foot, foot))


def valid_names(names: Iterable[str], prefix: str) -> dict[str, str]:
    """Return a distinct name that a linkage file takes for each of some names."""
    valid = {GROUND: GROUND}
    for name in names:
        letters = normalize('NFKD', name[:MAX_NAME_LENGTH]).encode('ascii', 'ignore').decode()
        stem = re.sub('[^A-Za-z0-9]+', '_', letters).strip('_')
        stem = stem if stem[:1].isalpha() else f'{prefix}{stem}'
        if name in valid and name != GROUND:
            raise MechanismError(f'the joint {listed([name])} is there twice')
        valid.setdefault(name, _new_name(stem, {*RESERVED_NAMES, *valid.values()}))
    return valid


def _new_name(stem: str, taken: Container[str]) -> str:
    """Return a name that is not taken, nor is in small letters."""
    name = stem
    number = 1
    while name in taken or name.lower() in taken:
        number += 1
        name = f'{stem}_{number}'
    return name


def _merge_rigid_links(joints: list[Joint]) -> list[Joint]:
    """Return joints with one link in the place of links that share two pins."""
    pins: dict[str, set[complex]] = {GROUND: set()}
    for joint in joints:
        for link in joint.pinned:
            pins.setdefault(link, set()).add(joint.position)
    for kept, dropped in combinations(pins, 2):
        if len(pins[kept] & pins[dropped]) > 1:
            return _merge_rigid_links([joint.renamed({dropped: kept}) for joint in joints])
    return joints


def _pivot_and_crank(joints: Sequence[Joint], crank: str) -> tuple[Joint, str]:
    pivots: dict[str, Joint] = {}
    motors = []
    for joint in joints:
        motors += [(link, joint) for link in joint.driven if link != GROUND]
        for link in joint.pinned if GROUND in joint.pinned else ():
            pivots.setdefault(link, joint)
    pivots.pop(GROUND, None)
    if not pivots:
        raise MechanismError('no link is joined to one that is called ground')
    if motors and not crank:
        places = listed(f'{link} at {joint.name}' for link, joint in motors)
        if len(motors) > 1:
            raise MechanismError(f'it has several motors, a linkage has one (--crank): {places}')
        crank, pivot = motors[0]
        if pivots.get(crank) is not pivot:
            raise MechanismError(f'a motor must turn a link about the ground, not {places}')
    crank = crank or next(iter(pivots))
    if crank not in pivots:
        hint = f'there are {listed(pivots)}{did_you_mean(crank, pivots)}'
        raise MechanismError(f'{listed([crank])} is no link that turns about the ground: {hint}')
    return pivots[crank], crank


class _Builder:
    """Builds the content of a linkage file from joints whose names are valid."""

    def __init__(self, joints: Sequence[Joint], pivot: Joint, crank: str) -> None:
        self._joints = joints
        self._crank = crank
        self._positions = {joint.name: joint.position for joint in joints}
        self._size = max(abs(joint.position - pivot.position) for joint in joints)
        if not self._size > 0.0:
            raise MechanismError('all joints are at one place')
        self._points: dict[str, list[str]] = {GROUND: [], crank: [pivot.name]}
        self._slides: dict[str, dict[str, str]] = {}
        for joint in joints:
            # A slider's point may be another joint of its link.
            for link in joint.pinned if joint.kind != SLIDER else ():
                if joint.name not in self._points.setdefault(link, []):
                    self._points[link].append(joint.name)
        # Lines on the ground come first: nothing else can carry them.
        for joint in sorted(joints, key=lambda joint: GROUND not in joint.links):
            if joint.kind != PIN:
                self._add_slide(joint)
        for link in [*self._points]:
            # A link with one point is that point.
            if len(self._points[link]) < 2 and link not in {GROUND, crank, *self._slides}:
                del self._points[link]

    def content(self, foot: str) -> dict[str, Any]:
        """Return the content of the file, with a foot or the most likely one."""
        ground = self._points.pop(GROUND)
        foot = self._foot(foot, ground)
        links: dict[str, Any] = {**self._points}
        used = {foot}.union(*self._points.values())
        for link, slide in self._slides.items():
            used.add(slide['from'])
            # The point that slides is the first.
            points = sorted(self._points[link], key=slide['to'].__ne__)
            links[link] = {'slides': slide, 'points': points}
        places = {}
        for name, place in self._positions.items():
            if name in used:
                places[name] = [float(f'{xy:.15g}') for xy in (place.real, place.imag)]
        pivots = [point for point in ground if point in used]
        named = {'ground': pivots, 'crank': self._crank, 'foot': foot}
        return {'points': places, **named, 'links': links}

    def _foot(self, foot: str, ground: Sequence[str]) -> str:
        """Return the foot, by default a traced point, or a point of one link, off the crank."""
        ranks = {}
        for joint in self._joints:
            links = [link for link in self._points if joint.name in self._points[link]]
            if links and joint.name not in ground:
                ranks[joint.name] = (self._crank not in links, joint.is_traced, len(links) == 1)
        foot = foot or max(reversed(ranks), key=lambda name: ranks[name], default='the crank')
        if foot not in ranks:
            hint = f'{listed(ranks)}{did_you_mean(foot, ranks)}'
            raise MechanismError(f'{listed([foot])} is no point that moves, of: {hint}')
        return foot

    def _add_slide(self, joint: Joint) -> None:
        """Add a link that slides: of a pin in a slot a block, which has no other point."""
        carrier, slider, *further = joint.links
        if joint.kind == PIN_IN_SLOT:
            slider = _new_name(f'block_{joint.name}', self._points)
            self._points[slider] = [joint.name]
        taken = {GROUND, self._crank, *self._slides}
        if slider in taken:
            carrier, slider = slider, carrier
        if slider in taken or (further and joint.kind == SLIDER):
            raise MechanismError(f'{listed(joint.links)} slide in more than one way')
        points = self._points.setdefault(slider, [])
        tolerance = SAME_PLACE * self._size
        for name in points:
            if abs(self._positions[name] - joint.position) <= tolerance:
                break
        else:
            name = joint.name
            if slider not in joint.pinned:
                name = _new_name(f'{joint.name}_slide', self._positions)
            self._positions[name] = joint.position
            points.append(name)
        start = self._line_point(carrier, joint)
        self._slides[slider] = {'along': carrier, 'from': start, 'to': name}

    def _line_point(self, link: str, joint: Joint) -> str:
        """Return a point of a link on the line through a joint, made where none is far."""
        points = self._points.setdefault(link, [])
        for name in points:
            way = (self._positions[name] - joint.position) * joint.direction.conjugate()
            is_on_line = abs(way.imag) <= LINE_TOLERANCE * self._size
            if is_on_line and abs(way.real) > 0.1 * self._size:
                return name
        name = _new_name(f'{joint.name}_line', self._positions)
        length = 10.0 ** floor(log10(self._size))
        self._positions[name] = joint.position - length * joint.direction
        points.append(name)
        return name
