"""Layers hold what another geometry library finds at many crank angles, and are the fewest."""

from collections.abc import Mapping, Sequence
from functools import cache
from itertools import permutations, product
import warnings
from xml.etree import ElementTree as ET

from klann_ros.export import assembly, Layers, layers, placed_legs, Plate, plates
from klann_ros.export.assembly import pins, spacers
from klann_ros.export.layers import Shaft
from klann_ros.export.travel import crank_angles
from klann_ros.kinematics import LinkageLeg
from klann_ros.robot import Robot, robot_of, RobotLeg
import pytest
from random_linkages import random_linkage
from sample_linkages import SHIPPED_ROBOTS
from shapely import box, LineString, Point, STRtree, union_all
from shapely.affinity import affine_transform

SVG = '{http://www.w3.org/2000/svg}'
STUBS = {
    'scotch_yoke': {('A', 'yoke')},
    'side_rod': {('D', 'rod1')},
    'watt_six_bar': {('O', 'R3')},
}
HOLE = 3.2e-3


@cache
def arranged(name: str) -> Layers:
    robot = robot_of(name)
    linkage = robot.legs[0].linkage
    return layers(linkage, plates(robot, hole=HOLE, width=max(3.0 * HOLE, 0.04 * linkage.size)))


@cache
def collisions(name: str) -> tuple[set[tuple[int, int]], set[tuple[int, int]]]:
    """Return the plates that overlap, and each shaft with a foreign plate, at any angle."""
    arrangement = arranged(name)
    leg = LinkageLeg(robot_of(name).legs[0].linkage)
    shapes = []
    for plate in arrangement.plates:
        links = [LineString([x_y(a), x_y(b)]).buffer(plate.width / 2.0) for a, b in plate.links]
        shapes.append(union_all(links))
    overlaps = set()
    entries = set()
    for alpha in crank_angles(leg.linkage, 36)[1:-1]:
        x_and_y = leg.closed_form(float(alpha)).points
        points = dict(zip(leg.linkage.structure.points, x_and_y @ (1.0, 1j), strict=True))
        frames = [plate_frame(plate, points) for plate in arrangement.plates]
        placed_shapes = []
        for shape, (origin, turn) in zip(shapes, frames, strict=True):
            matrix = [turn.real, -turn.imag, turn.imag, turn.real, origin.real, origin.imag]
            placed_shapes.append(affine_transform(shape, matrix))
        tree = STRtree(placed_shapes)
        overlaps |= {*map(tuple, tree.query(placed_shapes, predicate='intersects').T.tolist())}
        for k, shaft in enumerate(arrangement.shafts):
            origin, turn = frames[shaft.carrier]
            radius = shaft.radius(arrangement.plates[0].width)
            disc = Point(x_y(origin + shaft.at * turn)).buffer(radius)
            met_plates = {*tree.query(disc, predicate='intersects').tolist()}
            entries |= {(k, plate) for plate in met_plates - {*shaft.plates}}
    return {(i, j) for i, j in overlaps if i < j}, entries


def x_y(point: complex) -> tuple[float, float]:
    return point.real, point.imag


def plate_frame(plate: Plate, points: Mapping[str, complex]) -> tuple[complex, complex]:
    """Return origin and rotation of a plate, by the solved places of its first and last point."""
    if plate.body < 0:
        return 0j, 1 + 0j
    holes = {name: hole.at for hole in plate.holes for name in hole.points}
    first, *_, last = [*holes, *holes]
    turn = 1 + 0j
    if len(holes) > 1:
        turn = (points[last] - points[first]) / (holes[last] - holes[first])
    return points[first] - holes[first] * turn, turn


def is_between(layers_of_plates: Sequence[int], shaft: Shaft, plate: int) -> bool:
    """Return whether a plate lies between the outermost plates that a shaft joins."""
    joined = [layers_of_plates[joined_plate] for joined_plate in shaft.plates]
    return min(joined) <= layers_of_plates[plate] <= max(joined)


@pytest.mark.parametrize('name', SHIPPED_ROBOTS)
def test_over_a_turn_nothing_in_a_layer_collides(name: str) -> None:
    arrangement = arranged(name)
    overlaps, entries = collisions(name)
    assert overlaps
    for i, j in overlaps:
        assert arrangement.layer[i] != arrangement.layer[j]
    crossings = set()
    for k, plate in entries:
        shaft = arrangement.shafts[k]
        if is_between(arrangement.layer, shaft, plate):
            crossings.add((shaft.name, arrangement.plates[plate].name))
    assert crossings == STUBS.get(name, set())
    stubs = set()
    for shaft, crossing_plates in arrangement.stubs:
        stubs |= {(shaft.name, arrangement.plates[plate].name) for plate in crossing_plates}
    assert stubs == crossings


@pytest.mark.parametrize(
    'name', ['sem104', 'klann_lego', 'walker_six_bar', 'stephenson', 'quick_return', 'roberts']
)
def test_with_one_layer_less_something_collides(name: str) -> None:
    arrangement = arranged(name)
    overlaps, entries = collisions(name)
    for layer in product(range(arrangement.count - 1), repeat=len(arrangement.plates)):
        has_overlap = any(layer[i] == layer[j] for i, j in overlaps)
        assert has_overlap or any(
            is_between(layer, arrangement.shafts[k], plate) for k, plate in entries
        ), layer


def test_a_pin_that_no_arrangement_leaves_whole_is_a_stub() -> None:
    """Each arrangement of the six plates is tried."""
    arrangement = arranged('watt_six_bar')
    overlaps, entries = collisions('watt_six_bar')
    assert [shaft.name for shaft, _ in arrangement.stubs] == ['O']
    for layer in permutations(range(len(arrangement.plates))):
        assert any(is_between(layer, arrangement.shafts[k], plate) for k, plate in entries)
    assert overlaps


def test_pins_span_the_plates_they_join() -> None:
    arrangement = arranged('trotbot')
    pins_by_name = {pin.name: pin for pin in pins(arrangement, 3e-3, 0.5e-3)}
    # Plates in layers 1, 2 and 4, a spacer in 3: four thicknesses and three washers.
    j1 = pins_by_name['J1']
    assert (j1.low, j1.high, j1.spacers, j1.washers) == (1, 4, 1, 3)
    assert j1.grip == pytest.approx(13.5)
    assert j1.screw == 20
    spacer_counts = {f'spacer {pin.name}': pin.spacers for pin in pins_by_name.values()}
    for ring in spacers(arrangement):
        assert spacer_counts.pop(ring.name) == ring.count > 0
    assert not any(spacer_counts.values())


def sheet_of(name: str) -> ET.Element:
    return ET.fromstring(assembly([arranged(name)], thickness=3e-3, washer=0.0))  # noqa: S314


def test_the_title_of_a_layer_fits_its_panel() -> None:
    texts = sheet_of('strider').iter(f'{SVG}text')
    titles = [text for text in texts if text.text.startswith('Layer ')]
    assert max(len(title.text) for title in titles) > 45
    for title in titles:
        assert 0.6 * len(title.text) * float(title.get('font-size')) < 88


@pytest.mark.slow
@pytest.mark.parametrize('name', SHIPPED_ROBOTS)
def test_labels_of_a_layer_do_not_overlap(name: str) -> None:
    for panel in sheet_of(name).iter(f'{SVG}g'):
        boxes = []
        for text in panel.iter(f'{SVG}text'):
            x, y, size = (float(text.get(key)) for key in ('x', 'y', 'font-size'))
            boxes.append(box(x, y - size, x + 0.6 * size * len(text.text), y))
        assert boxes
        assert union_all(boxes).area == pytest.approx(sum(label.area for label in boxes))


def test_the_sheet_shows_each_layer_and_names_each_pin() -> None:
    texts = [text.text for text in sheet_of('sem104').iter(f'{SVG}text')]
    titles = ['Layer 0: ground, theta', 'Layer 1: alpha, beta, delta', 'Layer 2: gamma']
    assert [text for text in texts if text.startswith('Layer ')] == titles
    assert {shaft.name for shaft in arranged('sem104').shafts} == set('ABCDEFG')
    assert all(texts.count(name) > 1 for name in 'ABCDEFG')
    # The coupler passes over the axle of the crank, which cannot have a nut there.
    assert texts.count('upper flush') == 1


def test_angles_that_a_coupled_linkage_cannot_reach_give_no_warning() -> None:
    linkage = random_linkage(8, coupled=True)
    linkage = linkage.scaled(0.3 / linkage.size)
    with warnings.catch_warnings(action='error'):
        assert placed_legs(Robot('', (RobotLeg('', linkage),)))[0].stack.count > 1
