"""Two runs side by side: what differs is named with its size, and nothing else is."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from klann_ros.kinematics import KlannGeometry, linkage_from_file, LinkageLeg
from klann_ros.kinematics.klann import COORDINATES, LENGTHS
from klann_ros.review.command import main
from klann_ros.review.model.compare import compare, Comparison, leg_dimensions
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.recording import LegSolver
from klann_ros.review.model.review import located
from klann_ros.review.reviewing import review_run
import pytest
from review_findings import are_alike
from yaml_tables import read_table

ROOT = Path(__file__).resolve().parents[3]
COMPARISONS = read_table(Path(__file__).with_name('comparisons.yaml'))
JANSEN = ROOT / 'klann_ros' / 'linkages' / 'jansen.yaml'


@pytest.fixture
def compared(situation_of: Any, make_run: Any) -> Callable[..., Comparison]:
    """Return what writes two situations and compares them by limits."""

    def compare_situations(*situations: dict[str, Any], **limits: float) -> Comparison:
        reviews = []
        for index, situation in enumerate(situations):
            run = make_run(situation_of(situation), f'{index} {limits}')
            reviews.append(review_run(run, limits=Limits(**limits)))
        return compare(*reviews)

    return compare_situations


@pytest.mark.parametrize('pair', COMPARISONS.values(), ids=COMPARISONS)
def test_two_runs_have_their_differences(compared: Any, pair: dict[str, Any]) -> None:
    both = pair.get('one', {}), pair.get('other', {})
    comparison = compared(*both)
    lines = []
    for difference in comparison.differences:
        quantity = f'{difference.what} {difference.size:.12g} {difference.unit}'.rstrip()
        lines.append(f'{quantity}: {located(difference.leg, difference.text)}')
    assert are_alike(lines, pair['finds']), lines
    assert comparison.remarks == tuple(pair.get('remarks', ()))
    for limits in pair.get('passes_with', ()):
        assert len(compared(*both, **limits).differences) == len(lines) - 1


def test_a_run_and_itself_do_not_differ(healthy, make_run, capsys) -> None:
    run = str(make_run(healthy))
    assert main([run, run]) == 0
    assert capsys.readouterr().out.endswith('\nthe two runs do not differ\n')


@pytest.mark.parametrize('name', [*LENGTHS, *(name for name in COORDINATES if name != 'x_d')])
def test_a_length_that_is_one_percent_longer_is_named(compared, name) -> None:
    nominal = getattr(KlannGeometry(), name)
    longer = {'run': {'geometry': {name: 1.01 * nominal}, 'count': 100}}
    length, *motion = compared({'run': {'count': 100}}, longer).differences
    assert (length.what, length.unit) == (name, 'm')
    assert length.size == pytest.approx(0.01 * nominal)
    lengths = f'{nominal:.9g} m in the first run, {1.01 * nominal:.9g} m in the second'
    assert length.text == f'{name} is {lengths}, +1.000%'
    # GH moves the foot, and no angle.
    quantities = ['path'] if name == 'l_gh' else ['angles', 'path']
    assert [difference.what for difference in motion] == quantities
    for difference in motion:
        assert 1e-4 < difference.size < 0.1
    if name == 'l_gh':
        assert motion[0].size == pytest.approx(0.0043, abs=1e-12)
        assert motion[0].text == 'the feet are up to 4.3 mm apart at the same crank angle'


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


def test_a_run_that_differs_is_exit_code_1(make_script, make_run, capsys) -> None:
    first = str(make_run(make_script()))
    second = str(make_run(make_script(KlannGeometry(l_ab=0.1212)), 'second'))
    assert main([first, second]) == 1
    output = capsys.readouterr().out
    assert output.count('nothing found: every pose is the right one') == 2
    lengths = 'l_ab is 0.12 m in the first run, 0.1212 m in the second, +1.000%'
    assert f'\nDIFFERS l_ab: {lengths}\n' in output
    assert main([first, 'nothing.mcap']) == 2
    capsys.readouterr()


def test_the_bars_of_a_linkage_have_names(tmp_path) -> None:
    longer = tmp_path / 'jansen.yaml'
    longer.write_text(JANSEN.read_text().replace('length: 50.0', 'length: 50.5'))
    dimensions, longer_dimensions = (
        leg_dimensions(LegSolver(leg=LinkageLeg(linkage_from_file(path))))
        for path in (JANSEN, longer)
    )
    assert longer_dimensions['X-W'].value == pytest.approx(0.505)
    dimensions['X-W'] = longer_dimensions['X-W']
    assert dimensions == longer_dimensions
