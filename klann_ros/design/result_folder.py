"""
The folder of a search: its state, and the files of its result.

`design.json` lists the SHA-256 of each file, and its own. A file that is not as listed was changed
by somebody else, and is neither replaced nor removed.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
import errno
import hashlib
from itertools import count
import json
import os
from pathlib import Path
import re
import sys
from typing import Any

from klann_ros.cli import Output, OutputError, UsageError
from klann_ros.sanitize.files import read_regular
from klann_ros.sanitize.text import parse_json, printable

from .leg_file import leg_text, parameter_text
from .page import page
from .proof import check_file, ProofError
from .report import leg_name, report_content
from .search import SearchResult, State

STATE, RESULT, PAGE, LOCK = 'search.json', 'design.json', 'index.html', '.klann-search.lock'
MAX_FILE_SIZE = 100_000_000
# Names that a result may list.
LISTED_NAME = re.compile(r'leg_\d{3,9}(_walker)?\.yaml|index\.html')
# Errors of a file system without locks.
NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)


class ResultFolder:
    """The folder of a search, which no other search uses; `opened_folder` makes one."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def state(self) -> State | None:
        """Return the state of the search to resume; None if it ended in its first round."""
        if _is_empty(self._folder):
            return None
        try:
            state = State.of(parse_json(read_regular(self._folder / STATE, MAX_FILE_SIZE)))
        except (OSError, ValueError) as error:
            raise _unreadable(self._folder, error) from error
        self._check(self._listed_hashes())
        return state

    def save_state(self, state: State) -> None:
        """Write the state of the search."""
        self._save(STATE, json.dumps(state.content()))

    def save_result(self, search_result: SearchResult) -> tuple[list[str], list[str]]:
        """Write the files of a result; return the names of its legs, and the files left alone."""
        old_hashes = self._listed_hashes()
        self._check(old_hashes)
        old_hashes.pop(RESULT, None)
        names: list[str] = []
        texts: dict[str, str] = {}
        # A name is free if no file has it, or an old one of the search.
        taken_names = {file.name for file in self._folder.iterdir()} - old_hashes.keys()
        numbers = count()
        for leg, title in zip(search_result.legs, search_result.titles, strict=True):
            name = leg_name(next(numbers))
            while not taken_names.isdisjoint((f'{name}.yaml', f'{name}_walker.yaml')):
                name = leg_name(next(numbers))
            names.append(name)
            head = f'# Found by design{title and f", {title}"}; its figures:\n'
            for figure in search_result.requirements.figures:
                text = search_result.requirements.figure_text(figure, leg.reached.get(figure))
                head += f'#   {figure}: {text}\n'
            texts[f'{name}.yaml'] = head + leg_text(leg.leg)
            if leg.walker is not None:
                walker_text = f'# A walker of {name}.yaml.\n{parameter_text(leg.walker)}'
                texts[f'{name}_walker.yaml'] = walker_text
        texts[PAGE] = page(search_result, names)
        result = report_content(search_result, names)
        result['files'] = {name: _hash(text) for name, text in texts.items()}
        # The files are listed before they are written: a kill -9 meanwhile leaves none unlisted.
        self._save(RESULT, _with_checksum({**result, 'old_files': old_hashes}))
        for name, text in texts.items():
            self._save(name, text)
        try:
            for name, leg in zip(names, search_result.legs, strict=True):
                check_file(self._folder / f'{name}.yaml', leg)
        except ProofError as error:
            raise OutputError(str(error)) from error
        for name in old_hashes.keys() - texts.keys():
            (self._folder / name).unlink(missing_ok=True)
        self._save(RESULT, _with_checksum({**result, 'old_files': {}}))
        return names, sorted(name for name in taken_names if name.startswith('leg_'))

    def _check(self, listed_hashes: Mapping[str, str]) -> None:
        """Raise an OutputError if somebody else changed a file that a result replaces."""
        for name in (STATE, RESULT, PAGE):
            file = self._folder / name
            is_listed = name == STATE or name in listed_hashes
            if os.path.lexists(file) and (file.is_symlink() or not is_listed):
                advice = 'move it away, or choose another folder with -o'
                raise OutputError(f'{printable(file)} is not as the last search left it: {advice}')

    def _listed_hashes(self) -> dict[str, str]:
        """Return the hashes of the files that are as the last result lists them, and its own."""
        hashes: dict[str, str] = {}
        with suppress(AttributeError, KeyError, TypeError, ValueError):
            result = parse_json(self._text(RESULT))
            checksum = result.pop('sha256')
            if checksum == _checksum(result):
                hashes[RESULT] = checksum
                for name, listed_hash in (*result['files'].items(), *result['old_files'].items()):
                    is_old_file = LISTED_NAME.fullmatch(name) is not None
                    if is_old_file and _hash(self._text(name)) == listed_hash:
                        hashes[name] = listed_hash
        return hashes

    def _text(self, name: str) -> str:
        """Return the text of a file; an empty one if it is no regular file, or cannot be read."""
        with suppress(OSError, ValueError):
            if not (self._folder / name).is_symlink():
                return read_regular(self._folder / name, MAX_FILE_SIZE)
        return ''

    def _save(self, name: str, text: str) -> None:
        # A name may have bytes that are not UTF-8.
        Output('-o', os.fspath(self._folder / name)).write(text.encode(errors='replace'))


@contextmanager
def opened_folder(folder: Path, *, resume: bool) -> Iterator[tuple[ResultFolder, State | None]]:
    """
    Yield the folder of a search, locked, and the state to resume: None of a new search.

    An OutputError says that it cannot be used, a UsageError that there is nothing to resume.
    """
    title = printable(folder)
    try:
        if not resume and not _is_empty(folder):
            folder.mkdir(parents=True)
        descriptor = _locked(folder / LOCK)
    except FileExistsError as error:
        advice = 'continue it with --resume, or choose another with -o'
        raise OutputError(f'{title} exists already: {advice}') from error
    except OSError as error:
        if resume and not folder.is_dir():
            raise _unreadable(folder, error) from error
        reason = printable(error.strerror or error)
        raise OutputError(f'{title} cannot be made or used: {reason}') from error
    try:
        result_folder = ResultFolder(folder)
        yield result_folder, result_folder.state()
    finally:
        os.close(descriptor)


def _unreadable(folder: Path, error: Exception) -> UsageError:
    reason = printable(getattr(error, 'strerror', None) or error)
    return UsageError(f'--resume: {printable(folder / STATE)} cannot be read: {reason}')


def _is_empty(folder: Path) -> bool:
    """Return whether a folder has no files but those that a killed search leaves behind."""
    return folder.is_dir() and all(file.name.startswith('.klann-') for file in folder.iterdir())


def _locked(lock: Path) -> int:
    """Return the descriptor of a locked file; the lock of the system ends with the process."""
    flags = os.O_RDWR | os.O_CREAT | getattr(os, 'O_NOFOLLOW', 0)
    descriptor = os.open(lock, flags, 0o666)
    try:
        if sys.platform == 'win32':
            import msvcrt  # noqa: PLC0415 - of Windows alone

            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl  # noqa: PLC0415 - absent on Windows

            # Workers, which may outlive a killed search, do not inherit it, as that of flock.
            fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in NO_LOCKS:
            os.close(descriptor)
            raise BlockingIOError(error.errno, 'another search has not ended') from error
    return descriptor


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode(errors='replace')).hexdigest()


def _checksum(result: Mapping[str, Any]) -> str:
    """Return the hash of a result without its own."""
    return _hash(json.dumps(result, sort_keys=True))


def _with_checksum(result: Mapping[str, Any]) -> str:
    """Return a result as JSON, with its own hash."""
    return json.dumps({**result, 'sha256': _checksum(result)}, indent=1, allow_nan=False) + '\n'
