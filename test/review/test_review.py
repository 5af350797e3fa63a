"""`review`: a healthy run has no finding, and each fault exactly its own."""

from collections.abc import Callable
import math
from pathlib import Path
import re

from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.review.command import main
import pytest

ROOT = Path(__file__).resolve().parents[2]
MakeRun = Callable[..., Path]
Capture = pytest.CaptureFixture[str]


def found(output: str) -> list[str]:
    return re.findall(r'^FOUND (\w+):', output, flags=re.MULTILINE)


def review(capsys: Capture, *arguments: object) -> tuple[int, str]:
    code = main([str(argument) for argument in arguments])
    return code, capsys.readouterr().out


def test_a_healthy_run_has_no_finding(healthy, make_run: MakeRun, capsys: Capture) -> None:
    code, output = review(capsys, make_run(healthy))
    assert (code, found(output)) == (0, [])
    assert re.search(r'turns of the crank +2\.000', output)
    assert re.search(r'stride +0\.4910 m', output)
    assert re.search(r'lift +0\.3001 m', output)
    assert re.search(r'worst transmission angle +23\.8\d deg', output)
    assert re.search(r'/joint_states +400 +200\.0 +5\.0 +0\.20 +0', output)
    worst = float(re.search(r'worst angle, solved again +(\S+)', output)[1])
    assert 0 < worst < 1e-13


def test_a_healthy_patent_leg_has_no_finding(
    make_script, make_run: MakeRun, capsys: Capture
) -> None:
    code, output = review(capsys, make_run(make_script(KlannGeometry.patent())))
    assert (code, found(output)) == (0, [])


def test_a_wrong_length_is_found(healthy, make_run: MakeRun, capsys: Capture) -> None:
    healthy.geometry = KlannGeometry(l_gh=0.4304)
    code, output = review(capsys, make_run(healthy))
    # The foot is not where the angles say; the loops do not know of GH.
    assert (code, found(output)) == (1, ['foot'])
    assert '400 feet' in output
    assert 'by 0.0004 m' in output


def test_lengths_that_do_not_close_are_found(healthy, make_run: MakeRun, capsys: Capture) -> None:
    healthy.geometry = KlannGeometry(l_ef=0.271)
    code, output = review(capsys, make_run(healthy))
    assert (code, found(output)) == (1, ['closure', 'resolve', 'foot'])
    assert '400 of 400 poses do not close' in output


def test_a_flipped_branch_is_found_at_its_time(
    healthy, make_run: MakeRun, capsys: Capture
) -> None:

    other = KlannLeg(KlannGeometry(assembly=(1, -1))).solve(healthy.answers[100].alpha)
    healthy.change(100, pose=list(other[:5]), foot=other.h)
    code, output = review(capsys, make_run(healthy))
    # Both loops close, and it is the wrong pose all the same.
    assert (code, found(output)) == (1, ['resolve', 'foot'])
    assert '1 of 400 poses differ' in output
    assert '(first at 0.500 s)' in output


@pytest.mark.parametrize('place', range(5))
@pytest.mark.parametrize('value', [math.nan, math.inf])
def test_an_angle_that_is_not_finite_is_found(
    healthy, make_run: MakeRun, capsys: Capture, place: int, value: float
) -> None:
    healthy.answers[7].pose[place] = value
    code, output = review(capsys, make_run(healthy))
    assert (code, found(output)) == (1, ['closure', 'resolve'])


def test_a_foot_that_is_not_finite_is_found(healthy, make_run: MakeRun, capsys: Capture) -> None:
    healthy.change(7, foot=(math.nan, 0.0))
    code, output = review(capsys, make_run(healthy))
    assert (code, found(output)) == (1, ['foot'])


def test_lost_messages_are_found(healthy, make_run: MakeRun, capsys: Capture) -> None:
    del healthy.answers[50:53]
    code, output = review(capsys, make_run(healthy))
    assert (code, found(output)) == (1, ['lost', 'lost', 'lost'])
    assert '3 messages of /joint_states were lost' in output


def test_an_unanswered_angle_is_found_but_not_at_the_edges(
    healthy, make_run: MakeRun, capsys: Capture
) -> None:
    inside = healthy.answers[30].stamp + 1000
    before, after = healthy.answers[0].stamp - 1000, healthy.answers[-1].stamp + 1000
    healthy.unanswered = [(before, 0.1), (inside, 0.2), (after, 0.3)]
    code, output = review(capsys, make_run(healthy))
    assert (code, found(output)) == (1, ['answers'])
    assert '1 of 401 crank angles were not answered (first at' in output


def test_a_damaged_run_is_found(healthy, make_run: MakeRun, capsys: Capture) -> None:
    (path,) = make_run(healthy).glob('*.mcap')
    path.write_bytes(path.read_bytes()[:-3000])
    code, output = review(capsys, path)
    assert code == 1
    assert found(output)[0] == 'container'


def test_a_run_without_geometry_takes_a_file(healthy, make_run: MakeRun, capsys: Capture) -> None:
    healthy.geometry = None
    run = make_run(healthy)
    code, output = review(capsys, run)
    assert (code, found(output)) == (1, ['geometry'])
    code, output = review(capsys, run, '--geometry', ROOT / 'config' / 'sem104.yaml')
    assert (code, found(output)) == (0, [])
    code, output = review(capsys, run, '--geometry', ROOT / 'config' / 'patent.yaml')
    assert code == 1


@pytest.mark.parametrize('content', ['', '[1, 2]', 'a: 1', 'l_ab: -1.0', ': :', 'l_ab: {}'])
def test_a_geometry_file_that_holds_none_is_one_line(
    healthy, make_run: MakeRun, capsys: Capture, tmp_path: Path, content: str
) -> None:
    file = tmp_path / 'geometry.yaml'
    file.write_text(content)
    assert main([str(make_run(healthy)), '--geometry', str(file)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f'review: {file} holds no geometry: ')
    assert error.count('\n') == 1


@pytest.mark.parametrize('name', ['nothing.mcap', 'text.mcap'])
def test_what_is_no_log_is_exit_code_2(name: str, tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / 'text.mcap').write_text('no log')
    assert main([str(tmp_path / name)]) == 2
    error = capsys.readouterr().err
    assert 'is not a readable log' in error
    assert error.count('\n') == 1


@pytest.mark.parametrize('ending', ['png', 'svg'])
def test_a_picture_shows_the_run(
    healthy, make_run: MakeRun, capsys: Capture, tmp_path: Path, ending: str
) -> None:
    picture = tmp_path / f'leg.{ending}'
    assert main([str(make_run(healthy)), '--picture', str(picture)]) == 0
    capsys.readouterr()
    start = {'png': b'\x89PNG', 'svg': b'<?xml'}[ending]
    assert picture.read_bytes().startswith(start)
    assert len(picture.read_bytes()) > 5000


@pytest.mark.parametrize('path', ['leg.nothing', '/not/there/leg.png'])
def test_a_picture_that_cannot_be_made_is_one_line(
    healthy, make_run: MakeRun, capsys: Capture, path: str
) -> None:
    assert main([str(make_run(healthy)), '--picture', path]) == 2
    error = capsys.readouterr().err
    assert error.startswith('review: ')
    assert error.count('\n') == 1
