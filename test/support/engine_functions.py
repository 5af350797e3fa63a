"""What workers are asked in the tests; of a module of their own, which workers import."""

from contextlib import redirect_stderr
from io import StringIO
import os
from pathlib import Path
import signal
import time
import warnings


def squared(item: int) -> int:
    return item * item


def fragile(item: str) -> str:
    """Answer, or die, or hang, as the item says."""
    kind, _, rest = item.partition(' ')
    if kind == 'die':
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == 'die-once' and not Path(rest).exists():
        Path(rest).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == 'hang':
        time.sleep(1000)
    if kind == 'raise':
        raise ValueError(rest)
    return kind


def warned(item: int) -> str:
    """Warn, and answer what Python prints about it."""
    with redirect_stderr(StringIO()) as printed:
        warnings.warn(f'there is {item}', stacklevel=1)
    return printed.getvalue()


def nothing(item: int) -> None:
    """Answer None, as a function may."""
