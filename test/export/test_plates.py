"""Plates fit the joints, lie apart, and are what SVG and DXF say."""

from collections.abc import Iterator, Sequence
from io import StringIO
from itertools import combinations
from math import pi
from pathlib import Path
import re
from typing import Any
from xml.etree import ElementTree as ET

from klann_ros.export import (
    Drawing,
    drawing,
    dxf,
    ExportError,
    PartSizes,
    placed_legs,
    Plate,
    plates,
    svg,
)
from klann_ros.export.outline import Corner, outlines
from klann_ros.export.plates import slot_conflict
from klann_ros.export.travel import crank_angles
from klann_ros.kinematics import Linkage, LinkageLeg
from klann_ros.kinematics.linkage.structure import Structure
from klann_ros.robot import Robot, robot_of
import numpy as np
import pytest
from sample_linkages import SHIPPED_ROBOTS
from shapely import box, LinearRing, LineString, Point, Polygon, polygonize, unary_union

ROOT = Path(__file__).resolve().parents[2]
HOLE, WIDTH = 2e-3, 8e-3
MICRON = 1e-3  # in mm


def drawn(robot: Robot) -> tuple[tuple[Plate, ...], Drawing]:
    robot_plates = plates(robot, hole=HOLE, width=WIDTH)
    return robot_plates, drawing(robot_plates)


@pytest.mark.parametrize('name', SHIPPED_ROBOTS)
def test_plates_are_apart_and_their_holes_as_far_apart_as_the_joints_of_the_leg(name: str) -> None:
    robot = robot_of(name)
    linkage = robot.legs[0].linkage
    robot_plates, sheet = drawn(robot)
    import ezdxf

    document = ezdxf.read(StringIO(dxf(sheet).decode()))
    assert not document.audit().errors
    assert document.header['$INSUNITS'] == ezdxf.units.MM
    cuts = document.modelspace().query('LWPOLYLINE[layer=="CUT"]')
    assert len(cuts) == len(robot_plates) + len(sheet.windows)
    circles = document.modelspace().query('CIRCLE[layer=="HOLES"]')
    assert len(circles) == sum(len(plate.holes) for plate in robot_plates)
    centres = iter([complex(*circle.dxf.center.vec2) for circle in circles])
    poses = list(joints_of_poses(linkage))
    checked_plates = 0
    for plate in robot_plates:
        points = {hole.name.split(',')[0]: next(centres) for hole in plate.holes}
        points.pop('', None)
        if len(points) < 2:
            continue
        checked_plates += 1
        on_sheet = np.array([*points.values()])
        for joints in poses:
            in_pose = np.array([joints[point] for point in points])
            # Turned and moved, but neither stretched nor mirrored.
            turn = (in_pose[1] - in_pose[0]) / (on_sheet[1] - on_sheet[0])
            turned_holes = turn / abs(turn) * (on_sheet - on_sheet[0])
            assert np.abs(turned_holes - (in_pose - in_pose[0])).max() < MICRON
    assert checked_plates >= (1 if linkage.structure.slides else len(robot_plates) - 1)
    check_holes(linkage.structure, {plate.name: plate for plate in robot_plates})
    check_places(sheet)


def joints_of_poses(linkage: Linkage) -> Iterator[dict[str, complex]]:
    """Yield the points of three poses by name [mm]."""
    leg = LinkageLeg(linkage)
    for alpha in crank_angles(linkage, 5)[1:4]:
        x_y = 1e3 * leg.closed_form(float(alpha)).points
        yield dict(zip(linkage.structure.points, x_y @ (1.0, 1j), strict=True))


def check_holes(structure: Structure, plates_by_name: dict[str, Plate]) -> None:
    """Find a hole at every point that joins bodies."""
    assert 'ground' in plates_by_name
    for body in structure.bodies:
        holes = ','.join(hole.name for hole in plates_by_name[body.angle].holes).split(',')
        assert {point for point in body.points if len(structure.owners[point]) > 1} <= {*holes}


def check_places(sheet: Drawing) -> None:
    """Find the plates within the sheet, and no two of them in one place."""
    boxes = [box(*polygon([outline]).bounds) for outline in sheet.outlines]
    paper = box(0.0, 0.0, sheet.size.real, sheet.size.imag)
    assert all(paper.contains_properly(plate_box) for plate_box in boxes)
    assert not any(box_a.intersects(box_b) for box_a, box_b in combinations(boxes, 2))


def x_y(points: Sequence[complex]) -> list[tuple[float, float]]:
    return [(point.real, point.imag) for point in points]


def sampled(outline: tuple, count: int = 24) -> list[tuple[float, float]]:
    """Return points on an outline, by what a bulge is defined as."""
    points = []
    for corner, following in zip(outline, [*outline[1:], outline[0]], strict=True):
        side = following.at - corner.at
        angle = 4 * np.arctan(corner.bulge)
        for share in np.linspace(0, 1, count, endpoint=False):
            if angle:
                middle = corner.at + side / 2 + 1j * side / 2 / np.tan(angle / 2)
                points.append(middle + (corner.at - middle) * np.exp(1j * share * angle))
            else:
                points.append(corner.at + share * side)
    return x_y(points)


def polygon(curves: Sequence[tuple]) -> Polygon:
    """Return the area within an outline and outside of its windows."""
    outline, *windows = map(sampled, curves)
    return Polygon(outline, windows)


@pytest.mark.parametrize('seed', range(12))
def test_outlines_are_those_of_another_geometry_library(seed: int) -> None:
    random = np.random.default_rng(seed)
    # Every third time on a grid, with links that overlap, touch and run on.
    step = 5.0 if seed % 3 == 0 else 1e-3
    joints = step * np.round(random.uniform(-30, 30, (6, 2)) / step) @ (1.0, 1j)
    links = [(joints[k], joints[random.integers(0, k)]) for k in range(1, 6)]
    links.append((joints[0], joints[3]))
    curves = outlines(links, 4.0)
    expected = unary_union([LineString(x_y(link)).buffer(4.0, quad_segs=32) for link in links])
    assert len(curves) == 1 + len(expected.interiors)
    assert polygon(curves).symmetric_difference(expected).area < 1e-3 * expected.area


def test_bodies_with_three_joints_are_links_of_the_stated_width() -> None:
    robot_plates, sheet = drawn(robot_of('jansen'))
    window_area = sum(polygon([window]).area for window in sheet.windows)
    for plate, outline in zip(robot_plates, sheet.outlines, strict=True):
        length = 1e3 * sum(abs(end - start) for start, end in plate.links)
        strip = 1e3 * WIDTH * length + pi * (500 * WIDTH) ** 2
        has_window = len(plate.links) > 2 and plate.name != 'ground'
        assert polygon([outline]).area - (window_area if has_window else 0.0) < strip


@pytest.mark.parametrize('name', ['sem104', 'quick_return'])
@pytest.mark.parametrize('kerf', [0.1e-3, 0.4e-3])
def test_plates_have_the_stated_sizes_after_the_kerf(name: str, kerf: float) -> None:
    robot_plates = plates(robot_of(name), hole=HOLE, width=WIDTH, holes={'A': 3e-3})
    exact = drawing(robot_plates)
    offset = drawing(robot_plates, kerf=kerf)
    for exact_outline, offset_outline in zip(exact.outlines, offset.outlines, strict=True):
        cut = polygon([offset_outline]).buffer(-500 * kerf, quad_segs=64)
        assert cut.area == pytest.approx(polygon([exact_outline]).area, rel=1e-3)
    radii = [circle.radius for circle in exact.circles]
    assert [circle.radius + 500 * kerf for circle in offset.circles] == pytest.approx(radii)
    assert {*radii} == {1.0, 1.5}


@pytest.mark.slow
@pytest.mark.parametrize('name', ['sem104', 'trotbot', 'quick_return', 'jansen', 'andrews'])
@pytest.mark.parametrize('width', [5e-3, 12e-3])
def test_no_label_crosses_a_cut_line(name: str, width: float) -> None:
    sheet = drawing(plates(robot_of(name), hole=HOLE, width=width), kerf=0.2e-3)
    lines = [LinearRing(sampled(cut)) for cut in (*sheet.outlines, *sheet.windows, *sheet.slots)]
    for circle in sheet.circles:
        lines.append(Point(*x_y([circle.at])).buffer(circle.radius).exterior)
    for text in sheet.texts:
        # Capitals of the fonts of browsers and cutters are no wider.
        size = complex((0.75 if ' ' in text.text else 1.2) * len(text.text), 1.0) * text.height
        (left, bottom), (right, top) = x_y([text.at, text.at + size])
        label = box(left, bottom, right, top)
        assert not any(label.intersects(line) for line in lines), text


@pytest.mark.parametrize('name', ['quick_return', 'scotch_yoke', 'slider_crank'])
def test_pins_stay_in_their_slots_all_the_way(name: str) -> None:
    robot = robot_of(name)
    linkage = robot.legs[0].linkage
    robot_plates = {plate.name: plate for plate in drawn(robot)[0]}
    slots = {slot.name: slot for plate in robot_plates.values() for slot in plate.slots}
    sliding = [body for body in linkage.structure.bodies if body.slides]
    assert {body.angle for body in sliding} == set(slots)
    poses = [LinkageLeg(linkage).closed_form(alpha) for alpha in np.linspace(0, 7, 40)]
    for body in sliding:
        slot = slots[body.angle]
        stroke = np.ptp([pose.joints[linkage.joint_names.index(body.angle)] for pose in poses])
        assert stroke - 1e-4 < abs(slot.end - slot.start) < stroke + 5 * WIDTH
        has_guides = any(not hole.name for hole in robot_plates[body.angle].holes)
        assert has_guides is bool(body.rigid)


def test_legs_that_are_alike_are_cut_once_with_their_number() -> None:
    robot_plates = plates(robot_of(str(ROOT / 'config' / 'walker6.yaml')), hole=HOLE, width=WIDTH)
    assert len(robot_plates) == 6
    assert {plate.count for plate in robot_plates} == {6}
    assert 'theta F G H x6' in {plate.title for plate in robot_plates}


def test_legs_that_differ_are_cut_each(tmp_path: Path) -> None:
    file = tmp_path / 'two.yaml'
    file.write_text('legs: [front, rear]\nrear: {l_gh: 0.5}\n')
    robot_plates = plates(robot_of(str(file)), hole=HOLE, width=WIDTH)
    assert len(robot_plates) == 12
    assert {plate.legs for plate in robot_plates} == {'front', 'rear'}


@pytest.mark.parametrize(
    ('hole', 'holes', 'reason'),
    [
        (6e-3, {}, 'K1: hole O and hole F are 7 mm apart, at least 7.5 mm are needed'),
        (5e-3, {'F': 8e-3}, 'at least 12 mm'),
        (5e-3, {'f': 4e-3}, 'hole of f: no such joint'),
    ],
)
def test_holes_without_material_between_them_are_refused(
    hole: float, holes: dict[str, float], reason: str
) -> None:
    assert plates(robot_of('andrews'), hole=5e-3, width=9e-3)
    with pytest.raises(ExportError, match=reason):
        plates(robot_of('andrews'), hole=hole, width=9e-3, holes=holes)


def test_a_slot_that_meets_an_axle_is_reported() -> None:
    conflicts = [*map(slot_conflict, drawn(robot_of('scotch_yoke'))[0])]
    expected = 'ground: the slot of yoke and hole A run into each other'
    assert list(filter(None, conflicts)) == [expected]


def test_scale_moves_the_holes_and_leaves_them_their_size() -> None:
    distances = []
    for scale in (1.0, 0.5):
        (leg,) = placed_legs(robot_of('patent'), PartSizes(hole=HOLE, width=WIDTH), scale)
        circles = drawing(leg.stack.plates).circles
        distances.append(abs(circles[-1].at - circles[-2].at))
        assert {circle.radius for circle in circles} == {1.0}
    assert distances[0] == pytest.approx(2 * distances[1])


def test_svg_and_dxf_agree() -> None:
    robot_plates, sheet = drawn(robot_of('quick_return'))
    root: Any = ET.fromstring(svg(sheet))  # noqa: S314 - our own
    space = '{http://www.w3.org/2000/svg}'
    assert root.get('width') == f'{sheet.size.real:.6f}mm'
    assert [group.get('id') for group in root] == ['CUT', 'HOLES', 'LABELS']
    centres = [(float(c.get('cx')), float(c.get('cy'))) for c in root.iter(f'{space}circle')]
    expected = [(c.at.real, sheet.size.imag - c.at.imag) for c in sheet.circles]
    np.testing.assert_allclose(centres, expected, atol=1e-6)
    paths = [path.get('d') for path in root[0]]
    assert len(paths) == len(robot_plates) + len(sheet.windows)
    # Arcs of the bars' ends, counter-clockwise as it is seen.
    radii = re.findall(r'A (\S+) (\S+) 0 0 0', ' '.join(paths))
    np.testing.assert_allclose(np.array(radii, float), 4.0, atol=1e-5)
    titles = {text.text for text in root.iter(f'{space}text')}
    assert {plate.title for plate in robot_plates} <= titles


def plate_area(plate: Plate, kerf: float) -> Polygon:
    """Return a plate after the cut, by another geometry library [mm]."""
    bars = [buffered(link, plate.width + kerf) for link in plate.links]
    cuts = [buffered(cut.line, cut.diameter - kerf) for cut in (*plate.holes, *plate.slots)]
    return unary_union(bars) - unary_union(cuts)


def buffered(line: Sequence[complex], width: float) -> Polygon:
    x_y_mm = x_y([1e3 * point for point in line])
    curve = Point(x_y_mm[0]) if line[0] == line[1] else LineString(x_y_mm)
    return curve.buffer(500 * width, quad_segs=32)


def edge(entity: Any) -> LineString:
    """Return a DXF entity as a line, its ends rounded to a picometre [mm]."""
    if entity.dxftype() == 'LINE':
        points = [entity.dxf.start, entity.dxf.end]
    else:
        points = entity.flattening(1e-4)
    return LineString([(round(point.x, 9), round(point.y, 9)) for point in points])


def filled_area(path: str) -> Polygon:
    """Return the area within an SVG path by the even-odd rule; curves are as SVG defines them."""
    area = Polygon()
    for subpath in path.split('M ')[1:]:
        corners: list[Corner] = []
        for command in re.findall('[^AL]+', subpath.replace('Z', '')):
            *arc, x, y = map(float, command.split())
            place = complex(x, -y)
            if arc:
                radius, _, _, is_long, is_clockwise = arc
                assert not is_long
                assert not is_clockwise
                half_angle = np.arcsin(min(abs(place - corners[-1].at) / 2 / radius, 1.0))
                corners[-1] = Corner(corners[-1].at, float(np.tan(half_angle / 2)))
            corners.append(Corner(place))
        assert corners[0].at == corners[-1].at
        area ^= Polygon(sampled(tuple(corners[:-1]), 96))
    return area


@pytest.mark.parametrize(
    ('name', 'kerf'),
    [('jansen', 0.2e-3), ('trotbot', 0.0), ('quick_return', 0.1e-3)],
)
def test_filled_paths_and_entities_enclose_the_plates_without_their_holes(
    name: str, kerf: float
) -> None:
    robot_plates = plates(robot_of(name), hole=HOLE, width=WIDTH)
    sheet = drawing(robot_plates, kerf=kerf)
    expected = [plate_area(plate, kerf) for plate in robot_plates]
    root: Any = ET.fromstring(svg(sheet, filled=True))  # noqa: S314 - our own
    assert root[0].get('fill-rule') == 'evenodd'
    filled = [filled_area(path.get('d')) for path in root[0]]
    import ezdxf

    document = ezdxf.read(StringIO(dxf(sheet, exploded=True).decode()))
    edges = [edge(entity) for entity in document.modelspace().query('LINE ARC CIRCLE')]
    enclosed = [area for area in polygonize(edges).geoms if area.interiors]
    assert not document.modelspace().query('LWPOLYLINE')
    for areas in (filled, enclosed):
        assert len(areas) == len(expected)
        for area, exact in zip(sorted(areas, key=size), sorted(expected, key=size), strict=True):
            assert area.area == pytest.approx(exact.area, rel=1e-3)
            assert len(area.interiors) == len(exact.interiors)


def size(area: Polygon) -> float:
    return float(area.area)
