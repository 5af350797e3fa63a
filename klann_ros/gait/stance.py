"""
A body on its feet: which of them carry it, and how it moves over the ground when they slip.

A body that may tilt rests on a facet of its feet's convex hull, three feet f_i with no foot below
their plane, if its centre of mass is above them: the point of the plane below it is

    sum l_i f_i,   sum l_i = 1,   l_i >= 0,

and the l_i are the load shares of these feet. There may be several such facets, as for a chair
that can be tilted back: the body stays on its facet while that holds, then tips to the one with
the lowest centre of mass. It does not lie down on its side, which may be lower still. Where more
feet touch the plane, all are taken as equally stiff springs (`spring_loads`).

Legs on separate cranks, and legs whose feet vary in speed over their stance, drag feet over the
ground. Each standing foot resists with friction mu l_i against the direction of its slip. At
walking speed these forces balance, and the motion (d, psi) of the body minimises the frictional
dissipation

    sum l_i |g_i' - g_i + d + psi J g_i|,

with the feet g_i seen from above before and after, and J a quarter turn; mu cancels. A foot that
carries more than half of the weight sticks; the others slip (quasi-static sliding with dry
friction: S. Goyal, A. Ruina, J. Papadopoulos, Wear 143 (1991)). Where friction leaves the motion
undetermined a prior decides: the momentum of the body, or its measured acceleration. One step is
then an implicit step of Newton's law with dry friction (J. J. Moreau, Unilateral contact and dry
friction in finite freedom dynamics, 1988). The sum is that of a geometric median, minimised by
least squares with weights 1 / slip, repeated (E. Weiszfeld, 1937).

Poses are computed one by one in plain numbers: arrays of six feet would be slower.
"""

from collections.abc import Iterable, Sequence
from functools import cache
from itertools import combinations
from math import asin, atan2, cos, hypot, inf, sin, sqrt
from typing import NamedTuple

from klann_ros.dynamics import GRAVITY

Point = Sequence[float]
Triple = tuple[float, float, float]
Facet = tuple[int, int, int]
# xx, xy, xz, yy, yz, zz of a symmetric matrix.
Symmetric = tuple[float, float, float, float, float, float]
# Tolerances of rounding: relative area of a vertical facet; load shares and positions [m].
FLAT = 1e-9
ROUNDING = 1e-12
# Feet up to this height above the plane carry load as well [m].
TOUCHING = 1e-6
# Iterations of loads and slip; the slip of sticking feet, by the longest step; and yaw information
# of no foot, as a part of the feet's: coincident feet define no rotation.
ITERATIONS = 12
STICK_TOLERANCE = 1e-3
NO_YAW = 1e-9


class Support(NamedTuple):
    """How a body rests on its feet."""

    # Those that carry it, three or more, and their shares of the weight.
    feet: tuple[int, ...]
    loads: tuple[float, ...]
    # Three of them around the centre of mass.
    facet: Facet
    # Upwards in base_link, and the height of its origin above the ground [m].
    normal: Triple
    height: float
    # The feet that touch the ground, and the centre of mass [m].
    corners: Sequence[Point]
    centre: Point

    @property
    def pitch(self) -> float:
        """Return the pitch, positive with the nose down, as in REP 103 [rad]."""
        return asin(-self.normal[0])

    @property
    def roll(self) -> float:
        """Return the roll, positive with the left side up [rad]."""
        return atan2(self.normal[1], self.normal[2])

    @property
    def margin(self) -> float:
        """Return the static margin [m]: the distance of the centre from the edge of its feet."""
        *corners, centre = gravity_aligned([*self.corners, self.centre], self.roll, self.pitch)
        return edge_distance(corners, centre)

    def off(self, attitude: tuple[float, float]) -> float:
        """Return how far it is from an attitude, roll and pitch [rad]."""
        return hypot(self.roll - attitude[0], self.pitch - attitude[1])

    def height_of(self, point: Point) -> float:
        """Return the height of a point of base_link above the ground [m]."""
        nx, ny, nz = self.normal
        x, y, z = point
        return self.height + nx * x + ny * y + nz * z


def gravity_aligned(points: Iterable[Point], roll: float, pitch: float) -> list[complex]:
    """Return points or vectors of base_link, turned by roll and pitch, seen from above: x + jy."""
    sin_roll = sin(roll)
    cos_roll = cos(roll)
    sin_pitch = sin(pitch)
    cos_pitch = cos(pitch)
    aligned = []
    for x, y, z in points:
        up = sin_roll * y + cos_roll * z
        aligned.append(complex(cos_pitch * x + sin_pitch * up, cos_roll * y - sin_roll * z))
    return aligned


def from_above(points: Iterable[Point]) -> list[complex]:
    """Return points of base_link without their heights: x + jy."""
    return [complex(point[0], point[1]) for point in points]


def support(
    feet: Sequence[Point],
    centre: Point,
    guess: Facet | None = None,
    attitude: tuple[float, float] | None = None,
    tolerance: float = 0.0,
) -> Support | None:
    """
    Return how a body rests; None where its centre of mass is not above the polygon of its feet.

    Positions are those in base_link [m]; it stays on the facet `guess` while that holds. Where a
    measured attitude, roll and pitch, is off by more than a tolerance [rad], the facet is the one
    nearest to it.
    """

    def tilt_error(candidate: Support) -> float:
        return candidate.off(attitude) if attitude else 0.0

    def preference(candidate: Support) -> tuple[float, float, float]:
        # Tilted by more than 30 deg it lies on its side.
        uprightness = min(candidate.normal[2], 0.866)
        return tilt_error(candidate), -uprightness, candidate.height_of(centre)

    stable = guess and _on_facet(feet, centre, guess)
    if not stable or tilt_error(stable) > tolerance:
        candidates = [_on_facet(feet, centre, facet) for facet in _facets(len(feet))]
        stable = min(filter(None, candidates), key=preference, default=None)
        if stable is None:
            return None
    nx, ny, nz = stable.normal
    top = TOUCHING - stable.height
    touching = []
    corners = []
    for foot, (x, y, z) in enumerate(feet):
        if x * nx + y * ny + z * nz <= top:
            touching.append(foot)
            corners.append(feet[foot])
    if len(touching) == 3:
        return stable
    stable = stable._replace(corners=corners)
    height = stable.height_of(centre)
    below = complex(centre[0] - height * nx, centre[1] - height * ny)
    loads = spring_loads(from_above(corners), [0.0] * len(touching), below)
    shares = {foot: load for foot, load in zip(touching, loads, strict=True) if load > 0.0}
    if len(shares) <= 3:
        return stable
    return stable._replace(feet=tuple(shares), loads=tuple(shares.values()))


def outside_feet(
    feet: Sequence[Point],
    centre: Point,
    attitude: tuple[float, float],
    guess: Facet = (0, 1, 2),
    tolerance: float = 0.01,
) -> float:
    """
    Return how far a centre of mass is outside of the feet that an attitude shows to carry it [m].

    The body lies on a facet of its feet within a tolerance of roll and pitch [rad]; 0 where there
    is none, as while it tips, or where one can carry it, which `guess` may do.
    """
    min_distance = inf
    for facet in (guess, *_facets(len(feet))):
        corners = [feet[foot] for foot in facet]
        middle = [sum(coordinates) / 3.0 for coordinates in zip(*corners, strict=True)]
        lying = _on_facet(feet, middle, facet)
        if lying and lying.off(attitude) < tolerance:
            if _on_facet(feet, centre, facet):
                return 0.0
            *flat, flat_centre = from_above([*corners, centre])
            min_distance = min(min_distance, edge_distance(flat, flat_centre))
    return min_distance if min_distance < inf else 0.0


def edge_distance(feet: Sequence[complex], centre: complex) -> float:
    """Return the distance of a point from the edge of the polygon around feet, from above [m]."""
    min_distance = inf
    for start, end in combinations(feet, 2):
        length = abs(end - start) or 1.0
        direction = (end - start) / length
        sides = [((foot - start) * direction.conjugate()).imag for foot in feet]
        if min(sides) > -ROUNDING or max(sides) < ROUNDING:
            along = ((centre - start) * direction.conjugate()).real
            nearest = max(0.0, min(length, along)) * direction
            min_distance = min(min_distance, abs(centre - start - nearest))
    return min_distance


@cache
def _facets(count: int) -> tuple[Facet, ...]:
    return tuple(combinations(range(count), 3))


def _on_facet(feet: Sequence[Point], centre: Point, facet: Facet) -> Support | None:
    """Return how it rests on three feet; None where its centre or a foot forbids it."""
    corners = [feet[foot] for foot in facet]
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    norm = sqrt(nx * nx + ny * ny + nz * nz)
    if norm == 0.0 or abs(nz) <= FLAT * (ux * ux + uy * uy + vx * vx + vy * vy):
        return None
    length = norm if nz > 0.0 else -norm
    x, y, z = nx / length, ny / length, nz / length
    height = -(x * ax + y * ay + z * az)
    centre_height = height + x * centre[0] + y * centre[1] + z * centre[2]
    # (px, py) leads from the first foot to the point below the centre, seen along z.
    px = centre[0] - centre_height * x - ax
    py = centre[1] - centre_height * y - ay
    load_b = (px * vy - py * vx) / nz
    load_c = (ux * py - uy * px) / nz
    load_a = 1.0 - load_b - load_c
    if min(load_a, load_b, load_c) < -ROUNDING:
        return None
    for fx, fy, fz in feet:
        if fx * x + fy * y + fz * z < -height - ROUNDING:
            return None
    loads = load_a, load_b, load_c
    return Support(facet, loads, facet, (x, y, z), height, corners, centre)


def zero_moment_point(centre: complex, height: float, acceleration: complex) -> complex:
    """
    Return the point around which the feet carry an accelerated body [m], seen from above.

    Gravity and inertia of a centre of mass at a height [m] have no moment about it that would tip
    the body (M. Vukobratovic, B. Borovac, Zero-moment point, 2004).
    """
    return centre - height / GRAVITY * acceleration


def spring_loads(
    flat: Sequence[complex], heights: Sequence[float], load_point: complex, sink: float = 5e-4
) -> list[float]:
    """
    Return the load shares of feet that give way like springs, as their legs and the floor do.

    Each foot carries (d + a x + b y - h) / sink where that is positive; d, a and b follow from the
    balance of the weight, which acts at `load_point`, seen from above. `heights` are those of the
    feet above the plane of their support, and `sink` is that of a foot under the whole weight [m].
    """
    springs = []
    active = []
    for foot, height in zip(flat, heights, strict=True):
        spring = (foot.real - load_point.real, foot.imag - load_point.imag, height)
        springs.append(spring)
        if height < TOUCHING:
            active.append(spring)
    sinks = [0.0] * len(springs)
    for _ in range(ITERATIONS):
        sx = sy = xx = xy = yy = hx = hy = 0.0
        sh = sink
        for x, y, h in active:
            sx, sy, sh, hx, hy = sx + x, sy + y, sh + h, hx + h * x, hy + h * y
            xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
        n = float(len(active))
        determinant = n * (xx * yy - xy * xy) - sx * (sx * yy - sy * xy) + sy * (sx * xy - sy * xx)
        if abs(determinant) <= FLAT * (xx + yy) ** 2:
            break
        d, a, b = product(inverse((n, sx, sy, xx, xy, yy)), (sh, hx, hy))
        last_active = active
        active = []
        for n, spring in enumerate(springs):
            x, y, h = spring
            sinks[n] = max(0.0, d + a * x + b * y - h)
            if sinks[n] > 0.0:
                active.append(spring)
        if active == last_active:
            break
    total = sum(sinks) or 1.0
    return [depth / total for depth in sinks]


class FootMotion(NamedTuple):
    """A standing foot in the level frame of base_link."""

    # A step [m] or velocity [m/s].
    motion: complex
    # Motion over the ground for each rad of the body's rotation [m].
    arm: complex
    # Weight of its slip in the sum.
    load: float


class MotionPrior(NamedTuple):
    """Motion of the body without friction, and a force that friction balances."""

    motion: complex = 0j
    yaw: float = 0.0
    # Inverse covariance of x, y and yaw.
    information: Symmetric = (0.0,) * 6
    # In units of mu times the weight of the body, weighted as the loads are.
    force: complex = 0j


class BodyStep(NamedTuple):
    """Motion of a body over the ground, in base_link's directions before: a step or velocity."""

    motion: complex = 0j
    yaw: float = 0.0
    # Load-weighted slip of its feet.
    slid: float = 0.0
    # Inverse of the information of prior and feet.
    covariance: Symmetric = (0.0,) * 6


class StancePose(NamedTuple):
    """A pose of a body on its feet; positions in its level frame, seen from above [m]."""

    support: Support
    # All feet, with their rolling, and the centre of mass.
    flat: list[complex]
    centre: complex


def stance_pose(
    feet: Sequence[Point],
    rolled: Sequence[Sequence[float]],
    support: Support,
    attitude: tuple[float, float] | None = None,
    centre: Point = (0.0, 0.0, 0.0),
) -> StancePose:
    """Return a pose; `attitude` is roll and pitch where they are measured [rad]."""
    roll, pitch = attitude or (support.roll, support.pitch)
    *level_feet, level_centre = gravity_aligned([*feet, centre], roll, pitch)
    flat = [foot + complex(*rolls) for foot, rolls in zip(level_feet, rolled, strict=True)]
    return StancePose(support, flat, level_centre)


def body_displacement(last_pose: StancePose, pose: StancePose) -> BodyStep:
    """Return how a body moves from pose to pose by friction alone."""
    loads = dict.fromkeys((*last_pose.support.feet, *pose.support.feet), 0.0)
    for support in (last_pose.support, pose.support):
        for foot, load in zip(support.feet, support.loads, strict=True):
            loads[foot] += load / 2.0
    feet = [foot_motion(last_pose.flat[i], pose.flat[i], load) for i, load in loads.items()]
    max_step = max(abs(foot.motion) for foot in feet)
    return minimize_slip(feet, STICK_TOLERANCE * max_step)


def foot_motion(start: complex, end: complex, load: float, seconds: float = 1.0) -> FootMotion:
    """Return the motion of a foot between two places, divided by a time."""
    return FootMotion((end - start) / seconds, 0.5j * (start + end), load)


def minimize_slip(
    feet: Sequence[FootMotion], creep: float, prior: MotionPrior | None = None
) -> BodyStep:
    """
    Return the motion of a body whose feet move; without a prior friction is all.

    `creep` is the slip below which friction is regularised, in the unit of the motions.
    """
    v, yaw = prior[:2] if prior else least_squares(feet)
    prior = prior or MotionPrior()
    scale = sum([abs(foot.motion) for foot in feet]) + abs(v)
    if scale == 0.0:
        return BodyStep(yaw=yaw)
    a, b, c, d, e, f = prior.information
    mean = prior.motion.real, prior.motion.imag, prior.yaw
    prior_x, prior_y, prior_yaw = product(prior.information, mean)
    prior_x += prior.force.real
    prior_y += prior.force.imag
    # Motion, arm, load, arm . arm, arm . motion.
    terms = []
    for motion, arm, load in feet:
        terms.append((motion, arm, load, abs(arm) ** 2, (arm.conjugate() * motion).real))
    for _ in range(ITERATIONS):
        weights = 0.0
        arms = 0j
        moves = 0j
        # Information on the yaw, and right side of its equation.
        information_yaw = f
        right_yaw = prior_yaw
        for motion, arm, load, square, along in terms:
            slip = motion + v + yaw * arm
            weight = load / hypot(slip.real, slip.imag, creep)
            weights += weight
            arms += weight * arm
            moves += weight * motion
            information_yaw += weight * square
            right_yaw -= weight * along
        information_yaw *= 1.0 + NO_YAW
        covariance = inverse(
            (a + weights, b, c + arms.real, d + weights, e + arms.imag, information_yaw)
        )
        xx, xy, xt, yy, yt, tt = covariance
        right_x = prior_x - moves.real
        right_y = prior_y - moves.imag
        last_v = v
        last_yaw = yaw
        # As `product`, whose call would take longer.
        v = complex(
            xx * right_x + xy * right_y + xt * right_yaw,
            xy * right_x + yy * right_y + yt * right_yaw,
        )
        yaw = xt * right_x + yt * right_y + tt * right_yaw
        # A rotation moves feet by about their distance in metres.
        if abs(v - last_v) + abs(yaw - last_yaw) < 1e-5 * scale:
            break
    slid = sum([load * abs(motion + v + yaw * arm) for motion, arm, load in feet])
    return BodyStep(v, yaw, slid, covariance)


def dissipation_hessian(
    feet: Sequence[FootMotion],
    step: BodyStep,
    creep: float,
    prior: Symmetric = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
) -> Symmetric:
    """
    Return the Hessian of prior and dissipation at a motion of the body, in x, y and yaw.

    That of the dissipation is zero along the slip of a foot. The weights of `minimize_slip` are
    those of a parabola above it: they would give feet that slide against each other a motion that
    they leave undetermined.
    """
    xx, xy, xt, yy, yt, tt = prior
    for motion, arm, load in feet:
        slip = motion + step.motion + step.yaw * arm
        speed = hypot(slip.real, slip.imag, creep)
        x = slip.real / speed
        y = slip.imag / speed
        weight = load / speed
        along = x * arm.real + y * arm.imag
        xx += weight * (1.0 - x * x)
        xy -= weight * x * y
        yy += weight * (1.0 - y * y)
        xt += weight * (arm.real - x * along)
        yt += weight * (arm.imag - y * along)
        tt += weight * (abs(arm) ** 2 - along * along)
    return xx, xy, xt, yy, yt, tt


def least_squares(feet: Sequence[FootMotion], yaw: float | None = None) -> tuple[complex, float]:
    """Return motion and yaw of the body by load-weighted least squares of the slip."""
    loads = sum([foot.load for foot in feet])
    moves = sum([foot.load * foot.motion for foot in feet])
    arms = sum([foot.load * foot.arm for foot in feet])
    if yaw is None:
        squares = sum([foot.load * abs(foot.arm) ** 2 for foot in feet])
        along = sum([foot.load * (foot.arm.conjugate() * foot.motion).real for foot in feet])
        yaw = (arms.conjugate() * moves).real - loads * along
        yaw /= loads * squares * (1.0 + NO_YAW) - abs(arms) ** 2
    return -(moves + yaw * arms) / loads, yaw


def inverse(matrix: Symmetric) -> Symmetric:
    """Return the inverse of a symmetric matrix."""
    a, b, c, d, e, f = matrix
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    s, t, u = a * f - c * c, b * c - a * e, a * d - b * b
    det = a * p + b * q + c * r
    return p / det, q / det, r / det, s / det, t / det, u / det


def product(matrix: Symmetric, vector: Triple) -> Triple:
    """Return a symmetric matrix times a vector."""
    a, b, c, d, e, f = matrix
    x, y, z = vector
    return a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z
