"""What the solver was asked, and what it answered."""

from collections.abc import Iterator, Sequence

from klann_ros.review.finding import Finding, Severity
from klann_ros.review.loading.holes import Hole, joined
from klann_ros.review.loading.layouts import Floats
from klann_ros.review.pairing import alone, many_to_one, Rows
from klann_ros.review.recording import LegRecording
from klann_ros.review.reviewed import Review, ReviewedLeg
import numpy as np

from .poses import Wrong
from .silences import silences
from .unanswered import Cause, refused, turned, unanswered

# The check of each cause, what it says, and what it means.
_UNANSWERED = {
    Cause.NO_ANGLE: (
        'rejected',
        '{count} crank angles were none: not finite, or beyond 1e6 rad',
        'whoever turns the crank sends what no crank can do; solver_node leaves it out',
    ),
    Cause.OUT_OF_REACH: (
        'reach',
        '{count} of {asked} crank angles cannot be reached by this leg',
        'the leg does not turn fully; solver_node publishes nothing there',
    ),
    Cause.UNKNOWN: (
        'answers',
        '{count} of {asked} crank angles were not answered',
        'the solver did not keep up, or was not running',
    ),
}


def check(review: Review) -> Iterator[Finding]:
    """Yield poses for another angle than the one that was asked, and questions without answer."""
    for leg in review.legs:
        if len(leg.judged.poses):
            yield from _wrong_questions(review, leg)
            yield from _unanswered(review, leg.judged)


def _wrong_questions(review: Review, reviewed: ReviewedLeg) -> Iterator[Finding]:
    leg = reviewed.judged
    rows, asked = _asked(leg)
    alphas = leg.poses.values[rows, 0]
    # A double comes through unchanged. What is not finite is wrong by itself, and found as such.
    wrong = np.isfinite(alphas) & (alphas != asked)
    if wrong.any() and reviewed.resolved is not None:
        # What is no pose of this leg is found as such, whatever its alpha.
        wrong &= ~Wrong.of(reviewed.resolved, review.limits).any()[rows]
    if wrong.any():
        text = (
            f'{int(wrong.sum())} of {len(wrong)} poses are not for the crank angle that was asked'
        )
        meaning = 'alpha, or direction and phase, are not what the input says'
        first = leg.poses.times[rows[int(np.argmax(wrong))]]
        time = review.recording.since_start(first)
        yield Finding('alpha', Severity.ERROR, text, meaning, time, leg.title)


def _unanswered(review: Review, leg: LegRecording) -> Iterator[Finding]:
    """Yield what was asked and not answered, holes and silences of the answers left out."""
    recording, found = review.recording, unanswered(leg)
    silent = _silent(review, leg, refused(leg, found))
    # An answer that was lost on its way into the run is a loss, and said there.
    lost = recording.lost_on(leg.pose_topics)
    for cause, (name, text, meaning) in _UNANSWERED.items():
        # Silence on what cannot be answered is as it should be.
        holes = silent if cause is Cause.UNKNOWN else recording.holes
        rows = found.of(cause, leg.cranks.times, holes)
        if not rows.size or (cause is Cause.UNKNOWN and rows.size <= lost):
            continue
        filled = text.format(count=rows.size, asked=found.asked)
        time = recording.since_start(leg.cranks.times[rows[0]])
        yield Finding(name, Severity.WARNING, filled, meaning, time, leg.title)


def _silent(review: Review, leg: LegRecording, refused_: Sequence[Hole]) -> tuple[Hole, ...]:
    """Return the holes in the log and the silences of a leg's poses, which are gaps."""
    recording = review.recording
    holes = joined([*recording.holes, *refused_])
    found = (
        (silence.begin, silence.end)
        for topic in recording.topics
        if topic.name in leg.pose_topics
        for silence in silences(topic, holes, review.limits)
    )
    return joined([*recording.holes, *found])


def _asked(leg: LegRecording) -> tuple[Rows, Floats]:
    """
    Return for which poses the run tells the crank angle that was asked, and these angles [rad].

    It does where one input alone has the pose's stamp.
    """
    rows = alone(leg.cranks.stamps)
    known, of_cranks = many_to_one(leg.poses.stamps, leg.cranks.stamps[rows])
    return known, turned(leg, leg.cranks.values[rows[of_cranks], 0])
