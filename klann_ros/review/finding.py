"""Something that is wrong with a run."""

from dataclasses import dataclass

from .recording import Recording


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
        When it was first seen, from the start of the run by the clock of the log [s]; None for
        the run as a whole.

    """

    check: str
    text: str
    time: float | None = None


def since_start(recording: Recording, log_time: int) -> float:
    """Return a log time from the start of the run [s]."""
    return (int(log_time) - recording.start) / 1e9
