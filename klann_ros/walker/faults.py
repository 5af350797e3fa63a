"""What a walker reports: levels, refused commands, and faults that stop it, with their latch."""

from enum import Enum
from typing import NamedTuple


class DiagnosticLevel(Enum):
    """The level of a diagnostic status, as in ROS."""

    OK = 0
    WARN = 1
    ERROR = 2


class RefusalKind(Enum):
    """Why a commanded motion is not followed."""

    NOT_FINITE = 'not finite'
    LATE = 'too late'
    CANNOT_TURN = 'it cannot turn'


class Refusal(NamedTuple):
    """A refused command: the kind, and a sentence."""

    kind: RefusalKind
    text: str


class FaultKind(Enum):
    """The cause of a fault, in words."""

    WRONG_WAY = 'turns against its command'
    FROZEN = 'repeats one angle, whatever its velocity'
    NOT_TURNING = 'does not turn'
    SLIPPING = 'turns, but not as it is commanded'
    TILTED = 'the body is tilted'
    FREE_FALL = 'the body falls'
    OVERLOAD = 'exceeds its effort'
    E_STOP = 'the emergency stop'


class Fault(NamedTuple):
    """A fault: its kind, the joint of the crank ('' of the whole walker), and a sentence."""

    kind: FaultKind
    joint: str
    text: str


# Automatic resets in a row: a joystick that wobbles about 0 would drive a motor that turns the
# wrong way again and again.
MAX_AUTO_RESETS = 3


class FaultLatch:
    """
    The first fault of a walker, until it is reset.

    With `auto_reset` a motion that is commanded after a command of 0 resets it, some times in a
    row; without, only `reset` does.
    """

    def __init__(self) -> None:
        self.auto_reset = False
        self.fault: Fault | None = None
        # Whether a motion of 0 was commanded since the fault.
        self._is_released = False
        # Since a reset by `reset`, or a walk.
        self._auto_resets = 0

    def trip(self, fault: Fault) -> None:
        """Latch a fault; a later one changes nothing."""
        if self.fault is None:
            self.fault = fault
            self._is_released = False

    def reset(self) -> None:
        """Forget the fault, and those before it."""
        self.fault = None
        self._auto_resets = 0

    def note_walk(self) -> None:
        """Take note that all cranks have followed for some time: the fault before is over."""
        self._auto_resets = 0

    def command(self, *, is_motion: bool) -> None:
        """Take note of a commanded motion, or of a command to stand."""
        if self.fault and self._resets_itself and is_motion and self._is_released:
            # One that is still pressed trips again before anything moves.
            self._auto_resets += self.fault.kind is not FaultKind.E_STOP
            self.fault = None
        self._is_released = not is_motion

    @property
    def _resets_itself(self) -> bool:
        return self.auto_reset and self._auto_resets < MAX_AUTO_RESETS

    @property
    def reason(self) -> str:
        """Return the fault and what resets it, in words; '' without a fault."""
        if self.fault is None:
            return ''
        way = 'call'
        if self._resets_itself:
            way = 'a cmd_vel of 0 and then a new one resets it, or'
        elif self.auto_reset:
            way = f'it has come back after {MAX_AUTO_RESETS} resets: repair it and call'
        return f'{self.fault.text}; {way} ~/reset_fault'
