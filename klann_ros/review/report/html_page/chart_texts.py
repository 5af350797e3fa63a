"""What each chart of a leg shows, in a sentence: for those who cannot see it, or have no time."""

from collections.abc import Iterable, Iterator
from math import degrees, isnan

from klann_ros.review.loading.layouts import Floats
from klann_ros.review.reviewed import ReviewedLeg
from klann_ros.untrusted.text import printable
import numpy as np
from numpy.typing import NDArray


def chart_texts(leg: ReviewedLeg) -> dict[str, str]:
    """Return a sentence for each chart."""
    recording, figures = leg.recording, leg.figures
    names, slides = recording.solver.joint_names, np.array(recording.solver.slides)
    poses = recording.poses.values.T
    turning, sliding = (
        [name for name, one in zip(names, slides, strict=True) if one == kind]
        for kind in (False, True)
    )
    texts = {
        'path': f'The recorded foot covers {_metres(np.ptp(recording.feet.values, axis=0))}'
        if len(recording.feet)
        else 'No foot is recorded',
        'angles': _ranges(turning[1:], np.degrees(poses[~slides][1:]), 'deg'),
        'distances': _ranges(sliding, poses[slides], 'm'),
        'rates': _ranges(turning, _of(recording.rates.T, ~slides), 'rad/s'),
        'speeds': _ranges(sliding, _of(recording.rates.T, slides), 'm/s'),
        'iterations': _iterations(recording.iterations.values),
    }
    if leg.resolved is not None and not isnan(figures.worst_transmission_angle):
        mu = degrees(figures.worst_transmission_angle)
        texts['residuals'] = f'The worst residual is {figures.worst_residual:.1e} m'
        texts['transmission'] = (
            f'The worst is {mu:.1f} deg from in line; solver_node warns below 20 deg by default'
        )
    return {name: f'{text}.' for name, text in texts.items()}


def _of(rates: Floats, which: NDArray[np.bool_]) -> Floats:
    """Return the rates of some joints; none where none are recorded."""
    return rates[which] if len(rates) else rates


def _iterations(most: Floats) -> str:
    known = most[np.isfinite(most)]
    return f'The solver reports {known.max():.0f} at most' if known.size else 'Nothing is recorded'


def _metres(size: Floats) -> str:
    return f'{size[0]:.4f} m in x and {size[1]:.4f} m in y'


def _ranges(names: Iterable[str], rows: Iterable[Floats], unit: str) -> str:
    found = list(_found(names, rows, unit))
    return '; '.join(found) if found else 'Nothing is recorded'


def _found(names: Iterable[str], rows: Iterable[Floats], unit: str) -> Iterator[str]:
    for name, values in zip(names, rows, strict=False):
        known = values[np.isfinite(values)]
        if known.size:
            yield f'{printable(name)} from {known.min():.4g} to {known.max():.4g} {unit}'
