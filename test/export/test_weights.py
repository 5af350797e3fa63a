"""The masses of parts: exact for a bar, by squares and by meshes for any, and in every use."""

from dataclasses import replace
import json
from math import pi
from pathlib import Path

from klann_ros.datasheet.command import main as describe
from klann_ros.dynamics import BodyMass
from klann_ros.export import Part, part_settings, PartSizes, placed_legs, plates, Role
from klann_ros.export.command import main
from klann_ros.export.parts import prisms
from klann_ros.export.plates import Plate
from klann_ros.export.weights import Material, weighed_file
from klann_ros.kinematics import (
    FIXED,
    Linkage,
    LinkageLeg,
    schema_error,
    SHIPPED,
    shipped_linkage,
)
from klann_ros.robot import Robot, robot_from_file, robot_of, RobotLeg
from klann_ros.sanitize.units import UnitWarning
from klann_ros.sanitize.yaml_text import parse
import mujoco
import numpy as np
from point_files import point_file
import pytest
from shapely import LineString, Point, Polygon, unary_union

ROOT = Path(__file__).resolve().parents[2]
HOLE, WIDTH, THICKNESS, DENSITY = 4e-3, 20e-3, 3e-3, 1190.0
OPTIONS = ['--hole', '4', '--width', '20', '--thickness', '3', '--material', '1190']
PLA, INFILL, WALL = 1240.0, 0.3, 1e-3


def leg_parts(linkage: Linkage, sizes: PartSizes | None = None) -> tuple[Part, ...]:
    return placed_legs(Robot('', (RobotLeg('', linkage),)), sizes)[0].parts


def plates_of(name: str) -> dict[str, Plate]:
    robot_plates = plates(robot_of(name), hole=HOLE, width=WIDTH)
    return {plate.name: plate for plate in robot_plates}


def plate_mass(plate: Plate, thickness: float, density: float) -> BodyMass:
    part = Part(plate.name, Role.LINK, plate.body, tuple(prisms(plate, 0.0, thickness)))
    return part.mass(density)


def test_a_bar_is_a_rectangle_with_two_half_discs_and_two_holes() -> None:
    length, radius = 0.15, WIDTH / 2.0
    mass = plate_mass(plates_of('jansen')['m'], THICKNESS, DENSITY)
    ends = pi * radius**2
    area = length * WIDTH + ends - 2.0 * pi * HOLE**2 / 4.0
    assert mass.mass == pytest.approx(DENSITY * THICKNESS * area, rel=2e-5)
    assert mass.centre == pytest.approx(length / 2.0, rel=1e-9)
    # A half disc's centre is 4 r / (3 pi) from its straight side.
    lever = 4.0 * radius / (3.0 * pi)
    own = ends * radius**2 / 2.0 - ends * lever**2
    second = length * WIDTH * (length**2 + WIDTH**2) / 12.0
    second += own + ends * (length / 2.0 + lever) ** 2
    hole = pi * HOLE**2 / 4.0
    second -= 2.0 * hole * (HOLE**2 / 8.0 + (length / 2.0) ** 2)
    assert mass.inertia == pytest.approx(DENSITY * THICKNESS * second, rel=1e-4)


def distances(segment: tuple[complex, complex], points: np.ndarray) -> np.ndarray:
    """Return the distances of points from a segment."""
    start, end = segment
    along = (end - start) / abs(end - start) if end != start else 1.0
    inside = np.clip(((points - start) * np.conj(along)).real, 0.0, abs(end - start))
    return np.abs(points - start - inside * along)


@pytest.mark.parametrize(
    ('name', 'body'),
    [('jansen', 'b'), ('jansen', 'g'), ('klann', 'gamma'), ('quick_return', 'arm')],
)
def test_any_plate_is_its_material_square_by_square(name: str, body: str) -> None:
    plate = plates_of(name)[body]
    places = np.array([*plate.links]).ravel()
    step = 1e-3 if abs(places).max() > 0.4 else 5e-4
    x, y = (
        np.arange(part.min() - WIDTH + 0.37 * step, part.max() + WIDTH, step)
        for part in (places.real, places.imag)
    )
    squares = (x[:, None] + 1j * y).ravel()
    is_material = np.min([distances(link, squares) for link in plate.links], axis=0) <= WIDTH / 2
    for cut in (*plate.holes, *plate.slots):
        is_material &= distances(cut.line, squares) > cut.diameter / 2.0
    material = squares[is_material]
    area = len(material) * step**2
    mass = plate_mass(plate, THICKNESS, DENSITY)
    assert mass.mass == pytest.approx(DENSITY * THICKNESS * area, rel=1e-2)
    assert abs(mass.centre - material.mean()) < 3e-4
    second = float((abs(material - material.mean()) ** 2).mean()) * mass.mass
    assert mass.inertia == pytest.approx(second, rel=1e-2)


def test_a_scaled_density_or_thickness_scales_all() -> None:
    plate = plates_of('klann')['theta']
    mass = plate_mass(plate, THICKNESS, DENSITY)
    double = plate_mass(plate, 2.0 * THICKNESS, DENSITY)
    assert double == mass._replace(mass=2.0 * mass.mass, inertia=2.0 * mass.inertia)
    solid = plate_mass(replace(plate, holes=()), THICKNESS, DENSITY)
    hole = pi * HOLE**2 / 4.0 * THICKNESS * DENSITY
    assert solid.mass - mass.mass == pytest.approx(len(plate.holes) * hole, rel=1e-3)


def mesh_volume(plate: Plate, inset: float, height: float) -> float:
    """Return the volume of a plate without a margin along its edges, by other libraries."""
    width = plate.width / 2.0 - inset
    shape = unary_union([bar(link).buffer(width, quad_segs=256) for link in plate.links])
    for cut in (*plate.holes, *plate.slots):
        radius = (cut.diameter + PartSizes().clearance) / 2.0 + inset
        shape -= bar(cut.line).buffer(radius, quad_segs=256)
    assert isinstance(shape, Polygon)
    import trimesh

    return float(trimesh.creation.extrude_polygon(shape, height).volume)


def bar(link: tuple[complex, complex]) -> LineString | Point:
    """Return the centre line of a bar or a slot."""
    start, end = ((point.real, point.imag) for point in link)
    return LineString([start, end]) if start != end else Point(start)


@pytest.mark.slow
@pytest.mark.parametrize('name', ['klann', 'jansen', 'quick_return'])
def test_a_printed_leg_weighs_its_meshes_in_describe(name: str, tmp_path: Path) -> None:
    file, sheet = tmp_path / 'leg.yaml', tmp_path / 'leg.json'
    text = (SHIPPED / f'{name}.yaml').read_text().replace('density:', '# ')
    file.write_text(f'{text}\nparts: {{material: PLA, infill: {INFILL}, pins: steel}}\n')
    assert describe([str(file), '--json', str(sheet)]) == 0
    (leg,) = json.loads(sheet.read_text())['legs']
    sizes = PartSizes(hole=3.2e-3, thickness=THICKNESS)
    linkage = robot_of(name).legs[0].linkage
    width = sizes.link_width(linkage.size)
    expected = 0.0
    for plate in plates(robot_of(name), hole=sizes.hole, width=width):
        if plate.body != FIXED:
            core = mesh_volume(plate, WALL, THICKNESS - 2.0 * WALL)
            expected += PLA * (mesh_volume(plate, 0.0, THICKNESS) - (1.0 - INFILL) * core)
    for part in leg_parts(linkage, sizes):
        if part.body != FIXED and part.role is Role.SPACER:
            expected += Material('PLA', PLA, INFILL).mass(part).mass
        elif part.body != FIXED and part.role.is_hardware:
            expected += 7850.0 * part.volume
    assert leg['mass'] == pytest.approx(expected, rel=1e-2)
    assert leg['mass_origin'] == 'parts of PLA, 3 mm, infill 30 %, pins of steel, by export'


def test_a_seat_has_no_wall_inside_of_its_plate() -> None:
    sizes = PartSizes(width=WIDTH, thickness=4e-3, seat=(10e-3, 2.5e-3))
    (leg,) = placed_legs(robot_of('klann'), sizes)
    gamma = [plate.name for plate in leg.stack.plates].index('gamma')
    plate = leg.stack.plates[gamma]
    below = replace(
        plate, holes=tuple(replace(h, diameter=h.bore or h.diameter) for h in plate.holes)
    )
    # The clearance, which seats have not, is in the meshes.
    seats = [replace(h, diameter=h.diameter - sizes.clearance) for h in plate.holes if h.bore]
    plain = [h for h in plate.holes if not h.bore]
    above = replace(plate, holes=(*seats, *plain))
    volume = mesh_volume(below, 0.0, 1.5e-3) + mesh_volume(above, 0.0, 2.5e-3)
    core = mesh_volume(below, WALL, 1.5e-3 - WALL) + mesh_volume(above, WALL, 2.5e-3 - WALL)
    mass = Material('PLA', PLA, INFILL).mass(leg.parts[gamma]).mass
    assert mass == pytest.approx(PLA * (volume - (1.0 - INFILL) * core), rel=1e-3)


def test_an_infill_without_walls_is_a_factor() -> None:
    for part in leg_parts(robot_of('klann').legs[0].linkage):
        solid = part.mass(PLA)
        filled = Material('PLA', PLA, INFILL, wall=0.0).mass(part)
        assert filled.mass == pytest.approx(INFILL * solid.mass)
        assert filled.inertia == pytest.approx(INFILL * solid.inertia)
        assert Material('PLA', PLA, INFILL, wall=1.0).mass(part) == pytest.approx(solid)


@pytest.fixture(scope='module')
def weighed_leg(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp('weighed') / 'leg.yaml'
    assert main(['jansen', '--weighed', str(out), *OPTIONS]) == 0
    return out


def test_the_masses_of_parts_are_in_every_use_of_the_file(
    weighed_leg: Path, tmp_path: Path
) -> None:
    sheet, mjcf = (str(tmp_path / name) for name in ('leg.json', 'leg.xml'))
    sizes = PartSizes(hole=HOLE, width=WIDTH, thickness=THICKNESS)
    (leg,) = robot_from_file(weighed_leg).legs
    assert leg.linkage == robot_of('jansen').legs[0].linkage
    assert leg.masses is not None
    expected = dict.fromkeys(range(len(leg.masses.bodies)), 0.0)
    for part in leg_parts(leg.linkage, sizes):
        if part.body != FIXED:
            expected[part.body] += 1190.0 * part.volume
    assert [body.mass for body in leg.masses.bodies] == pytest.approx([*expected.values()])
    assert describe([str(weighed_leg), '--json', sheet]) == 0
    (described,) = json.loads(Path(sheet).read_text())['legs']
    assert described['mass_basis'] == 'bodies'
    assert described['mass'] == pytest.approx(leg.masses.total)
    assert main([str(weighed_leg), '--mjcf', mjcf]) == 0
    assert 'masses: parts of 1190 kg/m^3, 3 mm, by export' in Path(mjcf).read_text()
    model = mujoco.MjModel.from_xml_path(mjcf)
    assert mujoco.mj_getTotalmass(model) == pytest.approx(leg.masses.total, rel=1e-6)


def test_a_weighed_file_is_weighed_again_by_its_own_sizes(
    weighed_leg: Path, tmp_path: Path
) -> None:
    again = tmp_path / 'again.yaml'
    assert main([str(weighed_leg), '--weighed', str(again)]) == 0
    assert again.read_text() == weighed_leg.read_text()
    thick = tmp_path / 'thick.yaml'
    assert main([str(again), '--weighed', str(thick), '--thickness', '6', '--hole', 'Y=5']) == 0
    wide = tmp_path / 'wide.yaml'
    assert main([str(thick), '--weighed', str(wide), '--hole', 'W=4.5']) == 0
    assert parse(wide.read_text())['parts']['holes'] == {'Y': 0.5, 'W': 0.45}
    parts = parse(thick.read_text())['parts']
    assert parts['thickness'] == pytest.approx(0.6)
    assert parts['holes'] == {'Y': 0.5}
    assert parts['hole'] == parse(again.read_text())['parts']['hole']


def test_a_walker_and_its_motor_carry_the_masses_of_parts(
    weighed_leg: Path, tmp_path: Path
) -> None:
    walker, sheet = tmp_path / 'two.yaml', str(tmp_path / 'two.json')
    walker.write_text(f'legs: [left, right]\nlinkage: {weighed_leg}\nfoot_mass: 0.05\n')
    motor = str(ROOT / 'config' / 'motor_example.yaml')
    assert describe([str(walker), '--motor', motor, '--speed', '1', '--json', sheet]) == 0
    part_masses = robot_from_file(weighed_leg).legs[0].masses
    assert part_masses is not None
    content = json.loads(Path(sheet).read_text())
    (leg,) = content['legs']
    assert leg['mass'] == pytest.approx(part_masses.total + 0.05)
    robot = robot_from_file(walker)
    turn = robot.dynamics(robot.legs[0]).turn(1.0)
    (crank,) = content['cranks']
    assert crank['motor']['peak'] == pytest.approx(2.0 * turn.torque.max(), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    'file',
    [
        'sem104',
        'config/sem104.yaml',
        'config/sem104_built.yaml',
        'config/walker6_two_motors.yaml',
        'config/walker_jansen.yaml',
    ],
)
def test_every_robot_is_the_same_one_in_its_weighed_file(file: str, tmp_path: Path) -> None:
    path = file if file == 'sem104' else str(ROOT / file)
    robot = robot_of(path)
    out = tmp_path / Path(path).name
    out.write_text(weighed_file(path, placed_legs(robot), {'material': 'PLA'}))
    assert '\\n' not in out.read_text()
    weighed_robot = robot_from_file(out)
    assert weighed_robot.body == robot.body
    for leg, weighed in zip(robot.legs, weighed_robot.legs, strict=True):
        assert weighed.masses is not None
        assert weighed.masses.source == 'parts of PLA, 3 mm, by export'
        assert leg.masses is not None
        assert weighed.masses.foot_mass == leg.masses.foot_mass
        assert (weighed.mount, weighed.phase, weighed.direction) == (
            leg.mount,
            leg.phase,
            leg.direction,
        )
        assert weighed.linkage.bars == pytest.approx(leg.linkage.bars, abs=1e-9)
        assert weighed.linkage.assembly == leg.linkage.assembly


def test_legs_that_differ_have_each_their_own_masses(tmp_path: Path) -> None:
    walker, out = tmp_path / 'two.yaml', tmp_path / 'out.yaml'
    walker.write_text(
        '/**:\n ros__parameters:\n  legs: [left, right]\n  right: {l_gh: 0.5}\n  rate: 50.0\n'
    )
    legs = placed_legs(robot_of(str(walker)))
    out.write_text(weighed_file(str(walker), legs, {'material': 'PLA'}))
    left, right = robot_from_file(out).legs
    assert left.masses is not None
    assert right.masses is not None
    assert right.masses.total > left.masses.total
    assert parse(out.read_text())['/**']['ros__parameters']['rate'] == 50.0


def test_a_weighed_file_is_no_other_output(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    out = str(tmp_path / 'a.svg')
    assert main(['jansen', '--svg', out, '--weighed', out, *OPTIONS]) == 3
    assert '--svg and --weighed are the same file' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        (['jansen', '--weighed', 'a.yaml'], 'parts.material must be one of PLA'),
        (['jansen', '--weighed', 'a.yaml', '--material', 'pla'], 'did you mean PLA?'),
        (['jansen', '--weighed', 'a.yaml', *OPTIONS, '--scale', '2'], 'takes no --scale'),
        (['jansen', '--weighed', 'there.yaml', *OPTIONS], 'is there already'),
        (['jansen', '--weighed', 'a.yaml', '--material', 'PLA', '--hole', '4000'], 'hole'),
    ],
)
def test_what_cannot_be_weighed_is_one_line(
    arguments: list[str],
    reason: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path('there.yaml').write_text('name: mine\n')
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert reason in error
    assert error.count('\n') == 1
    assert not Path('a.yaml').exists()
    assert Path('there.yaml').read_text() == 'name: mine\n'


@pytest.mark.parametrize(
    ('parts', 'reason'),
    [
        ({'thickness': -3}, 'parts.thickness: -3 must be > 0'),
        ({'thickness': '3 mm'}, "parts.thickness: '3 mm' must be a number"),
        ({'infill': 30}, 'parts.infill: 30 must be <= 1'),
        ({'materail': 'PLA'}, 'did you mean material?'),
        ({'material': 'PLA!'}, "parts.material: 'PLA!' is no name"),
        ({'material': 1e9}, 'must be <= 30000'),
        ({'holes': {'a b': 3}}, "'a b' is no name"),
        ({'holes': 3}, 'parts.holes: 3 must be a mapping'),
        ('PLA', "parts: 'PLA' must be a mapping"),
    ],
)
def test_hostile_settings_of_parts_have_a_reason(parts: object, reason: str) -> None:
    content = parse((SHIPPED / 'klann.yaml').read_text())
    assert reason in schema_error({**content, 'parts': parts})


def test_a_size_in_the_wrong_unit_is_warned_of() -> None:
    text = (SHIPPED / 'klann.yaml').read_text().replace('length: mm', 'length: m')
    leg = replace(robot_of('klann').legs[0], description=f'{text}\nparts: {{thickness: 3}}\n')
    with pytest.warns(UnitWarning, match=r'parts.thickness = 3 is read as 3 m'):
        part_settings([leg], {}, 1.0)


def test_a_file_by_points_is_weighed_by_points(tmp_path: Path) -> None:
    by_points = tmp_path / 'points.yaml'
    pose = LinkageLeg(shipped_linkage('four_bar')).solve(1.0)
    by_points.write_text(point_file(pose))
    out = tmp_path / 'weighed.yaml'
    assert main([str(by_points), '--weighed', str(out), *OPTIONS]) == 0
    assert parse(out.read_text())['points'] == parse(by_points.read_text())['points']
    (leg,) = robot_from_file(out).legs
    expected_file = tmp_path / 'expected.yaml'
    assert main(['four_bar', '--weighed', str(expected_file), *OPTIONS]) == 0
    (expected,) = robot_from_file(expected_file).legs
    assert leg.masses is not None
    assert expected.masses is not None
    for body, expected_body in zip(leg.masses.bodies, expected.masses.bodies, strict=True):
        assert body == pytest.approx(expected_body, rel=1e-6)
