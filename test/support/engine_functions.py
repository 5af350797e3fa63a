"""What workers are asked in the tests; of a module of their own, which workers import."""

import os
from pathlib import Path
import signal
import time


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


def nothing(item: int) -> None:
    """Answer None, as a function may."""
