"""Whether a robot walked as it was told, and was where it thought."""

from collections.abc import Iterator
from math import degrees

from klann_ros.review.model.review import Finding, Review, Severity


def check_walking(review: Review) -> Iterator[Finding]:
    """Yield cranks that were far from their commands, and odometry that was far from the truth."""
    limits, since = review.limits, review.recording.since_start
    for walk in review.walks:
        title = walk.namespace.lstrip('/')
        if walk.crank_lag > limits.crank_lag and walk.lag_time is not None:
            yield Finding(
                'crank_lag',
                Severity.WARNING,
                f'a crank was up to {degrees(walk.crank_lag):.3g} deg off its command',
                'its motor is too weak or blocked, or its encoder jumped',
                since(walk.lag_time),
                title,
            )
        if walk.phase_error > limits.phase and walk.phase_time is not None:
            yield Finding(
                'phase',
                Severity.WARNING,
                f'two cranks were up to {degrees(walk.phase_error):.3g} deg apart from the phases '
                'that were commanded',
                'the gait that keeps the body on its feet was not kept',
                since(walk.phase_time),
                title,
            )
        if walk.odometry_error > limits.odometry * walk.way and walk.odometry_time is not None:
            yield Finding(
                'odometry',
                Severity.WARNING,
                f'odometry was up to {walk.odometry_error:.3g} m off the ground truth on a way of '
                f'{walk.way:.3g} m, its heading up to {degrees(walk.heading_error):.3g} deg',
                'feet that slid, a crank that was not heard, or a curve without an IMU',
                since(walk.odometry_time),
                title,
            )
