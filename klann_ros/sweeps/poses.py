"""`linkage_poses` of more linkages than fit into memory."""

from collections.abc import Iterator
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

from klann_ros.kinematics import Linkage, linkage_poses, LinkagePoses, validation, Variants
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .store import ChunkStore, fingerprint, Progress

Array = NDArray[np.float64]
_NAMES = tuple(field.name for field in fields(LinkagePoses))


class PoseSweep:
    """
    The poses of many linkages, on disk; iterating loads chunk after chunk.

    Parameters
    ----------
    store : ChunkStore
        Where they are.
    length, chunk : int
        How many linkages there are, and in a chunk.

    """

    def __init__(self, store: ChunkStore, length: int, chunk: int) -> None:
        """Load nothing yet."""
        self._store, self._length, self._chunk = store, length, chunk

    def __len__(self) -> int:
        """Return how many chunks there are."""
        return self._store.count

    def __iter__(self) -> Iterator[tuple[slice, LinkagePoses]]:
        """Yield which linkages, and their poses, as `linkage_poses` gives them."""
        for number in range(len(self)):
            begin = number * self._chunk
            yield slice(begin, min(begin + self._chunk, self._length)), self[number]

    def __getitem__(self, number: int) -> LinkagePoses:
        """Return the poses of a chunk."""
        arrays = self._store.load(range(len(self))[number])
        found: dict[str, Any] = {name: arrays.get(name) for name in _NAMES}
        return LinkagePoses(**found)


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
    Return the poses of many linkages of one structure at crank angles, kept on disk in chunks.

    Parameters
    ----------
    variants : Variants
        The linkages.
    alphas : array-like of real numbers
        Crank angles, of any shape [rad].
    folder : path
        Where the chunks are; by an engine of several machines all of them see it. What is there of
        the same sweep is not computed again.
    chunk : int
        How many linkages are solved at once.
    engine, jobs, address
        Who works on it: see `klann_ros.engines.mapped`.
    progress : callable, optional
        Is called with how many chunks are done, and how many there are.
    **wanted : bool
        `angles`, `points`, `transmission_angles`, `velocities`: as of `linkage_poses`.

    Raises
    ------
    SweepError
        The folder holds another sweep or cannot be used, or a chunk cannot be computed.
    EngineError
        The engine cannot be had.
    TypeError, ValueError
        As `linkage_poses`; `chunk` is no whole number, at least 1.

    """
    chunk = validation.count('chunk', chunk, 1)
    angles = np.asarray(alphas, dtype=np.float64)
    # What is refused is refused before anything is computed, or left in a folder.
    options: dict[str, Any] = wanted
    linkage_poses(variants.base, angles.ravel()[:0], **options)
    base = variants.base
    signs = [tuple(each) for each in (base.structure.angles, base.assembly, base.joint_names)]
    identity = fingerprint(
        variants.numbers, variants.signs, angles, chunk, sorted(wanted.items()), signs
    )
    begins = range(0, len(variants), chunk)
    store = ChunkStore(folder, identity, len(begins))
    items = [
        (variants.numbers[:, slice(b, b + chunk)], variants.signs[:, slice(b, b + chunk)])
        for b in begins
    ]
    work = partial(_solved, base, angles, options)
    store.fill(work, items, progress, engine=engine, jobs=jobs, address=address)
    return PoseSweep(store, len(variants), chunk)


def _solved(
    base: Linkage, alphas: Array, wanted: dict[str, Any], part: tuple[Array, Array]
) -> dict[str, NDArray[Any]]:
    numbers, signs = part
    changes = dict(zip(base.dimensions, numbers, strict=True))
    poses = linkage_poses(Variants(base, changes, assembly=signs), alphas, **wanted)
    found = {name: getattr(poses, name) for name in _NAMES}
    return {name: array for name, array in found.items() if isinstance(array, np.ndarray)}
