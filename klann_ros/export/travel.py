"""How far bodies slide, over all that the crank can reach."""

from functools import lru_cache

from klann_ros.kinematics import Linkage, linkage_poses, reachable_arcs
import numpy as np
from numpy.typing import NDArray

# So fine the end of a stroke is missed by less than 2e-6 of the stroke.
SAMPLES = 1441


class ExportError(ValueError):
    """A robot that cannot be written so; the text says why."""


def travel(linkage: Linkage) -> dict[int, tuple[float, float]]:
    """
    Return of each body that slides its least and its greatest distance [m].

    Raises
    ------
    ExportError
        The crank reaches no angle.

    """
    structure = linkage.structure
    if not structure.slides:
        return {}
    x = linkage_poses(linkage, crank_angles(linkage, SAMPLES), angles=True).angles
    if x is None or not np.isfinite(x).any():
        raise ExportError('the crank reaches no angle: nothing slides anywhere')
    sliding = [j for j, body in enumerate(structure.bodies) if body.slides]
    return {j: (float(np.nanmin(x[:, j - 1])), float(np.nanmax(x[:, j - 1]))) for j in sliding}


def crank_angles(linkage: Linkage, count: int) -> NDArray[np.float64]:
    """Return crank angles, so many in each arc that can be reached [rad]."""
    return np.concatenate([np.empty(0), *(np.linspace(*arc, count) for arc in _arcs(linkage))])


# Where something slides the search takes some tenths of a second.
@lru_cache(maxsize=32)
def _arcs(linkage: Linkage) -> tuple[tuple[float, float], ...]:
    return tuple(reachable_arcs(linkage))
