"""What the command `export` writes, refuses, and leaves alone."""

from pathlib import Path
import sys
from xml.etree import ElementTree as ET

from klann_ros.export.command import main
import mujoco
import pytest

ROOT = Path(__file__).resolve().parents[2]
WALKER = str(ROOT / 'config' / 'walker6.yaml')


def test_all_formats_are_written_at_once(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    files = {name: tmp_path / f'leg.{name}' for name in ('mjcf', 'urdf', 'svg', 'dxf')}
    options = ['--cad', *(f'--{name}={file}' for name, file in files.items())]
    assert main(['sem104', '--bar-density', '0.4', *options]) == 0
    assert {*tmp_path.iterdir()} == {*files.values()}
    groups = ET.parse(files['svg']).getroot()  # noqa: S314 - our own
    assert [group.get('id') for group in groups] == ['PLATES', 'LABELS']
    assert ET.parse(files['urdf']).getroot().tag == 'robot'  # noqa: S314
    import ezdxf

    document = ezdxf.readfile(files['dxf'])
    assert not document.audit().errors
    assert document.modelspace().query('ARC')
    model = mujoco.MjModel.from_xml_path(str(files['mjcf']))
    assert model.actuator('crank').id == 0
    out, error = capsys.readouterr()
    assert (out.count('written: '), error) == (4, '')


def test_an_explicit_density_wins_over_that_of_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    masses = []
    for options in ([], ['--bar-density', '0.25']):
        mjcf = str(tmp_path / 'leg.xml')
        assert main(['strider', '--mjcf', mjcf, *options]) == 0
        masses.append(mujoco.mj_getTotalmass(mujoco.MjModel.from_xml_path(mjcf)))
    assert masses[1] == pytest.approx(0.25 * masses[0], rel=1e-6)
    out = capsys.readouterr().out
    assert 'masses: assumed, not measured: rods of 1 kg/m' in out
    assert 'masses: as rods of the given 0.25 kg/m' in out


def test_a_walker_is_written_with_all_its_legs(tmp_path: Path) -> None:
    mjcf, urdf = str(tmp_path / 'walker.xml'), tmp_path / 'walker.urdf'
    assert main([WALKER, '--mjcf', mjcf, '--urdf', str(urdf)]) == 0
    model = mujoco.MjModel.from_xml_path(mjcf)
    assert model.actuator('crank').id == 0
    assert model.site('front_left/h').id >= 0
    assert model.body('base_link').id == 1
    links = [link.get('name') for link in ET.parse(urdf).getroot().iter('link')]  # noqa: S314
    assert len(links) == 1 + 6 * 11
    assert 'front_left/h' in links


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        ('no_such_leg --svg a.svg', 'cannot be read'),
        ('sem104 --svg a.svg --width 3', 'wider than its hole'),
        ('sem104 --svg a.svg --kerf 4', 'narrower than the smallest hole'),
        ('sem104 --svg a.svg --hole Z=4', 'no such joint; there are A, B'),
        ('sem104 --stl a --seat Z=10x4', 'seat of Z: no plate turns on a pin there'),
        ('sem104 --stl a --seat H=10x4', 'seat of H: no plate turns on a pin there'),
        ('sem104 --stl a --seat A=3.3x3', 'is refused: wider than its hole'),
        ('sem104 --stl a --seat A=12x3 --width 17', 'at most 11.33 mm in this --width'),
        ('sem104 --stl a --seat A=8x2.5 --width 17', 'or at most 75% of that'),
        ('sem104 --stl a --seat A=8x4 --width 17', 'as deep as the plate, 3 mm'),
        ('watt_six_bar --scale 0.2 --svg a.svg --width 12 --seat 8x3', 'use smaller holes'),
        ('andrews --dxf a.dxf --hole 6 --width 9', 'larger --scale'),
        ('bare.yaml --mjcf a.xml', 'bar_density'),
        ('bad.yaml --urdf a.urdf', 'holds no robot'),
        ('apart.yaml --loops-urdf a', 'cannot be reached: dyad 1 does not close'),
        ('. --urdf a.urdf', 'cannot be read'),
    ],
)
def test_a_refused_robot_is_exit_code_2_in_one_line(
    arguments: str,
    reason: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    monkeypatch.chdir(tmp_path)
    names = ['apart.yaml', 'bad.yaml', 'bare.yaml']
    Path('bad.yaml').write_text('l_ab: \x1b[31m\n')
    Path('bare.yaml').write_text('l_ab: 0.12\n')
    # No position of their joint closes both legs.
    legs = 'legs: [a, b]\nlinkage: peaucellier\n'
    legs += 'a: {crank_joint: c}\nb: {crank_joint: c, phase: 3.14, mount_xyz: [0, 1, 0]}\n'
    Path('apart.yaml').write_text(legs)
    assert main(arguments.split()) == 2
    error = capsys.readouterr().err
    assert reason in error
    assert error.startswith('export: ')
    assert error.count('\n') == 1
    assert '\x1b' not in error
    assert sorted(path.name for path in tmp_path.iterdir()) == names


@pytest.mark.parametrize(
    ('option', 'reason'),
    [
        (None, 'no output is given'),
        ('--svg', 'expected one argument'),
        ('--hole=nan', 'nan is refused'),
        ('--hole=1e400', '1e400 is refused'),
        ('--hole=A=', 'it must be a diameter in mm, such as 4.2 or A=6'),
        ('--seat=A=10', 'it must be sizes in mm, such as 220x220, or A=10x4'),
        ('--seat=10xnan', 'nan is refused: it must be sizes in mm'),
        ('--scale=0', '0 is refused: it must be a number > 0'),
        ('--kerf=x', 'x is refused: it must be a number >= 0'),
        ('--kerf=nan', 'nan is refused: it must be a number >= 0'),
        ('--washer=-1', '-1 is refused: it must be a number >= 0'),
        ('--thickness=0', '0 is refused: it must be a number > 0'),
    ],
)
def test_an_invalid_option_is_exit_code_2(
    option: str | None, reason: str, capsys: pytest.CaptureFixture
) -> None:
    with pytest.raises(SystemExit) as end:
        main(['sem104', *([option] if option else [])])
    assert end.value.code == 2
    error = capsys.readouterr().err
    assert reason in error
    assert 'Traceback' not in error


@pytest.mark.parametrize('place', ['no/a.svg', 'leg.yaml', 'other.yml', 'link.svg'])
def test_a_refused_output_is_exit_code_3_and_nothing_is_written(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ('leg.yaml', 'other.yml'):
        Path(name).write_text('l_ab: 0.12\n')
    Path('link.svg').symlink_to('leg.yaml')
    assert main(['leg.yaml', '--urdf', 'a.urdf', '--svg', place]) == 3
    error = capsys.readouterr().err
    assert error.startswith('export: --svg')
    assert error.count('\n') == 1
    names = ['leg.yaml', 'link.svg', 'other.yml']
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    assert {Path(name).read_text() for name in names} == {'l_ab: 0.12\n'}


def test_without_ezdxf_one_line_names_the_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setitem(sys.modules, 'ezdxf.filemanagement', None)
    out = tmp_path / 'a.svg'
    assert main(['sem104', '--svg', str(out)]) == 0
    capsys.readouterr()
    assert main(['sem104', '--svg', str(out), '--dxf', str(tmp_path / 'a.dxf')]) == 3
    assert 'klann_ros[dxf]' in capsys.readouterr().err


def test_each_unbuildable_part_is_reported_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert main(['scotch_yoke', '--assembly', str(tmp_path / 'a.svg')]) == 0
    slot, stub = capsys.readouterr().err.splitlines()
    assert 'run into each other' in slot
    assert stub.endswith('the pin A must be a stub: yoke passes through it')


def test_a_walker_without_a_frame_and_seats_without_a_drawing_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    file = tmp_path / 'walker.yaml'
    legs = 'left: {mount_xyz: [0, 1, 0]}, right: {mount_rpy: [1, 0, 0], mount_xyz: [0, -1, 0]}'
    file.write_text(f'legs: [left, right]\npreset: sem104\n{legs.replace("}, ", "}" + chr(10))}\n')
    options = ['--seat', '6x2', '--svg', str(tmp_path / 'a.svg')]
    assert main([str(file), *options]) == 0
    out, error = capsys.readouterr()
    assert error.startswith('export: the legs get no frame, and none moves out: ')
    assert error.count('\n') == 1
    assert 'seats that do not go through are not in SVG and DXF' in out


def test_a_leg_of_every_kind_is_cut_and_assembled(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    for name in (WALKER, 'slider_crank'):
        sizes = ['--hole', '4', '--hole', 'A=6', '--kerf', '0.2', '--thickness', '4']
        outputs = ['--svg', f'{tmp_path}/a.svg', '--assembly', f'{tmp_path}/b.svg']
        assert main([name, *outputs, *sizes]) == 0
        assert 'holes 4 mm, in 3 layers' in capsys.readouterr().out
        sheet = ET.parse(tmp_path / 'a.svg')  # noqa: S314 - our own
        radii = [circle.get('r') for circle in sheet.iter('{http://www.w3.org/2000/svg}circle')]
        assert set(radii) == {'1.900000', '2.900000'}
