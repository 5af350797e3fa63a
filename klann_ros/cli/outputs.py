"""
The output files of a command: checked before the work begins, each written whole or not at all.

No input and no log is overwritten. The content goes to a temporary file beside the target, which
replaces it in one step: a full disk leaves the previous file.
"""

from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
import errno
from functools import partial
import os
from pathlib import Path
import shutil
import stat
import sys
from typing import Any, BinaryIO

from klann_ros.sanitize.files import is_regular_file, is_within, NO_WAITING, open_regular
from klann_ros.sanitize.text import printable, printable_line

from .arguments import OutputError

Save = Callable[[BinaryIO], object]
# First bytes of MCAP, SQLite and zstd files, which hold logs.
LOG_MAGICS = (b'\x89MCAP0\r\n', b'SQLite format 3\x00', b'\x28\xb5\x2f\xfd')

_EXISTS = 'it exists already, not overwriting; choose a new name'


@contextmanager
def output_errors(option: str, path: str, errors: type[Exception] = OutputError) -> Iterator[None]:
    """Raise an OutputError of an option for what the disk, an OutputError or `errors` say."""
    try:
        yield
    except (OSError, ValueError, OutputError, errors) as error:
        reason = printable_line(getattr(error, 'strerror', None) or error)
        raise OutputError(f'{option} {printable(path)} cannot be written: {reason}') from error


@dataclass(frozen=True)
class Output:
    """An output file: its option, such as '--html', and its path as given."""

    option: str
    path: str

    def save(self, save: Save) -> None:
        """Write the file; an OutputError leaves the previous one."""
        with output_errors(self.option, self.path), self._open_temporary() as file:
            save(file)

    def write(self, content: bytes) -> None:
        """Write the file with a content that is there already; errors as `save`."""
        self.save(lambda file: file.write(content))

    def check_distinct(self, outputs: Iterable['Output']) -> None:
        """Raise an OutputError if it is the file of another output."""
        for output in outputs:
            if self.is_file(output.path):
                raise OutputError(f'{output.option} and {self.option} are the same file')

    def check(self, inputs: Sequence[str]) -> None:
        """Raise an OutputError if it is an input, or cannot be written."""
        with output_errors(self.option, self.path):
            for input_path in inputs:
                if is_within(self.path, input_path):
                    inside = 'inside ' if Path(input_path).is_dir() else ''
                    raise OutputError(f'it is {inside}{printable(input_path)}, which is only read')
            if not self.path or self.path.endswith((os.sep, '/')):
                raise OutputError('that is no path of a file')
            if _is_special(self.path):
                return
            if is_regular_file(self.path):
                _check_replaceable(self.path)
            if Path(self.path).is_symlink():
                raise OutputError('it is a symbolic link: name the file itself')
            with _temporary_file(_target(self.path)) as (descriptor, _):
                os.close(descriptor)

    def is_file(self, path: str) -> bool:
        """Return whether a path is this file's."""
        if _is_special(self.path):
            return False
        return is_within(self.path, path) or _target(self.path) == _target(path)

    @contextmanager
    def _open_temporary(self) -> Iterator[BinaryIO]:
        """Yield a file that replaces the output when complete; a pipe is written directly."""
        if _is_special(self.path):
            # A pipe without a reader is an error; one with a reader may be slow.
            descriptor = os.open(self.path, os.O_WRONLY | NO_WAITING)
            if sys.platform != 'win32':
                os.set_blocking(descriptor, True)
            with os.fdopen(descriptor, 'wb') as file:
                yield file
            return
        place = _target(self.path)
        with _temporary_file(place) as (descriptor, beside):
            with os.fdopen(descriptor, 'wb') as file:
                yield file
                file.flush()
                os.fsync(descriptor)
            beside.replace(place)


def output_files(
    options: Namespace,
    names: Iterable[str],
    inputs: Iterable[str | None],
    *,
    refuse_yaml: Iterable[str] = (),
) -> list[Output]:
    """
    Return the output files of options, such as 'json' for --json, that can all be written.

    An OutputError says that an output is an input, or cannot be written, or that two of them are
    one file. The options of `refuse_yaml` may be no .yaml or .yml: a robot file may name others.
    """
    outputs: list[Output] = []
    input_paths = [path for path in inputs if path]
    for name in names:
        path = getattr(options, name)
        if path is None:
            continue
        output = Output(f'--{name}', path)
        if name in refuse_yaml and Path(path).suffix.lower() in ('.yaml', '.yml'):
            reason = 'a file of parameters or a linkage may be there, which FILE may name'
            raise OutputError(f'{output.option} {printable(path)} is refused: {reason}')
        output.check(input_paths)
        output.check_distinct(outputs)
        outputs.append(output)
    return outputs


def check_new_folder(option: str, path: str, inputs: Iterable[str | None]) -> None:
    """Raise an OutputError if a folder is there already, or would be in an input."""
    with output_errors(option, path):
        if os.path.lexists(path):
            is_folder = Path(path).is_dir() or Path(path).is_symlink()
            raise OutputError(_EXISTS if is_folder else 'it is no folder')
        if not Path(path).parent.is_dir():
            raise OutputError(f'there is no folder {printable(Path(path).parent)}')
        for input_path in filter(None, inputs):
            if is_within(path, input_path):
                raise OutputError(f'it is inside {printable(input_path)}, which is only read')


def save_folder(option: str, path: str, contents: Mapping[str, bytes]) -> None:
    """Write a new folder of files, whole or not at all; an OutputError gives the reason."""
    with output_errors(option, path), new_folder(Path(path)) as folder:
        folder.mkdir()
        for name, content in contents.items():
            (folder / name).write_bytes(content)


@contextmanager
def new_folder(place: Path) -> Iterator[Path]:
    """Yield a path for a folder of the same name, which moves to its place at the end."""
    beside = place.with_name(f'.klann-{os.urandom(8).hex()}.new')
    try:
        beside.mkdir()
        yield beside / place.name
        # An empty folder made meanwhile would be replaced.
        if os.path.lexists(place):
            raise FileExistsError(errno.EEXIST, _EXISTS, str(place))
        (beside / place.name).rename(place)
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def save_all(files: Iterable[Output], savers: Mapping[str, Save]) -> None:
    """Write each file by the saver of its option; an OutputError of all failures comes last."""
    errors: list[Any] = []
    for file in files:
        try:
            file.save(savers[file.option])
        except OutputError as error:  # noqa: PERF203, RUF100 - of each file
            errors += error.args
    if errors:
        raise OutputError(*errors)


def save_texts(files: Iterable[Output], views: Mapping[str, Callable[[], str]]) -> None:
    """Write each file with the text that its option's view returns, as `save_all` does."""
    save_all(files, {option: partial(_save_text, view) for option, view in views.items()})


def _save_text(view: Callable[[], str], file: BinaryIO) -> None:
    # A text may contain a path, whose bytes need not be UTF-8.
    file.write(view().encode(errors='replace'))


def _target(path: str) -> Path:
    """Return the file behind a link, which itself stays."""
    return Path(os.path.realpath(path))


@contextmanager
def _temporary_file(place: Path) -> Iterator[tuple[int, Path]]:
    """Yield a temporary file beside the target, open; it is removed, unless it was renamed."""
    old_status = place.stat() if place.exists() else None
    if old_status is not None and not stat.S_ISREG(old_status.st_mode):
        raise OutputError('it is a folder' if place.is_dir() else 'it is no regular file')
    if not place.parent.is_dir():
        raise OutputError(f'there is no folder {printable(place.parent)}')
    beside = place.with_name(f'.klann-{os.urandom(8).hex()}.new')
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    try:
        # A signal may come as soon as it is there.
        descriptor = os.open(beside, flags, 0o666)
        if old_status is not None and sys.platform != 'win32':
            with suppress(OSError):
                os.fchmod(descriptor, stat.S_IMODE(old_status.st_mode))
        yield descriptor, beside
    finally:
        beside.unlink(missing_ok=True)


def _is_special(path: str) -> bool:
    """Return whether a path is a pipe or a device, which is written directly."""
    try:
        mode = Path(path).stat().st_mode
    except OSError:
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISCHR(mode)


def _check_replaceable(path: str) -> None:
    """Refuse to replace a log, or a file that this process has open as stdout or stderr."""
    with suppress(PermissionError), open_regular(path) as file:
        if file.read(max(map(len, LOG_MAGICS))).startswith(LOG_MAGICS):
            raise OutputError('it is a log, and no log is overwritten')
    for descriptor in (1, 2):
        with suppress(OSError):
            if os.path.samestat(Path(path).stat(), os.fstat(descriptor)):
                raise OutputError('the report itself goes there')
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
