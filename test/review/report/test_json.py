"""The report for machines: what stands where, and null for what no number says."""

from dataclasses import asdict
import json
import math

from klann_ros.review.command import main
from klann_ros.review.model.limits import Limits
import pytest

NUMBER = (int, float)
MAYBE = (int, float, type(None))
CRANK_ANGLES = (
    'before_the_first_answer',
    'asked',
    'answered',
    'no_angle',
    'out_of_reach',
    'unanswered_in_gaps',
    'unanswered_while_unrecorded',
    'unanswered_by_lost_answers',
    'unanswered_unexplained',
    'after_the_last_answer',
)
# What stands in it, and of which type; machines rely on it.
SHAPE = {
    'version': int,
    'klann_ros': str,
    'path': str,
    'files': [{'name': str, 'size': int}],
    'start_time': NUMBER,
    'duration': NUMBER,
    'healthy': bool,
    'topics': [
        {
            'name': str,
            'type': str,
            'count': int,
            'rate': MAYBE,
            'period': MAYBE,
            'longest_gap': MAYBE,
            'latency_p50': MAYBE,
            'latency_p99': MAYBE,
            'lost': (int, type(None)),
            'early': int,
            'publishers_left': int,
        }
    ],
    'legs': [
        {
            'leg': str,
            'poses': int,
            'judged_poses': int,
            'geometry_source': str,
            'turns': MAYBE,
            'stride': MAYBE,
            'lift': MAYBE,
            'duty_factor': MAYBE,
            'straightness': MAYBE,
            'worst_transmission_angle': MAYBE,
            'worst_residual': MAYBE,
            'worst_angle_error': MAYBE,
            'worst_foot_error': MAYBE,
            'crank_angles': dict.fromkeys(CRANK_ANGLES, (int, type(None))),
        }
    ],
    'walks': [],
    'limits': dict.fromkeys(asdict(Limits()), NUMBER),
    'findings': [
        {'check': str, 'severity': str, 'text': str, 'meaning': str, 'time': MAYBE, 'leg': str}
    ],
}
COMPARISON = {
    'paths': [str],
    'differences': [{'what': str, 'text': str, 'size': MAYBE, 'unit': str, 'leg': str}],
    'remarks': [str],
}


def matches(value, shape) -> bool:
    if isinstance(shape, dict):
        return value.keys() == shape.keys() and all(
            matches(value[key], part) for key, part in shape.items()
        )
    if isinstance(shape, list):
        return isinstance(value, list) and all(matches(item, shape[0]) for item in value)
    return isinstance(value, shape) and not (shape is MAYBE and isinstance(value, bool))


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
    assert matches(found, SHAPE)
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


def test_findings_are_told_with_severity_and_time(healthy, make_run, report) -> None:
    healthy.answers[100].pose[1] += 1e-3
    code, found = report(make_run(healthy))
    assert matches(found, SHAPE)
    (finding,) = found['findings']
    assert (code, found['healthy']) == (1, False)
    assert (finding['check'], finding['severity'], finding['time']) == ('closure', 'error', 0.5)


def test_what_no_number_says_is_null(healthy, make_run, report) -> None:
    healthy.geometry = None
    healthy.answers[0].pose[0] = math.nan
    del healthy.answers[1:]
    code, found = report(make_run(healthy))
    assert code == 1
    assert matches(found, SHAPE)
    assert {topic['rate'] for topic in found['topics']} == {None}
    assert found['legs'][0]['turns'] is None
    assert found['legs'][0]['worst_residual'] is None


def test_a_comparison_stands_beside_the_first_run(healthy, make_run, make_script, report) -> None:
    other = make_script()
    other.in_namespace('/other')
    code, found = report(make_run(healthy), make_run(other, 'other'))
    assert code == 1
    assert matches(found, {**SHAPE, 'comparison': COMPARISON})
    assert [each['size'] for each in found['comparison']['differences']] == [None, None]
