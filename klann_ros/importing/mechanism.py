"""A mechanism as joints and links, as other programs describe it, and its linkage file."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
import re
from typing import Any
from unicodedata import normalize

from klann_ros.kinematics import GROUND
from klann_ros.sanitize.text import did_you_mean, listed

PIN, SLIDER, PIN_IN_SLOT = 'R', 'P', 'RP'
MAX_JOINTS, MAX_LINKS, MAX_NAME_LENGTH = 200, 60, 40
# The points of each link, and their positions [mm].
Points = dict[str, dict[str, complex]]


class MechanismError(ValueError):
    """A text that holds no mechanism, or a mechanism that is no linkage with one crank."""


@dataclass(frozen=True)
class Joint:
    """A joint of links, or a point of one link, in the pose of its text."""

    name: str
    position: complex  # [mm]
    # The first link of a slider, and of a pin in a slot, has the line.
    links: tuple[str, ...]
    kind: str = PIN
    # The direction of the line, a unit vector.
    direction: complex = 1 + 0j
    is_driven: bool = False
    is_traced: bool = False

    @property
    def pinned(self) -> tuple[str, ...]:
        """Return the links that are pinned together at the joint; a slider has no pin."""
        return {PIN: self.links, PIN_IN_SLOT: self.links[1:]}.get(self.kind, ())

    def renamed(self, names: Mapping[str, str]) -> 'Joint':
        """Return the joint with other names of links; a slider on a single link is a point."""
        links = tuple(dict.fromkeys(names.get(link, link) for link in self.links))
        return replace(self, links=links, kind=PIN if len(links) == 1 else self.kind)


def linkage_content(joints: Sequence[Joint], crank: str = '', foot: str = '') -> dict[str, Any]:
    """
    Return the content of a linkage file, by points in mm; a MechanismError says why there is none.

    The crank and the foot are chosen by their names in the text, or as the text has them.
    """
    links = dict.fromkeys(link for joint in joints[:MAX_JOINTS] for link in joint.links)
    if not 0 < len(joints) <= MAX_JOINTS or len(links) > MAX_LINKS:
        raise MechanismError(f'1 to {MAX_JOINTS} joints of at most {MAX_LINKS} links are read')
    names = _valid_names([joint.name for joint in joints], 'P')
    link_names = _valid_names(links, 'link')
    joints = [replace(joint, name=names[joint.name]).renamed(link_names) for joint in joints]
    joints = _merge_rigid_links(joints)
    pivot, crank = _pivot_and_crank(joints, link_names.get(crank, crank))
    points: Points = {GROUND: {}, crank: {pivot.name: pivot.position}}
    for joint in joints:
        for link in joint.pinned:
            points.setdefault(link, {})[joint.name] = joint.position
    slides = _slides(joints, crank, points)
    # Another link with one point is a point.
    needed = {GROUND, crank, *slides, *(slide['along'] for slide in slides.values())}
    points = {link: points[link] for link in points if link in needed or len(points[link]) > 1}
    bodies: dict[str, Any] = {}
    places = {name: place for members in points.values() for name, place in members.items()}
    for link, members in points.items():
        if link in slides:
            bodies[link] = {'slides': slides[link], 'points': [*members]}
        elif link != GROUND:
            bodies[link] = [*members]
    order = dict.fromkeys([*(joint.name for joint in joints), *places])
    coordinates = {n: [places[n].real, places[n].imag] for n in order if n in places}
    if foot and names.get(foot, foot) not in places:
        hint = f'there are {listed(coordinates)}{did_you_mean(foot, places)}'
        raise MechanismError(f'the foot {listed([foot])} is no joint: {hint}')
    foot = names.get(foot, foot) or _likely_foot(joints, points, crank)
    named_parts = {'ground': [*points[GROUND]], 'crank': crank, 'foot': foot}
    return {'points': coordinates, **named_parts, 'links': bodies}


def _valid_names(names: Iterable[str], prefix: str) -> dict[str, str]:
    """Return a distinct name that a linkage file takes, and has no __, for each of some names."""
    valid = {GROUND: GROUND}
    for name in names:
        if name in valid and name != GROUND:
            raise MechanismError(f'the joint {listed([name])} is there twice')
        letters = normalize('NFKD', name[:MAX_NAME_LENGTH]).encode('ascii', 'ignore').decode()
        stem = re.sub('[^A-Za-z0-9]+', '_', letters).strip('_')
        stem = stem if stem[:1].isalpha() else f'{prefix}{stem}'
        number = 1
        while stem in valid.values():
            number += 1
            stem = f'{stem.rstrip("0123456789")}{number}'
        valid.setdefault(name, stem)
    return valid


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
    """Return the crank, by default the first link at the motor or on the ground, and its pivot."""
    pivots: dict[str, Joint] = {}
    for joint in joints:
        for link in joint.pinned if GROUND in joint.pinned else ():
            pivots.setdefault(link, joint)
    pivots.pop(GROUND, None)
    if not pivots:
        raise MechanismError(f'no link has a pin on the link that is called {GROUND}')
    motors = [joint for joint in joints if joint.is_driven]
    driven = [link for joint in motors for link in joint.links if link != GROUND]
    if len(driven) > 1 and not crank:
        motor = 'it has several motors' if len(motors) > 1 else 'its motor is between links'
        raise MechanismError(f'{motor}, on {listed(driven)}: --crank may be {listed(pivots)}')
    crank = crank or next(iter(driven or pivots), '')
    if crank not in pivots or (driven == [crank] and pivots[crank] is not motors[0]):
        links = f'there are {listed(pivots)}{did_you_mean(crank, pivots)}'
        hint = f'its motor is at {motors[0].name}' if crank in pivots else links
        raise MechanismError(f'no link {listed([crank])} is turned about the ground: {hint}')
    return pivots[crank], crank


def _likely_foot(joints: Sequence[Joint], points: Points, crank: str) -> str:
    """Return the name of a traced point, or of a point of one link, and not of the crank."""
    ranks = {'nothing': (False, False, False)}
    for joint in joints:
        links = [link for link, members in points.items() if joint.name in members]
        if links and GROUND not in links:
            ranks[joint.name] = (crank not in links, joint.is_traced, len(links) == 1)
    return max(reversed(ranks), key=lambda name: ranks[name])


def _slides(joints: Sequence[Joint], crank: str, points: Points) -> dict[str, dict[str, str]]:
    """Return the line of each link that slides, and add its points to those of the links."""
    slides: dict[str, dict[str, str]] = {}
    # Lines on the ground come first: nothing else can carry them.
    for joint in sorted(joints, key=lambda joint: GROUND not in joint.links):
        if joint.kind == PIN:
            continue
        carrier, slider, *further = joint.links
        guided = {GROUND, crank, *slides}
        if joint.kind == PIN_IN_SLOT:
            # A block, which has no other point.
            slider = f'block__{joint.name}'
        elif slider in guided:
            carrier, slider = slider, carrier
        if slider in guided or (further and joint.kind == SLIDER):
            raise MechanismError(f'{listed(joint.links)} slide in more than one way')
        members = points.setdefault(slider, {})
        name = joint.name if slider != joint.links[0] else f'{joint.name}__slide'
        # The point that slides is the first; another joint of the link may be in its place.
        same = [n for n, place in members.items() if abs(place - joint.position) < 1e-9]
        name = next(iter(same), name)
        points[slider] = {name: joint.position, **members}
        # Farther than any joint, so that it is in no other's place.
        length = 1.1 * max(abs(other.position - joint.position) for other in joints)
        line = f'{joint.name}__line'
        points.setdefault(carrier, {})[line] = joint.position - length * joint.direction
        slides[slider] = {'along': carrier, 'from': line, 'to': name}
    return slides
