"""The dimensions of a four-bar linkage."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

from klann_ros.kinematics import validation
from klann_ros.kinematics.errors import GeometryError
from klann_ros.kinematics.linkage.change_points import COURSES, PARALLEL
from klann_ros.kinematics.linkage.linkage import Linkage, NamedGeometry
from klann_ros.kinematics.linkage.reach import crank_limits, length_rounding
from klann_ros.kinematics.linkage.structure import Bar, Body, Dimension, Structure

LENGTHS = ('ground', 'crank', 'coupler', 'rocker')
# Units that lengths may be named in; they are not converted.
LENGTH_UNITS = ('m', 'cm', 'mm', 'in')
STRUCTURE = Structure(
    pivots=('O2', 'O4'),
    bodies=(
        Body('theta2', (Bar('O2', 'A'),), label='crank'),
        Body('theta3', (Bar('A', 'B'),), label='coupler'),
        Body('theta4', (Bar('O4', 'B'),), label='rocker'),
    ),
    foot='B',
    points=('O2', 'A', 'B', 'O4'),
    dimensions=(
        Dimension('ground', 'x', 1),
        Dimension('crank', 'length', 0),
        Dimension('coupler', 'length', 1),
        Dimension('rocker', 'length', 2),
    ),
    unit='',
)


@dataclass(frozen=True)
class FourBarGeometry(NamedGeometry):
    """
    The four lengths and the assembly of a four-bar linkage.

    The pivots are O2 = (0, 0) of the crank and O4 = (ground, 0) of the rocker; the crank ends in
    A, the rocker in B, and the coupler is AB.

    Parameters
    ----------
    ground, crank, coupler, rocker : float
        L1, L2, L3 and L4 [m], > 0.
    assembly : int
        The sign (+1 or -1) of sin(theta4 - theta3), in class III that just after theta2 = 0: at
        its change points two motions meet, and the sign changes.
    at_change_points : str
        How it goes on there: 'parallel', along the tangent, so that a parallelogram stays one;
        'crossed', along the tangent of the other motion, the antiparallelogram; or 'sign', with
        the same sign, so that the motion turns back.
    unit : str
        The unit of the lengths in texts and on axes: 'm', 'cm', 'mm' or 'in'; by default none.

    Raises
    ------
    GeometryError
        A length is not a finite number, not positive or beyond all measure, the assembly is not
        +1 or -1, `at_change_points` or `unit` none of these, or one link is as long as the other
        three together. A ValueError.

    """

    structure: ClassVar[Structure] = STRUCTURE

    ground: float
    crank: float
    coupler: float
    rocker: float
    assembly: int = 1
    at_change_points: str = PARALLEL
    unit: str = ''

    def __post_init__(self) -> None:
        for name in LENGTHS:
            object.__setattr__(self, name, validation.finite_number(name, getattr(self, name)))
        for name in LENGTHS:
            validation.check_length(name, getattr(self, name), unit='')
            validation.check_magnitude(name, getattr(self, name), unit='')
        object.__setattr__(self, 'assembly', validation.assembly_signs((self.assembly,), 1)[0])
        validation.choice('at_change_points', self.at_change_points, COURSES)
        if self.unit != '':
            validation.choice('unit', self.unit, LENGTH_UNITS)
        longest = max(self.lengths)
        sum_of_others = sum(sorted(self.lengths)[:3])
        if longest >= sum_of_others - length_rounding(self.lengths):
            name = LENGTHS[self.lengths.index(longest)]
            raise GeometryError(
                f'these lengths are refused: at no crank angle does the linkage close and move, '
                f'{name} = {longest:g} is not shorter than the others together '
                f'({sum_of_others:g})'
            )

    @property
    def lengths(self) -> tuple[float, float, float, float]:
        """Return L1 to L4: ground, crank, coupler, rocker [m]."""
        return self.ground, self.crank, self.coupler, self.rocker

    @cached_property
    def linkage(self) -> Linkage:
        """Return the four-bar as a linkage, the form that is solved."""
        return Linkage(
            replace(STRUCTURE, unit=self.unit),
            self.lengths,
            assembly=(self.assembly,),
            at_change_points=self.at_change_points,
            name='Four-bar',
        )

    def mirrored(self) -> 'FourBarGeometry':
        """Return the four-bar mirrored in its ground: every angle has the other sign."""
        first, _ = crank_limits(self.lengths)
        (sign,) = self.linkage.mirrored().assembly_at(first)
        return replace(self, assembly=sign)
