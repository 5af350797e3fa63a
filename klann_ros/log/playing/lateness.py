"""How late messages were, and what was done about it."""

from dataclasses import dataclass

LATE = 0.01
"""A message later than this counts as late [s]."""


@dataclass
class Lateness:
    """
    What was late so far.

    Parameters
    ----------
    played, late
        How many messages were due, and how many of them came later than ``LATE``.
    worst
        The latest of them [s].
    held_up
        By how much the rest of the log was put off in all, instead of a burst [s].

    """

    played: int = 0
    late: int = 0
    worst: float = 0.0
    held_up: float = 0.0

    def note(self, late: float) -> None:
        """Count a message that comes so late [s]."""
        self.played += 1
        if late > LATE:
            self.late += 1
            self.worst = max(self.worst, late)

    def __str__(self) -> str:
        """Return it in one line; '' if nothing was late."""
        said = []
        if self.late:
            said.append(
                f'{self.late} of {self.played} messages came more than {LATE * 1e3:g} ms late, '
                f'{self.worst * 1e3:.0f} ms at worst'
            )
        if self.held_up:
            said.append(f'playback was held up for {self.held_up:.2f} s, and went on from there')
        return '; '.join(said)
