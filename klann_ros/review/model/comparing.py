"""Two runs side by side: what differs, and by how much."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple

from klann_ros.kinematics import AnyLeg
from klann_ros.kinematics.batch.given_angles import feet
from klann_ros.sanitize.text import printable
import numpy as np

from .limits import Limits
from .pose_errors import solved_blocks
from .recording import LegSolver
from .review import Review, ReviewedLeg
from .times import Floats


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


@dataclass(frozen=True)
class Difference:
    """
    Something in which two runs differ by more than the limit.

    Attributes
    ----------
    what : str
        What differs.
    text : str
        How, in words.
    size : float
        By how much, second minus first where it has a sign; infinite where there is no number.
    unit : str
        Of the size.
    leg : str
        Of which leg; '' for the only one, or the run as a whole.

    """

    what: str
    text: str
    size: float
    unit: str
    leg: str = ''


@dataclass(frozen=True)
class Comparison:
    """
    Two runs side by side.

    Attributes
    ----------
    paths : tuple of str
        Where the runs are.
    differences : tuple of Difference
        What differs; nothing for a run and itself.
    remarks : tuple of str
        What could not be compared, and why.

    """

    paths: tuple[str, str]
    differences: tuple[Difference, ...]
    remarks: tuple[str, ...] = ()

    @property
    def alike(self) -> str:
        """Return what it means that there is no difference: no more than could be compared."""
        as_far = ', as far as they can be compared' if self.remarks else ''
        return f'the two runs do not differ{as_far}'


def compare(first: Review, second: Review) -> Comparison:
    """Return in what two runs differ: their legs' dimensions, and their motion at equal cranks."""
    ones, others = (
        {leg.recording.title: leg for leg in review.legs} for review in (first, second)
    )
    pairs_ = [(ones[title], others[title]) for title in ones if title in others]
    return Comparison(
        (first.recording.path, second.recording.path),
        (
            *_lonely(ones, others),
            *(found for pair in pairs_ for found in _differences(first.limits, *pair)),
        ),
        tuple(remark for pair in pairs_ for remark in _remarks(*pair)),
    )


def _lonely(
    ones: Mapping[str, ReviewedLeg], others: Mapping[str, ReviewedLeg]
) -> Iterator[Difference]:
    """Yield the legs that are in one run only."""
    for which, own, foreign in (('first', ones, others), ('second', others, ones)):
        for title in own:
            if title not in foreign:
                text = f'the leg {printable(title) or "without a name"} is in the {which} run only'
                yield Difference('legs', text, inf, '', title)


def _differences(limits: Limits, one: ReviewedLeg, other: ReviewedLeg) -> Iterator[Difference]:
    # A leg that is not told is no other leg.
    if one.recording.solver.leg and other.recording.solver.leg:
        yield from _dimensions(limits, one, other)
    yield from _motion(limits, one, other)


def _dimensions(limits: Limits, one: ReviewedLeg, other: ReviewedLeg) -> Iterator[Difference]:
    title = one.recording.title
    before, after = dimensions(one.recording.solver), dimensions(other.recording.solver)
    if before.keys() != after.keys():
        kinds = f'{before["linkage"]} in the first run, {after["linkage"]} in the second'
        yield Difference('linkage', f'the leg has other bars: {kinds}', inf, '', title)
        return
    for name, a in before.items():
        b = after[name]
        text = f'{name} is {a} in the first run, {b} in the second'
        if not (isinstance(a, Dimension) and isinstance(b, Dimension)):
            if a != b:
                yield Difference(name, text, inf, '', title)
        elif abs(b.value - a.value) > limits.compare_length:
            by = b.value - a.value
            share = f', {by / a.value:+.3%}' if a.value else ''
            yield Difference(name, text + share, by, a.unit, title)


def _remarks(one: ReviewedLeg, other: ReviewedLeg) -> Iterator[str]:
    """Yield what of a leg could not be compared."""
    of = f'{printable(one.recording.title)}: ' if one.recording.title else ''
    untold = [
        which
        for which, leg in (('first', one), ('second', other))
        if leg.recording.solver.leg is None
    ]
    if len(untold) == 2:
        yield f'{of}neither run tells the geometry, so no motion was compared (--geometry FILE)'
    elif untold:
        yield f'{of}the {untold[0]} run does not tell its geometry, so no lengths were compared'


def _motion(limits: Limits, one: ReviewedLeg, other: ReviewedLeg) -> Iterator[Difference]:
    """Yield how far the motion of one run is from what the leg of the other does at its cranks."""
    leg, title = one.recording.solver.leg, one.recording.title
    moved = other
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

    What is wrong by the run's own geometry is a finding in that run, and no difference.
    """
    run, errors = moved.evaluated, moved.errors
    sound, right = np.ones(len(run.poses), dtype=bool), np.ones(len(run.feet), dtype=bool)
    if errors is not None:
        sound = errors.angle_errors <= limits.compare_angle
        right = errors.foot_errors <= limits.compare_path
    worst_angle = worst_foot = 0.0
    for block in solved_blocks(run, leg):
        sound_here = sound[block.rows]
        worst_angle = max(worst_angle, _worst(block.angle_errors(leg)[sound_here]))
        both = right[block.of_feet] & sound_here[block.of_poses]
        h = feet(leg, block.solved[block.of_poses[both]])
        with np.errstate(over='ignore'):
            distances = np.hypot(*(run.feet.values[block.of_feet[both]] - h).T)
        worst_foot = max(worst_foot, _worst(distances))
    return worst_angle, worst_foot


def _worst(values: Floats) -> float:
    worst = float(np.fmax.reduce(values, axis=None, initial=0.0))
    return worst if isfinite(worst) else inf
