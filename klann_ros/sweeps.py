"""
Millions of geometries: solved in chunks by any engine, stored on disk, resumable.

>>> import numpy as np, tempfile
>>> from klann_ros.kinematics import KlannGeometry, Variants
>>> from klann_ros.sweeps import sweep_poses
>>> lengths = np.linspace(0.33, 0.36, 1000)
>>> legs = Variants(KlannGeometry.sem104().linkage, {'l_bc': lengths})
>>> folder = tempfile.mkdtemp()
>>> sweep = sweep_poses(legs, np.linspace(0.0, 6.0, 7), folder, chunk=500, jobs=1)
>>> [poses.h.shape for _, poses in sweep]
[(500, 7, 2), (500, 7, 2)]

Chunks already in the folder are not computed again: the same call resumes an interrupted sweep.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
import hashlib
import json
from pathlib import Path
import secrets
from typing import Any

from klann_ros.engines import parallel_map, TaskError
from klann_ros.kinematics import (
    Linkage,
    linkage_poses,
    LinkagePoses,
    ToleranceStudy,
    validation,
    Variants,
)
from klann_ros.kinematics.arrays import AnyArray
from klann_ros.kinematics.batch.tolerance_study import tolerance_draw, ToleranceDraw
from klann_ros.sanitize.files import open_regular, read_regular
from klann_ros.sanitize.text import printable
import numpy as np
from numpy.typing import ArrayLike

__all__ = ['PoseSweep', 'SweepError', 'sweep_poses', 'sweep_tolerances']

MANIFEST = 'sweep.json'
_MAX_MANIFEST_SIZE = 1_000_000
Arrays = Mapping[str, AnyArray]
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
    The chunks of one sweep in a folder, written atomically, by the sweep's fingerprint.

    A SweepError says that the folder holds another sweep, or cannot be written.
    """

    def __init__(self, folder: str | Path, identity: str, count: int) -> None:
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

    def load(self, number: int) -> dict[str, AnyArray]:
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
        """Compute the missing chunks; a SweepError if one fails, the others are stored."""
        missing = [number for number in range(self.count) if not self.path(number).exists()]
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


class PoseSweep:
    """The poses of many linkages, on disk; iteration loads one chunk at a time."""

    def __init__(self, store: ChunkStore, length: int, chunk: int) -> None:
        self._store, self._length, self._chunk = store, length, chunk

    def __len__(self) -> int:
        """Return the number of chunks."""
        return self._store.count

    def __iter__(self) -> Iterator[tuple[slice, LinkagePoses]]:
        """Yield the slice of the linkages, and their poses as `linkage_poses` returns them."""
        for number in range(len(self)):
            start = number * self._chunk
            yield slice(start, min(start + self._chunk, self._length)), self[number]

    def __getitem__(self, number: int) -> LinkagePoses:
        """Return the poses of a chunk."""
        arrays: dict[str, Any] = self._store.load(range(len(self))[number])
        return LinkagePoses(**arrays)


def sweep_poses(
    variants: Variants,
    alphas: ArrayLike,
    folder: str | Path,
    *,
    chunk: int = 10_000,
    engine: str = 'local',
    jobs: int | None = None,
    address: str | None = None,
    progress: Progress | None = None,
    **wanted: bool,
) -> PoseSweep:
    """
    Return the poses of many linkages of one structure at crank angles, stored in chunks on disk.

    Parameters
    ----------
    variants : Variants
        The linkages.
    alphas : array-like of real numbers
        Crank angles, of any shape [rad].
    folder : path
        For the chunks; shared by all machines of a cluster. Chunks of the same sweep are reused.
    chunk : int
        Number of linkages in a chunk.
    engine, jobs, address
        As of `klann_ros.engines.parallel_map`.
    progress : callable, optional
        Called with the number of finished chunks, and of all.
    **wanted : bool
        `angles`, `points`, `transmission_angles`, `velocities`: as of `linkage_poses`.

    Raises
    ------
    SweepError
        The folder holds another sweep or cannot be used, or a chunk cannot be computed.
    EngineError
        The engine is unavailable.
    TypeError, ValueError
        As `linkage_poses`; `chunk` is no whole number, at least 1.

    """
    chunk = validation.count('chunk', chunk, 1)
    angles = np.asarray(alphas, dtype=np.float64)
    base, options = variants.base, dict[str, Any](wanted)
    # Bad input is refused before anything is computed or written.
    linkage_poses(base, angles.ravel()[:0], **options)
    structure = [tuple(each) for each in (base.structure.angles, base.assembly, base.joint_names)]
    identity = fingerprint(
        variants.numbers, variants.signs, angles, chunk, sorted(wanted.items()), structure
    )
    starts = range(0, len(variants), chunk)
    store = ChunkStore(folder, identity, len(starts))
    items = [
        (variants.numbers[:, slice(k, k + chunk)], variants.signs[:, slice(k, k + chunk)])
        for k in starts
    ]
    work = partial(_solve_chunk, base, angles, options)
    store.fill(work, items, progress, engine=engine, jobs=jobs, address=address)
    return PoseSweep(store, len(variants), chunk)


def _solve_chunk(
    base: Linkage,
    alphas: AnyArray,
    wanted: dict[str, Any],
    part: tuple[AnyArray, AnyArray],
) -> dict[str, AnyArray]:
    numbers, signs = part
    changes = dict(zip(base.dimensions, numbers, strict=True))
    poses = linkage_poses(Variants(base, changes, assembly=signs), alphas, **wanted)
    return {**poses.arrays(), 'reason': poses.reason}


def sweep_tolerances(  # noqa: D417 - its options are described by name
    linkage: Any,
    tolerances: Mapping[str, float] | float,
    folder: str | Path,
    *,
    engine: str = 'local',
    jobs: int | None = None,
    address: str | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> ToleranceStudy:
    """
    Return a `tolerance_study`, computed some crank angles at a time and stored on disk meanwhile.

    Parameters
    ----------
    linkage, tolerances
        As of `tolerance_study`, whose result is identical to the last digit.
    folder, engine, jobs, address, progress
        As of `sweep_poses`.
    samples, crank_angles, distribution, seed
        As of `tolerance_study`; by default 1,000,000 samples.

    Raises
    ------
    SweepError, EngineError
        As `sweep_poses`.
    TypeError, ValueError
        As `tolerance_study`.

    """
    draw = tolerance_draw(linkage, tolerances, **{'samples': 1_000_000} | options)
    settings = (draw.samples, draw.distribution, draw.seed)
    own = draw.linkage
    identity = fingerprint(
        np.array(own.numbers), draw.widths, draw.alphas, *settings, own.assembly, own.joint_names
    )
    store = ChunkStore(folder, identity, len(draw.parts))
    items = [(identity, draw, part) for part in draw.parts]
    store.fill(_deviations, items, progress, engine=engine, jobs=jobs, address=address)
    return draw.study(map(store.load, range(store.count)))


# A worker draws its legs once, for all its chunks.
_cached_draw: dict[str, ToleranceDraw] = {}


def _deviations(item: tuple[str, ToleranceDraw, slice]) -> dict[str, AnyArray]:
    identity, draw, part = item
    if identity not in _cached_draw:
        _cached_draw.clear()
    return _cached_draw.setdefault(identity, draw).deviations(part)
