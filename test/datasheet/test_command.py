"""The reports, outputs and refusals of the command `describe`."""

import json
import os
from pathlib import Path

from change_point_linkages import change_point_file
from hostile_leg import HOSTILE, LINKAGE
from klann_ros.datasheet.command import main
from klann_ros.kinematics import SHIPPED
import pytest

Capture = pytest.CaptureFixture[str]

ROOT = Path(__file__).resolve().parents[2]
SEM = str(ROOT / 'config' / 'sem104.yaml')
MOTOR = str(ROOT / 'config' / 'motor_example.yaml')


def test_a_new_user_gets_text_page_and_numbers(tmp_path: Path, capsys: Capture) -> None:
    page, numbers = tmp_path / 'leg.html', tmp_path / 'leg.json'
    outputs = ['--html', str(page), '--json', str(numbers)]
    assert main([SEM, '--load', '10', '--motor', MOTOR, *outputs]) == 0
    out, error = capsys.readouterr()
    lines = out.splitlines()
    assert error == ''
    assert lines[0].startswith('sem104: cranks at 6.283 rad/s (60.00 rpm), counter-clockwise, 10')
    assert 'The motor can turn it at 6.283 rad/s, margin 1.13.' in lines
    assert '  Stride              491.0 mm     x 435.9 .. 926.9 mm' in lines
    assert '  BC, DC         31.2     345.5           156.2     165.6          23.8' in lines
    assert '  coupler          0.7100          353.6   15.85          0.02966' in lines
    assert '  Torque, greatest   2.724    2.724  N m' in lines
    assert max(map(len, lines)) <= 110
    # The heads of a table and its 13 numbers are in columns.
    start = lines.index('Bars') + 1
    assert len({len(line) for line in lines[slice(start, start + 14)]}) == 1
    content = json.loads(numbers.read_text())
    assert content['motor_turns'] is True
    assert content['cranks'][0]['motor']['margin'] == pytest.approx(1.13, abs=0.005)
    assert page.read_text().startswith('<!doctype html>')


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        ([SEM, '--speed', '20'], 'turns no faster than 10.47 rad/s'),
        ([SEM, '--load', '1000'], 'N m are needed'),
        (['chebyshev', '--bar-density', '1'], 'the crank does not turn fully'),
    ],
)
def test_a_weak_motor_has_exit_code_1(arguments: list[str], reason: str, capsys: Capture) -> None:
    assert main([*arguments, '--motor', MOTOR]) == 1
    report = capsys.readouterr().out
    assert 'The motor cannot turn it' in report
    assert reason in report


def test_a_turn_is_a_table_in_steps_over_all_turns_that_it_takes(capsys: Capture) -> None:
    two_turns = str(change_point_file('two_turns'))
    for name, speed, step, count in (
        ('sem104', '2', '120', 4),
        (two_turns, '2000 mrad/s', '90', 9),
    ):
        assert main([name, '--table', f'{step}deg', '--speed', speed]) == 0
        table = capsys.readouterr().out.partition(' at 2 rad/s\n')[2]
        rows = table.split('\n\n')[0].splitlines()[2:]
        assert [float(row.split()[0]) for row in rows] == [int(step) * n for n in range(count)]
    for option, text, reason in (
        ('--table', '3', 'a step of 4 to 180 [deg]'),
        ('--table', '1rad/s', 'a step of 4 to 180 [deg]'),
        ('--speed', '5kg', 'a speed in rad/s, or with its unit, as 60rpm'),
        ('--speed', '1,000', 'a speed in rad/s'),
    ):
        with pytest.raises(SystemExit):
            main(['sem104', option, text])
        assert f'{text} is refused: it must be {reason}' in capsys.readouterr().err


# Doublebutterfly2.txt of DesignEngrLab/PMKS, Examples, in another pose after a turn.
TWO_TURNS = """\
name: double butterfly
units: {length: mm}
points: {A: [7.4, 4.2], B: [0, 0], C: [13, 0], D: [4.1276, 11.27], E: [10.4289, 14.25],
  F: [6.4193, 9.7727], G: [5.9286, 2.85], H: [4.4152, 3.9], J: [6.8309, 12.57], K: [8.1434, 9.87]}
ground: [A, B, C]
crank: crank
foot: K
links: {crank: [A, G, H], a: [B, D], b: [C, K], c: [D, E, F], d: [E, J, K], e: [F, G], f: [H, J]}
"""


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        (['no such leg'], 'cannot be read'),
        (['{pipe}'], 'a named pipe'),
        (['/dev/zero'], 'a device'),
        (['/'], 'a folder'),
        ([MOTOR], 'holds no robot'),
        ([SEM, '--motor', SEM], 'holds no motor'),
        ([SEM, '--motor', 'absent.yaml'], 'absent.yaml cannot be read'),
        ([SEM, '--motor', '/dev/zero'], 'a device'),
        (['{two_turns}'], 'its coupled loops are not back where they were after a turn'),
        ([SEM, '--speed', 'inf'], 'speed = inf rad/s is refused'),
        ([SEM, '--speed=-1e300'], 'speed = -1e+300 rad/s is refused'),
        ([SEM, '--speed', '1e-9'], 'speed = 1e-09 rad/s is refused'),
        ([SEM, '--load=-5'], 'load = -5.0 N is refused'),
        ([SEM, '--load', '1e10'], 'load = 10000000000.0 N is refused'),
        (['patent', '--bar-density=-1'], 'density = -1.0 kg/m is refused'),
        (['{bare}', '--motor', MOTOR], 'bar_density [kg/m]'),
    ],
)
def test_a_refusal_is_one_line(
    arguments: list[str], reason: str, tmp_path: Path, capsys: Capture
) -> None:
    bare = tmp_path / 'bare.yaml'
    pipe = tmp_path / 'pipe'
    os.mkfifo(pipe)
    weightless = [line for line in Path(SEM).read_text().splitlines() if 'bar_density' not in line]
    bare.write_text('\n'.join(weightless))
    two_turns = tmp_path / 'two_turns.yaml'
    two_turns.write_text(TWO_TURNS)
    files = {'bare': bare, 'pipe': pipe, 'two_turns': two_turns}
    assert main([text.format(**files) for text in arguments]) == 2
    out, error = capsys.readouterr()
    assert (out, error.count('\n')) == ('', 1)
    assert error.startswith('describe: ')
    assert reason in error


def test_every_report_says_what_the_masses_come_from(tmp_path: Path, capsys: Capture) -> None:
    page = tmp_path / 'sheet.html'
    sheet = tmp_path / 'sheet.json'
    sizes = []
    measured = tmp_path / 'measured.yaml'
    shipped = (SHIPPED / 'jansen.yaml').read_text()
    measured.write_text(shipped.replace('density: 1 ', 'density: 0.3 '))
    for arguments, origin, basis in (
        (['jansen'], 'assumed, not measured: rods of 1 kg/m', 'assumed_rods'),
        (['jansen', '--bar-density', '0.3'], 'as rods of the given 0.3 kg/m', 'rods'),
        ([str(measured)], 'as rods of the given 0.3 kg/m', 'rods'),
    ):
        assert main([*arguments, '--html', str(page), '--json', str(sheet)]) == 0
        assert origin in capsys.readouterr().out
        assert origin in page.read_text()
        (leg,) = json.loads(sheet.read_text())['legs']
        assert leg['mass_basis'] == basis
        assert origin.lower() in leg['mass_origin'].lower()
        sizes.append(leg['mass'])
    assert sizes == pytest.approx([sizes[0], 0.3 * sizes[0], 0.3 * sizes[0]])


@pytest.mark.parametrize('option', ['--html', '--json'])
@pytest.mark.parametrize(
    ('name', 'reason'),
    [('leg', 'only read'), ('motor', 'only read'), ('linkage.yaml', 'which FILE may name')],
)
def test_no_input_is_overwritten_nor_a_file_that_a_leg_may_name(
    option: str, name: str, reason: str, tmp_path: Path, capsys: Capture
) -> None:
    contents = {'leg': 'linkage: linkage.yaml\n', 'linkage.yaml': LINKAGE}
    contents['motor'] = Path(MOTOR).read_text()
    for file, text in contents.items():
        (tmp_path / file).write_text(text)
    paths = [str(tmp_path / file) for file in ('leg', 'motor', name)]
    assert main([paths[0], '--motor', paths[1], option, paths[2]]) == 3
    out, error = capsys.readouterr()
    assert (out, error.count('\n')) == ('', 1)
    assert error.startswith(f'describe: {option} ')
    assert reason in error
    assert {file: (tmp_path / file).read_text() for file in contents} == contents


def test_a_hostile_name_is_whole_in_json_only(tmp_path: Path, capsys: Capture) -> None:
    leg, out = tmp_path / 'leg.yaml', tmp_path / 'leg.json'
    leg.write_text(LINKAGE)
    assert main([str(leg), '--bar-density', '1', '--json', str(out)]) == 0
    reported = capsys.readouterr().out
    assert '\u202e' not in reported
    assert json.loads(out.read_text())['legs'][0]['source'].startswith(HOSTILE)
