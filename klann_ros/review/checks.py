"""What is wrong with a run: findings, the gravest first."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .figures import Resolved
from .recording import Recording

# A double comes through a message unchanged, so a difference is the solver's own. A right pose is
# within 1e-11 rad of the closed form, divided by the sine of a nearly singular transmission angle.
ANGLE_LIMIT = 1e-9
FOOT_LIMIT = 1e-9
RESIDUAL_LIMIT = 1e-9


@dataclass(frozen=True)
class Finding:
    """
    Something that is wrong with a run.

    Attributes
    ----------
    check : str
        Which check found it.
    text : str
        What it is and what it means.
    time : float or None
        When it was first seen, from the start of the run [s]; None for the run as a whole.

    """

    check: str
    text: str
    time: float | None = None


def findings(recording: Recording, resolved: Resolved | None) -> list[Finding]:
    """Return what is wrong with a run; an empty list for a healthy one."""
    return [
        *_container(recording),
        *_poses(recording, resolved),
        *_feet(recording, resolved),
        *_answers(recording),
        *_losses(recording),
    ]


def _container(recording: Recording) -> Iterator[Finding]:
    if recording.problem:
        yield Finding('container', f'the log is damaged: {recording.problem}')
    if not len(recording.poses):
        yield Finding('poses', 'there is no pose in the run (no joint_states of a leg)')
    elif recording.geometry is None:
        yield Finding('geometry', 'the run does not tell the geometry: give it by --geometry FILE')


def _poses(recording: Recording, resolved: Resolved | None) -> Iterator[Finding]:
    if resolved is None:
        return
    unsolved = np.isnan(resolved.angle_errors)
    sines = np.sin(resolved.transmission_angles).min(axis=1)
    # NaN, from an angle that is not finite, is wrong as well.
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


def _count(
    recording: Recording, check: str, which: np.ndarray[tuple[int], np.dtype[np.bool_]], text: str
) -> Finding:
    first = int(recording.pose_stamps[int(np.argmax(which))])
    text = f'{int(which.sum())} of {len(which)} poses {text}'
    return Finding(check, text, _time(recording, first))


def _feet(recording: Recording, resolved: Resolved | None) -> Iterator[Finding]:
    if resolved is None:
        return
    wrong = resolved.foot_errors > FOOT_LIMIT
    if wrong.any():
        worst = resolved.foot_errors[wrong].max()
        text = f'{int(wrong.sum())} feet (point_h) are not those of their poses (by {worst:.3g} m)'
        first = int(recording.foot_stamps[int(np.argmax(wrong))])
        yield Finding('foot', text, _time(recording, first))


def _answers(recording: Recording) -> Iterator[Finding]:
    """Yield what was asked and not answered, the run's edges left out."""
    if not len(recording.pose_stamps):
        return
    stamps = recording.crank_stamps
    first, last = recording.pose_stamps.min(), recording.pose_stamps.max()
    inside = (stamps >= first) & (stamps <= last)
    open_ = inside & ~np.isin(stamps, recording.pose_stamps)
    if open_.any():
        text = f'{int(open_.sum())} of {int(inside.sum())} crank angles were not answered'
        where = int(stamps[int(np.argmax(open_))])
        yield Finding('answers', text, _time(recording, where))


def _losses(recording: Recording) -> Iterator[Finding]:
    for topic in recording.topics:
        if topic.lost:
            yield Finding('lost', f'{topic.lost} messages of {topic.name} were lost')


def _time(recording: Recording, stamp: int) -> float:
    return (stamp - recording.start) / 1e9
