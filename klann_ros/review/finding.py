"""Something that is wrong with a run."""

from dataclasses import dataclass
from enum import IntEnum


class Severity(IntEnum):
    """How grave it is."""

    NOTE = 0  # worth knowing, and no fault
    WARNING = 1  # the run is not what it should be
    ERROR = 2  # what the run says is wrong


@dataclass(frozen=True)
class Finding:
    """
    Something that is wrong with a run.

    Attributes
    ----------
    check : str
        Which check found it.
    severity : Severity
        How grave it is.
    text : str
        What it is.
    meaning : str
        What it means for whoever reads it.
    time : float or None
        When it was first seen, from the start of the run by the clock of the log [s]; None for
        the run as a whole.
    leg : str
        Of which leg it is; '' for the only one, or the run as a whole.

    """

    check: str
    severity: Severity
    text: str
    meaning: str
    time: float | None = None
    leg: str = ''

    @property
    def is_fault(self) -> bool:
        """Return whether it counts for the exit code."""
        return self.severity > Severity.NOTE
