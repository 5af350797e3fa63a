"""Check each pose against its crank angle, each foot against its pose, each input for answers."""

from collections.abc import Callable, Iterator
from math import degrees, inf
from typing import NamedTuple

from klann_ros.kinematics import differences, loop_errors, wrapped
from klann_ros.kinematics.arrays import BoolArray, FloatArray, IntArray
from klann_ros.review.model.answers import (
    Cause,
    Duplicates,
    find_duplicates,
    MAX_RESPONSE_TIME,
    requested_angles,
)
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.poses import path_angles, PoseErrors
from klann_ros.review.model.recording import LegRecording
from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.review.model.times import isin, pairs
from klann_ros.sanitize.text import counted, in_words, listed, printable, verb
import numpy as np

# Poses that are tried in degrees; their residuals are smaller by this factor if they are. Largest
# error of an angle in whole degrees [rad].
_MAX_TRIED_POSES = 100
_UNIT_RATIO = 0.05
_MAX_ROUNDING = 0.01
# Rotation of the crank until two motions of a change point differ by more than the limits [rad].
_CHANGE_POINT_DELAY = 0.1


class WrongPoses(NamedTuple):
    """Flags of the wrong poses by fault; the faults exclude each other."""

    not_finite: BoolArray
    not_closed: BoolArray
    unreachable: BoolArray
    flipped: BoolArray

    @classmethod
    def of(cls, errors: PoseErrors, limits: Limits) -> 'WrongPoses':
        """Return which poses are wrong."""
        not_finite = np.isinf(errors.residuals)
        not_closed = ~not_finite & (errors.residuals > limits.closure)
        closed = ~not_finite & ~not_closed
        sines = np.sin(errors.transmission_angles).min(axis=1)
        flipped = closed & (errors.angle_errors * sines > limits.angle)
        return cls(not_finite, not_closed, closed & np.isnan(errors.angle_errors), flipped)

    def any(self) -> BoolArray:  # noqa: A003, RUF100 - as NumPy calls it
        """Return the poses with any fault."""
        is_wrong: BoolArray = np.logical_or.reduce(self)
        return is_wrong


def wrong_poses(leg: ReviewedLeg, errors: PoseErrors, limits: Limits) -> WrongPoses:
    """Return the wrong poses, without those whose input another solver answered rightly."""
    wrong = WrongPoses.of(errors, limits)
    second_answers = leg.answers.duplicates.answered_rightly(wrong.any())
    for flags in wrong:
        flags[second_answers] = False
    return wrong


class _Fault(NamedTuple):
    """A fault of poses or feet."""

    check: str
    flags: BoolArray  # of the poses or feet
    verbs: tuple[str, str]  # for one and several
    text: str
    meaning: str


def check_poses(review: Review) -> Iterator[Finding]:
    """Yield wrong poses and feet; each pose has one fault at most."""
    for leg in review.legs:
        if leg.errors is None:
            continue
        wrong = wrong_poses(leg, leg.errors, review.limits)
        feet = _feet(leg, leg.errors, review.limits, wrong.any())
        for noun, series, faults in (
            ('poses', leg.evaluated.poses, _poses(leg, leg.errors, wrong)),
            ('feet (point_h)', leg.evaluated.feet, feet),
        ):
            for fault in faults:
                if fault.flags.any():
                    count = int(fault.flags.sum())
                    subject = f'{count} of {len(fault.flags)} {noun}'
                    text = f'{subject} {verb(count, *fault.verbs)} {fault.text}'
                    time = review.since_start(series.times[int(np.argmax(fault.flags))])
                    title = leg.recording.title
                    yield Finding(fault.check, Severity.ERROR, text, fault.meaning, time, title)


def _poses(leg: ReviewedLeg, errors: PoseErrors, wrong: WrongPoses) -> Iterator[_Fault]:
    """Yield the faults of poses, by their angles."""
    meaning = 'solver_node never publishes such a pose: another node did'
    yield _Fault('nan', wrong.not_finite, ('has', 'have'), 'an angle that is not finite', meaning)
    gap = _by_up_to(1e3 * errors.residuals, wrong.not_closed, 'mm')
    meaning = _not_closed_meaning(leg.evaluated, wrong.not_closed)
    yield _Fault('closure', wrong.not_closed, ('does', 'do'), f'not close the loops{gap}', meaning)
    text = 'at a crank angle that the leg cannot reach'
    meaning = 'the loops still close within the limit: the crank is at the end of its range'
    yield _Fault('reach', wrong.unreachable, ('stands', 'stand'), text, meaning)
    rotation = _by_up_to(np.degrees(errors.angle_errors), wrong.flipped, 'deg')
    text = f'in another assembly mode than the leg{rotation}'
    meaning = _flipped_meaning(leg.evaluated, int(np.argmax(wrong.flipped)))
    yield _Fault('branch', wrong.flipped, ('is', 'are'), text, meaning)


def _flipped_meaning(leg: LegRecording, first: int) -> str:
    """Return why poses from the first on are in another assembly mode, as by a change point."""
    if leg.solver.leg is not None and first > 0:
        points = leg.solver.leg.linkage.change_points
        begin, end = path_angles(leg, leg.solver.leg)[[first - 1, first]]
        for point in points.points:
            behind = float(wrapped(end - point.beta)) * np.sign(end - begin)
            if -1e-9 <= behind <= abs(end - begin) + _CHANGE_POINT_DELAY:
                return (
                    f'at the change point at {round(degrees(point.beta), 6) % 360.0:.4g} deg '
                    f'({", ".join(points.links(point))}) it took the other of the two motions '
                    'that meet there'
                )
    return 'the loops close, but in another assembly mode: the branch flipped'


def _not_closed_meaning(leg: LegRecording, flags: BoolArray) -> str:
    """Return why poses do not close the loops: other dimensions, degrees, or rounded angles."""
    rows = np.flatnonzero(flags)[:_MAX_TRIED_POSES]
    slides = np.array(leg.solver.slides)
    if rows.size and leg.solver.leg is not None:
        poses = leg.poses.values[rows]
        residuals = loop_errors(leg.solver.leg, poses)
        in_radians = np.where(slides, poses, np.radians(poses))
        if np.median(loop_errors(leg.solver.leg, in_radians)) < _UNIT_RATIO * np.median(residuals):
            return 'the angles are in degrees, and have to be in radians'
        step = _rounding_step(leg.poses.values)
        if residuals.max() <= 2.0 * step * leg.solver.leg.linkage.size:
            return (
                f'the angles are rounded to {step:.1g} rad; if that is intended, raise closure, '
                'angle and foot by --limits'
            )
    return 'the poses are of a leg with other dimensions'


def _rounding_step(numbers: FloatArray) -> float:
    """Return the largest step of numbers as 32 bits or some decimals hold them, 0 for doubles."""
    narrow = numbers.astype(np.float32)
    if (narrow == numbers).all():
        return float(np.spacing(np.abs(narrow).max()))
    decimals = (places for places in range(1, 10) if (numbers.round(places) == numbers).all())
    return 10.0 ** -next(decimals, inf)


def _feet(
    leg: ReviewedLeg, errors: PoseErrors, limits: Limits, wrong_poses_: BoolArray
) -> Iterator[_Fault]:
    """Yield the faults of feet, by the angles of their poses."""
    not_finite = np.isinf(errors.foot_errors)
    meaning = 'solver_node never publishes such a foot'
    yield _Fault('nan', not_finite, ('is', 'are'), 'not finite', meaning)
    wrong = ~not_finite & (errors.foot_errors > limits.foot)
    if wrong.any():
        wrong &= ~_follow(leg, wrong_poses_)
    distance = _by_up_to(1e3 * errors.foot_errors, wrong, 'mm')
    text = f'not at the position that the angles of their poses give{distance}'
    meaning = (
        'angles and foot contradict each other: the bent bodies, or GH, have other dimensions'
    )
    yield _Fault('foot', wrong, ('is', 'are'), text, meaning)


def _by_up_to(errors: FloatArray, flags: BoolArray, unit: str) -> str:
    """Return the largest of some errors in words."""
    return f' (by up to {errors[flags].max():.3g} {unit})' if flags.any() else ''


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
            yield from _wrong_crank_angles(review, leg)
            yield from _refused(review, leg)
            yield from _missing_answers(review, leg)


def _wrong_crank_angles(review: Review, reviewed: ReviewedLeg) -> Iterator[Finding]:
    """Yield a finding of poses at another crank angle than their input requests, if any."""
    leg = reviewed.evaluated
    rows, requested_alphas = requested_angles(leg)
    alphas = leg.poses.values[rows, 0]
    # A double comes through unchanged; `check_poses` finds values that are not finite.
    wrong = np.zeros(len(leg.poses), dtype=bool)
    # Other solvers may wrap the angle.
    errors = np.abs(wrapped(wrapped(alphas) - wrapped(requested_alphas)))
    is_turn = ~np.isclose(alphas, requested_alphas, atol=1.0) & (errors <= review.limits.angle)
    wrong[rows] = np.isfinite(alphas) & (alphas != requested_alphas) & ~is_turn
    if wrong.any() and reviewed.errors is not None:
        # `check_poses` finds poses of another leg.
        wrong &= ~wrong_poses(reviewed, reviewed.errors, review.limits).any()
    wrong[reviewed.answers.duplicates.answered_rightly(wrong)] = False
    if wrong.any():
        count = int(wrong.sum())
        text = (
            f'{count} of {len(rows)} poses {verb(count, "is", "are")} at another crank angle '
            'than their input'
        )
        meaning = 'alpha does not follow from the input by direction and phase'
        errors = wrapped(alphas - np.radians(requested_alphas))[wrong[rows]]
        if np.median(np.abs(errors)) < _MAX_ROUNDING:
            meaning = 'the input is in degrees, and has to be in radians'
        time = review.since_start(leg.poses.times[int(np.argmax(wrong))])
        yield Finding('alpha', Severity.ERROR, text, meaning, time, leg.title)


def _refused(review: Review, leg: ReviewedLeg) -> Iterator[Finding]:
    """Yield the crank angles that have no pose."""
    title = leg.recording.title
    for cause in (Cause.NO_ANGLE, Cause.OUT_OF_REACH):
        rows = leg.answers.of(cause)
        if not rows.size:
            continue
        angles = f'{rows.size} of {leg.answers.asked} crank angles'
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
    unanswered = leg.unanswered
    if unanswered.unexplained <= 0:
        return
    severity = Severity.WARNING
    meaning = 'the solver was overloaded or not running, or its input was lost'
    for topic in review.recording.topics:
        if topic.name in leg.evaluated.pose_topics and topic.lost is None:
            severity = Severity.NOTE
            reason = 'its messages have no sequence numbers'
            if topic.shared:
                reason = 'it has several publishers'
            meaning = (
                f'the answers may have been lost on their way into the log: losses of '
                f'{printable(topic.name)} are unknown, as {reason}'
            )
            break
    were = verb(unanswered.count, 'was', 'were')
    angles = f'{unanswered.count} of {leg.answers.asked} crank angles'
    text = f'{angles} {were} not answered{unanswered}'
    time = review.since_start(leg.evaluated.cranks.times[unanswered.other_rows[0]])
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
    answers = leg.answers
    duplicates = answers.duplicates
    if duplicates.solvers > 1:
        angles = counted(answers.asked, 'crank angle')
        yield _several(review, leg, duplicates, f'{answers.count} answers to {angles}')
    elif len(duplicates.rows):
        count = len(np.unique(duplicates.inputs))
        were = verb(count, 'angle was', 'angles were')
        text = f'{count} of {answers.asked} crank {were} answered more than once'
        meaning = 'a second solver ran for a moment, or the log holds answers twice'
        time = review.since_start(leg.evaluated.poses.times[duplicates.rows.min()])
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
    inputs = leg.evaluated.unstamped
    answers = leg.evaluated.poses.times
    crank_topics = leg.evaluated.crank_topics
    losses = [topic.lost for topic in review.recording.topics if topic.name in crank_topics]
    if not len(inputs) or None in losses:
        return
    input_count = len(inputs) + sum(lost or 0 for lost in losses)
    last_answer = inputs[-1] + MAX_RESPONSE_TIME
    inside = np.flatnonzero((answers >= inputs[0]) & (answers <= last_answer))
    if len(inside) > _DUPLICATE_RATIO * input_count + _EDGE_ANSWERS:
        ratio = round(len(inside) / input_count)
        first = inside[:1]
        duplicates = Duplicates(first, first, np.zeros(1, dtype=bool), max(2, ratio))
        text = f'{len(inside)} answers to {counted(len(inputs), "crank angle")}'
        yield _several(review, leg, duplicates, text)


def _several(review: Review, leg: ReviewedLeg, duplicates: Duplicates, counts: str) -> Finding:
    evaluated = leg.evaluated
    names = sorted(evaluated.solver.nodes)
    solvers = f'{in_words(duplicates.solvers)} solvers'
    if len(names) > 1:
        solvers += f' ({listed(names)})'
    difference = _difference_text(evaluated, duplicates, review.limits)
    severity = Severity.ERROR if difference else Severity.WARNING
    topics = listed(sorted(evaluated.pose_topics))
    text = f'{solvers} answer on {topics}: {counts}{difference}'
    meaning = 'subscribers receive all of them: stop one, or give it its own namespace'
    time = review.since_start(evaluated.poses.times[duplicates.rows.min()])
    return Finding('solvers', severity, text, meaning, time, leg.recording.title)


def _difference_text(leg: LegRecording, duplicates: Duplicates, limits: Limits) -> str:
    """Return the largest difference of answers to one input in words; '' for none."""
    rows = duplicates.rows[duplicates.alone]
    stamps = leg.poses.stamps[rows]
    solved_leg = leg.solver.leg

    def rotation(a: FloatArray, b: FloatArray) -> FloatArray:
        return differences(solved_leg, a[:, 1:], b[:, 1:]) if solved_leg else wrapped(a - b)

    angle = _spread(stamps, leg.poses.values[rows], rotation)
    is_answer = isin(leg.feet.stamps, stamps)
    distance = _spread(leg.feet.stamps[is_answer], leg.feet.values[is_answer], np.subtract)
    sizes = []
    if angle > limits.angle:
        sizes.append(f'{degrees(angle):.3g} deg')
    if distance > limits.foot:
        sizes.append(f'{1e3 * distance:.3g} mm')
    return f', up to {" and ".join(sizes)} apart' if sizes else ''


def _spread(stamps: IntArray, answers: FloatArray, subtract: Callable[..., FloatArray]) -> float:
    """Return the largest difference of answers with equal stamps."""
    order = np.argsort(stamps, kind='stable')
    stamps = stamps[order]
    answers = answers[order]
    first_answers = answers[np.searchsorted(stamps, stamps)]
    distances = np.abs(subtract(answers, first_answers))
    return float(np.fmax.reduce(distances, axis=None, initial=0.0))
