"""The report for machines: its keys and types, and null for a missing number."""

from dataclasses import asdict
import json
import math
from pathlib import Path

from klann_ros.review.command import main
from klann_ros.review.model.limits import Limits
import pytest
from yaml_tables import read_table

NULL = type(None)
TYPES = {
    'text': str,
    'flag': bool,
    'int': int,
    'number': (int, float),
    'number or null': (int, float, NULL),
    'int or null': (int, NULL),
}
# The keys of a report and the type of each value; machines rely on it.
SHAPES = read_table(Path(__file__).with_name('report_shape.yaml'))
REPORT = {**SHAPES['report'], 'limits': dict.fromkeys(asdict(Limits()), 'number')}


def matches(value, shape) -> bool:
    if isinstance(shape, dict):
        return value.keys() == shape.keys() and all(
            matches(value[key], part) for key, part in shape.items()
        )
    if isinstance(shape, list):
        return isinstance(value, list) and all(matches(item, shape[0]) for item in value)
    is_flag = isinstance(value, bool)
    return isinstance(value, TYPES[shape]) and is_flag == (shape == 'flag')


@pytest.fixture
def report(tmp_path, capsys):
    """Return what reviews runs and reads the JSON as strictly as a machine."""

    def read(*runs):
        file = tmp_path / 'run.json'
        code = main([*map(str, runs), '--json', str(file)])
        capsys.readouterr()
        # NaN and Infinity are no JSON.
        return code, json.loads(file.read_text(), parse_constant=pytest.fail)

    return read


def test_a_healthy_run_has_its_figures(healthy, make_run, report) -> None:
    code, found = report(make_run(healthy))
    assert matches(found, REPORT)
    assert (code, found['healthy'], found['findings']) == (0, True, [])
    (leg,) = found['legs']
    assert (leg['poses'], leg['judged_poses']) == (400, 400)
    assert leg['turns'] == pytest.approx(2.0)
    assert leg['stride'] == pytest.approx(0.491, abs=1e-4)
    assert found['duration'] == pytest.approx(1.995)
    assert {topic['name']: topic['count'] for topic in found['topics']} == {
        '/crank_angle': 400,
        '/joint_states': 400,
        '/point_h': 400,
    }


def test_findings_have_a_severity_and_a_time(healthy, make_run, report) -> None:
    healthy.answers[100].pose[1] += 1e-3
    code, found = report(make_run(healthy))
    assert matches(found, REPORT)
    (finding,) = found['findings']
    assert (code, found['healthy']) == (1, False)
    assert (finding['check'], finding['severity'], finding['time']) == ('closure', 'error', 0.5)


def test_a_missing_number_is_null(healthy, make_run, report) -> None:
    healthy.geometry = None
    healthy.answers[0].pose[0] = math.nan
    del healthy.answers[1:]
    code, found = report(make_run(healthy))
    assert code == 1
    assert matches(found, REPORT)
    assert {topic['rate'] for topic in found['topics']} == {None}
    assert found['legs'][0]['turns'] is None
    assert found['legs'][0]['worst_residual'] is None


def test_a_comparison_stands_beside_the_first_run(healthy, make_run, make_script, report) -> None:
    other = make_script()
    other.in_namespace('/other')
    code, found = report(make_run(healthy), make_run(other, 'other'))
    assert code == 1
    assert matches(found, {**REPORT, 'comparison': SHAPES['comparison']})
    assert [each['size'] for each in found['comparison']['differences']] == [None, None]
