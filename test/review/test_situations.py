"""Each fault is exactly its own finding, and a healthy situation is none: situations.yaml."""

from dataclasses import fields
from pathlib import Path
from typing import Any

from klann_ros.review.model.limits import Limits
from klann_ros.review.reviewing import review_run
import pytest
from review_findings import are_alike, checks, timed
from yaml_tables import read_table

SITUATIONS = read_table(Path(__file__).with_name('situations.yaml'))
PASSES = {}
for name, situation in SITUATIONS.items():
    for index, limits in enumerate(situation.get('passes_with', ())):
        PASSES[f'{name} {index}'] = situation, limits


@pytest.mark.parametrize('situation', SITUATIONS.values(), ids=SITUATIONS)
def test_a_situation_has_its_findings(situation_of, make_run, situation: dict[str, Any]) -> None:
    limits = Limits(**situation.get('limits', {}))
    review = review_run(make_run(situation_of(situation)), limits=limits)
    lines = []
    for finding, line in zip(review.findings, timed(review), strict=True):
        lines.append(f'{finding.severity.name} {line}')
    assert are_alike(lines, situation['finds']), lines
    lost = {topic.name: topic.lost_in_words for topic in review.topics}
    assert lost.items() >= situation.get('lost', {}).items()
    if 'means' in situation:
        assert situation['means'] in review.findings[-1].meaning
    if 'source' in situation:
        assert review.legs[0].recording.solver.source == situation['source']
    if 'judged' in situation:
        judged_legs = [leg for leg in review.legs if leg.errors]
        poses = {leg.recording.title: len(leg.evaluated.poses) for leg in judged_legs}
        assert poses == situation['judged']


@pytest.mark.parametrize(('situation', 'limits'), PASSES.values(), ids=PASSES)
def test_a_higher_limit_lets_it_pass(
    situation_of, make_run, situation: dict[str, Any], limits: dict[str, float]
) -> None:
    review = review_run(make_run(situation_of(situation)), limits=Limits(**limits))
    passed = {line.split()[1].rstrip(':') for line in situation['finds']}
    assert passed - {*checks(review)}


def test_every_limit_has_its_test() -> None:
    # Comparisons and walks have files of their own.
    tested = {'compare_path', 'compare_angle', 'compare_length', 'crank_lag', 'phase', 'odometry'}
    for _, limits in PASSES.values():
        tested |= limits.keys()
    assert tested == {field.name for field in fields(Limits)}
