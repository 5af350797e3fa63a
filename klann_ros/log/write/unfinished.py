"""Runs that were begun and not finished, as a crash leaves them."""

from collections.abc import Iterator
from enum import Enum
from pathlib import Path

from klann_ros.log.mcap.container import find_footer, MAGIC
from klann_ros.sanitize.files import open_plain

from .disk_space import remove_old_reserve
from .durable_file import is_being_written


def unfinished_runs(folder: Path) -> list[Path]:
    """
    Return the runs in a folder that were not finished, and that nobody is writing now.

    One that was recovered, so that another run stands beside it under its name and
    ``_recovered``, is not among them.
    """
    return [run for run in _left_runs(folder) if not _recovered(run).exists()]


def remove_old_reserves(folder: Path) -> None:
    """Remove what earlier versions left of their reserves in such runs, recovered or not."""
    for run in _left_runs(folder):
        remove_old_reserve(run)


def _left_runs(folder: Path) -> Iterator[Path]:
    try:
        runs = sorted(path for path in folder.iterdir() if path.is_dir())
    except OSError:
        return
    yield from (run for run in runs if _is_unfinished(run))


def _recovered(run: Path) -> Path:
    return run.with_name(f'{run.name}_recovered')


def _is_unfinished(run: Path) -> bool:
    try:
        states = [_state(path) for path in run.glob('*.mcap') if not path.name.startswith('.')]
    except OSError:
        return False
    # A run that is being written may have a file that somebody has cut off.
    return _State.LEFT in states and _State.IN_HAND not in states


class _State(Enum):
    LEFT, IN_HAND, OTHER = range(3)


def _state(path: Path) -> _State:
    try:
        with open_plain(path) as file:
            size = file.seek(0, 2)
            file.seek(0)
            is_mcap = file.read(len(MAGIC)) in (MAGIC, b'')
            if not is_mcap or find_footer(file, size) is not None:
                return _State.OTHER
            return _State.IN_HAND if is_being_written(file) else _State.LEFT
    except OSError:
        return _State.OTHER
