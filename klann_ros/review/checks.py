"""What is wrong with a run: findings, the gravest first."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .answers import unanswered, wrong_questions
from .figures import Resolved
from .finding import Finding, since_start
from .recording import Recording

# A double comes through a message unchanged, so a difference is the solver's own. A right pose is
# within 1e-11 rad of the closed form, divided by the sine of a nearly singular transmission angle.
ANGLE_LIMIT = 1e-9
FOOT_LIMIT = 1e-9
RESIDUAL_LIMIT = 1e-9


def findings(recording: Recording, resolved: Resolved | None) -> list[Finding]:
    """
    Return what is wrong with a run; an empty list for a healthy one.

    Parameters
    ----------
    recording : Recording
        The run.
    resolved : Resolved or None
        The judged part of it, solved again.

    """
    judged = recording.judged()
    return [
        *_container(recording),
        *_undecoded(recording),
        *_poses(judged, resolved),
        *_feet(judged, resolved),
        *wrong_questions(judged),
        *unanswered(judged),
        *_losses(recording),
    ]


def _container(recording: Recording) -> Iterator[Finding]:
    if recording.problem:
        yield Finding('container', f'the log is damaged: {recording.problem}')
    if not len(recording.poses):
        yield Finding('poses', 'there is no pose in the run (no joint_states of a leg)')
    elif recording.leg is None:
        yield Finding('geometry', 'the run does not tell the geometry: give it by --geometry FILE')


def _undecoded(recording: Recording) -> Iterator[Finding]:
    for failed in recording.undecoded:
        text = f'{failed.count} messages of {failed.topic} cannot be decoded'
        yield Finding('decode', text, since_start(recording, failed.time))


def _poses(recording: Recording, resolved: Resolved | None) -> Iterator[Finding]:
    if resolved is None:
        return
    unsolved = np.isnan(resolved.angle_errors)
    sines = np.sin(resolved.transmission_angles).min(axis=1)
    # NaN, from an angle that is not finite, is wrong as well.
    with np.errstate(invalid='ignore'):
        wrong = ~unsolved & ~(resolved.angle_errors * sines <= ANGLE_LIMIT)
    opened = ~(resolved.residuals <= RESIDUAL_LIMIT)
    if opened.any():
        worst = np.nanmax(resolved.residuals)
        text = f'do not close the loops of the geometry (by up to {worst:.3g} m)'
        yield _count(recording, 'closure', opened, text)
    if wrong.any():
        worst = resolved.angle_errors[wrong].max()
        text = f'differ from the re-solved ones (by up to {worst:.3g} rad)'
        yield _count(recording, 'resolve', wrong, text)
    if unsolved.any():
        text = 'stand at a crank angle that the geometry cannot reach'
        yield _count(recording, 'reach', unsolved, text)


def _count(recording: Recording, check: str, which: NDArray[np.bool_], text: str) -> Finding:
    first = recording.poses.times[int(np.argmax(which))]
    text = f'{int(which.sum())} of {len(which)} poses {text}'
    return Finding(check, text, since_start(recording, first))


def _feet(recording: Recording, resolved: Resolved | None) -> Iterator[Finding]:
    if resolved is None:
        return
    wrong = resolved.foot_errors > FOOT_LIMIT
    if wrong.any():
        worst = resolved.foot_errors[wrong].max()
        text = f'{int(wrong.sum())} feet (point_h) are not those of their poses (by {worst:.3g} m)'
        first = recording.feet.times[int(np.argmax(wrong))]
        yield Finding('foot', text, since_start(recording, first))


def _losses(recording: Recording) -> Iterator[Finding]:
    for topic in recording.topics:
        if topic.lost:
            yield Finding('lost', f'{topic.lost} messages of {topic.name} were lost')
