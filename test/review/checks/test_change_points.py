"""A run through change points: right along the tangent, and named where it goes another way."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from change_point_linkages import change_point_file, change_point_linkage, FEET
from engine_leg import engine_poses
from klann_ros.kinematics import Linkage, LinkageLeg, LinkagePose
from klann_ros.kinematics.linkage.file import linkage_from_text
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.review import Finding, Severity
from klann_ros.review.reviewing import review_run
from leg_runs import LegRun
import numpy as np
import pytest

TURN = 2.0 * np.pi
EXACT = Limits()
# The engine's loops are soft.
PLAY = Limits(closure=1e-5, angle=1e-3, foot=1e-5)


@dataclass
class RecordedLeg:
    """Poses that a robot had, in place of a solver's."""

    linkage: Linkage
    pose_at: Callable[[float], LinkagePose]

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self.linkage.joint_names

    def solve(self, alpha: float) -> LinkagePose:
        return self.pose_at(alpha)


def errors_of(
    folder: Path,
    name: str,
    pose_at: Callable[[float], LinkagePose],
    limits: Limits = EXACT,
    **options: Any,
) -> list[Finding]:
    parameters = {'linkage_description': change_point_file(name).read_text(encoding='utf-8')}
    leg = RecordedLeg(change_point_linkage(name), pose_at)
    run = LegRun(legs={'': leg}, parameters=parameters, rates=False, **options)
    findings = review_run(run.write(folder / 'run'), limits=limits).findings
    return [finding for finding in findings if finding.severity is Severity.ERROR]


def crossed(name: str) -> LinkageLeg:
    """Return the leg that goes the other way at its change points."""
    text = change_point_file(name).read_text(encoding='utf-8')
    return LinkageLeg(linkage_from_text(f'{text}\nat_change_points: crossed\n', name))


@pytest.mark.parametrize('turns', [2.5, -2.5])
@pytest.mark.parametrize('name', FEET)
def test_a_run_along_the_tangent_is_right(tmp_path: Path, name: str, turns: float) -> None:
    leg = LinkageLeg(change_point_linkage(name))
    assert errors_of(tmp_path, name, leg.solve, turns=turns, start=0.3, count=120) == []


@pytest.mark.parametrize('first', [0.0, 1.0])
@pytest.mark.parametrize('name', ['two_turns', 'slotted_arm', 'kite_on_crank'])
def test_recorded_angles_may_be_wrapped_and_begin_in_any_turn(
    tmp_path: Path, name: str, first: float
) -> None:
    leg = LinkageLeg(change_point_linkage(name))

    def pose_at(alpha: float) -> LinkagePose:
        return leg.closed_form(alpha + first * TURN)._replace(alpha=alpha % TURN)

    assert errors_of(tmp_path, name, pose_at, turns=4.0, start=0.3, count=120) == []


@pytest.mark.parametrize('name', ['parallelogram', 'two_turns', 'level_foot', 'slotted_arm'])
def test_a_robot_in_the_engine_is_right(tmp_path: Path, name: str) -> None:
    poses = iter(engine_poses(name, 8.0 * np.pi, turns=2, count=400))
    assert errors_of(tmp_path, name, lambda _: next(poses), PLAY) == []


class OtherWay(NamedTuple):
    """A robot that is on the other motion in a part of its path [turns]."""

    name: str
    bodies: str
    part: tuple[float, float]
    # The change points at which the part begins and ends [deg].
    begins: str
    ends: str


@pytest.mark.parametrize(
    'other_way',
    [
        OtherWay('parallelogram', 'coupler, rocker', (0.5, 1.0), '180', '0'),
        OtherWay('parallelogram', 'coupler, rocker', (1.0, 2.0), '0', '0'),
        OtherWay('side_rod', 'rod2, wheel3', (0.75, 1.25), '270', '90'),
        OtherWay('galloway', 'coupler, rocker', (0.5, 2.5), '180', '180'),
        OtherWay('two_turns', 'coupler, rocker', (0.5, 2.5), '180', '180'),
        OtherWay('level_foot', 'link, foot', (0.960292749, 1.217012263), '345.7', '78.12'),
    ],
)
@pytest.mark.parametrize('is_forward', [True, False])
def test_the_other_way_at_a_change_point_is_found_and_named(
    tmp_path: Path, other_way: OtherWay, *, is_forward: bool
) -> None:
    """Backwards it leaves its motion at the end of the same part of the path."""
    right = LinkageLeg(change_point_linkage(other_way.name))
    other = crossed(other_way.name)
    if other_way.name == 'side_rod':
        # The first rod goes on as it should.
        flipped = right.linkage.assembly[0], -right.linkage.assembly[1]
        other = LinkageLeg(right.linkage.in_assembly(flipped))
    begin, end = other_way.part

    def pose_at(alpha: float) -> LinkagePose:
        leg = other if begin * TURN < alpha < end * TURN else right
        return leg.closed_form(alpha)

    start, turns = (0.02, 2.9) if is_forward else (2.92, -2.9)
    way = {'start': start * TURN, 'turns': turns, 'count': 150}
    found = errors_of(tmp_path, other_way.name, pose_at, **way)
    assert [finding.check for finding in found] == ['branch']
    degrees = other_way.begins if is_forward else other_way.ends
    meaning = f'at the change point at {degrees} deg ({other_way.bodies}) it took the other of'
    assert found[0].meaning.startswith(meaning)


def test_a_robot_that_was_put_together_crossed_has_a_wrong_branch(tmp_path: Path) -> None:
    leg = crossed('parallelogram')
    found = errors_of(tmp_path, 'parallelogram', leg.closed_form, start=0.3)
    assert [finding.check for finding in found] == ['branch']


def test_after_a_gap_the_turn_is_found_again(tmp_path: Path) -> None:
    leg = LinkageLeg(change_point_linkage('two_turns'))
    alphas = iter(np.concatenate([np.linspace(0.3, 3.0, 200), np.linspace(9.0, 15.0, 200)]))

    def pose_at(_: float) -> LinkagePose:
        alpha = next(alphas)
        return leg.closed_form(alpha)._replace(alpha=alpha % TURN)

    assert errors_of(tmp_path, 'two_turns', pose_at, pause=(200, 3.0)) == []


def test_another_assembly_of_another_dyad_is_no_change_point(tmp_path: Path) -> None:
    linkage = change_point_linkage('level_foot')
    flipped = LinkageLeg(linkage.in_assembly((-linkage.assembly[0], linkage.assembly[1])))
    right = LinkageLeg(linkage)

    def pose_at(alpha: float) -> LinkagePose:
        return (flipped if 3.0 < alpha < 4.0 else right).closed_form(alpha)

    finding, *more = errors_of(tmp_path, 'level_foot', pose_at)
    assert (finding.check, more) == ('branch', [])
    assert finding.meaning.startswith('the loops close, but in another assembly mode')


def test_what_is_no_angle_does_not_change_the_turn(tmp_path: Path) -> None:
    leg = LinkageLeg(change_point_linkage('two_turns'))
    garbled = {0: np.nan, 100: np.inf, 101: np.nan, 200: 1e300, 300: -1e60, 399: 1e9}
    found = errors_of(tmp_path, 'two_turns', leg.solve, garbled=garbled)
    assert {finding.check for finding in found} == {'nan', 'closure'}
