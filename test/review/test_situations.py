"""Each fault is exactly its own finding, and a healthy situation is none: situations.yaml."""

from dataclasses import fields
from pathlib import Path
import re
from typing import Any

from findings import checks, timed
from klann_ros.kinematics import KlannGeometry
from klann_ros.review.model.limits import Limits
from klann_ros.review.reviewing import review_run
import pytest
import yaml

SITUATIONS = yaml.safe_load(Path(__file__).with_name('situations.yaml').read_text())
PASSES = {
    f'{key} {k}': (one, limits)
    for key, one in SITUATIONS.items()
    for k, limits in enumerate(one.get('passes_with', ()))
}


def script_of(situation: dict[str, Any], make_script: Any) -> Any:
    """Return the run of a situation: a healthy one, and one thing done to it after the other."""
    given = {**situation.get('run', {})}
    if 'geometry' in given:
        leg = given['geometry']
        given['geometry'] = KlannGeometry.patent() if leg == 'patent' else KlannGeometry(**leg)
    made = make_script(**given)
    for step in situation.get('do', ()):
        do(made, step)
    return made


def do(script: Any, step: dict[str, Any]) -> None:
    ((name, given),) = step.items()
    if name == 'other':
        do(script.others[-1], given)
    elif name == 'recorded':
        script.geometry = given and KlannGeometry(**given)
    elif name == 'parameters':
        script.parameters |= given
    else:
        words = [*given] if isinstance(given, list) else [given]
        are_named = words and isinstance(words[-1], dict) and name not in ('add_counts', 'record')
        named = words.pop() if are_named else {}
        getattr(script, name)(*words, **named)


@pytest.mark.parametrize('situation', SITUATIONS.values(), ids=SITUATIONS)
def test_a_situation_has_its_findings(make_script, make_run, situation: dict[str, Any]) -> None:
    limits = Limits(**situation.get('limits', {}))
    review = review_run(make_run(script_of(situation, make_script)), limits=limits)
    severities = [finding.severity.name for finding in review.findings]
    lines = [' '.join(pair) for pair in zip(severities, timed(review), strict=True)]
    # Three dots stand for any text.
    for line, expected in zip(lines, situation['finds'], strict=True):
        assert re.fullmatch(re.escape(expected).replace(r'\.\.\.', '.*'), line), lines
    lost = {topic.name: topic.lost_in_words for topic in review.topics}
    assert lost.items() >= situation.get('lost', {}).items()
    if 'means' in situation:
        assert situation['means'] in review.findings[-1].meaning
    if 'source' in situation:
        assert review.legs[0].recording.solver.source == situation['source']
    if 'judged' in situation:
        legs = {leg.recording.title: len(leg.evaluated.poses) for leg in review.legs if leg.errors}
        assert legs == situation['judged']


@pytest.mark.parametrize(('situation', 'limits'), PASSES.values(), ids=PASSES)
def test_a_higher_limit_lets_it_pass(
    make_script, make_run, situation: dict[str, Any], limits: dict[str, float]
) -> None:
    review = review_run(make_run(script_of(situation, make_script)), limits=Limits(**limits))
    passed = {line.split()[1].rstrip(':') for line in situation['finds']}
    assert passed - {*checks(review)}


def test_every_limit_has_its_test() -> None:
    # Comparisons are in test_limits.py, torques and walks have files of their own.
    elsewhere = {'compare_path', 'compare_angle', 'compare_length'}
    elsewhere |= {'torque', 'crank_lag', 'phase', 'odometry'}
    tested = {name for _, limits in PASSES.values() for name in limits}
    assert tested | elsewhere == {field.name for field in fields(Limits)}
