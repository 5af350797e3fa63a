"""What others do to a run while it is written: told once each, remembered while it lasts."""

from collections.abc import Callable

from klann_ros.untrusted.text import printable

# A line with the paths of a folder and two files in it.
_LONGEST = 2000


def _nobody(_: str) -> None:
    """Tell nobody."""


class Faults:
    """
    What is wrong with a run that is being written, though the disk says nothing.

    Written by the thread that writes the run; any other may ask what lasts.

    Parameters
    ----------
    error, warning : callable
        Are called with a line for each fault, and for what harms nothing but should be known.

    """

    def __init__(
        self,
        error: Callable[[str], object] = _nobody,
        warning: Callable[[str], object] = _nobody,
    ) -> None:
        self._error, self._warning = error, warning
        self._lasting: dict[str, str] = {}

    @property
    def lasting(self) -> tuple[str, ...]:
        """Return what is wrong now, a line each; of many files that are gone, the last one."""
        return tuple(self._lasting.values())

    def note(self, about: str, text: str, now: str = '') -> None:
        """Note what is wrong about something; the same is told once, with what is done now."""
        line = printable(text, _LONGEST)
        if self._lasting.get(about) != line:
            self._lasting[about] = line
            self._error(f'{line}; {now}' if now else line)

    def mend(self, about: str) -> None:
        """Forget what was wrong about something."""
        self._lasting.pop(about, None)

    def has(self, about: str) -> bool:
        """Return whether something is wrong about it."""
        return about in self._lasting

    def mention(self, text: str) -> None:
        """Tell what harms nothing."""
        self._warning(printable(text, _LONGEST))
