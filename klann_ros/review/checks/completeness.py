"""Check completeness: damage, lost messages, gaps and missing poses."""

from collections import defaultdict
from collections.abc import Iterator
from itertools import chain, groupby
from operator import attrgetter

from klann_ros.kinematics.arrays import IntArray
from klann_ros.log import LAST_TIME
from klann_ros.review.model.answers import MAX_RESPONSE_TIME, refused_intervals
from klann_ros.review.model.recording import LegRecording, LegSolver, Mismatch, RunRecording
from klann_ros.review.model.review import Finding, Review, Severity
from klann_ros.review.model.times import (
    CLOCK,
    Interval,
    merge_intervals,
    no_series,
    overlaps,
    pauses,
    Series,
    time_steps,
)
from klann_ros.review.model.topics import exclude_intervals, Gap, TopicRecording
from klann_ros.robot import preset_names
from klann_ros.sanitize.text import counted, listed, number_range, printable, printable_line, verb
import numpy as np

_MAX_PROBLEMS = 3
_MAX_RECORDER_FINDINGS = 10
_MISMATCHES = {
    Mismatch.ENCODING: 'only cdr, the encoding of ROS 2, can be read',
    Mismatch.DEFINITION: 'their definition in the log has other fields than their type',
    Mismatch.CONTENT: 'the bytes do not match the type; they are ignored',
    Mismatch.NO_POSITIONS: 'joints of a leg have no positions; they are ignored',
}


def check_container(review: Review) -> Iterator[Finding]:
    """Yield damage of the log, and missing poses."""
    recording = review.recording
    if recording.problems:
        problems = '; '.join(recording.problems[:_MAX_PROBLEMS])
        unlisted_count = len(recording.problems) - _MAX_PROBLEMS
        if unlisted_count > 0:
            problems += f'; and {unlisted_count} more'
        meaning = 'only the readable part is checked; `recover` restores a complete run'
        fault = 'the log is damaged'
        if recording.is_refused_only:
            meaning = 'the rest is checked; a machine with more memory can read all of it'
            fault = 'part of the log is refused'
        yield Finding('container', Severity.ERROR, f'{fault}: {problems}', meaning)
    if recording.stopped:
        text = f'the recording ended early: {recording.stopped}'
        yield Finding('container', Severity.WARNING, text, 'later messages are not in the run')
    for undecoded in recording.undecoded:
        messages = f'{counted(undecoded.count, "message")} of {printable(undecoded.topic)}'
        text = f'{messages} cannot be decoded'
        if undecoded.reason is Mismatch.ENCODING:
            text += f': they are {printable(undecoded.encoding) or "of no encoding"}, not cdr'
        time = review.since_start(undecoded.time)
        meaning = _MISMATCHES[undecoded.reason]
        yield Finding('decode', Severity.ERROR, text, meaning, time)
    for refusal in recording.refused_descriptions:
        meaning = 'its leg is unknown, and nothing is held against it; --geometry names a leg'
        yield Finding('geometry', Severity.ERROR, refusal, meaning)
    yield from _poses(review)


def check_recorder_findings(review: Review) -> Iterator[Finding]:
    """Yield the findings of the recorder, whose run is checked again as a whole."""
    recorded = review.recording.recorder_findings
    for finding in recorded[:_MAX_RECORDER_FINDINGS]:
        source = printable(finding.check)
        if finding.leg:
            source += f' of {printable(finding.leg)}'
        text = f'the recorder reported: {printable_line(finding.text)} ({source})'
        meaning = (
            'it was on /diagnostics during the recording; the whole run is checked separately'
        )
        time = review.since_start(finding.time)
        yield Finding('recorder_finding', Severity.NOTE, text, meaning, time)
    unlisted_count = len(recorded) - _MAX_RECORDER_FINDINGS
    if unlisted_count > 0:
        text = f'the recorder reported {unlisted_count} more findings'
        meaning = 'they are in the run (klann_ros.finding)'
        yield Finding('recorder_finding', Severity.NOTE, text, meaning)


def _poses(review: Review) -> Iterator[Finding]:
    """Yield the poses and geometries that are missing."""
    has_poses = any(len(leg.recording.poses) for leg in review.legs)
    kind = _kind_without_poses(review)
    if kind and not has_poses:
        text = f'there is no pose in the run: {kind}'
        meaning = 'no solver answered, and none is expected; the rest is checked'
        yield Finding('poses', Severity.NOTE, text, meaning)
    elif not has_poses:
        text = 'there is no pose in the run (no joint_states of a leg)'
        meaning = f'nothing can be checked: {_missing_poses(review)}'
        yield Finding('poses', Severity.ERROR, text, meaning)
    for leg in review.legs:
        title = leg.recording.title
        if has_poses and not len(leg.recording.poses):
            text = 'there is no pose of this leg in the run'
            meaning = 'its solver defines it; its crank joint was probably never published'
            yield Finding('poses', Severity.NOTE, text, meaning, leg=title)
        elif has_poses and leg.recording.solver.leg is None:
            text = 'the run does not contain the geometry'
            legs = ', '.join(preset_names())
            meaning = f'no pose can be checked; give the leg by --geometry FILE, or one of {legs}'
            yield Finding('geometry', Severity.WARNING, text, meaning, leg=title)


def _kind_without_poses(review: Review) -> str:
    """Return what a run without a solver is, in words; '' if a solver is missing."""
    if any(len(leg.recording.feet) for leg in review.legs):
        return ''
    cranks = [leg for leg in review.legs if len(leg.recording.cranks)]
    if review.recording.measured and cranks:
        names = listed(sorted(review.recording.measured))
        return f'a calibration run, with points measured on {names}'
    has_solver = any(leg.recording.solver.nodes for leg in review.legs)
    drives = [walk for walk in review.recording.walks if walk.states]
    return 'cranks are driven without a solver' if drives and not has_solver else ''


def _missing_poses(review: Review) -> str:
    """Return the likely reason of a run without poses."""
    recording = review.recording
    if recording.undecoded:
        return 'the messages cannot be decoded'
    if not recording.joints:
        types = [
            f'{printable(topic.name)} is {printable(topic.type) or "of no type"}'
            for topic in recording.topics
            if topic.name.endswith('/joint_states')
        ]
        return '; '.join(types) or 'was solver_node running, and its topic recorded?'
    solvers = [leg.recording.solver for leg in review.legs] or [LegSolver()]
    joints = dict.fromkeys(chain.from_iterable(solver.joint_names for solver in solvers))
    cranks = dict.fromkeys(solver.crank_joint for solver in solvers)
    topics = [f'{printable(name)} has {listed(names)}' for name, names in recording.joints.items()]
    topics.append('a leg with other joints needs --geometry FILE')
    return f'a leg is {listed(joints)}, its crank {listed(cranks)}; {"; ".join(topics)}'


def check_losses(review: Review) -> Iterator[Finding]:
    """Yield the topics with missing sequence numbers."""
    recording = review.recording
    for topic in recording.topics:
        if topic.lost:
            text = f'{_messages(topic.lost, topic.name)} lost'
            meaning = _meaning(topic, recording)
            time = review.since_start(topic.missing[0, 1]) if len(topic.missing) else None
            yield Finding('lost', Severity.WARNING, text, meaning, time)
        if topic.early:
            text = (
                f'{_messages(topic.early, topic.name)} sent before the recorder discovered their '
            )
            meaning = 'the publisher did not wait for discovery (crank_node: min_subscribers)'
            yield Finding('lost', Severity.WARNING, f'{text}publishers', meaning)
        # One publisher may leave at the end of the run.
        if topic.publishers_left > 1 and topic.lost is not None:
            count = counted(topic.publishers_left, 'publisher')
            text = f'{count} of {printable(topic.name)} left during the run'
            meaning = "losses at the end of a publisher's life cannot be detected"
            yield Finding('lost', Severity.NOTE, text, meaning)
    yield from _lost_inputs(review)


def _lost_inputs(review: Review) -> Iterator[Finding]:
    """Yield inputs that were answered and are not in the run, beside the counted losses."""
    recording = review.recording
    if recording.impossible_times:
        # Messages with such a time are in the run, and are not loaded.
        return
    # Legs on one crank share them.
    times: dict[frozenset[str], list[int]] = {}
    for leg in review.legs:
        answered = leg.evaluated.poses.times[leg.answers.unasked]
        is_unrecorded = overlaps(answered - MAX_RESPONSE_TIME, answered, recording.unrecorded)
        crank_topics = leg.recording.crank_topics
        leg_times = answered[~is_unrecorded].tolist()
        times[crank_topics] = max(times.get(crank_topics, []), leg_times, key=len)
    for crank_topics, input_times in times.items():
        undecoded = sum(u.count for u in recording.undecoded if u.topic in crank_topics)
        count = len(input_times) - recording.lost_on(crank_topics) - undecoded
        if count > 0:
            answers = f'{verb(count, "its answer is", "their answers are")} in the run'
            text = f'{_messages(count, listed(sorted(crank_topics)))} lost: {answers}'
            meaning = 'no number is missing: they were the last ones of a publisher, which left'
            time = review.since_start(input_times[0])
            yield Finding('lost', Severity.WARNING, text, meaning, time)


def _meaning(topic: TopicRecording, recording: RunRecording) -> str:
    """Return where the messages were lost, and the known reason."""
    in_transit = 'published and did not reach the run: a short queue, or an overload'
    if not topic.dropped:
        return f'they were {in_transit}'
    reason = '; '.join(filter(None, (recording.file_fault, recording.stopped)))
    reason = reason or 'its queue was full, or the disk refused them'
    in_transit_count = (topic.lost or 0) - topic.dropped
    others = f', {in_transit_count} were {in_transit}' if in_transit_count > 0 else ''
    return f'the recorder had received {topic.dropped} of them{others}. Its reason: {reason}'


def _messages(number: int, topic: str) -> str:
    return f'{counted(number, "message")} of {printable(topic)} {verb(number, "was", "were")}'


# Topics of a solver beside the poses.
_FOOT_TOPICS = ('point_h', 'velocity_h')


def check_gaps(review: Review) -> Iterator[Finding]:
    """Yield gaps within the run, restarts of publishers, stalls, and poses that ended early."""
    explained = _explained_intervals(review)
    answers: set[str] = set()
    for leg in review.legs:
        answers.update(answer_topics(leg.recording))
    gaps: list[Gap] = []
    restarts: list[Gap] = []
    for (topic,), topic_gaps in groupby(review.gaps, key=attrgetter('topics')):
        intervals = explained.get(topic, review.recording.unrecorded)
        for gap in exclude_intervals([*topic_gaps], intervals):
            # A restart of a solver leaves inputs without answer: that is a gap.
            is_restart = gap.is_restart and answers.isdisjoint(gap.topics)
            (restarts if is_restart else gaps).append(gap)
    if gaps:
        yield _gap(review, _simultaneous(gaps))
    if restarts:
        yield _restart(review, _simultaneous(restarts))
    for stall in review.recording.stalls:
        meaning = 'the gap is explained; messages published meanwhile may be lost'
        time = review.since_start(stall.begin)
        yield Finding('stall', Severity.NOTE, printable_line(stall.reason), meaning, time)
    yield from _ended(review)


def _explained_intervals(review: Review) -> dict[str, tuple[Interval, ...]]:
    """Return the explained intervals by topic: no valid input, restart, pause or damage."""
    recording = review.recording
    paused = [*recording.unrecorded, *pauses(recording.clock)]
    explained = {topic.name: [*paused] for topic in recording.topics if topic.name != CLOCK}
    releases = _releases(review)
    for name, intervals in releases.items():
        explained[name] += intervals
    for leg in review.legs:
        intervals = refused_intervals(leg.evaluated, leg.answers)
        silences = recording.restarts_on(leg.recording.crank_topics)
        for name in releases.keys() & leg.recording.crank_topics:
            gaps = [gap for gap in review.gaps if name in gap.topics]
            unreleased = exclude_intervals(gaps, merge_intervals(releases[name]))
            silences += [(gap.begin, gap.end) for gap in gaps if gap not in unreleased]
        for begin, end in silences:
            intervals.append((begin, end + MAX_RESPONSE_TIME))
        for topic in answer_topics(leg.recording):
            explained.setdefault(topic, [*paused]).extend(intervals)
    return {topic: merge_intervals(intervals) for topic, intervals in explained.items()}


# A driver of a topic announces its lease more often than this, and its last message may arrive
# this time after its release [ns].
_LEASE_TIME = 1_000_000_000
_DELIVERY_TIME = 200_000_000


def _releases(review: Review) -> defaultdict[str, list[Interval]]:
    """Return when no command is due, by topic: under a lease, and after a command to stand."""
    recording = review.recording
    releases = defaultdict[str, list[Interval]](list)
    for topic in recording.topics:
        lease = recording.leases.get(topic.name, no_series(1))
        if len(lease):
            releases[topic.name] += _lease_intervals(lease, topic.times)
    for walk in recording.walks:
        for name, speeds in walk.speeds.items():
            stands = speeds.values[:-1, 0] == 0.0
            is_long = time_steps(speeds.times) > review.limits.gap_time
            rows = np.flatnonzero(stands & is_long)
            ends = speeds.times[rows + 1].tolist()
            releases[name] += zip(speeds.times[rows].tolist(), ends, strict=True)
    return releases


def _lease_intervals(lease: Series, times: IntArray) -> Iterator[Interval]:
    """Yield when a driver holds a lease, and from its release until the topic resumes."""
    next_announcements = np.append(lease.times[1:], LAST_TIME)
    held_ends = np.minimum(lease.times + _LEASE_TIME, next_announcements)
    next_rows = np.searchsorted(times, lease.times + _DELIVERY_TIME)
    next_times = np.append(times, lease.times[-1])[next_rows]
    ends = np.where(lease.values[:, 0] == 1.0, held_ends, next_times)
    yield from zip(lease.times.tolist(), ends.tolist(), strict=True)


def answer_topics(leg: LegRecording) -> list[str]:
    """Return the topics of a leg's solver."""
    place = f'{leg.namespace}/{leg.name}'.rstrip('/')
    return [*leg.pose_topics, *(f'{place}/{name}' for name in _FOOT_TOPICS)]


# Share of the longest gap of one cause that all its gaps have in common.
_MIN_COMMON_SHARE = 0.5
# Last silences that a gap may belong to.
_MAX_OPEN_SILENCES = 20


class _Silence:
    """Gaps of several topics at nearly the same time: they have one cause."""

    def __init__(self, gap: Gap) -> None:
        self.begin = gap.begin
        # Length of the longest gap [s].
        self.length = gap.length
        self._gaps = [gap]
        # The time that all gaps have in common [ns].
        self._common_begin = gap.begin
        self._common_end = gap.end

    def add(self, gap: Gap) -> bool:
        """Add a gap if all gaps have most of their time in common; return whether."""
        begin = max(self._common_begin, gap.begin)
        end = min(self._common_end, gap.end)
        length = max(self.length, gap.length)
        if (end - begin) / 1e9 < _MIN_COMMON_SHARE * length:
            return False
        self.length = length
        self._gaps.append(gap)
        self._common_begin = begin
        self._common_end = end
        return True

    @property
    def topics(self) -> str:
        """Return the topics in words."""
        return listed(dict.fromkeys(topic for gap in self._gaps for topic in gap.topics))

    @property
    def duration(self) -> str:
        """Return the range of the gaps' lengths in words, which is true of each topic."""
        return f'{number_range([gap.length for gap in self._gaps], ".3f")} s'


def _simultaneous(gaps: list[Gap]) -> list[_Silence]:
    """Return the gaps of several topics by their causes, in the order of time."""
    silences: list[_Silence] = []
    for gap in sorted(gaps):
        if not any(silence.add(gap) for silence in silences[-_MAX_OPEN_SILENCES:]):
            silences.append(_Silence(gap))
    return silences


def _describe_longest(review: Review, silences: list[_Silence], noun: str, form: str) -> str:
    longest = max(silences, key=attrgetter('length'))
    text = form.format(longest.topics, longest.duration)
    if len(silences) > 1:
        begin = review.since_start(longest.begin)
        text = f'{len(silences)} {noun}; the longest: {text} at {begin:.3f} s'
    return text


def _restart(review: Review, restarts: list[_Silence]) -> Finding:
    form = 'another publisher of {} began {} after the last'
    text = _describe_longest(review, restarts, 'restarts', form)
    meaning = 'a node was shut down and started again; the time between is no gap'
    time = review.since_start(restarts[0].begin)
    return Finding('restart', Severity.NOTE, text, meaning, time)


def _gap(review: Review, gaps: list[_Silence]) -> Finding:
    text = _describe_longest(review, gaps, 'gaps', 'nothing on {} for {}')
    count = _unanswered(review)
    if count:
        angles = verb(count, 'crank angle was', 'crank angles were')
        meanwhile = 'meanwhile' if len(gaps) == 1 else 'in all gaps'
        text += f'; {count} {angles} not answered {meanwhile}'
    meaning = 'the publisher stalled, or messages could not reach the recorder'
    return Finding('gap', Severity.WARNING, text, meaning, review.since_start(gaps[0].begin))


def _unanswered(review: Review) -> int:
    """Return the number of crank angles without answer in gaps; legs on one crank share them."""
    counts: dict[frozenset[str], int] = {}
    for leg in review.legs:
        topics = leg.recording.crank_topics
        counts[topics] = max(counts.get(topics, 0), leg.unanswered.in_gaps)
    return sum(counts.values())


def _ended(review: Review) -> Iterator[Finding]:
    for leg in review.legs:
        poses = leg.evaluated.poses
        cranks = leg.evaluated.cranks
        if not (len(poses) and len(cranks)):
            continue
        silence = (int(cranks.times[-1]) - int(poses.times[-1])) / 1e9
        if silence > review.limits.stale_time:
            late = counted(leg.answers.late, 'crank angle')
            text = f'the poses ended {silence:.1f} s before the crank did; {late} came after them'
            meaning = (
                'the solver stopped, refused every angle, or its poses did not reach the recorder'
            )
            time = review.since_start(poses.times[-1])
            yield Finding('stale', Severity.WARNING, text, meaning, time, leg.recording.title)
