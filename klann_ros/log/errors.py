"""What can go wrong with a log: one base class, one class a cause, one line a message."""

from collections.abc import Sequence
from os import PathLike
from typing import TypeAlias

from klann_ros.sanitize.text import printable, printable_line

REFUSED = 'refused: '
"""How the reason begins when something is not read because of a limit, not of damage."""

AnyPath: TypeAlias = str | PathLike[str]


class LogError(Exception):
    """Anything that is wrong with a log, as opposed to the disk it is on (OSError)."""

    def __init__(self, text: object) -> None:
        # What is wrong may be a name in the log, or a path: one line, whatever stands in it.
        super().__init__(printable_line(text))


class NotALogError(LogError):
    """The path is no log that can be read."""

    def __init__(self, path: AnyPath, reason: str) -> None:
        super().__init__(f'{printable(path)} is not a readable log: {reason}')


class RunExistsError(LogError):
    """The output is there already; nothing is overwritten."""

    def __init__(self, path: AnyPath) -> None:
        super().__init__(f'{printable(path)} exists already, not overwriting; choose a new name')


class RunClosedError(LogError):
    """Something was to be written to a run that is closed."""

    def __init__(self, path: AnyPath) -> None:
        super().__init__(f'{printable(path)} is closed, nothing more can be written to it')


class RunHarmedError(LogError):
    """Somebody else has taken away what was written; the rest of the run is finished."""

    def __init__(self, path: AnyPath, faults: Sequence[str]) -> None:
        super().__init__(f'{path} is not whole: {"; ".join(faults)}')


class RunLostError(LogError):
    """Somebody else has taken away the file that was written, and no other can be made."""


class UnknownTypeError(LogError):
    """No definition is installed for a message type."""

    def __init__(self, type_name: str, reason: str) -> None:
        super().__init__(f"no definition of '{printable(type_name)}': {reason}")


class MalformedQosError(LogError):
    """A text is no YAML sequence of quality of service profiles with all nine keys."""

    def __init__(self, reason: str) -> None:
        super().__init__(f'malformed quality of service: {reason}')


class UnwritableError(LogError):
    """A value does not fit into the file format."""


class DiskFullError(LogError):
    """The disk is full; the run could be finished, with what it had kept free for that."""

    def __init__(self, path: AnyPath, reason: str) -> None:
        super().__init__(f'the disk of {printable(path)} is full: {reason}')


class LowSpaceError(LogError):
    """
    Less space is free than is to be left.

    Attributes
    ----------
    free, least
        How much is free, and how much has to be [bytes].

    """

    def __init__(self, path: AnyPath, free: int, least: int) -> None:
        super().__init__(
            f'only {free / 1e6:.1f} MB are free on the disk of {printable(path)}, '
            f'{least / 1e6:.1f} MB have to stay free; make room, or set a smaller '
            'min_free_space [bytes]'
        )
        self.free = free
        self.least = least


class DamagedError(LogError):
    """
    Bytes of a log that do not hold what they should.

    Attributes
    ----------
    reason
        What is wrong, without the place.
    offset
        Where the damaged record starts [bytes from the start of its file].
    opcode
        Which record it says it is; 0 if that is unknown.

    """

    def __init__(self, reason: str, offset: int = 0, opcode: int = 0) -> None:
        super().__init__(f'damaged at byte {offset}: {reason}')
        self.reason = printable_line(reason)
        self.offset = offset
        self.opcode = opcode
