"""Two runs side by side: what differs is named with its size, and nothing else is."""

from pathlib import Path

from klann_ros.kinematics import KlannGeometry, linkage_from_file, LinkageLeg
from klann_ros.kinematics.klann import COORDINATES, LENGTHS
from klann_ros.review.command import main
from klann_ros.review.model.compare import compare, leg_dimensions
from klann_ros.review.model.recording import LegSolver
from klann_ros.review.reviewing import review_run
import pytest

ROOT = Path(__file__).resolve().parents[3]
JANSEN = ROOT / 'klann_ros' / 'linkages' / 'jansen.yaml'


@pytest.fixture
def differences(make_run):
    """Return what writes two runs and compares them."""

    def of(one, other):
        reviews = [review_run(make_run(each, f'run_{n}')) for n, each in enumerate((one, other))]
        return compare(*reviews)

    return of


def test_a_run_and_itself_do_not_differ(healthy, make_run, capsys) -> None:
    run = str(make_run(healthy))
    assert main([run, run]) == 0
    assert capsys.readouterr().out.endswith('\nthe two runs do not differ\n')


def test_a_faulty_run_and_itself_do_not_differ(healthy, make_run) -> None:
    healthy.answers[100].pose[1] += 0.3
    healthy.change(200, foot=(0.0, 0.0))
    review = review_run(make_run(healthy))
    assert {finding.check for finding in review.findings} == {'closure', 'foot'}
    assert compare(review, review).differences == ()
    healthy.geometry = KlannGeometry(l_ef=0.28)
    review = review_run(make_run(healthy, 'other'))
    assert review.findings
    assert compare(review, review).differences == ()


@pytest.mark.parametrize('name', [*LENGTHS, *(name for name in COORDINATES if name != 'x_d')])
def test_a_length_that_is_one_percent_longer_is_named(make_script, differences, name) -> None:
    before = getattr(KlannGeometry(), name)
    longer = KlannGeometry(**{name: 1.01 * before})
    found = differences(make_script(count=100), make_script(longer, count=100)).differences
    length, *motion = found
    assert (length.what, length.unit) == (name, 'm')
    assert length.size == pytest.approx(0.01 * before)
    both = f'{before:.9g} m in the first run, {1.01 * before:.9g} m in the second'
    assert length.text == f'{name} is {both}, +1.000%'
    # GH moves the foot, and no angle.
    assert [each.what for each in motion] == (['path'] if name == 'l_gh' else ['angles', 'path'])
    for each in motion:
        assert 1e-4 < each.size < 0.1
    if name == 'l_gh':
        assert motion[0].size == pytest.approx(0.0043, abs=1e-12)
        assert motion[0].text == 'the feet are up to 0.0043 m apart at the same crank angle'


def test_different_crank_motions_are_not_reported(make_script, differences) -> None:
    assert differences(make_script(), make_script(turns=-3.3, count=77)).differences == ()


def test_another_phase_is_named(healthy, make_script, differences) -> None:
    other = make_script()
    other.parameters['phase'] = 0.5
    (found,) = differences(healthy, other).differences
    assert (found.what, found.size, found.unit) == ('phase', 0.5, 'rad')
    assert found.text == 'phase is 0 rad in the first run, 0.5 rad in the second'


@pytest.mark.parametrize('which', ['first', 'second'])
def test_a_geometry_missing_in_one_run_is_not_a_difference(
    make_script, differences, which
) -> None:
    runs = [make_script(), make_script(KlannGeometry(l_gh=0.4343))]
    runs[1].geometry = None
    found = differences(*(runs[::-1] if which == 'first' else runs))
    assert [each.what for each in found.differences] == ['path']
    remark = f'the {which} run does not contain its geometry: lengths not compared'
    assert found.remarks == (remark,)


def test_runs_without_any_geometry_are_not_compared(healthy, make_run, capsys) -> None:
    healthy.geometry = None
    run = str(make_run(healthy))
    assert main([run, run]) == 1
    output = capsys.readouterr().out
    assert 'the two runs do not differ, as far as they can be compared\n' in output
    assert 'neither run contains the geometry: motion not compared' in output
    sem104 = str(ROOT / 'config' / 'sem104.yaml')
    assert main([run, run, '--geometry', sem104]) == 0
    assert 'the two runs do not differ\n' in capsys.readouterr().out


def test_legs_that_are_in_one_run_only_are_named(make_script, differences) -> None:
    one, other = make_script().in_namespace('/a'), make_script().in_namespace('/b')
    found = differences(one, other).differences
    assert [(each.what, each.leg) for each in found] == [('legs', 'a'), ('legs', 'b')]
    assert found[0].text == 'the leg a is in the first run only'


def test_a_run_that_differs_is_exit_code_1(make_script, make_run, capsys) -> None:
    one = str(make_run(make_script()))
    other = str(make_run(make_script(KlannGeometry(l_ab=0.1212)), 'other'))
    assert main([one, other]) == 1
    output = capsys.readouterr().out
    assert output.count('nothing found: every pose is the right one') == 2
    assert (
        '\nDIFFERS l_ab: l_ab is 0.12 m in the first run, 0.1212 m in the second, +1.000%\n'
        in output
    )
    assert main([one, 'nothing.mcap']) == 2
    capsys.readouterr()


def test_another_linkage_is_one_difference(healthy, make_script, differences) -> None:
    other = make_script()
    other.parameters['linkage_description'] = JANSEN.read_text()
    (found,) = differences(healthy, other).differences
    kinds = 'Klann leg in the first run, Jansen leg in the second'
    assert (found.what, found.text) == ('linkage', f'the linkages differ: {kinds}')


def test_the_bars_of_a_linkage_have_names(tmp_path) -> None:
    longer = tmp_path / 'jansen.yaml'
    longer.write_text(JANSEN.read_text().replace('length: 50.0', 'length: 50.5'))
    before, after = (
        leg_dimensions(LegSolver(leg=LinkageLeg(linkage_from_file(path))))
        for path in (JANSEN, longer)
    )
    changed = [name for name in before if before[name] != after[name]]
    assert changed == ['X-W']
    assert after['X-W'].value == pytest.approx(0.505)
