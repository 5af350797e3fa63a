"""Solids for a printer: closed, of the computed volume, with true holes, free of each other."""

from dataclasses import replace
from functools import cache
from io import BytesIO
from itertools import combinations
from pathlib import Path
import re
import sys
from typing import Any

from klann_ros.export import Part, PartSizes, placed_legs, PlacedLeg
from klann_ros.export.command import main
from klann_ros.export.parts import distinct_parts
from klann_ros.export.solids import glb, printed_parts, solid, stl_files, three_mf
from klann_ros.kinematics import SHIPPED
from klann_ros.robot import robot_from_file, robot_of
from manifold3d import Manifold, Mesh, OpType
import numpy as np
import pytest

CONFIG = Path(__file__).resolve().parents[2] / 'config'
LINKAGES = ['klann', 'jansen', 'stephenson', 'slider_crank', 'quick_return', 'watt_six_bar']
CLEARANCE = 0.3e-3
SIZES = PartSizes(clearance=CLEARANCE)


@cache
def leg_of(name: str) -> PlacedLeg:
    return placed_legs(robot_of(name), SIZES)[0]


def load(file: BytesIO | Path, file_type: str | None = None) -> Any:
    # At the head of a file it costs every worker a second while it collects the tests.
    import trimesh

    return trimesh.load(file, file_type=file_type)


@cache
def mesh_of(part: Part) -> Any:
    return solid(part)


@pytest.mark.parametrize('name', LINKAGES)
def test_every_part_is_closed_and_has_the_volume_in_closed_form(name: str) -> None:
    for part in leg_of(name).parts:
        mesh = mesh_of(part)
        assert mesh.is_watertight
        assert mesh.body_count == 1
        assert mesh.volume == pytest.approx(1e9 * part.volume, rel=5e-4), part.name


@pytest.mark.parametrize('name', LINKAGES)
def test_holes_are_as_wide_as_asked_with_their_clearance(name: str) -> None:
    leg = leg_of(name)
    for plate, part in zip(leg.stack.plates, leg.parts, strict=False):
        vertices = mesh_of(part).vertices
        plane = vertices[:, 0] + 1j * vertices[:, 1]
        for hole in plate.holes:
            distances = 2.0 * abs(plane - 1e3 * hole.at)
            rim = distances[distances < 1e3 * hole.diameter + 1.0]
            assert rim == pytest.approx(1e3 * (hole.diameter + CLEARANCE), abs=0.01)


@pytest.mark.parametrize('name', ['klann', 'slider_crank'])
def test_parts_keep_their_clearance_over_a_turn(name: str) -> None:
    leg = leg_of(name)
    joined = {}
    for shaft in leg.stack.shafts:
        joined[shaft.name] = {leg.stack.plates[p].name for p in shaft.plates} | {shaft.name}
    meshes = [solid(part, VIEW_TOLERANCE) for part in leg.parts]
    for sample in range(0, len(leg.stack.motion.angles), 600):
        solids = []
        for part, mesh in zip(leg.parts, meshes, strict=True):
            placed = mesh.copy().apply_transform(leg.pose(part.body, sample) * MM_POSE)
            shape = Mesh(np.float32(placed.vertices), np.uint32(placed.faces))
            name_or_pin = part.name.partition(' ')[2] or part.name
            solids.append((name_or_pin, heights(part), Manifold(shape)))
        for (name_a, heights_a, solid_a), (name_b, heights_b, solid_b) in combinations(solids, 2):
            if name_b in joined.get(name_a, ()) or name_a in joined.get(name_b, ()):
                assert (solid_a ^ solid_b).volume() < 1e-3
            elif heights_a[0] < heights_b[1] - 1e-9 and heights_b[0] < heights_a[1] - 1e-9:
                assert solid_a.min_gap(solid_b, 0.5) > 0.45, (name_a, name_b)


# A pose in metres for vertices in millimetres.
MM_POSE = np.array([[1.0, 1.0, 1.0, 1e3]] * 3 + [[1.0] * 4])
VIEW_TOLERANCE = 5e-5


def heights(part: Part) -> tuple[float, float]:
    return min(prism.low for prism in part.prisms), max(prism.high for prism in part.prisms)


def test_printed_parts_lie_flat_with_the_larger_face_down() -> None:
    meshes = printed_parts(leg_of('klann').parts)
    assert sum(count for _, count in meshes.values()) == len(leg_of('klann').parts)
    for mesh, _ in meshes.values():
        assert mesh.bounds[0] == pytest.approx(0.0, abs=1e-9)
        assert mesh.extents[0] >= mesh.extents[1] - 0.01
        faces = mesh.area_faces * (mesh.face_normals[:, 2] * [[-1.0], [1.0]] > 0.99)
        low = faces[0][mesh.triangles_center[:, 2] < 1e-6].sum()
        high = faces[1][mesh.triangles_center[:, 2] > mesh.extents[2] - 1e-6].sum()
        assert low >= high - 1e-6


def test_seats_are_cut_in_the_plates_that_turn_on_a_pin() -> None:
    sizes = PartSizes(width=15e-3, thickness=4e-3, clearance=CLEARANCE)
    seats = {'seat': (10e-3, 2.5e-3), 'seats': {'G': (7e-3, 4e-3)}}
    robot = robot_of('klann')
    (plain,) = placed_legs(robot, sizes, 0.25)
    (leg,) = placed_legs(robot, replace(sizes, **seats), 0.25)
    blind = np.pi / 4.0 * (10.0**2 - 3.5**2) * 2.5
    through = np.pi / 4.0 * (7.0**2 - 3.5**2) * 4.0
    # The pins of D and E are fixed to the ground, that of B to the crank, which turns in A, and
    # that of C to beta, where its end is flush.
    cut_volumes = {'ground': blind, 'gamma': 2.0 * blind, 'beta': blind}
    cut_volumes |= {'delta': blind, 'theta': blind + through}
    for without, part in zip(plain.parts, leg.parts, strict=True):
        cut = cut_volumes.get(part.name, 0.0)
        assert 1e9 * (without.volume - part.volume) == pytest.approx(cut, rel=1e-4), part.name
        if not cut:
            continue
        mesh = mesh_of(part)
        assert mesh.is_watertight
        assert mesh.body_count == 1
        assert mesh.volume == pytest.approx(1e9 * part.volume, rel=5e-4)
        laid = next(iter(printed_parts([part]).values()))[0]
        faces = laid.area_faces * (laid.face_normals[:, 2] > 0.99)
        # The floors of blind seats look up.
        is_floor = abs(laid.triangles_center[:, 2] - 1.5) < 1e-6
        floors = np.pi / 4.0 * (10.0**2 - 3.5**2) * (2 if part.name == 'gamma' else 1)
        assert faces[is_floor].sum() == pytest.approx(floors, rel=1e-3)


@pytest.mark.slow
def test_a_walker_is_printed_leg_by_leg_on_beds_without_overlap() -> None:
    robot = robot_from_file(str(CONFIG / 'walker4.yaml'))
    legs = placed_legs(robot, SIZES, 0.2)
    meshes = printed_parts(distinct_parts(legs), 240 + 140j)
    beds = three_mf(meshes, 240 + 140j)
    assert beds == three_mf(meshes, 240 + 140j)
    assert len(beds) > 1
    part_count = 0
    for bed in beds:
        scene = load(BytesIO(bed), file_type='3mf')
        assert scene.units == 'millimeter'
        boxes = []
        for node in scene.graph.nodes_geometry:
            pose, name = scene.graph[node]
            low, high = scene.geometry[name].bounds[:, :2] + pose[:2, 3]
            assert low.min() >= 9.99
            assert (high <= (230.01, 130.01)).all()
            boxes.append((low, high))
        for (low_a, high_a), (low_b, high_b) in combinations(boxes, 2):
            assert ((low_b > high_a + 3.99) | (low_a > high_b + 3.99)).any()
        part_count += len(boxes)
    assert part_count == sum(len(leg.parts) for leg in legs)
    assembled = load(BytesIO(glb(legs)), file_type='glb')
    assert len(assembled.graph.nodes_geometry) == sum(len(leg.parts) for leg in legs)
    # y is up, and z to the right: the mounts are at 50 mm, and three layers with heads outside.
    assert abs(assembled.bounds[:, 2]) == pytest.approx([0.06271, 0.06271], abs=1e-6)


@pytest.mark.slow
def test_legs_of_a_plane_that_would_collide_stand_beside_each_other() -> None:
    legs = placed_legs(robot_from_file(str(CONFIG / 'walker_jansen.yaml')), SIZES, 0.3)
    left = [leg for leg in legs if 'left' in leg.leg.name]
    assert [round(1e3 * abs(leg.offset), 3) for leg in left] == [0.0, 4.0, 24.5, 28.5]
    solids = []
    for leg in (left[0], left[2]):
        sample = leg.stack.motion.nearest(float(leg.leg.crank_angles(0.4)))
        shapes = []
        for part in leg.parts:
            mesh = solid(part, 4.0 * VIEW_TOLERANCE)
            mesh.apply_transform(leg.pose(part.body, sample) * MM_POSE)
            shapes.append(Manifold(Mesh(np.float32(mesh.vertices), np.uint32(mesh.faces))))
        solids.append(Manifold.batch_boolean(shapes, OpType.Add))
    assert (solids[0] ^ solids[1]).volume() < 1e-3


def test_walls_and_beams_hold_the_legs_of_a_walker() -> None:
    legs = placed_legs(robot_from_file(str(CONFIG / 'walker4.yaml')), SIZES, 0.3)
    frame = [part for part in distinct_parts(legs) if part.name in {'wall', 'beam'}]
    assert [part.name for part in frame] == ['wall', 'beam', 'beam', 'beam', 'wall']
    # The mounts are 150 mm apart, and each wall is two layers of 3.5 mm further in.
    (beam,) = frame[1].prisms
    assert 1e3 * (beam.high - beam.low) == pytest.approx(150.0 - 4.0 * 3.5)
    # The pivots of two legs, A of both in one line, and the holes of three beams.
    assert len(frame[0].prisms[0].cuts) == 2 * 3 + 3
    laid, count = printed_parts(distinct_parts(legs))['frame_beam_x3']
    assert count == 3
    assert laid.extents == pytest.approx([136.0, 9.6, 9.6])
    # A long screw holds the ground to its wall.
    (axle,) = [part for part in legs[0].parts if part.name == 'pin D']
    assert min(prism.low for prism in axle.prisms) < -2.0 * 3.5e-3


def test_the_pins_and_walls_of_both_sides_do_not_cross_the_middle() -> None:
    robot = robot_from_file(str(CONFIG / 'walker4.yaml'))
    narrow_legs = []
    for leg in robot.legs:
        x, y, z = leg.mount.xyz
        narrow_legs.append(replace(leg, mount=replace(leg.mount, xyz=(x, y / 100.0, z))))
    heights = []
    for leg in placed_legs(replace(robot, legs=tuple(narrow_legs)), SIZES, 0.3):
        y = leg.leg.mount.xyz[1] + leg.leg.mount.rotation[1, 2] * leg.offset
        out = leg.leg.mount.rotation[1, 2] * leg.direction
        for part in leg.parts:
            if part.name != 'beam':
                heights += [out * y + prism.low for prism in part.prisms]
    assert 0.0 <= min(heights) < 1e-3


def test_files_have_plain_names_with_their_number(tmp_path: Path) -> None:
    parts = leg_of('chebyshev').parts
    hostile = [replace(parts[0], name='../\u00e9 /x'), replace(parts[1], name='../\u00e8 /x')]
    assert [*stl_files(printed_parts(hostile))] == ['frame_x_x1.stl', 'crank_x_x1.stl']
    folder = tmp_path / 'parts'
    assert main(['chebyshev', '--stl', str(folder)]) == 0
    assert {path.suffix for path in folder.iterdir()} == {'.stl'}
    rocker = load(folder / 'link_rocker_x1.stl')
    assert rocker.is_watertight
    assert rocker.extents[2] == pytest.approx(3.0)


def test_each_bed_is_a_file_and_a_larger_part_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / 'klann.3mf'
    assert main(['klann', '--scale', '0.2', '--3mf', str(out), '--bed', '180x90']) == 0
    names = ['klann.3mf', 'klann_2.3mf', 'klann_3.3mf']
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    assert 'larger than the bed' not in capsys.readouterr().err
    assert main(['jansen', '--3mf', str(tmp_path / 'jansen.3mf')]) == 0
    assert 'larger than the bed' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('options', 'reason'),
    [
        ('--glb klann_2.3mf', '--glb and --3mf 2 are the same file'),
        ('--stl klann_2.3mf', '--stl and --3mf 2 are the same file'),
        ('--stl klann.3mf', '--3mf and --stl are the same file'),
        ('--stl a --ros2-control a', 'are the same file'),
        ('--stl a --loops-urdf a', 'are the same file'),
        ('--stl no/parts', 'there is no folder no'),
        ('--hole 0.0032', 'holes of 0.0032 mm'),
        ('--thickness 0.003', 'a thickness of 0.003 mm'),
    ],
)
def test_parts_that_cannot_be_written_leave_no_file(
    options: str,
    reason: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    command = ['klann', '--scale', '0.2', '--3mf', 'klann.3mf', '--bed', '180x90']
    assert main([*command, *options.split()]) in {2, 3}
    assert reason in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]


@pytest.mark.slow
def test_the_sheet_of_a_framed_walker_counts_the_parts_of_its_longer_pins(tmp_path: Path) -> None:
    walker = str(CONFIG / 'walker4.yaml')
    sheet = tmp_path / 'sheet.svg'
    assert main([walker, '--scale', '0.25', '--assembly', str(sheet)]) == 0
    lines = re.findall(
        r'wall, pin (\w): (\d) spacers?, (\d) washers?, a grip of ([\d.]+) mm', sheet.read_text()
    )
    assert [line[0] for line in lines] == ['A', 'D', 'E']
    names = [part.name for part in placed_legs(robot_from_file(walker), scale=0.25)[1].parts]
    for pin, spacer_count, washer_count, grip in lines:
        assert names.count(f'spacer {pin}') == int(spacer_count) > 0
        assert names.count(f'washer {pin}') == int(washer_count)
        plates = 1 + int(washer_count)
        assert float(grip) == pytest.approx(3.0 * plates + 0.5 * (plates - 1))
    plain = tmp_path / 'plain.svg'
    assert main(['klann', '--scale', '0.25', '--assembly', str(plain)]) == 0
    assert 'printed wall' not in plain.read_text()


@pytest.mark.slow
def test_frames_of_one_kind_and_several_sizes_have_names_of_their_own() -> None:
    legs = placed_legs(robot_from_file(str(CONFIG / 'walker6.yaml')), SIZES, 0.2)
    meshes = printed_parts(distinct_parts(legs))
    assert {'frame_beam_x3', 'frame_beam_2_x6'} <= {*meshes}
    # The items of a 3MF are named by the stem and a number.
    assert len({name.rpartition('_')[0] for name in meshes}) == len(meshes)
    assert sum(count for _, count in meshes.values()) == sum(len(leg.parts) for leg in legs)


def test_without_the_extra_a_line_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'manifold3d', None)
    assert main(['klann', '--scale', '0.2', '--glb', '/dev/null']) == 3


def test_pins_of_another_material_are_bought_and_not_printed(tmp_path: Path) -> None:
    file = tmp_path / 'leg.yaml'
    linkage = (SHIPPED / 'klann.yaml').read_text().replace('density: 1 ', '# ')
    file.write_text(linkage + 'parts: {material: PLA, pins: steel}\n')
    assert main([str(file), '--scale', '0.25', '--stl', str(tmp_path / 'parts')]) == 0
    uses = {path.name.partition('_')[0] for path in (tmp_path / 'parts').iterdir()}
    assert uses == {'frame', 'crank', 'link', 'spacer'}
