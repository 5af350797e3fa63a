"""What the command `design` writes, refuses and leaves alone."""

import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from klann_ros.datasheet.command import main as describe
from klann_ros.design.command import main
import pytest

WISH = """\
linkage: klann
units: {length: mm, angle: deg}
vary: 10
figures:
  stride: maximize
  lift: maximize
  transmission_angle: {at_least: 20}
count: 4
"""


@pytest.fixture
def wish(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / 'wish.yaml'
    file.write_text(WISH)
    return file


def run(*arguments: str) -> int:
    return main([*arguments, '--jobs', '1', '--evaluations', '600'])


def test_a_wish_gives_a_folder_of_legs_that_describe_takes(
    wish: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run('wish.yaml') == 0
    out, error = capsys.readouterr()
    folder = wish.parent / 'wish_legs'
    assert out.splitlines()[0].endswith('in wish_legs')
    assert 'candidates' in error
    content = json.loads((folder / 'design.json').read_text())
    assert content['legs']
    page = (folder / 'index.html').read_text()
    for leg in content['legs']:
        assert describe([str(folder / leg['file'])]) == 0
        assert leg['file'].removesuffix('.yaml') in page
        assert 'The crank turns fully.' in capsys.readouterr().out


def test_an_existing_folder_is_refused_and_resumed(
    wish: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run('wish.yaml', '-o', 'out') == 0
    before = (wish.parent / 'out' / 'design.json').read_bytes()
    assert run('wish.yaml', '-o', 'out') == 3
    assert 'out exists already: continue it with --resume' in capsys.readouterr().err
    assert run('wish.yaml', '-o', 'out', '--resume') == 0
    assert (wish.parent / 'out' / 'design.json').read_bytes() == before
    with pytest.raises(SystemExit, match='2'):
        run('wish.yaml', '-o', 'out', '--resume', '--seed', '5')
    assert 'another wish or seed' in capsys.readouterr().err


def test_a_link_in_the_folder_is_not_followed(
    wish: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run('wish.yaml', '-o', 'out') == 0
    victim = wish.parent / 'victim'
    victim.write_text('mine')
    (wish.parent / 'out' / 'design.json').unlink()
    (wish.parent / 'out' / 'design.json').symlink_to(victim)
    assert run('wish.yaml', '-o', 'out', '--resume') == 3
    assert 'is a link' in capsys.readouterr().err
    assert victim.read_text() == 'mine'


def test_a_wish_that_no_leg_fulfils_has_exit_code_1(
    wish: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wish.write_text(WISH.replace('at_least: 20', 'at_least: 85'))
    assert run('wish.yaml') == 1
    assert 'transmission_angle is ' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('arguments', 'code', 'message'),
    [
        (['none.yaml'], 2, 'none.yaml cannot be read'),
        (['wish.yaml', '--resume'], 2, 'has no search'),
        (['wish.yaml', '--time', '-1'], 2, 'seconds > 0'),
        (['wish.yaml', '-o', 'wish.yaml/x'], 3, 'cannot be made'),
    ],
)
def test_a_refusal_is_one_line(
    arguments: list[str],
    code: int,
    message: str,
    wish: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    try:
        found = run(*arguments)
    except SystemExit as end:
        found = int(end.code or 0)
    assert found == code
    error = capsys.readouterr().err
    assert message in error.splitlines()[-1]
    assert 'Traceback' not in error
    assert wish.exists()


def test_ctrl_c_keeps_the_legs_found_and_prints_no_traceback(wish: Path) -> None:
    command = [sys.executable, '-c', 'from klann_ros.executables import design; design()']
    arguments = ['wish.yaml', '--evaluations', '100000', '--jobs', '2']
    process = subprocess.Popen(
        [*command, *arguments], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    folder = wish.parent / 'wish_legs'
    while not (folder / 'search.json').exists():
        assert process.poll() is None
        time.sleep(0.05)
    # As a terminal does: the workers of the next round are starting.
    os.killpg(process.pid, signal.SIGINT)
    _, error = process.communicate(timeout=200)
    assert 'Traceback' not in error
    assert json.loads((folder / 'design.json').read_text())['legs']


def test_a_damaged_search_is_not_resumed(wish: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (wish.parent / 'out').mkdir()
    (wish.parent / 'out' / 'search.json').write_text('{"key": 1}')
    with pytest.raises(SystemExit, match='2'):
        run('wish.yaml', '-o', 'out', '--resume')
    assert 'search.json is damaged' in capsys.readouterr().err
