"""What goes wrong in a search: a full disk, killed processes, Ctrl-C, degenerate linkages."""

from collections.abc import Callable, Mapping
import json
import os
from pathlib import Path
import resource
import signal
import subprocess
import sys
import time

from klann_ros.design import requirements_from, search
from klann_ros.design.command import main
from klann_ros.design.figures import FIGURES
from klann_ros.design.report import report
from klann_ros.kinematics import linkage_poses
from klann_ros.sanitize.yaml_text import parse
import numpy as np
import pytest

PROGRAM = 'import sys; from klann_ros.executables import design; sys.exit(design())'
COMMAND = [sys.executable, '-c', PROGRAM]
REQUIREMENTS = """\
linkage: klann
vary: 10
figures: {stride: maximize, lift: maximize, transmission_angle: {at_least: 0.3}}
count: 3
"""
EVALUATIONS = 960


@pytest.fixture
def requirements(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / 'requirements.yaml'
    file.write_text(REQUIREMENTS)
    return file


@pytest.fixture(scope='module')
def undisturbed() -> str:
    return report(search(requirements_from(parse(REQUIREMENTS)), evaluations=EVALUATIONS))


def started(*options: str) -> subprocess.Popen[str]:
    arguments = ['requirements.yaml', '-o', 'out', '--evaluations', str(EVALUATIONS), *options]
    return subprocess.Popen(
        [*COMMAND, *arguments], stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def wait_until(process: subprocess.Popen[str], holds: Callable[[], bool]) -> None:
    while not holds():
        assert process.poll() is None
        time.sleep(0.02)


def children(pid: int) -> list[int]:
    return [int(k) for k in Path(f'/proc/{pid}/task/{pid}/children').read_text().split()]


def workers(process: subprocess.Popen[str]) -> list[int]:
    return [worker for server in children(process.pid) for worker in children(server)]


def test_two_jobs_find_the_same_legs_though_a_worker_is_killed(
    requirements: Path, undisturbed: str
) -> None:
    process = started('--jobs', '2')
    wait_until(process, lambda: bool(workers(process)))
    os.kill(workers(process)[0], signal.SIGKILL)
    _, error = process.communicate(timeout=300)
    assert process.returncode == 0
    assert 'Traceback' not in error
    assert (requirements.parent / 'out' / 'design.json').read_text() == undisturbed


def test_a_killed_search_is_resumed(
    requirements: Path, undisturbed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    process = started('--jobs', '1')
    wait_until(process, (requirements.parent / 'out' / 'search.json').exists)
    process.kill()
    process.communicate(timeout=300)
    assert process.returncode == -signal.SIGKILL
    options = ['-o', 'out', '--evaluations', str(EVALUATIONS), '--jobs', '1', '--resume']
    assert main(['requirements.yaml', *options]) == 0
    assert (requirements.parent / 'out' / 'design.json').read_text() == undisturbed
    requirements.write_text(REQUIREMENTS.replace('0.3', '0.4'))
    with pytest.raises(SystemExit, match='2'):
        main(['requirements.yaml', *options])
    assert 'the search to resume has other requirements or another seed' in capsys.readouterr().err


@pytest.mark.parametrize('stage', ['first round', 'proof'])
def test_ctrl_c_at_the_begin_and_at_the_end_leaves_no_traceback(
    requirements: Path, stage: str
) -> None:
    out = requirements.parent / 'out'
    process = started('--jobs', '1')

    def holds() -> bool:
        if stage == 'first round':
            return out.exists()
        file = out / 'search.json'
        return file.exists() and json.loads(file.read_text())['evaluations'] >= EVALUATIONS

    wait_until(process, holds)
    os.killpg(process.pid, signal.SIGINT)
    _, error = process.communicate(timeout=300)
    assert process.returncode == 130
    assert 'Traceback' not in error


# Bytes that a file may have.
@pytest.mark.parametrize('room', [20_000, 100])
def test_a_full_disk_is_one_line_and_the_search_can_be_resumed(
    requirements: Path, undisturbed: str, capsys: pytest.CaptureFixture[str], room: int
) -> None:
    options = ['-o', 'out', '--evaluations', str(EVALUATIONS), '--jobs', '1']
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
    try:
        assert main(['requirements.yaml', *options]) == 3
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    error = capsys.readouterr().err
    assert 'cannot be written: File too large' in error.splitlines()[-1]
    assert main(['requirements.yaml', *options, '--resume']) == 0
    assert (requirements.parent / 'out' / 'design.json').read_text() == undisturbed


@pytest.mark.parametrize(
    'content',
    [
        # Two pivots on one another.
        {'linkage': 'four_bar', 'vary': 30, 'tie': {'O4.x': 'O2.x', 'O4.y': 'O2.y'}},
        {'linkage': 'klann', 'vary': 30, 'tie': {'E.x': 'D.x', 'E.y': 'D.y'}},
        # A crank that vanishes, and lengths of nearly nothing.
        {'linkage': 'klann', 'vary': {'A-B': [1e-9, 0.12]}},
        {'linkage': 'klann', 'scale': [1e-9, 1e-8]},
        # No lift, and feet that stand still.
        {'linkage': 'slider_crank'},
        {'linkage': 'scotch_yoke'},
        {'linkage': 'peaucellier'},
    ],
)
def test_degenerate_linkages_give_legs_that_close_or_reasons(
    content: Mapping[str, object],
) -> None:
    found = search(requirements_from({**content, 'count': 3}), evaluations=480)
    assert found.legs or found.reasons
    for leg in found.legs:
        alphas = np.linspace(0.0, 2.0 * np.pi, 2000)
        assert not linkage_poses(leg.linkage, alphas).reason.any()


@pytest.mark.parametrize('linkage', ['klann', 'slider_crank'])
def test_every_figure_that_no_leg_has_is_named_with_its_shortfall(linkage: str) -> None:
    for name, kind in FIGURES.items():
        if kind.is_costly or name == 'path_error':
            continue
        wanted = min(1e4, 0.999 * kind.greatest)
        requirements = requirements_from(
            {'linkage': linkage, 'vary': 5, 'load': 1, 'figures': {name: {'at_least': wanted}}}
        )
        found = search(requirements, evaluations=480)
        assert not found.legs
        assert any(name in reason for reason in found.reasons), (name, found.reasons)
        assert 'nan' not in ' '.join(found.reasons)
