"""What the command `describe` says, writes, refuses, and leaves alone."""

import json
import os
from pathlib import Path
import subprocess
import sys

from hostile_leg import HOSTILE, LINKAGE
from klann_ros.datasheet.command import main
import pytest

ROOT = Path(__file__).resolve().parents[2]
SEM = str(ROOT / 'config' / 'sem104.yaml')
MOTOR = str(ROOT / 'config' / 'motor_example.yaml')


def test_a_new_user_gets_text_page_and_numbers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page, numbers = tmp_path / 'leg.html', tmp_path / 'leg.json'
    asked = [SEM, '--load', '10', '--motor', MOTOR, '--html', str(page), '--json', str(numbers)]
    assert main(asked) == 0
    said = capsys.readouterr()
    assert said.err == ''
    lines = said.out.splitlines()
    assert lines[0].startswith('sem104: cranks at 6.283 rad/s (60.00 rpm), counter-clockwise, 10')
    assert 'The motor can turn it at 6.283 rad/s, margin 1.13.' in lines
    assert '  Stride              491.0 mm     x 435.9 .. 926.9 mm' in lines
    assert '  Torque, greatest   2.724    2.724  N m' in lines
    assert max(map(len, lines)) <= 110
    content = json.loads(numbers.read_text())
    assert content['motor_turns'] is True
    assert content['cranks'][0]['motor']['margin'] == pytest.approx(1.13, abs=0.005)
    assert page.read_text().startswith('<!doctype html>')


def test_tables_are_in_columns(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([SEM]) == 0
    lines = capsys.readouterr().out.splitlines()
    start = lines.index('Bars') + 1
    # Its heads, and its 13 numbers.
    ends = {len(line) for line in lines[slice(start, start + 14)]}
    assert len(ends) == 1


@pytest.mark.parametrize(
    ('options', 'said'),
    [
        (['--speed', '20'], 'turns no faster than 10.47 rad/s'),
        (['--load', '1000'], 'N m are needed'),
    ],
)
def test_a_motor_that_cannot_gives_exit_code_1(
    options: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([SEM, '--motor', MOTOR, *options]) == 1
    reported = capsys.readouterr().out
    assert 'The motor cannot turn it' in reported
    assert said in reported


def test_no_motor_turns_a_crank_that_does_not_turn_fully(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(['chebyshev', '--bar-density', '1', '--motor', MOTOR]) == 1
    assert 'the crank does not turn fully' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (['no such leg'], 'cannot be read'),
        (['/dev/zero'], 'a device'),
        (['/'], 'a folder'),
        ([MOTOR], 'holds no robot'),
        ([SEM, '--motor', SEM], 'holds no motor'),
        ([SEM, '--motor', 'absent.yaml'], 'absent.yaml cannot be read'),
        ([SEM, '--motor', '/dev/zero'], 'a device'),
        ([SEM, '--speed', 'nan'], 'speed = nan rad/s is refused'),
        ([SEM, '--speed=-1e300'], 'speed = -1e+300 rad/s is refused'),
        ([SEM, '--speed', '0'], 'speed = 0.0 rad/s is refused'),
        ([SEM, '--load=-5'], 'load = -5.0 N is refused'),
        ([SEM, '--load', '1e400'], 'load = inf N is refused'),
        (['patent', '--bar-density=-1'], 'density = -1.0 kg/m is refused'),
        (['{bare}', '--motor', MOTOR], 'bar_density [kg/m]'),
    ],
)
def test_what_is_refused_is_reported_in_one_line(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bare = tmp_path / 'bare.yaml'
    weightless = [line for line in Path(SEM).read_text().splitlines() if 'bar_density' not in line]
    bare.write_text('\n'.join(weightless))
    assert main([text.replace('{bare}', str(bare)) for text in arguments]) == 2
    reported = capsys.readouterr()
    assert reported.out == ''
    assert reported.err.startswith('describe: ')
    assert said in reported.err
    assert reported.err.count('\n') == 1


@pytest.mark.parametrize('option', ['--speed', '--load', '--bar-density'])
def test_what_is_no_number_is_refused(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main([SEM, option, 'much'])
    assert end.value.code == 2
    assert "invalid float value: 'much'" in capsys.readouterr().err


def test_a_pipe_that_nobody_writes_is_not_waited_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pipe = tmp_path / 'leg.yaml'
    os.mkfifo(pipe)
    assert main([str(pipe)]) == 2
    assert 'a named pipe' in capsys.readouterr().err


@pytest.mark.parametrize('option', ['--html', '--json'])
@pytest.mark.parametrize('given', ['leg', 'motor', 'link', 'folder', 'nowhere'])
def test_nothing_is_written_where_it_may_not_be(
    option: str, given: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    leg, motor, link = (tmp_path / name for name in ('leg.yaml', 'motor.yaml', 'link'))
    leg.write_bytes(Path(SEM).read_bytes())
    motor.write_bytes(Path(MOTOR).read_bytes())
    link.symlink_to(leg)
    out = {'leg': leg, 'motor': motor, 'link': link, 'folder': tmp_path}.get(
        given, tmp_path / 'absent' / 'out'
    )
    assert main([str(leg), '--motor', str(motor), option, str(out)]) == 3
    reported = capsys.readouterr()
    assert reported.out == ''
    assert reported.err.startswith(f'describe: {option} ')
    assert reported.err.count('\n') == 1
    assert leg.read_bytes() == Path(SEM).read_bytes()
    assert motor.read_bytes() == Path(MOTOR).read_bytes()


def test_no_yaml_file_is_written_for_a_leg_may_name_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    linkage = tmp_path / 'linkage.yaml'
    linkage.write_text(LINKAGE)
    leg = tmp_path / 'leg.yaml'
    leg.write_text('linkage: linkage.yaml\n')
    assert main([str(leg), '--html', str(linkage)]) == 3
    assert 'which FILE may name' in capsys.readouterr().err
    assert linkage.read_text() == LINKAGE


def test_both_in_one_file_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / 'out')
    assert main([SEM, '--html', out, '--json', out]) == 3
    assert 'are the same file' in capsys.readouterr().err


def test_a_hostile_name_moves_no_terminal_and_is_whole_in_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    leg, out = tmp_path / 'leg.yaml', tmp_path / 'leg.json'
    leg.write_text(LINKAGE)
    assert main([str(leg), '--bar-density', '1', '--json', str(out)]) == 0
    reported = capsys.readouterr().out
    assert not {'\x1b', '\u202e'} & set(reported)
    assert json.loads(out.read_text())['legs'][0]['source'].startswith(HOSTILE)


def test_it_is_a_process_that_ends_well_on_a_closed_pipe() -> None:
    start = 'import sys; from klann_ros.executables import describe; sys.exit(describe())'
    described = subprocess.Popen(
        [sys.executable, '-c', start, SEM],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ | {'PYTHONPATH': str(ROOT)},
    )
    assert described.stdout is not None
    assert described.stderr is not None
    described.stdout.close()
    assert described.stderr.read() == b''
    described.stderr.close()
    assert described.wait(60) == 0
