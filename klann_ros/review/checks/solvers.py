"""Whether one solver answered, or several on the same topic."""

from collections.abc import Callable, Iterator

from klann_ros.kinematics.batch.given_angles import differences, wrapped
from klann_ros.review.model.answering import repeated, Surplus
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.pairing import are_among
from klann_ros.review.model.recording import LegRecording
from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.review.model.times import Floats, Times
from klann_ros.review.model.unanswered import SOON
from klann_ros.sanitize.text import counted, in_words, listed, verb
import numpy as np

# Returns how values differ from others of the same shape.
Difference = Callable[[Floats, Floats], Floats]
# Under a simulated clock the stamps do not tell whose answer is whose. Then so many answers to a
# question are more than what comes of edges ...
_MORE = 1.25
# ... and so many.
_LEAST = 10


def check_solvers(review: Review) -> Iterator[Finding]:
    """Yield legs that several solvers answer for, and questions that were answered twice."""
    for leg in review.legs:
        yield from _stamped(review, leg) if len(leg.evaluated.cranks) else _unstamped(review, leg)


def _stamped(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    """Yield what the stamps of questions and answers tell."""
    found = leg.answering
    if found.surplus.solvers > 1:
        asked = counted(found.asked, 'question')
        yield _several(review, leg, found.surplus, f'{found.answers} answers to {asked}')
    elif len(found.surplus.rows):
        first = leg.evaluated.poses.times[found.surplus.rows.min()]
        count = len(np.unique(found.surplus.questions))
        were = verb(count, 'angle was', 'angles were')
        yield Finding(
            'solvers',
            Severity.NOTE,
            f'{count} of {found.asked} crank {were} answered more than once',
            'a second solver was there for a moment, or answers are in the log twice',
            review.recording.since_start(first),
            leg.recording.title,
        )


def _unstamped(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    """Yield what can be told without stamps of questions, if several publish the answers."""
    evaluated = leg.evaluated
    if not any(t.shared for t in review.recording.topics if t.name in evaluated.pose_topics):
        return
    if evaluated.solver.sim_time:
        yield from _by_number(review, leg)
        return
    surplus = repeated(evaluated.poses.stamps)
    if surplus.solvers > 1:
        stamps = np.unique(evaluated.poses.stamps)
        yield _several(
            review, leg, surplus, f'{len(evaluated.poses)} answers with {len(stamps)} stamps'
        )


def _by_number(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    """Yield that there are more answers than questions, where no question can be lost unseen."""
    asked, answers = leg.evaluated.unstamped, leg.evaluated.poses.times
    of_cranks = [t for t in review.recording.topics if t.name in leg.evaluated.crank_topics]
    lost = sum(topic.lost or 0 for topic in of_cranks)
    if not len(asked) or any(topic.lost is None for topic in of_cranks):
        return
    inside = np.flatnonzero((answers >= asked[0]) & (answers <= asked[-1] + SOON))
    if len(inside) > _MORE * (len(asked) + lost) + _LEAST:
        ratio = round(len(inside) / (len(asked) + lost))
        first = inside[:1]
        surplus = Surplus(first, first, np.zeros(1, dtype=bool), max(2, ratio))
        text = f'{len(inside)} answers to {counted(len(asked), "question")}'
        yield _several(review, leg, surplus, text)


def _several(review: Review, leg: ReviewedLeg, surplus: Surplus, counts: str) -> Finding:
    evaluated = leg.evaluated
    names = sorted(evaluated.solver.nodes)
    who = f'{in_words(surplus.solvers)} solvers'
    who += f' ({listed(names)})' if len(names) > 1 else ''
    apart = _apart(evaluated, surplus, review.limits)
    return Finding(
        'solvers',
        Severity.ERROR if apart else Severity.WARNING,
        f'{who} answer on {listed(sorted(evaluated.pose_topics))}: {counts}{apart}',
        'whoever listens gets all of them: end one, or give it a namespace of its own',
        review.recording.since_start(evaluated.poses.times[surplus.rows.min()]),
        leg.recording.title,
    )


def _apart(leg: LegRecording, surplus: Surplus, limits: Limits) -> str:
    """Return by how much the answers to the same question differ; '' for not at all."""
    rows = surplus.rows[surplus.alone]
    stamps = leg.poses.stamps[rows]
    angle = _spread(stamps, leg.poses.values[rows], _difference(leg))
    of_them = are_among(leg.feet.stamps, stamps)
    foot = _spread(leg.feet.stamps[of_them], leg.feet.values[of_them], np.subtract)
    told = [f'{angle:.3g} rad'] if angle > limits.angle else []
    told += [f'{foot:.3g} m'] if foot > limits.foot else []
    return f', up to {" and ".join(told)} apart' if told else ''


def _difference(leg: LegRecording) -> Difference:
    """Return how two poses differ, by what is known of the leg."""
    known = leg.solver.leg
    if known is None:
        return lambda one, other: wrapped(one - other)
    return lambda one, other: differences(known, one[:, 1:], other[:, 1:])


def _spread(stamps: Times, values: Floats, difference: Difference) -> float:
    """Return how far apart values with the same stamp are at most."""
    order = np.argsort(stamps, kind='stable')
    stamps, values = stamps[order], values[order]
    apart = np.abs(difference(values, values[np.searchsorted(stamps, stamps)]))
    return float(np.fmax.reduce(apart, axis=None, initial=0.0))
