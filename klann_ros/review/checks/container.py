"""Whether the log is whole, and tells what a review needs."""

from collections.abc import Iterator

from klann_ros.log.wording import counted
from klann_ros.review.finding import Finding, Severity
from klann_ros.review.leg_file import preset_names
from klann_ros.review.reviewed import Review
from klann_ros.untrusted.text import printable

_MOST_PROBLEMS = 3


def check(review: Review) -> Iterator[Finding]:
    """Yield what is wrong with the log as a log."""
    recording = review.recording
    if recording.problems:
        shown = '; '.join(recording.problems[:_MOST_PROBLEMS])
        more = len(recording.problems) - _MOST_PROBLEMS
        also = f'; and {more} more' if more > 0 else ''
        meaning = 'what is judged is what could be read; `recover` makes a whole run of it'
        yield Finding('container', Severity.ERROR, f'the log is damaged: {shown}{also}', meaning)
    if recording.stopped:
        yield Finding(
            'container',
            Severity.WARNING,
            f'the recording ended before its time: {recording.stopped}',
            'what came later is not in the run',
        )
    for failed in recording.undecoded:
        yield Finding(
            'decode',
            Severity.ERROR,
            f'{counted(failed.count, "message")} of {printable(failed.topic)} cannot be decoded',
            'the bytes are not what the type says, or joints have no positions; left out',
            recording.since_start(failed.time),
        )
    yield from _poses(review)


def _poses(review: Review) -> Iterator[Finding]:
    """Yield that there are none, or nothing to judge them by."""
    there_are = any(len(leg.recording.poses) for leg in review.legs)
    if not there_are:
        text = 'there is no pose in the run (no joint_states of a leg)'
        meaning = 'nothing can be judged: was solver_node running, and its topic recorded?'
        yield Finding('poses', Severity.ERROR, text, meaning)
    for leg in review.legs:
        title = leg.recording.title
        if there_are and not len(leg.recording.poses):
            text = 'there is no pose of this leg in the run'
            meaning = 'its solver has it; nobody told an angle of its crank joint, it seems'
            yield Finding('poses', Severity.NOTE, text, meaning, leg=title)
        elif there_are and leg.recording.solver.leg is None:
            text = 'the run does not tell the geometry'
            legs = ', '.join(preset_names())
            meaning = f'no pose can be judged; give the leg by --geometry FILE, or one of {legs}'
            yield Finding('geometry', Severity.WARNING, text, meaning, leg=title)
