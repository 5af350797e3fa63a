"""Compare two runs: dimensions of the legs, and motion at equal crank angles."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import degrees, inf, isfinite
from typing import NamedTuple

from klann_ros.kinematics import AnyLeg, feet
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.sanitize.text import printable
import numpy as np

from .limits import Limits
from .poses import solve_blocks
from .recording import LegSolver
from .review import Review, ReviewedLeg


class Quantity(NamedTuple):
    """A number with its unit."""

    value: float
    unit: str = ''

    def __str__(self) -> str:
        """Return the number and its unit for people."""
        return f'{self.value:.9g} {self.unit}'.rstrip()


def leg_dimensions(solver: LegSolver) -> dict[str, Quantity | str]:
    """Return all known dimensions of a leg."""
    leg = solver.leg
    dimensions: dict[str, Quantity | str] = {
        'direction': Quantity(solver.direction),
        'phase': Quantity(solver.phase, 'rad'),
    }
    if leg is not None:
        linkage = leg.linkage
        dimensions['linkage'] = linkage.name
        dimensions['foot'] = linkage.structure.foot
        for body in linkage.structure.bodies:
            dimensions[f'sense of {body.angle}'] = Quantity(body.sense)
        for dimension, number in zip(linkage.structure.dimensions, linkage.numbers, strict=True):
            dimensions[dimension.name] = Quantity(number, dimension.unit)
        dimensions['assembly'] = str(list(leg.assembly))
    return dimensions


@dataclass(frozen=True)
class Difference:
    """A difference of two runs above the limit."""

    what: str  #: the differing quantity
    text: str  #: description
    size: float  #: second minus first where it has a sign; infinite without a number
    unit: str  #: of the size
    leg: str = ''  #: the leg; '' for the only one, or the whole run


@dataclass(frozen=True)
class Comparison:
    """Two runs side by side."""

    paths: tuple[str, str]  #: paths of the runs
    differences: tuple[Difference, ...]  #: none for a run and itself
    remarks: tuple[str, ...] = ()  #: parts that could not be compared, with the reason

    @property
    def alike(self) -> str:
        """Return the text for no difference."""
        as_far = ', as far as they can be compared' if self.remarks else ''
        return f'the two runs do not differ{as_far}'


def compare(first: Review, second: Review) -> Comparison:
    """Compare the dimensions of legs, and their motion at equal crank angles."""
    first_legs = {leg.recording.title: leg for leg in first.legs}
    second_legs = {leg.recording.title: leg for leg in second.legs}
    differences = [*_unmatched_legs(first_legs, second_legs)]
    remarks: list[str] = []
    for title, first_leg in first_legs.items():
        if title in second_legs:
            second_leg = second_legs[title]
            # An unknown leg does not differ.
            if first_leg.recording.solver.leg and second_leg.recording.solver.leg:
                differences += _dimensions(first.limits, first_leg, second_leg)
            differences += _motion(first.limits, first_leg, second_leg)
            remarks += _remarks(first_leg, second_leg)
    if not (first_legs or second_legs):
        remarks.append('neither run contains a leg: no motion compared')
    if first.walks or second.walks:
        remarks.append('walks are not compared')
    paths = (first.recording.path, second.recording.path)
    return Comparison(paths, tuple(differences), tuple(remarks))


def _unmatched_legs(
    first_legs: Mapping[str, ReviewedLeg], second_legs: Mapping[str, ReviewedLeg]
) -> Iterator[Difference]:
    for run, legs, other_legs in (
        ('first', first_legs, second_legs),
        ('second', second_legs, first_legs),
    ):
        for title in legs:
            if title not in other_legs:
                name = printable(title) or 'without a name'
                text = f'the leg {name} is in the {run} run only'
                yield Difference('legs', text, inf, '', title)


def _dimensions(limits: Limits, first: ReviewedLeg, second: ReviewedLeg) -> Iterator[Difference]:
    """Yield the dimensions of a leg that differ in two runs."""
    title = first.recording.title
    first_dimensions = leg_dimensions(first.recording.solver)
    second_dimensions = leg_dimensions(second.recording.solver)
    if first_dimensions.keys() != second_dimensions.keys():
        linkages = first_dimensions['linkage'], second_dimensions['linkage']
        kinds = f'{linkages[0]} in the first run, {linkages[1]} in the second'
        yield Difference('linkage', f'the linkages differ: {kinds}', inf, '', title)
        return
    for name, a in first_dimensions.items():
        b = second_dimensions[name]
        text = f'{name} is {a} in the first run, {b} in the second'
        if not (isinstance(a, Quantity) and isinstance(b, Quantity)):
            if a != b:
                yield Difference(name, text, inf, '', title)
        elif abs(b.value - a.value) > limits.compare_length:
            change = b.value - a.value
            share = f', {change / a.value:+.3%}' if a.value else ''
            yield Difference(name, text + share, change, a.unit, title)


def _remarks(first: ReviewedLeg, second: ReviewedLeg) -> Iterator[str]:
    """Yield the parts of a leg that could not be compared."""
    title = first.recording.title
    prefix = f'{printable(title)}: ' if title else ''
    is_first_unknown = first.recording.solver.leg is None
    is_second_unknown = second.recording.solver.leg is None
    if is_first_unknown and is_second_unknown:
        yield f'{prefix}neither run contains the geometry: motion not compared (--geometry FILE)'
    elif is_first_unknown or is_second_unknown:
        run = 'first' if is_first_unknown else 'second'
        yield f'{prefix}the {run} run does not contain its geometry: lengths not compared'


def _motion(limits: Limits, first: ReviewedLeg, second: ReviewedLeg) -> Iterator[Difference]:
    """Yield the distance of the motion in one run from the leg of the other."""
    title = first.recording.title
    leg = first.recording.solver.leg
    moving = second
    if leg is None:
        leg = second.recording.solver.leg
        moving = first
    if leg is None or moving.evaluated.poses.values.shape[1] != len(leg.joint_names):
        return
    angle, path = _distances(moving, leg, limits)
    if angle > limits.compare_angle:
        text = f'the angles differ by up to {degrees(angle):.3g} deg at the same crank angle'
        yield Difference('angles', text, angle, 'rad', title)
    if path > limits.compare_path:
        text = f'the feet are up to {1e3 * path:.3g} mm apart at the same crank angle'
        yield Difference('path', text, path, 'm', title)


def _distances(moving: ReviewedLeg, leg: AnyLeg, limits: Limits) -> tuple[float, float]:
    """
    Return the largest differences of a run from a leg: angles [rad], feet [m].

    Poses that are wrong by the geometry of their own run are findings, not differences.
    """
    run = moving.evaluated
    errors = moving.errors
    are_poses_right = np.ones(len(run.poses), dtype=bool)
    are_feet_right = np.ones(len(run.feet), dtype=bool)
    if errors is not None:
        are_poses_right = errors.angle_errors <= limits.compare_angle
        are_feet_right = errors.foot_errors <= limits.compare_path
    worst_angle = worst_foot = 0.0
    for block in solve_blocks(run, leg):
        is_right = are_poses_right[block.rows]
        worst_angle = max(worst_angle, _worst(block.angle_errors(leg)[is_right]))
        are_both_right = are_feet_right[block.of_feet] & is_right[block.of_poses]
        h = feet(leg, block.solved[block.of_poses[are_both_right]])
        with np.errstate(over='ignore'):
            distances = np.hypot(*(run.feet.values[block.of_feet[are_both_right]] - h).T)
        worst_foot = max(worst_foot, _worst(distances))
    return worst_angle, worst_foot


def _worst(errors: FloatArray) -> float:
    worst = float(np.fmax.reduce(errors, axis=None, initial=0.0))
    return worst if isfinite(worst) else inf
