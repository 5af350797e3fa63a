"""Which files a log consists of: a run's folder or a single file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
import re
from typing import Any, TYPE_CHECKING

from klann_ros.log import yaml_text
from klann_ros.log.bag_metadata import FILE_NAME, ROOT_KEY
from klann_ros.log.errors import NotALogError

if TYPE_CHECKING:
    from klann_ros.log.errors import AnyPath

_MAX_NAME = 1000
# How rosbag2 compresses itself, other than chunk by chunk.
_COMPRESSED = ('file', 'message')


@dataclass
class RunFiles:
    """
    The files of a log in order, and what is wrong with its folder.

    Attributes
    ----------
    paths
        The MCAP files that are there.
    missing
        Files that should be there, one line each.
    remarks
        What else is wrong, one line each.

    """

    paths: list[Path] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


def run_files(path: AnyPath) -> RunFiles:
    """
    Return which MCAP files a log consists of.

    For a folder these are the files that its ``metadata.yaml`` names, and those that continue
    their numbers, since the metadata of a recording that was killed may be a file behind; or else
    all ``*.mcap`` in natural order (2 before 10).

    Raises
    ------
    NotALogError
        There is nothing at the path, or a folder without MCAP file, or one that rosbag2 compressed
        as a whole or message by message.

    """
    place = Path(path)
    try:
        if place.is_dir():
            return _folder_files(place)
        if place.is_file():
            return RunFiles([place])
        exists = place.exists()
    except (OSError, ValueError) as error:  # ValueError: a path with a null byte
        raise NotALogError(path, str(error)) from None
    raise NotALogError(path, 'neither a file nor a folder' if exists else 'there is no such path')


def _folder_files(folder: Path) -> RunFiles:
    # Hidden ones are some tool's own, such as a copy in progress.
    visible = (path for path in folder.glob('*.mcap') if not path.name.startswith('.'))
    found = sorted(visible, key=_natural)
    files = RunFiles()
    metadata = _metadata(folder / FILE_NAME, files.remarks)
    mode = str(metadata.get('compression_mode') or 'none')[:_MAX_NAME]
    if mode.lower() in _COMPRESSED:
        raise NotALogError(
            folder, f'it was recorded with rosbag2 compression mode {mode!r}; convert it first'
        )
    if mode.lower() != 'none':
        files.remarks.append(f'{FILE_NAME} is damaged: there is no compression mode {mode!r}')
    names = metadata.get('relative_file_paths')
    if isinstance(names, list) and names:
        # The last part only: older recorders put the folder's name before it.
        named = [folder / Path(str(name)[:_MAX_NAME]).name for name in names]
        there = [path for path in dict.fromkeys(named) if path.is_file()]
        files.missing = [
            f'{path.name} is missing, though {FILE_NAME} names it'
            for path in named
            if path not in there
        ]
        if there:
            more = _continuing(there, found)
            files.remarks += [
                f'{path.name} is not named in {FILE_NAME}; it continues the run, and is read'
                for path in more
            ]
            files.remarks += [
                f'{path.name} is not named in {FILE_NAME}, and is left out'
                for path in found
                if path not in there and path not in more
            ]
            found = [*there, *more]
    if not found:
        raise NotALogError(folder, 'there is no .mcap file in the folder')
    files.paths = found
    return files


def _continuing(named: list[Path], found: list[Path]) -> list[Path]:
    """Return the files that are not named, but numbered like those that are and behind them."""
    series = {_series(path) for path in named}
    last = max(map(_natural, named))
    others = (path for path in found if path not in named)
    return [path for path in others if _series(path) in series and _natural(path) > last]


def _series(path: Path) -> str:
    return path.stem.rpartition('_')[0]


def _metadata(path: Path, remarks: list[str]) -> dict[str, Any]:
    """Return what metadata.yaml says under its root key; nothing if there is none."""
    if not path.exists():
        return {}
    try:
        data = yaml_text.load(path.read_bytes()[: yaml_text.MAX_SIZE + 1].decode())
    except (ValueError, OSError) as error:
        remarks.append(f'{FILE_NAME} is damaged: {error}')
        return {}
    content = data.get(ROOT_KEY) if isinstance(data, dict) else None
    if not isinstance(content, dict):
        remarks.append(f'{FILE_NAME} is damaged: there is no {ROOT_KEY} in it')
        return {}
    return content


def _natural(path: Path) -> list[tuple[int, str]]:
    parts = re.findall(r'\d+|\D+', path.name)
    return [(int(part), '') if part.isdecimal() else (-1, part) for part in parts]
