"""Errors of logs: one base class, one class for each cause, one line each."""

from collections.abc import Sequence
from os import PathLike
from typing import TypeAlias

from klann_ros.sanitize.text import printable, printable_line

AnyPath: TypeAlias = str | PathLike[str]


class LogError(Exception):
    """Error of a log, as opposed to one of the disk (OSError)."""

    def __init__(self, text: object) -> None:
        # The text may contain a path or a name of the log: one line, whatever it contains.
        super().__init__(printable_line(text))


class NotALogError(LogError):
    """The path is not a readable log."""

    def __init__(self, path: AnyPath, reason: str) -> None:
        super().__init__(f'{printable(path)} is not a readable log: {reason}')


class RunExistsError(LogError):
    """The output exists; nothing is overwritten."""

    def __init__(self, path: AnyPath) -> None:
        super().__init__(f'{printable(path)} exists already, not overwriting; choose a new name')


class RunClosedError(LogError):
    """A write to a closed run."""

    def __init__(self, path: AnyPath) -> None:
        super().__init__(f'{printable(path)} is closed, nothing more can be written to it')


class RunIncompleteError(LogError):
    """Files of the run are gone or changed; the rest is finished."""

    def __init__(self, path: AnyPath, faults: Sequence[str]) -> None:
        super().__init__(f'{path} is incomplete: {"; ".join(faults)}')


class RunLostError(LogError):
    """The file in progress is gone or changed, and no other can be created."""


class UnknownTypeError(LogError):
    """No definition is installed for a message type."""

    def __init__(self, type_name: str, reason: str) -> None:
        super().__init__(f"no definition of '{printable(type_name)}': {reason}")


class MalformedQosError(LogError):
    """A text is not a YAML sequence of quality of service profiles with all nine keys."""

    def __init__(self, reason: str) -> None:
        super().__init__(f'malformed quality of service: {reason}')


class UnwritableError(LogError):
    """A value does not fit into the file format."""


class LowSpaceError(LogError):
    """Less than the wanted space [bytes] is free on the disk."""

    def __init__(self, path: AnyPath, free: int, min_free: int) -> None:
        super().__init__(
            f'only {free / 1e6:.1f} MB are free on the disk of {printable(path)}, '
            f'{min_free / 1e6:.1f} MB have to stay free; make room, or set a smaller '
            'min_free_space [bytes]'
        )


class DamagedError(LogError):
    """
    Bytes that cannot be read: the reason, the record's offset [bytes], its opcode or 0.

    A refusal is that of a limit, and no damage.
    """

    def __init__(
        self, reason: str, offset: int = 0, opcode: int = 0, *, is_refusal: bool = False
    ) -> None:
        super().__init__(f'damaged at byte {offset}: {reason}')
        self.reason = printable_line(reason)
        self.offset = offset
        self.opcode = opcode
        self.is_refusal = is_refusal
