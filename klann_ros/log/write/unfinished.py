"""Runs that a crash left unfinished."""

from enum import Enum
from pathlib import Path

from klann_ros.log.mcap.records import find_footer, MAGIC
from klann_ros.sanitize.files import open_regular

from .durable_file import is_being_written


def unfinished_runs(folder: Path) -> list[Path]:
    """
    Return the runs in a folder that a crash left unfinished.

    Runs that a process is writing, and recovered ones (with ``<run>_recovered`` beside them), are
    not among them.
    """
    try:
        runs = sorted(path for path in folder.iterdir() if path.is_dir())
    except OSError:
        return []
    return [
        run
        for run in runs
        if _is_unfinished(run) and not run.with_name(f'{run.name}_recovered').exists()
    ]


class _FileState(Enum):
    UNFINISHED, IN_PROGRESS, OTHER = range(3)


def _is_unfinished(run: Path) -> bool:
    try:
        states = [_state(path) for path in run.glob('*.mcap') if not path.name.startswith('.')]
    except OSError:
        return False
    # A run in progress may have a file that was cut off.
    return _FileState.UNFINISHED in states and _FileState.IN_PROGRESS not in states


def _state(path: Path) -> _FileState:
    try:
        with open_regular(path) as file:
            size = file.seek(0, 2)
            file.seek(0)
            is_mcap = file.read(len(MAGIC)) in (MAGIC, b'')
            if not is_mcap or find_footer(file, size) is not None:
                return _FileState.OTHER
            return _FileState.IN_PROGRESS if is_being_written(file) else _FileState.UNFINISHED
    except OSError:
        return _FileState.OTHER
