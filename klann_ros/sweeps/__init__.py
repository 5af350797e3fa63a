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

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from klann_ros.kinematics import (
    Linkage,
    linkage_poses,
    LinkagePoses,
    ToleranceStudy,
    validation,
    Variants,
)
from klann_ros.kinematics.batch.tolerance_study import tolerance_draw, ToleranceDraw
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .store import ChunkStore, fingerprint, Progress, SweepError

__all__ = ['PoseSweep', 'SweepError', 'sweep_poses', 'sweep_tolerances']


class PoseSweep:
    """
    The poses of many linkages, on disk; iteration loads one chunk at a time.

    Parameters
    ----------
    store : ChunkStore
        The chunks.
    length, chunk : int
        Number of linkages, in total and in a chunk.

    """

    def __init__(self, store: ChunkStore, length: int, chunk: int) -> None:
        """Load nothing yet."""
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
    alphas: NDArray[np.float64],
    wanted: dict[str, Any],
    part: tuple[NDArray[Any], NDArray[Any]],
) -> dict[str, NDArray[Any]]:
    numbers, signs = part
    changes = dict(zip(base.dimensions, numbers, strict=True))
    poses = linkage_poses(Variants(base, changes, assembly=signs), alphas, **wanted)
    return {**poses.arrays(), 'reason': poses.reason}


def sweep_tolerances(
    linkage: Any,
    tolerances: Mapping[str, float] | float,
    folder: str | Path,
    *,
    samples: int = 1_000_000,
    crank_angles: int = 360,
    distribution: str = 'uniform',
    seed: int = 0,
    engine: str = 'local',
    jobs: int | None = None,
    address: str | None = None,
    progress: Progress | None = None,
) -> ToleranceStudy:
    """
    Return a `tolerance_study`, computed some crank angles at a time and stored on disk meanwhile.

    Parameters
    ----------
    linkage, tolerances, samples, crank_angles, distribution, seed
        As of `tolerance_study`, whose result is identical to the last digit.
    folder, engine, jobs, address, progress
        As of `sweep_poses`.

    Raises
    ------
    SweepError, EngineError
        As `sweep_poses`.
    TypeError, ValueError
        As `tolerance_study`.

    """
    draw = tolerance_draw(
        linkage,
        tolerances,
        samples=samples,
        crank_angles=crank_angles,
        distribution=distribution,
        seed=seed,
    )
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


def _deviations(item: tuple[str, ToleranceDraw, slice]) -> dict[str, NDArray[Any]]:
    identity, draw, part = item
    if identity not in _cached_draw:
        _cached_draw.clear()
    return _cached_draw.setdefault(identity, draw).deviations(part)
