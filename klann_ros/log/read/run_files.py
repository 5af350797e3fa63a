"""Which files a log consists of: a run's folder or a single file."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
import json
from pathlib import Path
import re
import shlex
from typing import Any

from klann_ros.log.bag_metadata import FILE_NAME, ROOT_KEY
from klann_ros.log.errors import AnyPath, NotALogError
from klann_ros.sanitize import yaml_text
from klann_ros.sanitize.files import is_regular_file, open_regular, read_regular
from klann_ros.sanitize.text import printable

from .zstd_file import SUFFIXES as PACKED

SUFFIXES = ('.mcap', '.db3')
"""How the files of a bag are called, before they are packed; the first is the usual one."""

LOG_HELP = 'a run folder, a rosbag2 bag, or an .mcap or .db3 file'
"""What may be given where a log is asked for."""

_MAX_NAME = 1000
_PLUGINS = ('mcap', 'sqlite3', '')
_MODES = ('file', 'message', 'none')
_FORMATS = ('zstd', '')
# It is there to be copied, and names the folder twice.
_LONGEST = 2000


@dataclass
class RunFiles:
    """The files of a log in order, and what is wrong with its folder."""

    # The files that are there.
    paths: list[Path] = field(default_factory=list)
    # Of some of them the same file as it was packed, in case that what was unpacked from it is not
    # all.
    packed: dict[Path, Path] = field(default_factory=dict)
    # Files that should be there, one line each.
    missing: list[str] = field(default_factory=list)
    # What else is wrong, one line each.
    remarks: list[str] = field(default_factory=list)


def run_files(path: AnyPath) -> RunFiles:
    """
    Return which files a log consists of.

    For a folder these are the files that its ``metadata.yaml`` names, and those that continue
    their numbers, since the metadata of a recording that was killed may be a file behind; or else
    all of the usual names in natural order (2 before 10). A file that was packed by rosbag2 may
    be unpacked by now, or the other way round; where it is there both ways it counts once.

    Raises
    ------
    NotALogError
        There is nothing at the path, or a folder without a file of a bag, or one that rosbag2
        stored in a way of which nothing is known here.

    """
    place = Path(path)
    try:
        if place.is_dir():
            return _folder_files(place)
        # What is no file either says so when it is opened.
        if place.exists():
            return RunFiles([place])
    except (OSError, ValueError) as error:  # ValueError: a path with a null byte
        raise NotALogError(path, str(error)) from None
    raise NotALogError(path, 'there is no such path')


def _folder_files(folder: Path) -> RunFiles:
    files = RunFiles()
    metadata = _metadata(folder / FILE_NAME, files.remarks)
    found = _once(folder.iterdir(), files.packed)
    names = metadata.get('relative_file_paths')
    named = _named(folder, names) if isinstance(names, list) else []
    _check_storage(
        folder, metadata, files.remarks, readable=any(map(is_log_name, [*named, *found]))
    )
    if named:
        # By their names when unpacked: somebody may have unpacked, or packed, them since.
        by_name = {_unpacked(path): path for path in found}
        named = list(dict.fromkeys(by_name.get(_unpacked(path), path) for path in named))
        there = [path for path in named if is_regular_file(path)]
        files.missing = [_missing(path) for path in named if path not in there]
        found = _with_those_named(there, found, files.remarks) if there else found
    else:
        found = _of_one_storage(found, files.remarks)
    if not found:
        nothing = f'there is no {" or ".join(SUFFIXES)} file in the folder'
        raise NotALogError(folder, '; '.join([nothing, *files.missing[:1]]))
    files.paths = found
    return files


def _missing(path: Path) -> str:
    """Return what is wrong with a file that is named and cannot be read."""
    name = printable(path.name)
    try:
        open_regular(path).close()
    except (FileNotFoundError, ValueError):
        return f'{name} is missing, though {FILE_NAME} names it'
    except OSError as error:
        return f'{name} is left out, though {FILE_NAME} names it: {error.strerror}'
    return f'{name} is left out: it was not there when it was looked for'


def _unnamed(path: Path, what_then: str) -> str:
    return f'{printable(path.name)} is not named in {FILE_NAME}{what_then}'


def _once(paths: Iterable[Path], packed: dict[Path, Path]) -> list[Path]:
    """Return the files of a bag in natural order, unpacked rather than packed."""
    found: dict[str, Path] = {}
    # Hidden ones are some tool's own, such as a copy in progress.
    visible = (path for path in paths if is_log_name(path) and not path.name.startswith('.'))
    for path in sorted(visible, key=natural):
        first = found.setdefault(_unpacked(path), path)
        if first != path and is_regular_file(first):
            packed[first] = path
        else:
            found[_unpacked(path)] = path
    return list(found.values())


def _named(folder: Path, names: list[object]) -> list[Path]:
    # The last part only: older recorders put the folder's name before it.
    return [folder / Path(str(name)[:_MAX_NAME]).name for name in names]


def _with_those_named(there: list[Path], found: list[Path], remarks: list[str]) -> list[Path]:
    """Return the files that are named and those that continue them; remark on the others."""
    more = _continuing(there, found)
    remarks += [_unnamed(path, '; it continues the run, and is read') for path in more]
    remarks += [
        _unnamed(path, ', and is left out')
        for path in found
        if path not in there and path not in more
    ]
    return [*there, *more]


def _continuing(named: list[Path], found: list[Path]) -> list[Path]:
    """Return the files that are not named, but numbered like those that are and behind them."""
    series = {_series(path) for path in named}
    last = max(map(natural, named))
    others = (path for path in found if path not in named and re.search(r'_\d+\.', path.name))
    return [path for path in others if _series(path) in series and natural(path) > last]


def _of_one_storage(found: list[Path], remarks: list[str]) -> list[Path]:
    """Return the files of the kind that comes first: where there are two, one is a copy."""
    kinds = {kind: [path for path in found if _kind(path) == kind] for kind in SUFFIXES}
    chosen = next((paths for paths in kinds.values() if paths), [])
    remarks += [
        f'{printable(path.name)} is left out: {printable(chosen[0].name)} beside it is of another '
        'storage'
        for path in found
        if path not in chosen
    ]
    return chosen


def _check_storage(
    folder: Path, metadata: dict[str, Any], remarks: list[str], *, readable: bool
) -> None:
    """Refuse what only rosbag2's own plugins can read, as far as the metadata tell."""
    plugin, mode, form = (
        str(metadata.get(key) or '')[:_MAX_NAME]
        for key in ('storage_identifier', 'compression_mode', 'compression_format')
    )
    if plugin not in _PLUGINS and not readable:
        raise NotALogError(
            folder, f"rosbag2 stored it by '{printable(plugin)}'; {_convert_command(folder)}"
        )
    if (mode.lower() or 'none') not in _MODES:
        shown = f"'{printable(mode)}'"
        remarks.append(f'{FILE_NAME} is damaged: there is no compression mode {shown}')
    elif mode.lower() == 'message' and form not in _FORMATS:
        raise NotALogError(
            folder,
            f"rosbag2 compressed its messages by '{printable(form)}'; {_convert_command(folder)}",
        )


def run_name(path: Path) -> str:
    """Return how a file of a run is called, without what tells how it is stored."""
    name = Path(_unpacked(path))
    return name.stem if name.suffix in SUFFIXES else name.name


def is_log_name(path: Path) -> bool:
    """Return whether a file is called as a log is."""
    return _kind(path) in SUFFIXES


def _kind(path: Path) -> str:
    return Path(_unpacked(path)).suffix


def _series(path: Path) -> tuple[str, str]:
    return Path(_unpacked(path)).stem.rpartition('_')[0], _kind(path)


def _unpacked(path: Path) -> str:
    """Return the name of a file when it is unpacked."""
    return path.stem if path.suffix in PACKED else path.name


def _metadata(path: Path, remarks: list[str]) -> dict[str, Any]:
    """Return what metadata.yaml says under its root key; nothing if there is none."""
    if not path.exists():
        return {}
    try:
        data = _parsed(read_regular(path, yaml_text.MAX_LOG_TEXT))
    except OSError as error:
        remarks.append(f'{FILE_NAME} cannot be read: {error.strerror}')
        return {}
    except ValueError as error:
        remarks.append(f'{FILE_NAME} is damaged: {error}')
        return {}
    content = data.get(ROOT_KEY) if isinstance(data, dict) else None
    if not isinstance(content, dict):
        remarks.append(f'{FILE_NAME} is damaged: there is no {ROOT_KEY} in it')
        return {}
    return content


@lru_cache(maxsize=1)
def _parsed(text: str) -> Any:
    """Return what a text says; who reads a run looks for its files more than once."""
    return yaml_text.load(text)


def natural(path: Path) -> list[tuple[int, str]]:
    """Return what paths are sorted by, so that 2 is before 10."""
    parts = re.findall(r'\d+|\D+', path.name)
    return [(int(part), '') if part.isdecimal() else (-1, part) for part in parts]


def _convert_command(folder: Path) -> str:
    """Return the command line, as a half sentence (rosbag2's README, "Converting bags")."""
    output = json.dumps(f'{folder}_mcap')
    options = f'output_bags: [{{uri: {output}, storage_id: mcap, all: true}}]'
    words = f'echo {shlex.quote(options)} > to.yaml && ros2 bag convert -i '
    command = f'{words}{shlex.quote(str(folder))} -o to.yaml'
    return f'`{printable(command, _LONGEST)}` makes a run of it'
