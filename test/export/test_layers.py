"""Layers hold what another geometry library finds at many crank angles, and are the fewest."""

from functools import cache
from itertools import permutations, product
from xml.etree import ElementTree as ET

from klann_ros.export import assembly, Layers, layers, plates
from klann_ros.export.assembly import pins, spacers
from klann_ros.export.travel import crank_angles
from klann_ros.kinematics import LinkageLeg, shipped_linkages
from klann_ros.robot import robot_of
import numpy as np
import pytest
from shapely import box, LineString, Point, STRtree, transform, union_all
from shapely.geometry.base import BaseGeometry

SHIPPED = ['sem104', 'patent', *shipped_linkages()]
STUBS = {'scotch_yoke': ('A', 'yoke'), 'watt_six_bar': ('O', 'R3')}
ANGLES, HOLE = 24, 3.2e-3


def width_of(name: str) -> float:
    return max(3.0 * HOLE, 0.04 * robot_of(name).legs[0].linkage.size)


@cache
def arranged(name: str) -> Layers:
    robot = robot_of(name)
    made = plates(robot, hole=HOLE, width=width_of(name))
    return layers(robot.legs[0].linkage, made)


@cache
def met(name: str) -> tuple[set[tuple[int, int]], set[tuple[int, int]]]:
    """Return the plates that overlap, and the plates that a foreign pin enters, at any angle."""
    of = arranged(name)
    leg = LinkageLeg(robot_of(name).legs[0].linkage)
    flat = [
        union_all([LineString([xy(a), xy(b)]).buffer(plate.width / 2.0) for a, b in plate.links])
        for plate in of.plates
    ]
    both, entered = set(), set()
    for alpha in crank_angles(leg.linkage, ANGLES)[1:-1]:
        pose = leg.closed_form(float(alpha))
        names = leg.linkage.structure.points
        points = {name: complex(*at) for name, at in zip(names, pose.points, strict=True)}
        placed = [put(shape, *frame(of, p, points)) for p, shape in enumerate(flat)]
        tree = STRtree(placed)
        pairs = tree.query(placed, predicate='intersects').T.tolist()
        both |= {(i, j) for i, j in pairs if i < j}
        for k, shaft in enumerate(of.shafts):
            origin, turn = frame(of, shaft.carrier, points)
            disc = Point(xy(origin + shaft.at * turn)).buffer(shaft.radius(of.plates[0].width))
            entered |= {
                (k, int(p))
                for p in tree.query(disc, predicate='intersects')
                if p not in shaft.plates
            }
    return both, entered


def xy(at: complex) -> tuple[float, float]:
    return at.real, at.imag


def frame(of: Layers, p: int, points: dict) -> tuple[complex, complex]:
    """Return where a plate is: by where two of its points are solved to be."""
    named = {name: hole.at for hole in of.plates[p].holes for name in hole.name.split(',') if name}
    if of.plates[p].body < 0:
        return 0j, 1 + 0j
    first, *others = named
    turn = 1 + 0j
    for other in others:
        turn = (points[other] - points[first]) / (named[other] - named[first])
    return points[first] - named[first] * turn, turn


def put(shape: BaseGeometry, origin: complex, turn: complex) -> BaseGeometry:
    def moved(at: np.ndarray) -> np.ndarray:
        there = origin + (at[:, 0] + 1j * at[:, 1]) * turn
        return np.column_stack([there.real, there.imag])

    return transform(shape, moved)


@pytest.mark.parametrize('name', SHIPPED)
def test_over_a_turn_nothing_in_a_layer_collides(name: str) -> None:
    of = arranged(name)
    both, entered = met(name)
    assert both
    assert not [pair for pair in both if of.layer[pair[0]] == of.layer[pair[1]]]
    through = {
        (of.shafts[k].name, of.plates[p].name)
        for k, p in entered
        if of.span(of.shafts[k])[0] <= of.layer[p] <= of.span(of.shafts[k])[1]
    }
    assert through == ({STUBS[name]} if name in STUBS else set())
    assert {(s.name, of.plates[p].name) for s, crossing in of.stubs for p in crossing} == through


@pytest.mark.parametrize(
    'name', ['sem104', 'klann_lego', 'walker_six_bar', 'stephenson', 'quick_return', 'roberts']
)
def test_with_one_layer_less_something_collides(name: str) -> None:
    of = arranged(name)
    both, entered = met(name)
    owners = [shaft.plates for shaft in of.shafts]
    for layer in product(range(of.count - 1), repeat=len(of.plates)):
        if any(layer[i] == layer[j] for i, j in both):
            continue
        spans = [[layer[p] for p in own] for own in owners]
        assert any(min(spans[k]) <= layer[p] <= max(spans[k]) for k, p in entered), layer


def test_a_pin_that_no_arrangement_leaves_whole_is_a_stub() -> None:
    """Each arrangement of the six plates is tried."""
    of = arranged('watt_six_bar')
    both, entered = met('watt_six_bar')
    assert [shaft.name for shaft, _ in of.stubs] == ['O']
    for layer in permutations(range(len(of.plates))):
        spans = [[layer[p] for p in shaft.plates] for shaft in of.shafts]
        assert any(min(spans[k]) < layer[p] < max(spans[k]) for k, p in entered)
    assert both


def test_pins_span_the_plates_they_join() -> None:
    of = arranged('trotbot')
    found = {pin.name: pin for pin in pins(of, 3e-3, 0.5e-3)}
    # Plates in layers 1, 2 and 4, a spacer in 3: four thicknesses and three washers.
    j1 = found['J1']
    assert (j1.low, j1.high, j1.spacers, j1.washers) == (1, 4, 1, 3)
    assert j1.grip == pytest.approx(13.5)
    assert j1.screw == 20
    rings = {ring.name: ring.count for ring in spacers(of)}
    assert rings == {f'spacer {name}': pin.spacers for name, pin in found.items() if pin.spacers}


def test_the_title_of_a_layer_fits_its_panel() -> None:
    root = ET.fromstring(assembly([arranged('strider')], thickness=3e-3, washer=0.0))  # noqa: S314
    texts = [*root.iter('{http://www.w3.org/2000/svg}text')]
    titles = [text for text in texts if text.text.startswith('Layer ')]
    assert max(len(title.text) for title in titles) > 45
    assert all(0.6 * len(one.text) * float(one.get('font-size')) < 88 for one in titles)


@pytest.mark.parametrize('name', SHIPPED)
def test_labels_of_a_layer_do_not_overlap(name: str) -> None:
    root = ET.fromstring(assembly([arranged(name)], thickness=3e-3, washer=0.0))  # noqa: S314
    for panel in root.iter('{http://www.w3.org/2000/svg}g'):
        boxes = []
        for text in panel.iter('{http://www.w3.org/2000/svg}text'):
            x, y, size = (float(text.get(key)) for key in ('x', 'y', 'font-size'))
            boxes.append(box(x, y - size, x + 0.6 * size * len(text.text), y))
        assert boxes
        assert union_all(boxes).area == pytest.approx(sum(one.area for one in boxes))


def test_the_sheet_shows_each_layer_and_names_each_pin() -> None:
    of = arranged('sem104')
    root = ET.fromstring(assembly([of], thickness=3e-3, washer=0.0))  # noqa: S314 - our own
    texts = [text.text for text in root.iter('{http://www.w3.org/2000/svg}text')]
    assert [text for text in texts if text.startswith('Layer ')] == [
        'Layer 0: ground, theta',
        'Layer 1: alpha, beta, delta',
        'Layer 2: gamma',
    ]
    assert {shaft.name for shaft in of.shafts} == set('ABCDEFG')
    assert all(texts.count(name) > 1 for name in 'ABCDEFG')
    # The coupler passes over the axle of the crank, which cannot have a nut there.
    assert texts.count('upper flush') == 1
