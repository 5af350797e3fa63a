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

from .compressed import COMPRESSED_SUFFIXES

SUFFIXES = ('.mcap', '.db3')
"""Suffixes of the files of a bag, unless they are compressed; the first is the usual one."""

LOG_HELP = 'a run folder, a rosbag2 bag, or an .mcap or .db3 file'
"""Description of a log argument."""

_MAX_NAME = 1000
_PLUGINS = ('mcap', 'sqlite3', '')
_MODES = ('file', 'message', 'none')
_FORMATS = ('zstd', '')
# A command to be copied, with the folder twice in it.
_MAX_COMMAND = 2000


@dataclass
class LogFiles:
    """The files of a log in order, and the faults of its folder."""

    # The existing files.
    paths: list[Path] = field(default_factory=list)
    # The compressed original of an unpacked file, in case that the latter is incomplete.
    packed: dict[Path, Path] = field(default_factory=dict)
    # Files that are missing, and other faults, one line each.
    missing: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


def run_files(path: AnyPath) -> LogFiles:
    """
    Return the files of a log.

    For a folder these are the files named by its ``metadata.yaml``, and those that continue their
    numbers, as the metadata of a killed recording may be a file behind; otherwise all of the usual
    names in natural order (2 before 10). A file that exists compressed and unpacked counts once.

    A NotALogError means that the path does not exist, that the folder has no file of a bag, or
    that rosbag2 stored it in an unknown format.
    """
    log = Path(path)
    try:
        if log.is_dir():
            return _folder_files(log)
        # If it is no file, opening it names its kind.
        if log.exists():
            return LogFiles([log])
    except (OSError, ValueError) as error:  # ValueError: a path with a null byte
        raise NotALogError(path, str(error)) from None
    raise NotALogError(path, 'there is no such path')


def _folder_files(folder: Path) -> LogFiles:
    """Return the files of a run's folder, as its metadata or their names tell."""
    files = LogFiles()
    metadata = _metadata(folder / FILE_NAME, files.remarks)
    existing, files.packed = _preferred_files(folder.iterdir())
    names = metadata.get('relative_file_paths')
    # The last part only: older recorders put the folder's name before it.
    named = [
        folder / Path(str(name)[:_MAX_NAME]).name
        for name in (names if isinstance(names, list) else ())
    ]
    readable = any(map(is_log_name, [*named, *existing]))
    _check_storage(folder, metadata, files.remarks, readable=readable)
    if named:
        # By their unpacked names: they may have been compressed or unpacked since.
        by_name = {_unpacked_name(path): path for path in existing}
        named = list(dict.fromkeys(by_name.get(_unpacked_name(path), path) for path in named))
        for path in named:
            if is_regular_file(path):
                files.paths.append(path)
            else:
                files.missing.append(_missing_fault(path))
        _add_continuation(files, existing)
    else:
        files.paths = _files_of_one_storage(existing, files.remarks)
    if not files.paths:
        nothing = f'there is no {" or ".join(SUFFIXES)} file in the folder'
        raise NotALogError(folder, '; '.join([nothing, *files.missing[:1]]))
    return files


def _missing_fault(path: Path) -> str:
    """Return the fault of a named file that cannot be read."""
    name = printable(path.name)
    try:
        open_regular(path).close()
    except (FileNotFoundError, ValueError):
        return f'{name} is missing, though {FILE_NAME} names it'
    except OSError as error:
        return f'{name} is left out, though {FILE_NAME} names it: {error.strerror}'
    return f'{name} is left out: it appeared while the folder was read'


def _preferred_files(paths: Iterable[Path]) -> tuple[list[Path], dict[Path, Path]]:
    """
    Return the files of a bag in natural order, and the compressed copies of unpacked ones.

    Of a file that exists unpacked and compressed the unpacked one is preferred.
    """
    preferred: dict[str, Path] = {}
    packed: dict[Path, Path] = {}
    # Hidden files are those of tools, such as an unfinished copy.
    visible = (path for path in paths if is_log_name(path) and not path.name.startswith('.'))
    # An unpacked file sorts before its compressed copy.
    for path in sorted(visible, key=natural_key):
        name = _unpacked_name(path)
        unpacked = preferred.get(name)
        if unpacked is not None and is_regular_file(unpacked):
            packed[unpacked] = path
        else:
            preferred[name] = path
    return list(preferred.values()), packed


def _add_continuation(files: LogFiles, existing: list[Path]) -> None:
    """Add to `files` those that continue the numbers of the named ones; remark on all others."""
    named = list(files.paths)
    if not named:
        files.paths = existing
        return
    series = {_series(path) for path in named}
    last = max(map(natural_key, named))
    for path in existing:
        if path in named:
            continue
        continues = re.search(r'_\d+\.', path.name) and _series(path) in series
        if continues and natural_key(path) > last:
            files.paths.append(path)
            reaction = '; it continues the run, and is read'
        else:
            reaction = ', and is left out'
        files.remarks.append(f'{printable(path.name)} is not named in {FILE_NAME}{reaction}')


def _files_of_one_storage(existing: list[Path], remarks: list[str]) -> list[Path]:
    """Return the files of the first suffix, and add a remark on each of another: it is a copy."""
    for suffix in SUFFIXES:
        chosen = [path for path in existing if _suffix(path) == suffix]
        if chosen:
            break
    for path in existing:
        if path not in chosen:
            chosen_name = printable(chosen[0].name)
            remarks.append(
                f'{printable(path.name)} is left out: {chosen_name} beside it is of another '
                'storage'
            )
    return chosen


def _check_storage(
    folder: Path, metadata: dict[str, Any], remarks: list[str], *, readable: bool
) -> None:
    """Refuse formats that only plugins of rosbag2 can read, and add faults to the remarks."""

    def setting(key: str) -> str:
        return str(metadata.get(key) or '')[:_MAX_NAME]

    plugin = setting('storage_identifier')
    if plugin not in _PLUGINS and not readable:
        reason = f"rosbag2 stored it by '{printable(plugin)}'"
        raise NotALogError(folder, f'{reason}; {_convert_command(folder)}')
    mode = setting('compression_mode')
    codec = setting('compression_format')
    if (mode.lower() or 'none') not in _MODES:
        remarks.append(f"{FILE_NAME} is damaged: there is no compression mode '{printable(mode)}'")
    elif mode.lower() == 'message' and codec not in _FORMATS:
        reason = f"rosbag2 compressed its messages by '{printable(codec)}'"
        raise NotALogError(folder, f'{reason}; {_convert_command(folder)}')


def run_name(path: Path) -> str:
    """Return the name of a run's file without the suffixes of its storage."""
    name = Path(_unpacked_name(path))
    return name.stem if name.suffix in SUFFIXES else name.name


def is_log_name(path: Path) -> bool:
    """Return whether a file has the name of a log."""
    return _suffix(path) in SUFFIXES


def natural_key(path: Path) -> list[tuple[int, str]]:
    """Return the sort key of natural order: 2 before 10."""
    return [
        (int(word), '') if word.isdecimal() else (-1, word)
        for word in re.findall(r'\d+|\D+', path.name)
    ]


def _suffix(path: Path) -> str:
    return Path(_unpacked_name(path)).suffix


def _series(path: Path) -> tuple[str, str]:
    return Path(_unpacked_name(path)).stem.rpartition('_')[0], _suffix(path)


def _unpacked_name(path: Path) -> str:
    return path.stem if path.suffix in COMPRESSED_SUFFIXES else path.name


def _metadata(path: Path, remarks: list[str]) -> dict[str, Any]:
    """Return the content of metadata.yaml; add faults to the remarks, and return {} then."""
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


# The files of a run are listed more than once.
_parsed = lru_cache(maxsize=1)(yaml_text.load)


def _convert_command(folder: Path) -> str:
    """Return the command line, as a half sentence (rosbag2's README, "Converting bags")."""
    output = json.dumps(f'{folder}_mcap')
    options = f'output_bags: [{{uri: {output}, storage_id: mcap, all: true}}]'
    source = shlex.quote(str(folder))
    command = f'echo {shlex.quote(options)} > to.yaml && ros2 bag convert -i {source} -o to.yaml'
    return f'`{printable(command, _MAX_COMMAND)}` makes a run of it'
