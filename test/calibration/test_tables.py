"""Tables of loggers, spreadsheets and video analyses are read, or a line says what is missing."""

from collections.abc import Callable
import math
from pathlib import Path
import re

from klann_ros.calibration.command import main
from klann_ros.calibration.measurements import MeasuredSeries
from klann_ros.calibration.tables import load_table, TableOptions
from klann_ros.robot import robot_of
from measured_robots import Robot
import numpy as np
import pytest

ROBOT = Robot(count=120, period=0.05)
(LEG,) = robot_of('sem104').legs
NAMES = ('time', 'crank', 'H.x', 'H.y', 'G.x', 'G.y')
Capture = pytest.CaptureFixture[str]


def columns() -> np.ndarray:
    """Return what was measured: time, crank, foot and knee, shape (n, 6)."""
    return np.column_stack([ROBOT.times, ROBOT.crank, ROBOT.seen('H'), ROBOT.seen('G')])


def text(table: np.ndarray, header: str = ','.join(NAMES), delimiter: str = ',') -> str:
    rows = [delimiter.join(f'{number:.12f}' for number in row) for row in table.tolist()]
    return '\n'.join([header, *rows] if header else rows)


def pin_table() -> np.ndarray:
    return np.column_stack([ROBOT.times, ROBOT.seen('B'), ROBOT.seen('H')])


def in_units(**factors: float) -> np.ndarray:
    table = columns()
    for name, factor in factors.items():
        table[:, NAMES.index(name.replace('_', '.'))] *= factor
    return table


def stamped() -> str:
    """Return rows as `ros2 topic echo --csv` writes messages with a header: without names."""
    seconds, fractions = np.divmod(np.round(ROBOT.times * 1e9).astype(int), 10**9)
    rows = []
    for sec, nanosec, row in zip(seconds, fractions, columns()[:, 1:].tolist(), strict=True):
        rows.append(f'{sec},{nanosec},world,{",".join(map(str, row))}')
    return '\n'.join(rows)


def kinovea(times: list[str], *names: str) -> str:
    """Return tracks as Kinovea's text export has them, one after the other."""
    lines = ['#Kinovea Trajectory data export', '#T X Y', '']
    for name in names:
        lines += [f'# {name}']
        for time, point in zip(times, ROBOT.seen(name).tolist(), strict=True):
            lines.append(f'{time} {point[0]:.9f} {point[1]:.9f}')
        lines += ['', '']
    return '\n'.join(lines)


def time_codes() -> list[str]:
    """Return the times as hours, minutes, seconds and hundredths."""
    codes = []
    for hundredths in np.round(100.0 * ROBOT.times).astype(int).tolist():
        minutes, rest = divmod(hundredths, 6000)
        codes.append(f'0:{minutes:02}:{rest // 100:02}:{rest % 100:02}')
    return codes


def frames() -> np.ndarray:
    return in_units(time=20.0)


NUMBERS = {name: str(n + 1) for n, name in enumerate(NAMES)}
JOURNAL = '__time,/crank_state/crank/position,/mocap/h/point/x,/mocap/h/point/y,/m/G/x,/m/G/y'
DEGREES = math.degrees(1.0)


def load(tmp_path: Path, content: str, options: TableOptions) -> list[MeasuredSeries]:
    file = tmp_path / 'table.txt'
    file.write_text(content)
    return load_table(str(file), LEG, (), options).measured


@pytest.mark.parametrize(
    ('make', 'options'),
    [
        (lambda: text(columns()), TableOptions()),
        (lambda: '# a sketch\n' + text(columns()) + '\n# end', TableOptions()),
        (lambda: text(columns(), '# ' + ' '.join(NAMES), ' '), TableOptions()),
        (lambda: text(columns(), ''), TableOptions(NUMBERS)),
        (lambda: text(columns(), '\t'.join(NAMES), '\t'), TableOptions()),
        (lambda: 'sep=;\n' + text(columns(), ';'.join(NAMES), ';').replace('.0', ',0'),
         TableOptions()),
        # Spreadsheets of Portugal and Brazil put decimal commas in quotes.
        (lambda: re.sub(r'(-?[0-9]+)\.([0-9]+)', r'"\1,\2"', text(columns())), TableOptions()),
        (lambda: 'Ready.\nTurn the crank\n\nGo\n' + text(columns()), TableOptions()),
        (lambda: text(in_units(time=1e9), 'time_ns,crank,H.x,H.y,G.x,G.y'), TableOptions()),
        (lambda: text(columns(), JOURNAL), TableOptions()),
        (lambda: text(in_units(time=1e3, crank=DEGREES, H_x=1e3, H_y=1e2),
                      'Time (ms),crank_deg,H x [mm],H_y_cm,G_x,G_y'), TableOptions()),
        (lambda: text(in_units(time=1e9, crank=DEGREES, G_x=1.0 / 0.0254),
                      't [ns],crank (°),H.x,H.y,G.x [in],G.y'),
         TableOptions()),
        (lambda: text(in_units(time=1.0 / 60.0), 'time [min],crank,H.x,H.y,G.x,G.y'),
         TableOptions()),
        (lambda: text(in_units(time=1.0 / 3600.0, crank=0.5 / math.pi, H_x=1.0 / 0.3048),
                      'time (h),crank (turns),H.x [ft],H.y,G.x,G.y'), TableOptions()),
        (stamped, TableOptions({'sec': '1', 'nanosec': '2', **{name: str(n + 3) for n, name in
                                enumerate(NAMES) if name != 'time'}})),
        (lambda: 'header.stamp.sec,header.stamp.nanosec,header.frame_id,crank,H.x,H.y,G.x,G.y\n'
         + stamped(), TableOptions()),
        (lambda: '# my left foot and knee here\n' + text(columns(), '# ' + ' '.join(NAMES), ' ')
         + '\n# one two three four five six', TableOptions()),
        (lambda: text(in_units(crank=DEGREES)), TableOptions(angle_unit='deg')),
        (lambda: text(in_units(crank=DEGREES)), TableOptions()),
        (lambda: text(frames(), 'frame,alpha,H.x,H.y,G.x,G.y'), TableOptions(rate=20.0)),
        (lambda: text(columns()[:, 1:], ','.join(NAMES[1:])), TableOptions(rate=20.0)),
        (lambda: text(columns(), 'Time,crank,foot.x,"foot, y",G.x,G.y'),
         TableOptions({'H.x': 'foot.x', 'H.y': 'foot, y'})),
        (lambda: text(columns(), '\t\tH\t\tG\t\t\nt\tcrank\tx\ty\tx\ty\t', '\t'),
         TableOptions({'crank': '2'})),
        (lambda: text(columns(), '\t\tH\t\tG\nt\tcrank\tx\ty\tx\ty', '\t'),
         TableOptions({'crank': '2'})),
    ],
)  # fmt: skip
def test_a_table_has_the_same_numbers_however_it_is_written(
    tmp_path: Path, make: Callable[[], str], options: TableOptions
) -> None:
    measured = {series.name: series for series in load(tmp_path, make(), options)}
    assert set(measured) == {'H', 'G'}
    for name, series in measured.items():
        np.testing.assert_allclose(series.times, ROBOT.times, atol=1e-8)
        np.testing.assert_allclose(series.values, ROBOT.seen(name), atol=1e-8)
        np.testing.assert_allclose(series.crank, ROBOT.crank, atol=1e-6)


def test_whole_numbers_behind_commas_and_blanks_have_their_header(tmp_path: Path) -> None:
    rows = (f'{n}, 40, {n % 7}, {n % 5}' for n in range(30))
    file = tmp_path / 'serial.txt'
    file.write_text('\n'.join(['time_ms, crank_deg, B_x_mm, B_y_mm', *rows]))
    (series,) = load_table(str(file), LEG, (), TableOptions()).measured
    assert series.values[6].tolist() == [0.006, 0.001]


@pytest.mark.parametrize('header', ['t,x,y', '# t,x,y', '# note\nt,x,y', '# my,own,note\n# t,x,y'])
def test_a_point_without_a_name_is_named_by_its_columns(tmp_path: Path, header: str) -> None:
    file = tmp_path / 'pin.csv'
    file.write_text(text(pin_table()[:, :3], header))
    options = TableOptions({'B.x': 'x', 'B.y': 'y'})
    (series,) = load_table(str(file), LEG, (), options).measured
    np.testing.assert_allclose(series.values, ROBOT.seen('B'), atol=1e-8)


def test_tracks_without_names_are_told_by_number(tmp_path: Path) -> None:
    content = kinovea(time_codes(), 'B', 'H').replace('# B\n', '').replace('# H\n', '')
    numbers = {'B.x': '2', 'B.y': '3', 'H.x': '4', 'H.y': '5'}
    for series in load(tmp_path, content, TableOptions(numbers)):
        np.testing.assert_allclose(series.values, ROBOT.seen(series.name), atol=1e-8)


def test_degrees_that_are_found_are_reported(tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / 'run.csv'
    file.write_text(text(in_units(crank=DEGREES)))
    assert main([str(file), '--leg', 'sem104']) == 0
    assert 'the crank is in degrees' in capsys.readouterr().out
    # In radians it turns by more than can be followed from sample to sample.
    assert main([str(file), '--leg', 'sem104', '--angle-unit', 'rad']) == 2
    assert 'the crank at least every 2 rad' in capsys.readouterr().err
    file.write_text(text(columns()))
    assert main([str(file), '--leg', 'sem104']) == 0
    assert 'degrees' not in capsys.readouterr().out


@pytest.mark.parametrize(
    'content',
    [
        text(pin_table(), 'time,B.x,B.y,H.x,H.y'),
        text(pin_table(), '#multi:\n,B,,H,\nt,x,y,x,y'),
        kinovea(time_codes(), 'B', 'H'),
        kinovea([f'{time:.6f}' for time in ROBOT.times], 'B', 'H'),
        kinovea(time_codes(), 'B', 'H').replace('.', ','),
    ],
)
def test_a_tracked_pin_is_the_crank(tmp_path: Path, capsys: Capture, content: str) -> None:
    file = tmp_path / 'run.txt'
    file.write_text(content)
    built = tmp_path / 'built.yaml'
    assert main([str(file), '--leg', 'sem104', '-o', str(built)]) == 0
    printed = capsys.readouterr().out
    assert 'the crank is that of the point B' in printed
    assert 'phase' not in printed
    length = robot_of(str(built)).legs[0].linkage.dimensions['l_gh']
    assert length == pytest.approx(ROBOT.linkage.dimensions['l_gh'], abs=5e-4)
    assert main([str(file), '--leg', 'sem104', '--delay', 'unknown']) == 2
    assert 'has no delay' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('make', 'arguments', 'reason'),
    [
        (lambda: text(columns(), 'stamp,crank,H.x,H.y,G.x,G.y'), '', 'has no column time'),
        (lambda: text(columns(), 'frame,crank,H.x,H.y,G.x,G.y'), '', 'frames a second with'),
        (lambda: text(columns(), 'time,angle,H.x,H.y,G.x,G.y'), '', 'no angle of the crank'),
        (lambda: text(columns()) + '\n1,2,three,4,5,6', '', 'line 122 is no table of numbers'),
        (lambda: text(columns()) + '\n1,2', '', 'is no table of numbers: 2 cells for 6 columns'),
        # 1.234, or one thousand?
        (lambda: text(columns()) + '\n"1,234",2,3,4,5,6', '', 'is no table of numbers'),
        (lambda: text(columns()) + '\n7,"10,500",3,4,5,6', '', 'column 2 has words and numbers'),
        (lambda: text(columns()) + '\nend,2,3,4,5,6', '', 'line 122 is no table of numbers'),
        (lambda: stamped() + '\n9,5,7,0.1,2,3,4,5', '', 'column 3 has words and numbers'),
        (
            lambda: kinovea(time_codes(), 'B') + kinovea([*time_codes()[1:], '0:01:00:00'], 'H'),
            '',
            '2 tracks of different times',
        ),
        (lambda: text(columns(), 'time,crank,H.x [li],H.y,G.x,G.y'), '', 'li is no known unit'),
        (lambda: text(columns(), 'time [d],crank,H.x,H.y,G.x,G.y'), '', 'd is no known unit'),
        # Degrees in German, gradians elsewhere.
        (lambda: text(columns(), 'time,crank (grad),H.x,H.y,G.x,G.y'), '', 'grad is no known'),
        (lambda: '', '', 'has no column time'),
        (lambda: 'a,b\nc,d\ne,f', '', 'is no table of numbers'),
        (lambda: text(columns(), 'time,crank,H.x,H.y,G.x,G.z'), '', 'has no column G.y'),
        (lambda: text(columns(), 'time,crank,K.x,K.y,L.x,L.y'), '', 'K is no point'),
        (lambda: text(columns(), ''), '', '--column time=1 --column H.x=2'),
        (lambda: text(columns()), '--column H.x=7', 'no column 7: there are time, crank'),
        (lambda: text(columns(), 'time,crank,x,y,x,y'), '--column H.x=x', 'several columns x'),
        (lambda: text(columns()), '--column H.x', 'must be WHAT=NAME'),
        (lambda: text(columns()), '--rate 0', 'frames a second, above 0'),
    ],
)
def test_unusable_tables_are_refused_in_one_line(
    tmp_path: Path, capsys: Capture, make: Callable[[], str], arguments: str, reason: str
) -> None:
    file = tmp_path / 'bad.csv'
    file.write_text(make())
    try:
        assert main([str(file), '--leg', 'sem104', *arguments.split()]) == 2
    except SystemExit as end:
        assert end.code == 2
    assert reason in capsys.readouterr().err.splitlines()[-1]


def test_columns_of_no_point_are_named_and_left_out(tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / 'run.csv'
    file.write_text(text(columns(), 'time,crank,H.x,H.y,rod.x,rod.y'))
    assert main([str(file), '--leg', 'sem104']) == 0
    assert 'not used: column rod' in capsys.readouterr().out
