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

REQUIREMENTS = """\
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
def requirements(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / 'requirements.yaml'
    file.write_text(REQUIREMENTS)
    return file


def run(*arguments: str) -> int:
    return main([*arguments, '--jobs', '1', '--evaluations', '600'])


def test_a_wish_gives_a_folder_of_legs_that_describe_takes(
    requirements: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run('requirements.yaml') == 0
    out, error = capsys.readouterr()
    folder = requirements.parent / 'requirements_legs'
    assert out.splitlines()[0].endswith('in requirements_legs')
    assert 'candidates' in error
    content = json.loads((folder / 'design.json').read_text())
    assert content['legs']
    page = (folder / 'index.html').read_text()
    for leg in content['legs']:
        assert describe([str(folder / leg['file'])]) == 0
        assert leg['file'].removesuffix('.yaml') in page
        assert 'The crank turns fully.' in capsys.readouterr().out


def test_an_existing_folder_is_refused_and_resumed(
    requirements: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run('requirements.yaml', '-o', 'out') == 0
    before = (requirements.parent / 'out' / 'design.json').read_bytes()
    assert run('requirements.yaml', '-o', 'out') == 3
    assert 'out exists already: continue it with --resume' in capsys.readouterr().err
    assert run('requirements.yaml', '-o', 'out', '--resume') == 0
    assert (requirements.parent / 'out' / 'design.json').read_bytes() == before
    with pytest.raises(SystemExit, match='2'):
        run('requirements.yaml', '-o', 'out', '--resume', '--seed', '5')
    assert 'other requirements or another seed' in capsys.readouterr().err


def test_a_link_in_the_folder_is_not_followed(
    requirements: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run('requirements.yaml', '-o', 'out') == 0
    victim = requirements.parent / 'victim'
    victim.write_text('mine')
    (requirements.parent / 'out' / 'design.json').unlink()
    (requirements.parent / 'out' / 'design.json').symlink_to(victim)
    assert run('requirements.yaml', '-o', 'out', '--resume') == 3
    assert 'is a link' in capsys.readouterr().err
    assert victim.read_text() == 'mine'


def test_a_wish_that_no_leg_fulfils_has_exit_code_1(
    requirements: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    requirements.write_text(REQUIREMENTS.replace('at_least: 20', 'at_least: 85'))
    assert run('requirements.yaml') == 1
    assert 'transmission_angle is ' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('arguments', 'code', 'message'),
    [
        (['none.yaml'], 2, 'none.yaml cannot be read'),
        (['requirements.yaml', '--resume'], 2, 'has no search'),
        (['requirements.yaml', '--time', '-1'], 2, 'seconds > 0'),
        (['requirements.yaml', '-o', 'requirements.yaml/x'], 3, 'cannot be made'),
    ],
)
def test_a_refusal_is_one_line(
    arguments: list[str],
    code: int,
    message: str,
    requirements: Path,
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
    assert requirements.exists()


def test_ctrl_c_keeps_the_legs_found_and_prints_no_traceback(requirements: Path) -> None:
    command = [sys.executable, '-c', 'from klann_ros.executables import design; design()']
    arguments = ['requirements.yaml', '--evaluations', '100000', '--jobs', '2']
    process = subprocess.Popen(
        [*command, *arguments], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    folder = requirements.parent / 'requirements_legs'
    while not (folder / 'search.json').exists():
        assert process.poll() is None
        time.sleep(0.05)
    # As a terminal does: the workers of the next round are starting.
    os.killpg(process.pid, signal.SIGINT)
    _, error = process.communicate(timeout=200)
    assert 'Traceback' not in error
    assert json.loads((folder / 'design.json').read_text())['legs']


def test_a_damaged_search_is_not_resumed(
    requirements: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (requirements.parent / 'out').mkdir()
    (requirements.parent / 'out' / 'search.json').write_text('{"key": 1}')
    with pytest.raises(SystemExit, match='2'):
        run('requirements.yaml', '-o', 'out', '--resume')
    assert 'search.json is damaged' in capsys.readouterr().err
