"""The runs in folders, by names alone: nothing is opened to find them."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
import os
from pathlib import Path
import re
import stat

from klann_ros.log.bag_metadata import FILE_NAME
from klann_ros.log.read.run_files import is_log_name, natural, run_name
from klann_ros.sanitize.text import printable


@dataclass(frozen=True)
class FoundRun:
    """
    A run, or what stands in its place.

    Attributes
    ----------
    path : str
        Where it is.
    fault : str
        Why it cannot be one; '' for a run.

    """

    path: str
    fault: str = ''


def find_runs(paths: Iterable[str]) -> list[FoundRun]:
    """
    Return the runs at paths and in folders, each once, in the order of the paths and by names.

    A folder is one run if it has metadata.yaml, or if all its logs are numbered files of one name;
    else each log in it is a run, and so are those in the folders below. What cannot be looked
    into is in the list with its reason, as is an empty folder: its recorder may have died early. A
    link to a folder is followed once: in what it leads to, other links to folders are not.
    """
    found: dict[str, FoundRun] = {}
    for path in paths:
        for run in _runs(path, ()):
            found.setdefault(os.path.realpath(run.path) + run.fault, run)
    return list(found.values())


def _runs(
    path: str, above: tuple[tuple[int, int], ...], *, is_linked: bool = False
) -> Iterator[FoundRun]:
    try:
        status = Path(path).stat()
        if not stat.S_ISDIR(status.st_mode):
            yield FoundRun(path)
            return
        here = status.st_dev, status.st_ino
        if here in above:
            yield FoundRun(path, f'{printable(path)} leads back to a folder that it is in')
            return
        with os.scandir(path) as entries:
            names = sorted((entry.name for entry in entries), key=lambda name: natural(Path(name)))
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        yield FoundRun(path, f'{printable(path)} cannot be read: {reason}')
        return
    visible = [name for name in names if not name.startswith('.')]
    logs = [name for name in visible if is_log_name(Path(name))]
    if FILE_NAME in names or (logs and _are_one(logs)):
        yield FoundRun(path)
        return
    for name in visible:
        inner = str(Path(path) / name)
        if name in logs:
            yield FoundRun(inner)
        else:
            yield from _below(inner, (*above, here), is_linked=is_linked)
    if above and not names:
        yield FoundRun(path, f'{printable(path)} is an empty folder: there is no log in it')


def _below(
    path: str, above: tuple[tuple[int, int], ...], *, is_linked: bool
) -> Iterator[FoundRun]:
    """Yield the runs in what is in a folder, if that is a folder as well."""
    try:
        is_folder = stat.S_ISDIR(Path(path).stat().st_mode)
    except FileNotFoundError:
        return
    except OSError as error:
        yield FoundRun(path, f'{printable(path)} cannot be read: {error.strerror}')
        return
    is_link = Path(path).is_symlink()
    if is_folder and is_link and is_linked:
        yield FoundRun(path, f'{printable(path)} is a link in a linked folder, not followed')
    elif is_folder:
        yield from _runs(path, above, is_linked=is_linked or is_link)


def _are_one(logs: Iterable[str]) -> bool:
    """Return whether files are numbered parts of one run, as recorders name them."""
    parts = [re.fullmatch(r'(.+)_\d+', run_name(Path(name))) for name in logs]
    return len({part and part[1] for part in parts}) == 1 and None not in parts
