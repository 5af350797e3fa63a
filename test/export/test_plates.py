"""Plates fit the joints, lie apart, and are what SVG and DXF say."""

from io import StringIO
from itertools import combinations
from math import pi
from pathlib import Path
import re
from typing import Any
from xml.etree import ElementTree as ET

import ezdxf
from klann_ros.export import Drawing, drawing, dxf, ExportError, Plate, plates, svg
from klann_ros.export.outline import outlines
from klann_ros.export.plates import slot_conflict
from klann_ros.export.travel import crank_angles
from klann_ros.kinematics import LinkageLeg, shipped_linkages
from klann_ros.kinematics.linkage.structure import Structure
from klann_ros.robot import Robot, robot_of
import numpy as np
import pytest
from shapely import box as box_of, LinearRing, LineString, Point, Polygon, unary_union

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ['sem104', 'patent', *shipped_linkages()]
HOLE, WIDTH = 2e-3, 8e-3
MICRON = 1e-3  # in mm
DXF_CIRCLES = 'CIRCLE[layer=="HOLES"]'


def drawn(robot: Robot, **options: float) -> tuple[tuple[Plate, ...], Drawing]:
    robot_plates = plates(robot, hole=HOLE, width=WIDTH, **options)
    return robot_plates, drawing(robot_plates)


@pytest.mark.parametrize('name', SHIPPED)
def test_plates_are_apart_and_their_holes_as_far_apart_as_the_joints_of_the_leg(name: str) -> None:
    robot = robot_of(name)
    leg = LinkageLeg(robot.legs[0].linkage)
    made, sheet = drawn(robot)
    document = ezdxf.read(text_stream(dxf(sheet)))
    assert not document.audit().errors
    assert document.header['$INSUNITS'] == ezdxf.units.MM
    circles = [complex(c.dxf.center.x, c.dxf.center.y) for c in found(document, DXF_CIRCLES)]
    assert len(circles) == sum(len(plate.holes) for plate in made)
    assert len(found(document, 'LWPOLYLINE[layer=="CUT"]')) == len(made) + len(sheet.windows)
    rest, seen = iter(circles), 0
    for plate in made:
        own = [(hole.name.split(',')[0], next(rest)) for hole in plate.holes]
        own = [pair for pair in own if pair[0]]
        if len(own) < 2:
            continue
        seen += 1
        for pose in poses(leg):
            there = np.array([pose[name] for name, _ in own])
            here = np.array([at for _, at in own])
            # Turned and moved, but neither stretched nor mirrored.
            turn = (there[1] - there[0]) / (here[1] - here[0])
            assert np.abs(turn / abs(turn) * (here - here[0]) - (there - there[0])).max() < MICRON
    assert seen >= (1 if robot.legs[0].linkage.structure.slides else len(made) - 1)
    check_holes(robot.legs[0].linkage.structure, {plate.name: plate for plate in made})
    check_places(sheet)


def check_holes(structure: Structure, made: dict[str, Plate]) -> None:
    """Find a hole at every point that joins bodies."""
    assert 'ground' in made
    for body in structure.bodies:
        names = {n for hole in made[body.angle].holes for n in hole.name.split(',')}
        assert {p for p in body.points if len(structure.owners[p]) > 1} <= names


def check_places(sheet: Drawing) -> None:
    """Find the plates within the sheet, and no two of them in one place."""
    boxes = [box(outline) for outline in sheet.outlines]
    for low, high in boxes:
        assert min(low) > 0
        assert high[0] < sheet.size.real
        assert high[1] < sheet.size.imag
    for (low, high), (other_low, other_high) in combinations(boxes, 2):
        assert any(high[k] < other_low[k] or other_high[k] < low[k] for k in (0, 1))


def found(document: Any, query: str) -> list:
    return list(document.modelspace().query(query))


def poses(leg: LinkageLeg) -> list[dict[str, complex]]:
    """Return the points of some poses by name [mm]."""
    angles = crank_angles(leg.linkage, 5)[1:4]
    assert len(angles) == 3
    names = leg.linkage.structure.points
    return [
        dict(zip(names, (1e3 * complex(x, y) for x, y in pose.points), strict=True))
        for pose in (leg.closed_form(float(alpha)) for alpha in angles)
    ]


def box(outline: tuple) -> tuple[tuple[float, float], tuple[float, float]]:
    x, y = zip(*[(at.real, at.imag) for at in sampled(outline)], strict=True)
    return (min(x), min(y)), (max(x), max(y))


def sampled(outline: tuple, count: int = 24) -> list[complex]:
    """Return points on an outline, by what a bulge is defined as."""
    found = []
    for corner, following in zip(outline, [*outline[1:], outline[0]], strict=True):
        way = following.at - corner.at
        angle = 4 * np.arctan(corner.bulge)
        for part in np.linspace(0, 1, count, endpoint=False):
            if not angle:
                found.append(corner.at + part * way)
                continue
            middle = corner.at + way / 2 + 1j * way / 2 / np.tan(angle / 2)
            found.append(middle + (corner.at - middle) * np.exp(1j * part * angle))
    return found


@pytest.mark.parametrize('seed', range(12))
def test_outlines_are_those_of_another_geometry_library(seed: int) -> None:
    random = np.random.default_rng(seed)
    # Every third time on a grid, with links that overlap, touch and run on.
    step = 5.0 if seed % 3 == 0 else 1e-3
    places = [complex(*at) for at in step * np.round(random.uniform(-30, 30, (6, 2)) / step)]
    links = [(places[k], places[random.integers(0, k)]) for k in range(1, 6)]
    links.append((places[0], places[3]))
    made = outlines(links, 4.0)
    expected = united(links, 4.0)
    assert len(made) == 1 + len(expected.interiors)
    assert covered(made).symmetric_difference(expected).area < 1e-3 * expected.area


def united(links: list, radius: float) -> Any:
    lines = [LineString([(at.real, at.imag) for at in link]) for link in links]
    return unary_union([line.buffer(radius, quad_segs=32) for line in lines])


def covered(made: tuple) -> Any:
    outer, *windows = ([(at.real, at.imag) for at in sampled(outline)] for outline in made)
    return Polygon(outer, windows)


def test_bodies_with_three_joints_are_links_of_the_stated_width() -> None:
    made, sheet = drawn(robot_of('jansen'))
    area = {
        plate.name: covered((outline,)).area
        for plate, outline in zip(made, sheet.outlines, strict=True)
    }
    windows = sum(abs(covered((window,)).area) for window in sheet.windows)
    for plate in made:
        length = 1e3 * sum(abs(b - a) for a, b in plate.links)
        strip = 1e3 * WIDTH * length + pi * (500 * WIDTH) ** 2
        filled = windows if len(plate.links) > 2 and plate.name != 'ground' else 0.0
        assert area[plate.name] - filled < strip


@pytest.mark.parametrize('kerf', [0.1e-3, 0.4e-3])
def test_plates_have_the_stated_sizes_after_the_kerf(kerf: float) -> None:
    for name in ('sem104', 'quick_return'):
        robot_plates = plates(robot_of(name), hole=HOLE, width=WIDTH, holes={'A': 3e-3})
        exact, offset = drawing(robot_plates), drawing(robot_plates, kerf=kerf)
        for one, other in zip(exact.outlines, offset.outlines, strict=True):
            cut = covered((other,)).buffer(-500 * kerf, quad_segs=64)
            assert cut.area == pytest.approx(covered((one,)).area, rel=1e-3)
        sizes = [(a.radius, b.radius + 500 * kerf) for a, b in holes_of(exact, offset)]
        assert sizes == [(a, pytest.approx(a)) for a, _ in sizes]
        assert {a for a, _ in sizes} == {1.0, 1.5}


def holes_of(one: Drawing, other: Drawing) -> list:
    return list(zip(one.circles, other.circles, strict=True))


@pytest.mark.parametrize('name', ['sem104', 'trotbot', 'quick_return', 'jansen', 'andrews'])
@pytest.mark.parametrize('width', [5e-3, 12e-3])
def test_no_label_crosses_a_cut_line(name: str, width: float) -> None:
    sheet = drawing(plates(robot_of(name), hole=HOLE, width=width), kerf=0.2e-3)
    cuts = [*sheet.outlines, *sheet.windows, *sheet.slots]
    lines = [LinearRing([(at.real, at.imag) for at in sampled(cut)]) for cut in cuts]
    lines += [Point(c.at.real, c.at.imag).buffer(c.radius).exterior for c in sheet.circles]
    for text in sheet.texts:
        # Capitals of the fonts of browsers and cutters are no wider.
        size = complex((0.75 if ' ' in text.text else 1.2) * len(text.text), 1.0) * text.height
        end = text.at + size
        label = box_of(text.at.real, text.at.imag, end.real, end.imag)
        assert not any(label.intersects(line) for line in lines), text


@pytest.mark.parametrize('name', ['quick_return', 'scotch_yoke', 'slider_crank'])
def test_pins_stay_in_their_slots_all_the_way(name: str) -> None:
    robot = robot_of(name)
    linkage = robot.legs[0].linkage
    made = {plate.name: plate for plate in drawn(robot)[0]}
    slots = {slot.name: slot for plate in made.values() for slot in plate.slots}
    sliding = [body for body in linkage.structure.bodies if body.slides]
    assert {body.angle for body in sliding} == set(slots)
    leg = LinkageLeg(linkage)
    for body in sliding:
        slot, j = slots[body.angle], linkage.joint_names.index(body.angle)
        x = [leg.closed_form(a).joints[j] for a in np.linspace(0, 7, 40)]
        stroke = max(x) - min(x)
        assert stroke - 1e-4 < abs(slot.end - slot.start) < stroke + 5 * WIDTH
        guides = [hole for hole in made[body.angle].holes if not hole.name]
        assert bool(guides) is bool(body.rigid)


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


def test_holes_without_material_between_them_are_refused() -> None:
    robot = robot_of('andrews')
    assert plates(robot, hole=5e-3, width=9e-3)
    reason = 'K1: hole O and hole F are 7 mm apart, at least 7.5 mm are needed'
    with pytest.raises(ExportError, match=reason):
        plates(robot, hole=6e-3, width=9e-3)
    with pytest.raises(ExportError, match='at least 12 mm'):
        plates(robot, hole=5e-3, width=9e-3, holes={'F': 8e-3})
    with pytest.raises(ExportError, match='hole of f: no such joint'):
        plates(robot, hole=5e-3, width=9e-3, holes={'f': 4e-3})


def test_a_slot_that_meets_an_axle_is_reported() -> None:
    found = [
        slot_conflict(plate) for plate in plates(robot_of('scotch_yoke'), hole=HOLE, width=WIDTH)
    ]
    assert list(filter(None, found)) == ['ground: the slot of yoke and hole A run into each other']


def test_scale_moves_the_holes_and_leaves_them_their_size() -> None:
    (_, one), (_, half) = (drawn(robot_of('patent'), scale=scale) for scale in (1.0, 0.5))
    apart = [abs(sheet.circles[-1].at - sheet.circles[-2].at) for sheet in (one, half)]
    assert apart[0] == pytest.approx(2 * apart[1])
    assert {circle.radius for circle in (*one.circles, *half.circles)} == {1.0}


def test_svg_and_dxf_agree() -> None:
    made, sheet = drawn(robot_of('quick_return'))
    root = ET.fromstring(svg(sheet))  # noqa: S314 - our own
    space = '{http://www.w3.org/2000/svg}'
    assert root.get('width') == f'{sheet.size.real:.6f}mm'
    assert [group.get('id') for group in root] == ['CUT', 'HOLES', 'LABELS']
    circles = [(float(c.get('cx')), float(c.get('cy'))) for c in root.iter(f'{space}circle')]
    expected = [(c.at.real, sheet.size.imag - c.at.imag) for c in sheet.circles]
    np.testing.assert_allclose(circles, expected, atol=1e-6)
    paths = [path.get('d') for path in root[0]]
    assert len(paths) == len(made) + len(sheet.windows)
    # Arcs of the bars' ends, counter-clockwise as it is seen.
    arcs = [re.findall(r'A (\S+) (\S+) 0 0 0', path) for path in paths]
    assert all(
        float(r) == pytest.approx(4.0, abs=1e-5) for arc in arcs for pair in arc for r in pair
    )
    titles = [text.text for text in root.iter(f'{space}text')]
    assert {plate.title for plate in made} <= set(titles)


def text_stream(content: bytes) -> StringIO:
    return StringIO(content.decode())
