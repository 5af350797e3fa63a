"""A walk is held against its commands and the ground truth, and blamed for no more than it did."""

from pathlib import Path
from typing import Any

from klann_ros.review import review_run
from klann_ros.review.model.review import Review
import numpy as np
import pytest
from walk_runs import Walking, WAY


@pytest.fixture
def review_recording(tmp_path: Path) -> Any:
    return lambda walking: review_run(walking.write(tmp_path / 'run'))


def checks(review: Review) -> set[str]:
    return {finding.check for finding in review.findings} & {'odometry', 'crank_lag', 'phase'}


def test_a_walk_without_a_fault_has_figures_and_no_finding(review_recording: Any) -> None:
    review = review_recording(Walking(scale=1.01))
    (walk,) = review.walks
    assert walk.distance == pytest.approx(WAY, rel=1e-6)
    assert walk.odometry_error == pytest.approx(0.01 * WAY, rel=1e-6)
    assert walk.heading_error == pytest.approx(0.0, abs=1e-12)
    assert (walk.crank_lag, walk.phase_error) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert checks(review) == set()


def test_a_heading_across_pi_gives_no_error(review_recording: Any) -> None:
    # Between messages of the ground truth, one before a full turn and one after it.
    (walk,) = review_recording(Walking(turning=3.0, late=4_000_000)).walks
    assert walk.heading_error == pytest.approx(0.0, abs=1e-9)


def test_a_heading_is_that_of_a_quaternion_of_any_norm(review_recording: Any) -> None:
    (walk,) = review_recording(Walking(turning=3.0, norm=0.9)).walks
    assert walk.heading_error == pytest.approx(0.0, abs=1e-9)


def test_odometry_that_is_far_from_the_truth_is_found(review_recording: Any) -> None:
    review = review_recording(Walking(scale=1.1))
    (finding,) = (finding for finding in review.findings if finding.check == 'odometry')
    assert finding.text.startswith('odometry was up to 0.2 m off the ground truth over 2 m')
    assert finding.time == pytest.approx(3.99, abs=1e-3)


def test_without_ground_truth_no_error_is_reported(review_recording: Any) -> None:
    review = review_recording(Walking(scale=1.1, truth=False))
    (walk,) = review.walks
    assert np.isnan(walk.odometry_error)
    assert walk.distance == pytest.approx(1.1 * WAY, rel=1e-6)
    assert checks(review) == set()


@pytest.mark.parametrize(
    ('lag', 'expected'),
    [((0.5, 0.5), {'crank_lag'}), ((0.3, 0.0), {'phase'}), ((0.5, 0.0), {'crank_lag', 'phase'})],
)
def test_cranks_that_are_not_where_they_should_be_are_found(
    lag: tuple[float, float], expected: set[str], review_recording: Any
) -> None:
    review = review_recording(Walking(lag=lag))
    assert checks(review) == expected
    times = [finding.time for finding in review.findings if finding.check in expected]
    assert times == pytest.approx([3.0] * len(expected), abs=1e-3)


def test_invalid_messages_are_counted_and_the_rest_is_checked(review_recording: Any) -> None:
    review = review_recording(Walking(cut=10))
    counts = {undecoded.topic: undecoded.count for undecoded in review.recording.undecoded}
    assert counts == {'/odom': 1, '/ground_truth': 1}
    assert checks(review) == set()


def test_crank_commands_require_no_solver_answer(review_recording: Any) -> None:
    review = review_recording(Walking())
    assert all('/crank_command' not in leg.recording.crank_topics for leg in review.legs)
