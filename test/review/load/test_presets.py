"""Every leg that is shipped gives a healthy run: presets, walkers and linkages."""

import math
from pathlib import Path
from typing import Any

from klann_ros.kinematics import KlannGeometry, LinkageLeg
from klann_ros.log.run_parameters import LINKAGE_PARAMETER
from klann_ros.review.reviewing import review_run
from klann_ros.robot import robot_of, solver_parameters
from leg_runs import LegRun
import pytest
from review_findings import checks
import yaml

ROOT = Path(__file__).resolve().parents[3]
# These are of no leg.
OTHERS = {
    'motor_example.yaml',
    'ros2_control.yaml',
    'ekf.yaml',
    'nav2_walker.yaml',
    'gamepad.yaml',
}
CONFIGS = [p for p in sorted((ROOT / 'config').glob('*.yaml')) if p.name not in OTHERS]
LINKAGES = sorted((ROOT / 'klann_ros' / 'linkages').glob('*.yaml'))
# More messages than a check needs, and steps below those of a jump.
COUNT = 60


def parameters_of(path: Path) -> dict[str, Any]:
    """Return the parameters as solver_node records them: with the text of a linkage."""
    text = {LINKAGE_PARAMETER: robot_of(str(path)).legs[0].description}
    if path.parent.name == 'linkages':
        return text
    parameters = solver_parameters(yaml.safe_load(path.read_text())) | text
    return parameters if 'linkage' in parameters else KlannGeometry().as_dict() | parameters


def run_of(path: Path, recorded: dict[str, Any], **options: Any) -> LegRun:
    """Return a run of more than two turns, or of most of the arc where no crank turns fully."""
    legs = robot_of(str(path)).legs
    (start, end), *_ = LinkageLeg(legs[0].linkage).reachable_arcs()
    turns, margin = (end - start) / math.tau, 0.05 * (end - start)
    return LegRun(
        {leg.name: LinkageLeg(leg.linkage) for leg in legs},
        phases={leg.name: leg.phase for leg in legs},
        directions={leg.name: leg.direction for leg in legs},
        parameters=recorded,
        start=-1.0 if turns == 1.0 else start + margin,
        turns=2.4 if turns == 1.0 else 0.9 * turns,
        count=COUNT,
        period=0.01,
        cranks=True,
        **options,
    )


@pytest.mark.parametrize(
    ('path', 'namespace'),
    [(path, '') for path in CONFIGS + LINKAGES]
    + [(ROOT / 'config' / 'walker4.yaml', '/robot/left')],
    ids=lambda value: getattr(value, 'stem', value),
)
def test_shipped_configurations_give_a_healthy_run(tmp_path, path, namespace) -> None:
    parameters = parameters_of(path)
    run = run_of(path, parameters, namespace=namespace)
    review = review_run(run.write(tmp_path / 'run'))
    assert checks(review) == []
    legs = parameters.get('legs', [''])
    titles = {'/'.join(part for part in (namespace[1:], leg) if part) for leg in legs}
    assert {leg.recording.title for leg in review.legs} == titles
    for leg in review.legs:
        assert leg.errors is not None
        evaluated = leg.evaluated
        assert len(evaluated.poses) == len(evaluated.feet) == len(evaluated.cranks) == COUNT
        assert leg.figures.worst_foot_error < 1e-12
        assert abs(leg.figures.turns) == pytest.approx(run.turns)


@pytest.mark.parametrize(
    ('name', 'change'), [('rear_left.direction', 1), ('front_right.phase', 3.1)]
)
def test_a_leg_of_a_walker_that_is_driven_otherwise_is_found(tmp_path, name, change) -> None:
    path = ROOT / 'config' / 'walker4.yaml'
    # The poses are those of one walker, the record is that of another.
    run = run_of(path, {**parameters_of(path), name: change})
    (finding,) = review_run(run.write(tmp_path / 'run')).findings
    assert (finding.check, finding.leg) == ('alpha', name.partition('.')[0])
