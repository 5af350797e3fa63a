"""Compare two runs: dimensions of the legs, and motion at equal crank angles."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf, isfinite
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
        """Return it for people."""
        return f'{self.value:.9g} {self.unit}'.rstrip()


def leg_dimensions(solver: LegSolver) -> dict[str, Quantity | str]:
    """Return all known dimensions of a leg."""
    leg = solver.leg
    found: dict[str, Quantity | str] = {
        'direction': Quantity(solver.direction),
        'phase': Quantity(solver.phase, 'rad'),
    }
    if leg is not None:
        linkage = leg.linkage
        found |= {'linkage': linkage.name, 'foot': linkage.structure.foot}
        for body in linkage.structure.bodies:
            found[f'sense of {body.angle}'] = Quantity(body.sense)
        for dimension, number in zip(linkage.structure.dimensions, linkage.numbers, strict=True):
            found[dimension.name] = Quantity(number, dimension.unit)
        found['assembly'] = str(list(leg.assembly))
    return found


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
    ones, others = (
        {leg.recording.title: leg for leg in review.legs} for review in (first, second)
    )
    pairs_ = [(ones[title], others[title]) for title in ones if title in others]
    return Comparison(
        (first.recording.path, second.recording.path),
        (
            *_unmatched_legs(ones, others),
            *(found for pair in pairs_ for found in _differences(first.limits, *pair)),
        ),
        tuple(remark for pair in pairs_ for remark in _remarks(*pair)),
    )


def _unmatched_legs(
    ones: Mapping[str, ReviewedLeg], others: Mapping[str, ReviewedLeg]
) -> Iterator[Difference]:
    for which, own, foreign in (('first', ones, others), ('second', others, ones)):
        for title in (title for title in own if title not in foreign):
            text = f'the leg {printable(title) or "without a name"} is in the {which} run only'
            yield Difference('legs', text, inf, '', title)


def _differences(limits: Limits, one: ReviewedLeg, other: ReviewedLeg) -> Iterator[Difference]:
    # An unknown leg does not differ.
    if one.recording.solver.leg and other.recording.solver.leg:
        yield from _dimensions(limits, one, other)
    yield from _motion(limits, one, other)


def _dimensions(limits: Limits, one: ReviewedLeg, other: ReviewedLeg) -> Iterator[Difference]:
    title = one.recording.title
    before, after = leg_dimensions(one.recording.solver), leg_dimensions(other.recording.solver)
    if before.keys() != after.keys():
        kinds = f'{before["linkage"]} in the first run, {after["linkage"]} in the second'
        yield Difference('linkage', f'the linkages differ: {kinds}', inf, '', title)
        return
    for name, a in before.items():
        b = after[name]
        text = f'{name} is {a} in the first run, {b} in the second'
        if not (isinstance(a, Quantity) and isinstance(b, Quantity)):
            if a != b:
                yield Difference(name, text, inf, '', title)
        elif abs(b.value - a.value) > limits.compare_length:
            by = b.value - a.value
            share = f', {by / a.value:+.3%}' if a.value else ''
            yield Difference(name, text + share, by, a.unit, title)


def _remarks(one: ReviewedLeg, other: ReviewedLeg) -> Iterator[str]:
    """Yield the parts of a leg that could not be compared."""
    of = f'{printable(one.recording.title)}: ' if one.recording.title else ''
    both = (('first', one), ('second', other))
    unknown = [which for which, leg in both if leg.recording.solver.leg is None]
    if len(unknown) == 2:
        yield f'{of}neither run contains the geometry: motion not compared (--geometry FILE)'
    elif unknown:
        yield f'{of}the {unknown[0]} run does not contain its geometry: lengths not compared'


def _motion(limits: Limits, one: ReviewedLeg, other: ReviewedLeg) -> Iterator[Difference]:
    """Yield the distance of the motion in one run from the leg of the other."""
    leg, moved, title = one.recording.solver.leg, other, one.recording.title
    if leg is None:
        leg, moved = other.recording.solver.leg, one
    if leg is None or moved.evaluated.poses.values.shape[1] != len(leg.joint_names):
        return
    angle, path = _distances(moved, leg, limits)
    if angle > limits.compare_angle:
        text = f'the angles differ by up to {angle:.3g} rad at the same crank angle'
        yield Difference('angles', text, angle, 'rad', title)
    if path > limits.compare_path:
        text = f'the feet are up to {path:.3g} m apart at the same crank angle'
        yield Difference('path', text, path, 'm', title)


def _distances(moved: ReviewedLeg, leg: AnyLeg, limits: Limits) -> tuple[float, float]:
    """
    Return the largest differences of a run from a leg: angles [rad], feet [m].

    Poses that are wrong by the geometry of their own run are findings, not differences.
    """
    run, errors = moved.evaluated, moved.errors
    sound, right = np.ones(len(run.poses), dtype=bool), np.ones(len(run.feet), dtype=bool)
    if errors is not None:
        sound = errors.angle_errors <= limits.compare_angle
        right = errors.foot_errors <= limits.compare_path
    worst_angle = worst_foot = 0.0
    for block in solve_blocks(run, leg):
        sound_here = sound[block.rows]
        worst_angle = max(worst_angle, _worst(block.angle_errors(leg)[sound_here]))
        both = right[block.of_feet] & sound_here[block.of_poses]
        h = feet(leg, block.solved[block.of_poses[both]])
        with np.errstate(over='ignore'):
            distances = np.hypot(*(run.feet.values[block.of_feet[both]] - h).T)
        worst_foot = max(worst_foot, _worst(distances))
    return worst_angle, worst_foot


def _worst(values: FloatArray) -> float:
    worst = float(np.fmax.reduce(values, axis=None, initial=0.0))
    return worst if isfinite(worst) else inf
