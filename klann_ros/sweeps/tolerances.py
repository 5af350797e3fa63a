"""`tolerance_study` of millions of legs."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from klann_ros.kinematics import Linkage, ToleranceStudy
from klann_ros.kinematics.batch.tolerance_study import tolerance_draw, ToleranceDraw
import numpy as np
from numpy.typing import NDArray

from .store import ChunkStore, fingerprint, Progress


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
    Return a `tolerance_study`, computed some crank angles at a time and kept on disk until then.

    Parameters
    ----------
    linkage, tolerances, samples, crank_angles, distribution, seed
        As of `tolerance_study`, whose result it is to the last digit.
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
    told = (draw.samples, draw.distribution, draw.seed, draw.linkage.assembly)
    numbers = np.array(draw.linkage.numbers)
    identity = fingerprint(numbers, draw.widths, draw.alphas, *told, draw.linkage.joint_names)
    store = ChunkStore(folder, identity, len(draw.parts))
    legs = (draw.linkage, draw.widths.tobytes(), *told[:3], draw.alphas.tobytes())
    items = [(legs, part.start, part.stop) for part in draw.parts]
    store.fill(_deviations, items, progress, engine=engine, jobs=jobs, address=address)
    return draw.study(map(store.load, range(store.count)))


def _deviations(item: tuple[Any, int, int]) -> dict[str, NDArray[Any]]:
    legs, start, stop = item
    return _draw(legs).deviations(slice(start, stop))


# A worker draws its legs once, for all its parts.
@lru_cache(maxsize=1)
def _draw(legs: tuple[Linkage, bytes, int, str, int, bytes]) -> ToleranceDraw:
    linkage, widths, samples, distribution, seed, alphas = legs
    half_widths, angles = (np.frombuffer(each, dtype=np.float64) for each in (widths, alphas))
    return ToleranceDraw(linkage, half_widths, samples, distribution, seed, angles)
