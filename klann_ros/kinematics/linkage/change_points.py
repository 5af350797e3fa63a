"""
Change points: poses in which a dyad is in line, or its ends coincide, and two motions meet.

Along the path of a linkage the discriminant p of a dyad, whose root places its joint, is a smooth
function of the unwrapped crank angle beta, the path angle. At a change point p touches 0,

    p ~ delta^(2 m),    delta = beta - beta_c,

and sqrt(p) continues smoothly as +-delta^m: where the order m is odd the dyad's sign changes (the
velocities of the two motions differ), where it is even the sign stays (their accelerations
differ). So a parallelogram stays one, and its branch is a table of sign changes. A dyad with an
odd number of them in a turn is back after two turns. With D = |m|^2 there is

    two links           m = M              p = ((r_a + r_b)^2 - D) (D - (r_a - r_b)^2),
    a link and a line   m = Im(M conj(e))  p = r^2 - D,
    a line on a link    m = M              p = D - q^2.

In a change point rounding is all that is left of sqrt(p). Near it a pose is interpolated: by the
polynomial through the poses at eight equal steps on both sides, whose derivatives are those of the
motion. See `dyads` for M, r, e and q.
"""

from functools import cache, cached_property
from math import ceil, log2, pi, remainder
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import BoolArray, FloatArray
from klann_ros.kinematics.errors import GeometryError
from klann_ros.kinematics.searches import parabola_peak
import numpy as np

from . import joints
from .blocks import Block

COURSES = PARALLEL, CROSSED, SIGN = 'parallel', 'crossed', 'sign'
# Crank angles of the search, and the longest period of a branch [turns].
SAMPLES_PER_TURN = 360
SAMPLE_SHIFT = 0.37
MAX_PERIOD = 8
# Steps of derivatives, and of the discriminant's growth, which tells the order [rad].
STENCIL_STEP = 1e-3
ORDER_STEP = 1e-2
# A contact that is missed by less than this part of the loop's longest vector is left to play.
NEAR_MISS = 1e-6
# Change points of several dyads that are one [rad].
SAME_ANGLE = 1e-6
# From an angle to one that is after a change point at it [rad].
JUST_AFTER = 2.0 * SAME_ANGLE
# Steps of the nodes of an interpolated pose [rad], and its largest error [rad, size].
NODE_STEP = 5e-3
NODES = np.array([-4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0])
# Steps at which the interpolated pose is compared.
MIDDLES = np.array([-0.5, 0.5])
MAX_HALVINGS = 12
INTERPOLATION_ERROR = 1e-10
_FIT = np.linalg.inv(np.vander(NODES, increasing=True))


class ChangePoint(NamedTuple):
    """A change point of a block, at a path angle [rad]."""

    beta: float
    # The block's number in the linkage, from 1.
    block: int
    # The order m of contact; the sign of the block changes where it is odd.
    order: int
    # Whether the ends of a dyad coincide, so that its two links may spin freely.
    is_free: bool = False


class NearMiss(NamedTuple):
    """A pose that is nearly a change point of a block: the path angle [rad], the clearance [m]."""

    beta: float
    block: int
    clearance: float


class SignChanges(NamedTuple):
    """The sign of a block along the path, from a start on [rad]."""

    sign: int
    start: float
    # Differences of the change points from the start, over `span`, after which they repeat [rad].
    changes: tuple[float, ...]
    span: float

    def signs_at(self, betas: Any) -> Any:
        """Return the signs at path angles, an array of their shape."""
        spans, offsets = np.divmod(betas - self.start, self.span)
        count = np.searchsorted(self.changes, offsets, side='right') + spans * len(self.changes)
        return np.where(count % 2.0 == 0.0, self.sign, -self.sign)


class InterpolatedPose(NamedTuple):
    """The other coordinates and their first two derivatives by the crank angle [rad, m]."""

    x: FloatArray
    x_1: FloatArray
    x_2: FloatArray


class _PosePolynomials(NamedTuple):
    """The polynomials of the other coordinates, shape (8, n - 1), within a radius [rad]."""

    radius: float
    coefficients: FloatArray

    def at(self, offset: Any) -> InterpolatedPose:
        """Return the poses at distances from the centre, shape (..., n - 1)."""
        from numpy.polynomial.polynomial import polyder, polyval  # noqa: PLC0415 - six modules

        derivatives = []
        for order in range(3):
            polynomial = polyder(self.coefficients, order) / self.radius**order
            derivatives.append(polyval(offset / self.radius, polynomial).T)
        return InterpolatedPose(*derivatives)


def may_touch_zero(p: FloatArray) -> BoolArray:
    """Return where samples over a period, the last axis, may be next to a zero that p touches."""
    before = np.roll(p, 1, axis=-1)
    after = np.roll(p, -1, axis=-1)
    is_touching: BoolArray = p <= 0.25 * (before - 2.0 * p + after)
    return is_touching & (p <= before) & (p <= after)


class ChangePoints:
    """The change points of a linkage on its branch; false where there are none."""

    def __init__(self, linkage: Any, *, is_searched: bool = False) -> None:
        self._linkage = linkage
        # Turns of the crank after which every body is back.
        self.period = 1
        self.points: list[ChangePoint] = []
        self.near_misses: list[NearMiss] = []
        # The smallest clearance of each dyad over the path [m]; NaN for coupled loops.
        self.clearances: list[float] = []
        # An unreachable crank angle, if there is one: path angles are a turn from it on [rad].
        self._cut: float | None = None
        self._signs: list[SignChanges] = []
        self._fit = cache(self._fit_of)
        # The number of blocks that the branch of coupled loops places.
        self._branch_blocks = 0
        if linkage.at_change_points != SIGN and not is_searched:
            self._find()

    def __bool__(self) -> bool:
        """Return whether there are any."""
        return bool(self.points)

    def path_angles(self, betas: Any) -> Any:
        """Return path angles [rad], less whole turns where the crank cannot turn fully."""
        if self._cut is None:
            return betas
        return self._cut + (betas - self._cut) % TURN

    def signs(self, betas: Any) -> list[Any]:
        """Return the sign of each block at path angles, arrays of their shape."""
        betas = self.path_angles(betas)
        return [changes.signs_at(betas) for changes in self._signs]

    def interpolated(self, beta: float) -> InterpolatedPose | None:
        """Return the pose near a change point; None elsewhere."""
        for centre in self._centres:
            offset = remainder(beta - centre, self._span)
            if abs(offset) <= NODE_STEP and abs(offset) <= self._fit(centre).radius:
                return self._fit(centre).at(offset)
        return None

    def interpolated_poses(self, betas: FloatArray) -> list[tuple[BoolArray, InterpolatedPose]]:
        """Return the poses near each change point among path angles, and which ones they are."""
        poses = []
        for centre in self._centres:
            offsets = betas - centre
            offsets = offsets - self._span * np.round(offsets / self._span)
            near = np.abs(offsets) <= NODE_STEP
            if near.any():
                fit = self._fit(centre)
                near &= np.abs(offsets) <= fit.radius
                poses.append((near, fit.at(offsets[near])))
        return poses

    @cached_property
    def _centres(self) -> list[float]:
        """Return the distinct path angles of change points, over a period from the start on."""
        centres: list[float] = []
        for point in sorted(self.points):
            if not centres or point.beta - centres[-1] > SAME_ANGLE:
                centres.append(point.beta)
        return centres

    def links(self, point: ChangePoint | NearMiss) -> list[str]:
        """Return the names of the bodies that meet in a point's block."""
        unknowns = self._linkage.blocks[point.block - 1].unknowns
        return [self._linkage.joint_names[j] for j in unknowns]

    def continuations(self, point: ChangePoint) -> tuple[FloatArray, FloatArray | None]:
        """
        Return the derivatives of the block's coordinates along the path, and on the other motion.

        By the crank angle, the first ones where they differ: as many times as the order says. The
        other motion of coupled loops is not known.
        """
        bodies = np.array(self._linkage.blocks[point.block - 1].unknowns) - 1
        order = min(point.order, 2)
        path = self._fit(point.beta).at(0.0)[order][bodies]
        if point.block <= self._branch_blocks:
            return path, None
        return path, self._fit(point.beta, point.block).at(0.0)[order][bodies]

    @property
    def middle(self) -> float:
        """Return a path angle far from an end of the path [rad]."""
        return self._linkage.reference if self._cut is None else self._cut + pi

    @property
    def _span(self) -> float:
        """Return the difference of path angles after which the poses repeat [rad]."""
        return self.period * TURN

    def _fit_of(self, centre: float, crossed_block: int = 0) -> _PosePolynomials:
        """Return the interpolated poses around a point, or those of a dyad's other motion."""
        slides = [body.slides for body in self._linkage.structure.bodies[1:]]
        radius = NODE_STEP
        for _ in range(MAX_HALVINGS):
            x = self._coordinates(centre + radius * np.insert(NODES, 4, MIDDLES), crossed_block)
            fit = _PosePolynomials(radius, _FIT @ np.delete(x, [4, 5], axis=0))
            error = fit.at(radius * MIDDLES).x - x[[4, 5]]
            error = np.where(slides, error / self._linkage.size, np.sin(error))
            if np.abs(error).max() <= INTERPOLATION_ERROR:
                return fit
            radius /= 2.0
        # No motion leads through it.
        return _PosePolynomials(-1.0, np.full_like(fit.coefficients, np.nan))

    def _coordinates(self, betas: FloatArray, crossed_block: int = 0) -> FloatArray:
        """Return the other coordinates along path angles, shape (k, n - 1)."""
        structure = self._linkage.structure
        u = self._vectors(betas, len(self._linkage.blocks), crossed_block)
        x = []
        for j, body in enumerate(structure.bodies[1:], 1):
            coordinate = joints.coordinate(structure, u, j)
            x.append(coordinate if body.slides else np.unwrap(coordinate))
        return np.stack(x, axis=-1)

    # The search.

    def _find(self) -> None:
        linkage = self._linkage
        if not linkage.is_dyadic:
            self._branch_blocks = linkage.branch.block
            self.period = linkage.branch.period
            start, end = linkage.branch.arc
            if end - start < TURN:
                self._cut = (start + end) / 2.0 - pi
            self.points += linkage.branch.change_points
            if self.points and linkage.at_change_points == CROSSED:
                raise GeometryError(
                    'at_change_points: crossed is refused for coupled loops: start on that motion'
                )
            self.clearances += [np.nan] * self._branch_blocks
            self._signs += linkage.branch.sign_changes
        for block in linkage.blocks[slice(self._branch_blocks, None)]:
            self._add(block)
        self.points = self._path_points()

    def _add(self, block: Block) -> None:
        """Add the change points of a dyad that follows on those already added."""
        span = self.period * TURN
        reference = self._linkage.reference
        contacts: list[ChangePoint] = []
        if block.two_branches:
            contacts = self._contacts(block)
        else:
            self.clearances.append(np.inf)
        self.points += contacts
        changes = []
        for point in contacts:
            if point.order % 2:
                # The signs hold after a change point at the reference.
                changes.append((point.beta - reference - SAME_ANGLE) % span + SAME_ANGLE)
        sign = self._linkage.assembly[block.number - 1]
        if contacts and self._linkage.at_change_points == CROSSED:
            sign = -sign
        self._signs.append(SignChanges(sign, reference, tuple(sorted(changes)), span))
        if len(changes) % 2 and self._cut is None and self.period < MAX_PERIOD:
            self.period *= 2

    def _path_points(self) -> list[ChangePoint]:
        """Return the points of all blocks over the whole path, in order."""
        start = self._linkage.reference
        if self._cut is not None:
            start = self._cut
            self.period = 1
        points = set()
        for point in self.points:
            span = self._signs[point.block - 1].span
            first = start + (point.beta - start + SAME_ANGLE) % span - SAME_ANGLE
            for turn in range(max(1, round(self._span / span))):
                if first + turn * span < start + self._span - SAME_ANGLE:
                    points.add(point._replace(beta=first + turn * span))
        return sorted(points)

    def _cut_at(self, beta: float) -> None:
        """Let path angles end at an unreachable crank angle, the last before the reference."""
        if self._cut is None:
            self._cut = beta - TURN * ceil((beta - self._linkage.reference) / TURN)

    def _contacts(self, block: Block) -> list[ChangePoint]:
        """Return the contacts of a dyad over a period of the blocks before it."""
        longest = block.dyad_solver.dyad.length
        rounding = block.dyad_solver.dyad.contact_rounding
        step = TURN / SAMPLES_PER_TURN
        count = SAMPLES_PER_TURN * self.period
        # Not at whole degrees, where the dyads before it often have theirs.
        betas = self._linkage.reference + step * (np.arange(count) + SAMPLE_SHIFT)
        with np.errstate(all='ignore'):
            span, clearances = self._spans(block, betas)
            p = block.dyad_solver.discriminant(span)
            is_dip = may_touch_zero(p)
            heights = [np.roll(-clearances, shift) for shift in (1, 0, -1)]
            self.clearances.append(-float(np.fmax.reduce(parabola_peak(*heights))))
            missed = np.flatnonzero(~(clearances >= -rounding))
            if len(missed):
                self._cut_at(float(betas[missed[-1]]))
            if not is_dip.any():
                return []
            dips = self._refined(block, betas[is_dip])
            span, clearances = self._spans(block, dips)
            orders = self._orders(block, dips)
        contacts = []
        for n, beta in enumerate(dips.tolist()):
            clearance = float(clearances[n])
            # A dyad that stays in line has no order.
            if abs(clearance) <= rounding and orders[n]:
                is_free = bool(abs(span[n]) <= rounding)
                contacts.append(ChangePoint(beta, block.number, orders[n], is_free))
                self.clearances[-1] = 0.0
                continue
            if abs(clearance) <= NEAR_MISS * longest:
                self.near_misses.append(NearMiss(beta, block.number, clearance))
            if clearance < 0.0:
                self._cut_at(beta)
        return contacts

    def _refined(self, block: Block, betas: FloatArray) -> FloatArray:
        """Return the angles near others at which D is stationary, by Newton's method."""
        e = STENCIL_STEP
        for _ in range(40):
            points = betas[:, None] + e * np.arange(-2.0, 3.0)
            m = self._spans(block, points.ravel())[0].reshape(points.shape).T
            m_1 = (8.0 * (m[3] - m[1]) - (m[4] - m[0])) / (12.0 * e)
            m_2 = (16.0 * (m[3] + m[1]) - (m[4] + m[0]) - 30.0 * m[2]) / (12.0 * e * e)
            slope = (np.conj(m[2]) * m_1).real
            bend = abs(m_1) ** 2 + (np.conj(m[2]) * m_2).real
            change = np.nan_to_num(-slope / bend)
            betas = betas + np.clip(change, -0.02, 0.02)
            if np.abs(change).max() < 1e-9:
                break
        return betas

    def _orders(self, block: Block, betas: FloatArray) -> list[int]:
        """Return the orders m of contacts; 0 where the dyad stays in line."""
        growth = []
        for distance in (ORDER_STEP, 2.0 * ORDER_STEP):
            sides = [self._spans(block, betas + side * distance)[0] for side in (-1.0, 1.0)]
            p = [block.dyad_solver.discriminant(span) for span in sides]
            growth.append(np.nanmean(p, axis=0))
        orders = []
        for near, far in zip(*growth, strict=True):
            orders.append(round(log2(far / near) / 2.0) if near > 0.0 and far > 0.0 else 0)
        return orders

    # Poses along the path.

    def _spans(self, block: Block, betas: FloatArray) -> tuple[Any, Any]:
        """Return m and the clearance of a dyad at path angles."""
        u = self._vectors(betas, block.number - 1)
        closure = block.closure_vector(u)
        solver = block.dyad_solver
        return solver.span(u, closure), solver.clearance(closure, u)

    def _vectors(self, betas: FloatArray, count: int, crossed_block: int = 0) -> list[Any]:
        """
        Return u_j of the bodies in the first blocks at path angles, shape (k,).

        The dyad of number `crossed_block` has the opposite sign.
        """
        linkage = self._linkage
        betas = self.path_angles(betas)
        u: list[Any] = [None] * len(linkage.structure.bodies)
        u[0] = np.exp(1j * linkage.structure.senses[0] * betas)
        first = self._branch_blocks
        if first:
            x = np.zeros((len(u), len(betas)))
            x[[*linkage.prefix_bodies]] = [betas, *linkage.branch.angles(betas)]
            u = joints.body_vectors(linkage.structure, [*x])
        with np.errstate(all='ignore'):
            for block in linkage.blocks[first:count]:
                a, b = block.unknowns
                signs = self._signs[block.number - 1].signs_at(betas)
                signs = -signs if block.number == crossed_block else signs
                closure = block.closure_vector(u)
                u[a], u[b] = block.dyad_solver.place(u, closure, signs)
        return u
