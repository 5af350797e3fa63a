"""What a recording says about itself: one diagnostic status a second."""

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from klann_ros.log.wording import counted, verb
from klann_ros.log.writing.recording import RecordingState


def status(name: str, state: RecordingState, lost_before: int) -> DiagnosticStatus:
    """
    Return the status of a recording.

    Parameters
    ----------
    name : str
        The status's name.
    state : RecordingState
        The recording.
    lost_before : int
        How many messages were lost when this was last told.

    """
    level, message = _verdict(state, state.lost - lost_before)
    return DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        hardware_id=name,
        values=[KeyValue(key=key, value=str(value)) for key, value in _values(state).items()],
    )


def _verdict(state: RecordingState, lost_now: int) -> tuple[bytes, str]:
    """Return the level and the most important thing to say."""
    if state.failure:
        return DiagnosticStatus.ERROR, f'the recording has ended: {state.failure}'
    if state.faults:
        return DiagnosticStatus.ERROR, '; '.join(state.faults)
    if lost_now > 0:
        return (
            DiagnosticStatus.WARN,
            f'{counted(lost_now, "message")} {verb(lost_now, "was", "were")} lost',
        )
    return DiagnosticStatus.OK, 'paused' if state.paused else 'recording'


def _values(state: RecordingState) -> dict[str, object]:
    values: dict[str, object] = {
        'file': state.file,
        'size': state.size,
        'free': 'unknown' if state.free is None else state.free,
        'queued': state.queued,
        'paused': str(state.paused).lower(),
    }
    for name, count in state.counts.items():
        values[f'{name} received'] = count.received
        values[f'{name} written'] = count.written
        values[f'{name} lost'] = 'unknown' if count.lost is None else count.lost
        # What is not lost and not in the run, and where nothing can be known.
        values[f'{name} sent before heard'] = count.early
        values[f'{name} publishers left'] = count.left
    return values
