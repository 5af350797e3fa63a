"""What the solver was asked, and what it answered."""

from collections.abc import Iterator

from klann_ros.review.model.answering import asked_angles, Cause
from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.sanitize.text import printable, verb
import numpy as np

from .poses import wrong_poses


def check_answers(review: Review) -> Iterator[Finding]:
    """Yield poses for another angle than the one that was asked, and questions without answer."""
    for leg in review.legs:
        if len(leg.evaluated.poses):
            yield from _wrong_questions(review, leg)
            yield from _refused(review, leg)
            yield from _unanswered(review, leg)


def _wrong_questions(review: Review, reviewed: ReviewedLeg) -> Iterator[Finding]:
    leg = reviewed.evaluated
    rows, asked = asked_angles(leg)
    alphas = leg.poses.values[rows, 0]
    # A double comes through unchanged. What is not finite is wrong by itself, and found as such.
    wrong = np.zeros(len(leg.poses), dtype=bool)
    wrong[rows] = np.isfinite(alphas) & (alphas != asked)
    if wrong.any() and reviewed.errors is not None:
        # What is no pose of this leg is found as such, whatever its alpha.
        wrong &= ~wrong_poses(reviewed, reviewed.errors, review.limits).any()
    wrong[reviewed.answering.surplus.excused(wrong)] = False
    if wrong.any():
        count = int(wrong.sum())
        text = (
            f'{count} of {len(rows)} poses {verb(count, "is", "are")} not for the crank angle '
            'that was asked'
        )
        meaning = 'alpha, or direction and phase, are not what the input says'
        time = review.recording.since_start(leg.poses.times[int(np.argmax(wrong))])
        yield Finding('alpha', Severity.ERROR, text, meaning, time, leg.title)


def _refused(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    """Yield what was asked and cannot be answered."""
    found, times = leg.answering, leg.evaluated.cranks.times
    rows = found.of(Cause.NO_ANGLE)
    if rows.size:
        yield Finding(
            'rejected',
            Severity.WARNING,
            f'{rows.size} of {found.asked} crank angles {verb(rows.size, "was", "were")} none: '
            'not finite, or beyond 1e6 rad',
            'whoever turns the crank sends what no crank can do; solver_node leaves it out',
            review.recording.since_start(times[rows[0]]),
            leg.recording.title,
        )
    rows = found.of(Cause.OUT_OF_REACH)
    if rows.size:
        yield Finding(
            'reach',
            Severity.WARNING,
            f'{rows.size} of {found.asked} crank angles cannot be reached by this leg',
            'the leg does not turn fully; solver_node publishes nothing there',
            review.recording.since_start(times[rows[0]]),
            leg.recording.title,
        )


def _unanswered(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    """Yield what was asked and not answered, if not all of it is a gap, a hole or a loss."""
    found = leg.unanswered
    if found.unexplained <= 0:
        return
    evaluated = leg.evaluated
    unknown = [
        topic
        for topic in review.recording.topics
        if topic.name in evaluated.pose_topics and topic.lost is None
    ]
    severity = Severity.WARNING
    meaning = 'the solver did not keep up, was not running, or the question was lost on its way'
    if unknown:
        severity = Severity.NOTE
        why = 'several publish there' if unknown[0].shared else 'its messages have no numbers'
        meaning = (
            f'nobody can tell whether the answers were lost on their way into the log: '
            f'of {printable(unknown[0].name)} no loss is known, as {why}'
        )
    yield Finding(
        'answers',
        severity,
        f'{found.count} of {leg.answering.asked} crank angles '
        f'{verb(found.count, "was", "were")} not answered{found}',
        meaning,
        review.recording.since_start(evaluated.cranks.times[found.elsewhere[0]]),
        leg.recording.title,
    )
