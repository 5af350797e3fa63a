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


def matches(content, shape) -> bool:
    if isinstance(shape, dict):
        same_keys = content.keys() == shape.keys()
        return same_keys and all(matches(content[key], shape[key]) for key in shape)
    if isinstance(shape, list):
        return isinstance(content, list) and all(matches(item, shape[0]) for item in content)
    is_flag = isinstance(content, bool)
    return isinstance(content, TYPES[shape]) and is_flag == (shape == 'flag')


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
    code, content = report(make_run(healthy))
    assert matches(content, REPORT)
    assert (code, content['healthy'], content['findings']) == (0, True, [])
    (leg,) = content['legs']
    assert (leg['poses'], leg['judged_poses']) == (400, 400)
    assert leg['turns'] == pytest.approx(2.0)
    assert leg['stride'] == pytest.approx(0.491, abs=1e-4)
    assert content['duration'] == pytest.approx(1.995)
    counts = {topic['name']: topic['count'] for topic in content['topics']}
    assert counts == dict.fromkeys(('/crank_angle', '/joint_states', '/point_h'), 400)


def test_findings_have_a_severity_and_a_time(healthy, make_run, report) -> None:
    healthy.answers[100].pose[1] += 1e-3
    code, content = report(make_run(healthy))
    assert matches(content, REPORT)
    (finding,) = content['findings']
    assert (code, content['healthy']) == (1, False)
    assert (finding['check'], finding['severity'], finding['time']) == ('closure', 'error', 0.5)


def test_a_missing_number_is_null(healthy, make_run, report) -> None:
    healthy.geometry = None
    healthy.answers[0].pose[0] = math.nan
    del healthy.answers[1:]
    code, content = report(make_run(healthy))
    assert code == 1
    assert matches(content, REPORT)
    assert {topic['rate'] for topic in content['topics']} == {None}
    assert content['legs'][0]['turns'] is None
    assert content['legs'][0]['worst_residual'] is None


def test_a_comparison_stands_beside_the_first_run(healthy, make_run, make_script, report) -> None:
    second = make_script().in_namespace('/other')
    code, content = report(make_run(healthy), make_run(second, 'other'))
    assert code == 1
    assert matches(content, {**REPORT, 'comparison': SHAPES['comparison']})
    assert [difference['size'] for difference in content['comparison']['differences']] == [
        None,
        None,
    ]
