"""The masses of plates: exact for a bar, by counting small squares for any, and in every use."""

from dataclasses import replace
import json
from math import pi
from pathlib import Path

from klann_ros.datasheet.command import main as describe
from klann_ros.export import plates
from klann_ros.export.command import main
from klann_ros.export.plates import Plate
from klann_ros.export.weights import plate_mass
from klann_ros.robot import robot_from_file, robot_of
import mujoco
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
HOLE, WIDTH, THICKNESS, DENSITY = 4e-3, 20e-3, 3e-3, 1190.0
OPTIONS = ['--hole', '4', '--width', '20', '--thickness', '3', '--plate-density', '1190']


def plates_of(name: str) -> dict[str, Plate]:
    robot_plates = plates(robot_of(name), hole=HOLE, width=WIDTH)
    return {plate.name: plate for plate in robot_plates}


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


def test_the_masses_of_plates_are_in_every_use_of_the_file(tmp_path: Path) -> None:
    out, sheet, mjcf = (str(tmp_path / name) for name in ('leg.yaml', 'leg.json', 'leg.xml'))
    assert main(['jansen', '--weighed', out, *OPTIONS]) == 0
    expected = {}
    for plate in plates_of('jansen').values():
        expected[plate.name] = plate_mass(plate, THICKNESS, DENSITY).mass
    (leg,) = robot_from_file(out).legs
    assert leg.linkage == robot_of('jansen').legs[0].linkage
    assert leg.masses is not None
    for name, body in zip(leg.linkage.joint_names, leg.masses.bodies, strict=True):
        assert body.mass == pytest.approx(expected[name], rel=1e-12)
    assert describe([out, '--json', sheet]) == 0
    (described,) = json.loads(Path(sheet).read_text())['legs']
    assert described['mass_basis'] == 'bodies'
    assert described['mass'] == pytest.approx(leg.masses.total)
    assert main([out, '--mjcf', mjcf]) == 0
    model = mujoco.MjModel.from_xml_path(mjcf)
    assert mujoco.mj_getTotalmass(model) == pytest.approx(leg.masses.total, rel=1e-6)


def test_a_walker_and_its_motor_carry_the_masses_of_plates(tmp_path: Path) -> None:
    out, walker, sheet = (str(tmp_path / name) for name in ('leg.yaml', 'two.yaml', 'two.json'))
    assert main(['jansen', '--weighed', out, *OPTIONS]) == 0
    Path(walker).write_text('legs: [left, right]\nlinkage: leg.yaml\nfoot_mass: 0.05\n')
    motor = str(ROOT / 'config' / 'motor_example.yaml')
    assert describe([walker, '--motor', motor, '--speed', '1', '--json', sheet]) == 0
    plate_masses = robot_from_file(out).legs[0].masses
    assert plate_masses is not None
    content = json.loads(Path(sheet).read_text())
    (leg,) = content['legs']
    assert leg['mass'] == pytest.approx(plate_masses.total + 0.05)
    assert leg['mass_basis'] == 'bodies'
    robot = robot_from_file(walker)
    turn = robot.dynamics(robot.legs[0]).turn(1.0)
    (crank,) = content['cranks']
    assert crank['motor']['peak'] == pytest.approx(2.0 * turn.torque.max(), rel=1e-3)


def test_a_weighed_file_is_no_other_output(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    out = str(tmp_path / 'a.svg')
    assert main(['jansen', '--svg', out, '--weighed', out, *OPTIONS]) == 3
    assert '--svg and --weighed are the same file' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        (['jansen', '--weighed', 'a.yaml'], 'needs --plate-density'),
        (['jansen', '--weighed', 'a.yaml', *OPTIONS, '--scale', '2'], 'no --scale'),
        (['jansen', '--weighed', 'there.yaml', *OPTIONS], 'is there already'),
        (['sem104', '--weighed', 'a.yaml', *OPTIONS], "takes a linkage's file, such as klann"),
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
