"""
Another operating system for the modules of klann_ros, in this process and those it starts.

What they import is Linux's Python without the names of the file KLANN_ROS_SYSTEM. Below its folder
files behave as there: see `_WindowsFiles` and `_check_case`.
"""

import builtins
import json
import os
from pathlib import Path
import socket
import sys
from types import ModuleType
from typing import Any
import warnings

_BINARY = 1 << 30
_WINDOWS_SIGNALS = {2, 4, 6, 8, 11, 15}
_RESERVED = {
    'con',
    'prn',
    'aux',
    'nul',
    *(f'{port}{n}' for port in ('com', 'lpt') for n in range(10)),
}


class _Module:
    """A module without the absent names, and with some of another system's."""

    def __init__(self, module: ModuleType, absent: set[str], changes: dict[str, Any]) -> None:
        self.__dict__.update(changes, _module=module, _absent=absent)

    def __getattr__(self, name: str) -> Any:
        if name in self._absent:
            raise AttributeError(f'module {self._module.__name__!r} has no attribute {name!r}')
        return getattr(self._module, name)

    def __setattr__(self, name: str, attribute: object) -> None:
        setattr(self._module, name, attribute)


class _WindowsFiles:
    """Names, open files, folders and line feeds as Windows has them."""

    def __init__(self, folder: str) -> None:
        self._folder = folder
        self._text_descriptors: set[int] = set()
        self._rename = os.rename

    def check(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event not in {'open', 'os.rename', 'os.remove', 'os.rmdir', 'os.mkdir'}:
            return
        names = arguments[:2] if event == 'os.rename' else arguments[:1]
        for name in names:
            if not isinstance(name, str | os.PathLike):
                continue
            path = os.path.abspath(name)
            if not path.startswith(self._folder + os.sep):
                continue
            base = os.path.basename(path)
            if base.partition('.')[0].lower() in _RESERVED or set(base) & set('<>:"|?*\\'):
                raise OSError(22, f'Windows has no such name: {base}')
            if event == 'open' and os.path.isdir(path):
                raise PermissionError(13, f'Windows opens no folder: {path}')
            if event != 'open':
                self._check_closed(path)

    def _check_closed(self, path: str) -> None:
        for number in os.listdir('/proc/self/fd'):
            try:
                opened = os.readlink(f'/proc/self/fd/{number}')
            except OSError:
                continue
            if opened == path or opened.startswith(path + os.sep):
                raise PermissionError(13, f'Windows: it is open: {opened}')

    def open_file(self, path: Any, flags: int, mode: int = 0o777, **options: Any) -> int:
        descriptor = os.open(path, flags & ~_BINARY, mode, **options)
        if not flags & _BINARY:
            self._text_descriptors.add(descriptor)
        return descriptor

    def fdopen(self, descriptor: int, *arguments: Any, **options: Any) -> Any:
        self._text_descriptors.discard(descriptor)
        return os.fdopen(descriptor, *arguments, **options)

    def close(self, descriptor: int) -> None:
        self._text_descriptors.discard(descriptor)
        os.close(descriptor)

    def write(self, descriptor: int, block: Any) -> int:
        if descriptor in self._text_descriptors:
            os.write(descriptor, bytes(block).replace(b'\n', b'\r\n'))
            return len(block)
        return os.write(descriptor, block)

    def fsync(self, descriptor: int) -> None:
        import fcntl

        if not fcntl.fcntl(descriptor, fcntl.F_GETFL) & (os.O_WRONLY | os.O_RDWR):
            raise OSError(9, 'Windows: it is open for reading only')
        os.fsync(descriptor)

    def rename(self, old: Any, new: Any, **options: Any) -> None:
        if os.path.lexists(new):
            raise FileExistsError(17, f'Windows renames to no name that exists: {new}')
        self._rename(old, new, **options)

    def names(self) -> dict[str, Any]:
        functions = (self.fdopen, self.close, self.write, self.fsync)
        names = {function.__name__: function for function in functions}
        return {'O_BINARY': _BINARY, 'name': 'nt', 'open': self.open_file, **names}


def _check_case(folder: str) -> Any:
    """Return the audit hook that refuses two names of a file that differ in case only."""

    def check(event: str, arguments: tuple[Any, ...]) -> None:
        if event != 'open' or not isinstance(arguments[0], str | os.PathLike):
            return
        path = os.path.abspath(arguments[0])
        parent, base = os.path.split(path)
        is_new = path.startswith(folder + os.sep) and not os.path.lexists(path)
        if is_new and base.lower() in {name.lower() for name in os.listdir(parent)}:
            raise OSError(17, f'a name in other letters is the same file: {base}')

    return check


def _handle(number: int, handler: Any) -> Any:
    import signal

    if number not in _WINDOWS_SIGNALS:
        raise ValueError(f'Windows handles no signal {number}')
    return signal.signal(number, handler)


def _lock(descriptor: int, _mode: int, _size: int) -> None:
    import fcntl

    fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _spawning_context(method: str | None = None) -> Any:
    import multiprocessing

    if method not in {None, 'spawn'}:
        raise ValueError(f'cannot find context for {method!r}')
    return multiprocessing.get_context('spawn')


def _break_polls() -> None:
    """Let the poll of a pipe without its other end raise, as Windows does."""
    from multiprocessing.connection import Connection

    plain_poll = Connection.poll

    def poll(self: Any, timeout: float | None = 0.0) -> bool:
        if not plain_poll(self, timeout):
            return False
        with socket.socket(fileno=os.dup(self.fileno())) as end:
            if not end.recv(1, socket.MSG_PEEK):
                raise BrokenPipeError(109, 'the pipe has been ended')
        return True

    Connection.poll = poll  # type: ignore[method-assign]


def _install(file: str) -> None:
    description = json.loads(Path(file).read_text(encoding='utf-8'))
    folder = os.path.realpath(os.path.dirname(file))
    absent = {name: set(names) for name, names in description['absent'].items()}
    changes: dict[str, dict[str, Any]] = {'sys': {'platform': description['platform']}}
    substitutes: dict[str, _Module] = {}
    sys.addaudithook(_check_case(folder))
    if description['platform'] == 'win32':
        import shutil

        files = _WindowsFiles(folder)
        sys.addaudithook(files.check)
        os.rename = files.rename
        shutil._use_fd_functions = False  # type: ignore[attr-defined]
        changes['os'] = files.names()
        changes['signal'] = {'signal': _handle}
        _break_polls()
        locking = _Module(ModuleType('msvcrt'), set(), {'locking': _lock, 'LK_NBLCK': 2})
        substitutes['msvcrt'] = locking
    changes['multiprocessing'] = {'get_context': _spawning_context}
    plain_import = builtins.__import__

    def import_for(name: str, names: Any = None, *arguments: Any, **options: Any) -> Any:
        importer = (names or {}).get('__name__') or ''
        if importer.partition('.')[0] != 'klann_ros':
            return plain_import(name, names, *arguments, **options)
        if name in substitutes and name not in sys.modules:
            return substitutes[name]
        if name in description['modules']:
            raise ModuleNotFoundError(f'No module named {name!r}', name=name)
        module = plain_import(name, names, *arguments, **options)
        title = getattr(module, '__name__', '')
        if title == 'posixpath':
            title = 'os.path'
        if title not in absent and title not in changes:
            return module
        if title not in substitutes:
            substitutes[title] = _Module(module, absent.get(title, set()), changes.get(title, {}))
        return substitutes[title]

    builtins.__import__ = import_for
    # A text file in the encoding of the machine.
    warnings.filterwarnings('error', category=EncodingWarning, module='klann_ros')


if 'KLANN_ROS_SYSTEM' in os.environ:
    _install(os.environ['KLANN_ROS_SYSTEM'])
