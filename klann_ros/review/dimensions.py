"""The numbers a leg is made from and driven by, under names that people know."""

from typing import NamedTuple

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
    if leg is not None:
        linkage = leg.linkage
        found |= {'linkage': linkage.name, 'foot': linkage.structure.foot}
        for body in linkage.structure.bodies:
            found[f'sense of {body.angle}'] = Dimension(body.sense)
        for dimension, number in zip(linkage.structure.dimensions, linkage.numbers, strict=True):
            found[dimension.name] = Dimension(number, dimension.unit)
        found['assembly'] = str(list(leg.assembly))
    return found
