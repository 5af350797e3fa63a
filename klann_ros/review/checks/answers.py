"""Check answers: crank angles, missing answers, duplicate solvers."""

from collections.abc import Callable, Iterator

from klann_ros.kinematics.arrays import FloatArray, IntArray
from klann_ros.kinematics.batch.poses import differences, wrapped
from klann_ros.review.model.answers import (
    Cause,
    Duplicates,
    find_duplicates,
    MAX_RESPONSE_TIME,
    requested_angles,
)
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.recording import LegRecording
from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.review.model.times import isin
from klann_ros.sanitize.text import counted, in_words, listed, printable, verb
import numpy as np

from .poses import wrong_poses


def check_answers(review: Review) -> Iterator[Finding]:
    """Yield poses at another angle than their input, and inputs without answer."""
    for leg in review.legs:
        if len(leg.evaluated.poses):
            yield from _wrong_questions(review, leg)
            yield from _refused(review, leg)
            yield from _unanswered(review, leg)


def _wrong_questions(review: Review, reviewed: ReviewedLeg) -> Iterator[Finding]:
    leg = reviewed.evaluated
    rows, asked = requested_angles(leg)
    alphas = leg.poses.values[rows, 0]
    # A double comes through unchanged; `check_poses` finds values that are not finite.
    wrong = np.zeros(len(leg.poses), dtype=bool)
    wrong[rows] = np.isfinite(alphas) & (alphas != asked)
    if wrong.any() and reviewed.errors is not None:
        # `check_poses` finds poses of another leg.
        wrong &= ~wrong_poses(reviewed, reviewed.errors, review.limits).any()
    wrong[reviewed.answers.duplicates.explained(wrong)] = False
    if wrong.any():
        count = int(wrong.sum())
        text = (
            f'{count} of {len(rows)} poses {verb(count, "is", "are")} at another crank angle '
            'than their input'
        )
        meaning = 'alpha does not follow from the input by direction and phase'
        time = review.recording.since_start(leg.poses.times[int(np.argmax(wrong))])
        yield Finding('alpha', Severity.ERROR, text, meaning, time, leg.title)


def _refused(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    """Yield invalid and unreachable crank angles."""
    found, times = leg.answers, leg.evaluated.cranks.times
    rows = found.of(Cause.NO_ANGLE)
    if rows.size:
        yield Finding(
            'rejected',
            Severity.WARNING,
            f'{rows.size} of {found.asked} crank angles {verb(rows.size, "was", "were")} invalid: '
            'not finite, or beyond 1e6 rad',
            'the publisher of the crank angle sends invalid values; solver_node ignores them',
            review.recording.since_start(times[rows[0]]),
            leg.recording.title,
        )
    rows = found.of(Cause.OUT_OF_REACH)
    if rows.size:
        yield Finding(
            'reach',
            Severity.WARNING,
            f'{rows.size} of {found.asked} crank angles cannot be reached by this leg',
            'the crank cannot make a full turn; solver_node publishes nothing there',
            review.recording.since_start(times[rows[0]]),
            leg.recording.title,
        )


def _unanswered(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    """Yield unexplained crank angles without answer."""
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
    meaning = 'the solver was overloaded or not running, or its input was lost'
    if unknown:
        severity = Severity.NOTE
        why = (
            'it has several publishers'
            if unknown[0].shared
            else 'its messages have no sequence numbers'
        )
        meaning = (
            f'the answers may have been lost on their way into the log: losses of '
            f'{printable(unknown[0].name)} are unknown, as {why}'
        )
    yield Finding(
        'answers',
        severity,
        f'{found.count} of {leg.answers.asked} crank angles '
        f'{verb(found.count, "was", "were")} not answered{found}',
        meaning,
        review.recording.since_start(evaluated.cranks.times[found.other_rows[0]]),
        leg.recording.title,
    )


# Difference of values of the same shape.
Difference = Callable[[FloatArray, FloatArray], FloatArray]
# Thresholds where a simulated clock hides which answer belongs to which input: ratio of the
# counts, and surplus at the edges of the run.
_DUPLICATE_RATIO = 1.25
_EDGE_ANSWERS = 10


def check_solvers(review: Review) -> Iterator[Finding]:
    """Yield legs of several solvers, and inputs with several answers."""
    for leg in review.legs:
        yield from _stamped(review, leg) if len(leg.evaluated.cranks) else _unstamped(review, leg)


def _stamped(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    """Yield several answers to the stamp of one input."""
    found = leg.answers
    if found.duplicates.solvers > 1:
        asked = counted(found.asked, 'crank angle')
        yield _several(review, leg, found.duplicates, f'{found.count} answers to {asked}')
    elif len(found.duplicates.rows):
        first = leg.evaluated.poses.times[found.duplicates.rows.min()]
        count = len(np.unique(found.duplicates.inputs))
        were = verb(count, 'angle was', 'angles were')
        yield Finding(
            'solvers',
            Severity.NOTE,
            f'{count} of {found.asked} crank {were} answered more than once',
            'a second solver ran for a moment, or the log holds answers twice',
            review.recording.since_start(first),
            leg.recording.title,
        )


def _unstamped(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    """Yield several solvers in a run without stamped inputs."""
    evaluated = leg.evaluated
    if not any(t.shared for t in review.recording.topics if t.name in evaluated.pose_topics):
        return
    if evaluated.solver.sim_time:
        yield from _by_number(review, leg)
        return
    duplicates = find_duplicates(evaluated.poses.stamps)
    if duplicates.solvers > 1:
        stamps = np.unique(evaluated.poses.stamps)
        yield _several(
            review, leg, duplicates, f'{len(evaluated.poses)} answers with {len(stamps)} stamps'
        )


def _by_number(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    """Yield more answers than inputs, where every lost input is known."""
    asked, answers = leg.evaluated.unstamped, leg.evaluated.poses.times
    of_cranks = [t for t in review.recording.topics if t.name in leg.evaluated.crank_topics]
    lost = sum(topic.lost or 0 for topic in of_cranks)
    if not len(asked) or any(topic.lost is None for topic in of_cranks):
        return
    inside = np.flatnonzero((answers >= asked[0]) & (answers <= asked[-1] + MAX_RESPONSE_TIME))
    if len(inside) > _DUPLICATE_RATIO * (len(asked) + lost) + _EDGE_ANSWERS:
        ratio = round(len(inside) / (len(asked) + lost))
        first = inside[:1]
        duplicates = Duplicates(first, first, np.zeros(1, dtype=bool), max(2, ratio))
        text = f'{len(inside)} answers to {counted(len(asked), "crank angle")}'
        yield _several(review, leg, duplicates, text)


def _several(review: Review, leg: ReviewedLeg, duplicates: Duplicates, counts: str) -> Finding:
    evaluated = leg.evaluated
    names = sorted(evaluated.solver.nodes)
    who = f'{in_words(duplicates.solvers)} solvers'
    who += f' ({listed(names)})' if len(names) > 1 else ''
    apart = _apart(evaluated, duplicates, review.limits)
    return Finding(
        'solvers',
        Severity.ERROR if apart else Severity.WARNING,
        f'{who} answer on {listed(sorted(evaluated.pose_topics))}: {counts}{apart}',
        'subscribers receive all of them: stop one, or give it its own namespace',
        review.recording.since_start(evaluated.poses.times[duplicates.rows.min()]),
        leg.recording.title,
    )


def _apart(leg: LegRecording, duplicates: Duplicates, limits: Limits) -> str:
    """Return the largest difference of answers to one input in words; '' for none."""
    rows = duplicates.rows[duplicates.alone]
    stamps = leg.poses.stamps[rows]
    angle = _spread(stamps, leg.poses.values[rows], _difference(leg))
    of_them = isin(leg.feet.stamps, stamps)
    foot = _spread(leg.feet.stamps[of_them], leg.feet.values[of_them], np.subtract)
    parts = [f'{angle:.3g} rad'] if angle > limits.angle else []
    parts += [f'{foot:.3g} m'] if foot > limits.foot else []
    return f', up to {" and ".join(parts)} apart' if parts else ''


def _difference(leg: LegRecording) -> Difference:
    """Return the difference function of two poses of a leg."""
    known = leg.solver.leg
    if known is None:
        return lambda one, other: wrapped(one - other)
    return lambda one, other: differences(known, one[:, 1:], other[:, 1:])


def _spread(stamps: IntArray, values: FloatArray, difference: Difference) -> float:
    """Return the largest difference of values with equal stamps."""
    order = np.argsort(stamps, kind='stable')
    stamps, values = stamps[order], values[order]
    apart = np.abs(difference(values, values[np.searchsorted(stamps, stamps)]))
    return float(np.fmax.reduce(apart, axis=None, initial=0.0))
