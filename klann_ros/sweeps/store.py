"""Results in chunks on disk: written atomically, and reused only by the sweep that made them."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
import hashlib
import json
from pathlib import Path
import secrets
from typing import Any

from klann_ros.engines import parallel_map, TaskError
from klann_ros.sanitize.files import open_regular, read_regular
from klann_ros.sanitize.text import printable
import numpy as np
from numpy.typing import NDArray

MANIFEST = 'sweep.json'
_MAX_MANIFEST_SIZE = 1_000_000
Arrays = Mapping[str, NDArray[Any]]
# Called with the number of finished chunks, and of all.
Progress = Callable[[int, int], object]


class SweepError(Exception):
    """A sweep that cannot be started, resumed or completed; the text says why."""


def fingerprint(*parts: object) -> str:
    """Return the SHA-256 of arrays, by their bytes, and of other values, by their text."""
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f'{part.dtype} {part.shape}'.encode())
            digest.update(np.ascontiguousarray(part).tobytes())
        else:
            digest.update(repr(part).encode())
        digest.update(b'\0')
    return digest.hexdigest()


class ChunkStore:
    """
    The chunks of one sweep in a folder.

    Parameters
    ----------
    folder : path
        Created if missing.
    identity : str
        Fingerprint of the sweep.
    count : int
        Number of chunks of the complete sweep.

    Raises
    ------
    SweepError
        The folder holds another sweep, or cannot be written.

    """

    def __init__(self, folder: str | Path, identity: str, count: int) -> None:
        """Start the sweep, or resume it."""
        self.folder, self.count = Path(folder), count
        manifest_text = json.dumps({'klann_ros': 'sweep', 'identity': identity, 'chunks': count})
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            manifest = self.folder / MANIFEST
            if manifest.exists():
                if read_regular(manifest, _MAX_MANIFEST_SIZE) != manifest_text:
                    raise SweepError(
                        f'{printable(folder)} holds another sweep: choose an empty folder'
                    )
            elif any(self.folder.iterdir()):
                raise SweepError(f'{printable(folder)} is not empty, and holds no sweep')
            else:
                _write(manifest, lambda path: path.write_text(manifest_text))
        except (OSError, ValueError) as error:
            reason = getattr(error, 'strerror', None) or error
            raise SweepError(f'{printable(folder)} cannot be used: {reason}') from error

    def path(self, number: int) -> Path:
        """Return the file of a chunk."""
        return self.folder / f'chunk_{number:06}.npz'

    def missing(self) -> list[int]:
        """Return the numbers of the chunks without a file."""
        return [number for number in range(self.count) if not self.path(number).exists()]

    def load(self, number: int) -> dict[str, NDArray[Any]]:
        """Return the arrays of a chunk, read-only."""
        with open_regular(self.path(number)) as file, np.load(file, allow_pickle=False) as content:
            arrays = {name: content[name] for name in content.files}
        for array in arrays.values():
            array.setflags(write=False)
        return arrays

    def fill(
        self,
        function: Callable[[Any], Arrays],
        items: Sequence[Any],
        progress: Progress | None,
        **engine: Any,
    ) -> None:
        """
        Compute the missing chunks; engine options as of `klann_ros.engines.parallel_map`.

        Raises
        ------
        SweepError
            A chunk failed; the others are stored.
        EngineError
            The engine is unavailable.

        """
        missing = self.missing()
        done, faults = self.count - len(missing), []
        work = partial(_compute, function)
        tasks = ((self.path(number), items[number]) for number in missing)
        for place, answer in parallel_map(work, tasks, **engine):
            if isinstance(answer, TaskError):
                faults.append(f'chunk {missing[place]}: {answer.reason}')
                continue
            done += 1
            if progress is not None:
                progress(done, self.count)
        if faults:
            more = f' (and {len(faults) - 1} more)' if len(faults) > 1 else ''
            raise SweepError(f'{printable(faults[0])}{more}; finished chunks are kept')


def _compute(function: Callable[[Any], Arrays], task: tuple[Path, Any]) -> None:
    """Compute a chunk and store it from the worker, into the shared folder."""
    path, item = task
    arrays = function(item)

    def save(place: Path) -> None:
        with place.open('wb') as file:
            np.savez(file, **dict(arrays))  # type: ignore[arg-type]

    _write(path, save)


def _write(path: Path, save: Callable[[Path], object]) -> None:
    beside = path.with_name(f'.{path.name}.{secrets.token_hex(8)}')
    try:
        save(beside)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
