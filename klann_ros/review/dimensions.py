"""The numbers a leg is made from and driven by, under names that people know."""

from cmath import phase
from collections.abc import Iterator
from typing import NamedTuple

from klann_ros.kinematics import KlannLeg
from klann_ros.kinematics.linkage.description import Description

from .loading.solvers import LegSolver


class Dimension(NamedTuple):
    """A number with its unit."""

    value: float
    unit: str = ''

    def __str__(self) -> str:
        """Return it for people."""
        return f'{self.value:.9g} {self.unit}'.rstrip()


def dimensions(solver: LegSolver) -> dict[str, Dimension | str]:
    """Return all of a leg, as far as it is told."""
    leg = solver.leg
    found: dict[str, Dimension | str] = {
        'direction': Dimension(solver.direction),
        'phase': Dimension(solver.phase, 'rad'),
    }
    if isinstance(leg, KlannLeg):
        found['linkage'] = 'Klann leg'
        for name, value in leg.geometry.as_dict().items():
            unit = 'rad' if name.startswith('angle') else 'm'
            found[name] = str(value) if name == 'assembly' else Dimension(value, unit)
    elif leg is not None:
        found.update(_linkage(leg.geometry))
        found['assembly'] = str(list(leg.assembly))
    return found


def _linkage(described: Description) -> Iterator[tuple[str, Dimension | str]]:
    yield 'linkage', described.name
    yield 'foot', described.foot
    for point, place in described.pivots.items():
        yield f'x of {point}', Dimension(place.real, 'm')
        yield f'y of {point}', Dimension(place.imag, 'm')
    for body in described.bodies:
        yield f'sense of {body.angle}', Dimension(body.sense)
        for bar in body.bars:
            name = f'{bar.start}-{bar.end} of {body.angle}'
            yield name, Dimension(abs(bar.vector), 'm')
            yield f'angle of {name}', Dimension(phase(bar.vector), 'rad')
