"""Runs that were begun and not finished, as a crash leaves them."""

from pathlib import Path

from klann_ros.log.reading.container import find_footer, MAGIC

from .durable_file import is_being_written


def unfinished_runs(folder: Path) -> list[Path]:
    """
    Return the runs in a folder that were not finished, and that nobody is writing now.

    One that was recovered, so that another run stands beside it under its name and
    ``_recovered``, is not among them.
    """
    try:
        runs = sorted(path for path in folder.iterdir() if path.is_dir())
    except OSError:
        return []
    return [run for run in runs if not _recovered(run).exists() and _is_unfinished(run)]


def _recovered(run: Path) -> Path:
    return run.with_name(f'{run.name}_recovered')


def _is_unfinished(run: Path) -> bool:
    try:
        return any(_is_left(path) for path in run.glob('*.mcap'))
    except OSError:
        return False


def _is_left(path: Path) -> bool:
    with path.open('rb') as file:
        size = file.seek(0, 2)
        file.seek(0)
        is_mcap = file.read(len(MAGIC)) in (MAGIC, b'')
        return is_mcap and find_footer(file, size) is None and not is_being_written(file)
