"""Check each pose against its crank angle, each foot against its pose, each input for answers."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from klann_ros.kinematics import differences, wrapped
from klann_ros.kinematics.arrays import BoolArray, FloatArray, IntArray
from klann_ros.review.model.answers import (
    Cause,
    Duplicates,
    find_duplicates,
    MAX_RESPONSE_TIME,
    requested_angles,
)
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.poses import PoseErrors
from klann_ros.review.model.recording import LegRecording
from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.review.model.times import isin, pairs
from klann_ros.sanitize.text import counted, in_words, listed, printable, verb
import numpy as np


class WrongPoses(NamedTuple):
    """Flags of the wrong poses by fault; the faults exclude each other."""

    not_finite: BoolArray
    open_: BoolArray
    unreachable: BoolArray
    flipped: BoolArray

    @classmethod
    def of(cls, errors: PoseErrors, limits: Limits) -> 'WrongPoses':
        """Return which poses are wrong."""
        not_finite = np.isinf(errors.residuals)
        open_ = ~not_finite & (errors.residuals > limits.closure)
        closed = ~not_finite & ~open_
        sines = np.sin(errors.transmission_angles).min(axis=1)
        flipped = closed & (errors.angle_errors * sines > limits.angle)
        return cls(not_finite, open_, closed & np.isnan(errors.angle_errors), flipped)

    def any(self) -> BoolArray:  # noqa: A003, RUF100 - as NumPy calls it
        """Return the poses with any fault."""
        found: BoolArray = np.logical_or.reduce(self)
        return found


def wrong_poses(leg: ReviewedLeg, errors: PoseErrors, limits: Limits) -> WrongPoses:
    """Return the wrong poses, without those of a second solver."""
    wrong = WrongPoses.of(errors, limits)
    explained = leg.answers.duplicates.explained(wrong.any())
    for flags in wrong:
        flags[explained] = False
    return wrong


# A fault: its check, flags of poses or feet, verbs for one and several, text and meaning.
_Fault = tuple[str, BoolArray, tuple[str, str], str, str]


def check_poses(review: Review) -> Iterator[Finding]:
    """Yield wrong poses and feet; each pose has one fault at most."""
    for leg in review.legs:
        if leg.errors is None:
            continue
        wrong = wrong_poses(leg, leg.errors, review.limits)
        feet = _feet(leg, leg.errors, review.limits, wrong.any())
        for what, series, faults in (
            ('poses', leg.evaluated.poses, _poses(leg.errors, wrong)),
            ('feet (point_h)', leg.evaluated.feet, feet),
        ):
            for check, which, verbs, fault, meaning in faults:
                if which.any():
                    count = int(which.sum())
                    text = f'{count} of {len(which)} {what} {verb(count, *verbs)} {fault}'
                    time = review.since_start(series.times[int(np.argmax(which))])
                    title = leg.recording.title
                    yield Finding(check, Severity.ERROR, text, meaning, time, title)


def _poses(errors: PoseErrors, wrong: WrongPoses) -> Iterator[_Fault]:
    flipped = _by_up_to(errors.angle_errors, wrong.flipped, 'rad')
    yield (
        'nan',
        wrong.not_finite,
        ('has', 'have'),
        'an angle that is not finite',
        'solver_node never publishes such a pose: another node did',
    )
    yield (
        'closure',
        wrong.open_,
        ('does', 'do'),
        f'not close the loops{_by_up_to(errors.residuals, wrong.open_, "m")}',
        'the poses are of a leg with other dimensions',
    )
    yield (
        'reach',
        wrong.unreachable,
        ('stands', 'stand'),
        'at a crank angle that the leg cannot reach',
        'the loops still close within the limit: the crank is at the end of its range',
    )
    yield (
        'branch',
        wrong.flipped,
        ('is', 'are'),
        f'in another assembly mode than the leg{flipped}',
        'the loops close, but in another assembly mode: the branch flipped',
    )


def _feet(
    leg: ReviewedLeg, errors: PoseErrors, limits: Limits, wrong_poses_: BoolArray
) -> Iterator[_Fault]:
    not_finite = np.isinf(errors.foot_errors)
    yield (
        'nan',
        not_finite,
        ('is', 'are'),
        'not finite',
        'solver_node never publishes such a foot',
    )
    wrong = ~not_finite & (errors.foot_errors > limits.foot)
    if wrong.any():
        wrong &= ~_follow(leg, wrong_poses_)
    by = _by_up_to(errors.foot_errors, wrong, 'm')
    yield (
        'foot',
        wrong,
        ('is', 'are'),
        f'not at the position that the angles of their poses give{by}',
        'angles and foot contradict each other: the bent bodies, or GH, have other dimensions',
    )


def _by_up_to(errors: FloatArray, which: BoolArray, unit: str) -> str:
    """Return the largest of some errors in words."""
    return f' (by up to {errors[which].max():.3g} {unit})' if which.any() else ''


def _follow(leg: ReviewedLeg, wrong: BoolArray) -> BoolArray:
    """Return the feet of wrong poses, and those without a unique pose."""
    of_feet, of_poses = pairs(leg.evaluated.feet.stamps, leg.evaluated.poses.stamps)
    several = leg.evaluated.poses.stamps[leg.answers.duplicates.rows]
    follow = isin(leg.evaluated.feet.stamps, several)
    follow[of_feet] |= wrong[of_poses]
    return follow


def check_answers(review: Review) -> Iterator[Finding]:
    """Yield poses at another angle than their input, and inputs without answer."""
    for leg in review.legs:
        if len(leg.evaluated.poses):
            yield from _wrong_questions(review, leg)
            yield from _refused(review, leg)
            yield from _missing_answers(review, leg)


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
        time = review.since_start(leg.poses.times[int(np.argmax(wrong))])
        yield Finding('alpha', Severity.ERROR, text, meaning, time, leg.title)


def _refused(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    found, title = leg.answers, leg.recording.title
    for cause in (Cause.NO_ANGLE, Cause.OUT_OF_REACH):
        rows = found.of(cause)
        if not rows.size:
            continue
        angles = f'{rows.size} of {found.asked} crank angles'
        time = review.since_start(leg.evaluated.cranks.times[rows[0]])
        if cause == Cause.NO_ANGLE:
            were = verb(rows.size, 'was', 'were')
            text = f'{angles} {were} invalid: not finite, or beyond 1e6 rad'
            meaning = (
                'the publisher of the crank angle sends invalid values; solver_node ignores them'
            )
            yield Finding('rejected', Severity.WARNING, text, meaning, time, title)
        else:
            text = f'{angles} cannot be reached by this leg'
            meaning = 'the crank cannot make a full turn; solver_node publishes nothing there'
            yield Finding('reach', Severity.WARNING, text, meaning, time, title)


def _missing_answers(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    found = leg.unanswered
    if found.unexplained <= 0:
        return
    own = [t for t in review.recording.topics if t.name in leg.evaluated.pose_topics]
    unknown = next((topic for topic in own if topic.lost is None), None)
    severity = Severity.WARNING
    meaning = 'the solver was overloaded or not running, or its input was lost'
    if unknown is not None:
        severity = Severity.NOTE
        why = 'it has several publishers'
        why = why if unknown.shared else 'its messages have no sequence numbers'
        meaning = (
            f'the answers may have been lost on their way into the log: losses of '
            f'{printable(unknown.name)} are unknown, as {why}'
        )
    were = verb(found.count, 'was', 'were')
    text = f'{found.count} of {leg.answers.asked} crank angles {were} not answered{found}'
    time = review.since_start(leg.evaluated.cranks.times[found.other_rows[0]])
    yield Finding('answers', severity, text, meaning, time, leg.recording.title)


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
        count = len(np.unique(found.duplicates.inputs))
        were = verb(count, 'angle was', 'angles were')
        text = f'{count} of {found.asked} crank {were} answered more than once'
        meaning = 'a second solver ran for a moment, or the log holds answers twice'
        first = leg.evaluated.poses.times[found.duplicates.rows.min()]
        time = review.since_start(first)
        yield Finding('solvers', Severity.NOTE, text, meaning, time, leg.recording.title)


def _unstamped(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    """Yield several solvers in a run without stamped inputs."""
    evaluated = leg.evaluated
    if not review.recording.is_shared(evaluated.pose_topics):
        return
    if evaluated.solver.sim_time:
        yield from _by_number(review, leg)
        return
    duplicates = find_duplicates(evaluated.poses.stamps)
    if duplicates.solvers > 1:
        stamps = np.unique(evaluated.poses.stamps)
        text = f'{len(evaluated.poses)} answers with {len(stamps)} stamps'
        yield _several(review, leg, duplicates, text)


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
    severity = Severity.ERROR if apart else Severity.WARNING
    text = f'{who} answer on {listed(sorted(evaluated.pose_topics))}: {counts}{apart}'
    meaning = 'subscribers receive all of them: stop one, or give it its own namespace'
    time = review.since_start(evaluated.poses.times[duplicates.rows.min()])
    return Finding('solvers', severity, text, meaning, time, leg.recording.title)


def _apart(leg: LegRecording, duplicates: Duplicates, limits: Limits) -> str:
    """Return the largest difference of answers to one input in words; '' for none."""
    rows = duplicates.rows[duplicates.alone]
    stamps = leg.poses.stamps[rows]
    known = leg.solver.leg

    def turned(one: FloatArray, other: FloatArray) -> FloatArray:
        return differences(known, one[:, 1:], other[:, 1:]) if known else wrapped(one - other)

    angle = _spread(stamps, leg.poses.values[rows], turned)
    of_them = isin(leg.feet.stamps, stamps)
    foot = _spread(leg.feet.stamps[of_them], leg.feet.values[of_them], np.subtract)
    parts = [f'{angle:.3g} rad'] if angle > limits.angle else []
    parts += [f'{foot:.3g} m'] if foot > limits.foot else []
    return f', up to {" and ".join(parts)} apart' if parts else ''


def _spread(stamps: IntArray, values: FloatArray, difference: Callable[..., FloatArray]) -> float:
    """Return the largest difference of values with equal stamps."""
    order = np.argsort(stamps, kind='stable')
    stamps, values = stamps[order], values[order]
    apart = np.abs(difference(values, values[np.searchsorted(stamps, stamps)]))
    return float(np.fmax.reduce(apart, axis=None, initial=0.0))
