"""Diagnostics in plain words: the meaning of a status, and the remedy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import re
from typing import Any

from klann_ros.sanitize.text import printable

# Values read of a status at most.
MAX_VALUES = 64
LEVELS = ('fine', 'look', 'fault', 'silent')
# Patterns of messages and their meanings; the first match counts. Without a match the message is
# shown as it is: other nodes have texts of their own.
_MEANINGS: Sequence[tuple[str, str]] = (
    (r'no input for', 'The crank is not driven: no crank angle arrives.'),
    (
        r'cannot be reached: dyad|loops of block',
        'The leg cannot take this crank angle: its bars do not reach. It goes on where they do.',
    ),
    (
        r'is refused: it must be (one number, )?finite',
        'What came in was no crank angle; it was left out.',
    ),
    (
        r'turned by more than one',
        'Two or more turn this crank at once: the leg jumps between them. Stop all but one.',
    ),
    (r'inputs? (was|were) lost', 'Crank angles were lost on their way to the solver.'),
    (
        r'nearly singular',
        'Two bars of the leg are almost in line: there it may jam, and errors grow.',
    ),
    (r'did not converge', 'The iteration found no pose for this angle.'),
    (r'does not turn fully', 'The crank cannot make whole turns with these lengths.'),
    (r'the recording has ended', 'The recorder has stopped; the run can be read.'),
    (r'messages? (was|were) lost', 'Messages were lost on their way to the recorder.'),
    (r'^solving$', 'The leg is solved.'),
    (r'^recording$', 'The run is being recorded.'),
    (r'^paused$', 'The recording is paused.'),
)
_COMPILED = tuple((re.compile(pattern), meaning) for pattern, meaning in _MEANINGS)
# Values that the page shows.
_SHOWN = ('solved', 'rejected', 'failed', 'lost', 'rate', 'iterations', 'residual', 'file')


@dataclass(frozen=True)
class StatusText:
    """A status, as the page shows it."""

    who: str
    # One of LEVELS.
    level: str
    # What it means, in plain words; '' where only its own words can tell.
    meaning: str
    # Its own words.
    text: str
    # Numbers that belong to it.
    figures: Mapping[str, str]

    def as_data(self) -> dict[str, Any]:
        """Return it, ready for JSON."""
        return {
            'who': self.who,
            'level': self.level,
            'meaning': self.meaning,
            'text': self.text,
            'figures': dict(self.figures),
        }


def status_text(
    level: int, name: str, message: str, values: Sequence[tuple[str, str]]
) -> StatusText:
    """
    Return a status in plain words.

    Parameters
    ----------
    level : int
        As in diagnostic_msgs: 0 OK, 1 WARN, 2 ERROR, 3 STALE.
    name, message : str
        Anybody's texts.
    values : sequence of (str, str)
        Its keys and values.

    """
    shown = printable(message)
    meaning = next((m for pattern, m in _COMPILED if pattern.search(shown)), '')
    if meaning and level == 0 and 'does not turn fully' in shown:
        meaning = f'The leg is solved. {meaning}'
    figures = {key: printable(value, 60) for key, value in values[:MAX_VALUES] if key in _SHOWN}
    return StatusText(
        printable(name, 100),
        LEVELS[level] if 0 <= level < len(LEVELS) else 'fault',
        meaning,
        shown,
        figures,
    )


def recorded(values: Sequence[tuple[str, str]]) -> dict[str, int]:
    """Return how many messages a recorder's status tells as received, written and lost."""
    sums = dict.fromkeys(('received', 'written', 'lost'), 0)
    for key, value in values:
        last = key.rpartition(' ')[2]
        if key.startswith('/') and last in sums and value.isdecimal() and len(value) < 19:
            sums[last] += int(value)
    return sums
