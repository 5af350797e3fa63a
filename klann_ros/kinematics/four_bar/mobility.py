"""The mobility of a four-bar: Grashof's law, dead points and the limits of its rocker."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, copysign, cos, nan, pi, sin
from operator import attrgetter
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN, wrap
from klann_ros.kinematics.linkage.reach import crank_limits, length_rounding, Lengths

from .geometry import FourBarGeometry

FIXED, ROTATES, OSCILLATES = 'fixed', 'rotates', 'oscillates'


class Roles(NamedTuple):
    """
    The role of each link: 'fixed', 'rotates' or 'oscillates'.

    A link rotates if there is a motion of the linkage in which it turns fully against the fixed
    one. That includes motions through the change points of class III, where the sign changes: so
    the rocker of `FourBar(2, 1, 2, 1)` rotates. With `at_change_points='sign'` the motion turns
    back there.
    """

    ground: str
    crank: str
    coupler: str
    rocker: str


@dataclass(frozen=True)
class Grashof:
    """
    The class of a four-bar linkage by Grashof's law, s + l against p + q.

    s and l are the shortest and the longest link, p and q the other two.

    Parameters
    ----------
    lengths : tuple of float
        L1 to L4: ground, crank, coupler, rocker [m].
    fixed : str
        The fixed link: 'ground', or another one for an inversion.

    References
    ----------
    "Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples, "Lei de Grashof".

    """

    lengths: Lengths
    fixed: str = 'ground'

    def __str__(self) -> str:
        roles = ', '.join(f'{name} {role}' for name, role in self.roles._asdict().items())
        return f'class {self.class_}, {self.type_}: {roles}'

    @property
    def margin(self) -> float:
        """Return p + q - s - l [m]: > 0 in class I, < 0 in class II, rounding in class III."""
        s, p, q, l = sorted(self.lengths)  # noqa: E741 - the law's own letters
        # The differences of neighbours are exact where the law is close.
        return (p - s) - (l - q)

    @property
    def class_(self) -> str:
        """Return 'I' (s + l < p + q), 'II' (>) or 'III' (equal, but for rounding)."""
        margin = self.margin
        if abs(margin) <= length_rounding(self.lengths):
            return 'III'
        return 'I' if margin > 0.0 else 'II'

    @property
    def roles(self) -> Roles:
        """
        Return the role of each link by its name.

        In classes I and III two links turn fully against each other if one of them is a shortest
        one, and oscillate otherwise; in class II all oscillate.
        """
        shortest = min(self.lengths) + length_rounding(self.lengths)
        short = [length <= shortest for length in self.lengths]
        fixed = Roles._fields.index(self.fixed)
        if self.class_ == 'II':
            roles = [OSCILLATES] * 4
        else:
            roles = [ROTATES if short[fixed] or is_short else OSCILLATES for is_short in short]
        roles[fixed] = FIXED
        return Roles(*roles)

    @property
    def shape(self) -> str:
        """
        Return the special shape of a linkage of class III, '' in the other classes.

        'rhombus' (all equal), 'parallelogram' (opposite links equal; the antiparallelogram is its
        other assembly), 'kite' (neighbours equal: the deltoid), or 'change-point'.
        """
        if self.class_ != 'III':
            return ''
        tolerance = length_rounding(self.lengths)
        l_1, l_2, l_3, l_4 = self.lengths
        if max(self.lengths) - min(self.lengths) <= tolerance:
            return 'rhombus'
        if abs(l_1 - l_3) <= tolerance and abs(l_2 - l_4) <= tolerance:
            return 'parallelogram'
        if abs(l_1 - l_2) <= tolerance and abs(l_3 - l_4) <= tolerance:
            return 'kite'
        if abs(l_2 - l_3) <= tolerance and abs(l_4 - l_1) <= tolerance:
            return 'kite'
        return 'change-point'

    @property
    def motion(self) -> str:
        """
        Return the motion of the fixed link's two neighbours.

        'crank-rocker', 'rocker-crank', 'double crank', 'double rocker' (only the coupler turns),
        or 'triple rocker' (nothing does). Of an inversion, the next link in the order ground,
        crank, coupler, rocker plays the crank.
        """
        if self.class_ == 'II':
            return 'triple rocker'
        fixed = Roles._fields.index(self.fixed)
        crank_turns = self.roles[(fixed + 1) % 4] == ROTATES
        rocker_turns = self.roles[(fixed + 3) % 4] == ROTATES
        return {
            (True, True): 'double crank',
            (True, False): 'crank-rocker',
            (False, True): 'rocker-crank',
            (False, False): 'double rocker',
        }[crank_turns, rocker_turns]

    @property
    def type_(self) -> str:
        """Return shape and motion in one, such as 'crank-rocker' or 'kite double crank'."""
        return f'{self.shape} {self.motion}'.strip()

    @property
    def inversions(self) -> 'dict[str, Grashof]':
        """Return the same with each of the four links fixed, by its name."""
        return {name: Grashof(self.lengths, name) for name in Roles._fields}


STRETCHED, FOLDED = 'stretched', 'folded'


class DeadPoint(NamedTuple):
    """
    A dead point: the driver stops where the two other moving links are in line.

    The `driver` is 'crank' (coupler and rocker are in line) or 'rocker' (crank and coupler are),
    and `angle` its theta2 or theta4 [rad]. The `kind` is 'stretched' or 'folded': how the two are
    in line. `theta2`, `theta3` and `theta4` are the pose, each in (-pi, pi] [rad].
    """

    driver: str
    angle: float
    kind: str
    theta2: float
    theta3: float
    theta4: float


class RockerLimits(NamedTuple):
    """
    The limit positions of the rocker, where crank and coupler are in line.

    `stretched` and `folded` are DeadPoints of this assembly; None where there is no such limit.
    `swing` is the rocker's angle between its limits, 2 pi for one that turns fully [rad]; with
    only one kind of limit it swings through to the mirrored one, which the other assembly has.
    `time_ratio` is the time of the slow stroke over the time of the quick one, >= 1, for a
    crank-rocker whose crank turns evenly; NaN for any other linkage.
    """

    stretched: DeadPoint | None
    folded: DeadPoint | None
    swing: float
    time_ratio: float


def dead_points(geometry: FourBarGeometry, driver: str) -> list[DeadPoint]:
    """Return the dead points of a driver, by its angle; see `FourBar.dead_points`."""
    if driver not in ('crank', 'rocker', 'both'):
        raise ValueError(f"driver = {driver!r} is refused: it must be 'crank', 'rocker' or 'both'")
    of_crank = [] if driver == 'rocker' else [*_crank_dead_points(geometry.lengths)]
    of_rocker = [] if driver == 'crank' else [*_rocker_dead_points(geometry)]
    if driver == 'both':
        of_rocker += _rocker_dead_points(geometry.mirrored())
    by_angle = attrgetter('angle')
    return [*sorted(of_crank, key=by_angle), *sorted(of_rocker, key=by_angle)]


def rocker_limits(geometry: FourBarGeometry, motion: str) -> RockerLimits:
    """Return the limits of the rocker; only a motion of 'crank-rocker' has a time ratio."""
    points = {point.kind: point for point in _rocker_dead_points(geometry)}
    stretched = points.get(STRETCHED)
    folded = points.get(FOLDED)
    first, last = crank_limits(_reversed_lengths(geometry))
    # Within first .. last on one side of the ground, or through it where there is no limit.
    swing = (last - first) if first > 0.0 and last < pi else 2.0 * (last - first)
    ratio = nan
    if motion == 'crank-rocker' and stretched and folded:
        quick = abs(wrap(stretched.theta2 - folded.theta2))
        ratio = (TURN - quick) / quick
    return RockerLimits(stretched, folded, swing, ratio)


def _crank_dead_points(lengths: Lengths) -> Iterator[DeadPoint]:
    """Yield the dead points of the crank: two for each kind, one on each side of the ground."""
    first, last = crank_limits(lengths)
    limits = [(first, FOLDED)] if first > 0.0 else []
    if last < pi:
        limits.append((last, STRETCHED))
    for angle, kind in limits:
        for theta2 in (-angle, angle):
            theta3, theta4 = _angles_in_line(lengths, theta2, kind)
            yield DeadPoint('crank', theta2, kind, theta2, wrap(theta3), wrap(theta4))


def _rocker_dead_points(geometry: FourBarGeometry) -> Iterator[DeadPoint]:
    """Yield the dead points of the rocker in this assembly, at most one for each kind."""
    linkage = geometry.linkage
    for point in _crank_dead_points(_reversed_lengths(geometry)):
        theta2 = copysign(pi - abs(point.theta4), point.theta4)
        theta3 = wrap(-point.theta3)
        theta4 = copysign(pi - abs(point.theta2), point.theta2)
        # Each assembly has one of the two sides of the ground; through change points both.
        turns = range(linkage.change_points.period)
        signs = {linkage.signs(theta2 + turn * TURN) for turn in turns}
        if any(sin(theta4 - theta3) * sign > 0.0 for (sign,) in signs):
            yield DeadPoint('rocker', theta4, point.kind, theta2, theta3, theta4)


def _angles_in_line(lengths: Lengths, theta2: float, kind: str) -> tuple[float, float]:
    """Return theta3 and theta4 where coupler and rocker are stretched out or folded [rad]."""
    ground, crank, coupler, rocker = lengths
    x = crank * cos(theta2)
    y = crank * sin(theta2)
    from_a_to_o4 = atan2(-y, ground - x)
    from_o4_to_a = atan2(y, x - ground)
    if kind == STRETCHED:
        return from_a_to_o4, from_o4_to_a
    folded = from_a_to_o4 if coupler > rocker else from_o4_to_a
    return folded, folded


def _reversed_lengths(geometry: FourBarGeometry) -> Lengths:
    """Return the lengths seen from the rocker: the crank then, all directions mirrored in y."""
    return geometry.ground, geometry.rocker, geometry.coupler, geometry.crank
