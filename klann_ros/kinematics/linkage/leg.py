"""A leg solves a linkage; its only state is the last good pose."""

from collections.abc import Sequence
from functools import cache, partial
from math import ceil, hypot, inf, isnan, remainder
from sys import float_info
from typing import Any, ClassVar, Generic, TYPE_CHECKING, TypeAlias, TypeVar

from klann_ros.kinematics import errors, validation
from klann_ros.kinematics.angles import Arc, crank_angle, MAX_CRANK_ANGLE, TURN
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.batch.results import LinkagePoses
from klann_ros.kinematics.newton import Iterations, newton_raphson
from klann_ros.sanitize.text import listed, refusal
import numpy as np
from numpy.typing import ArrayLike

from .assemblies import assembly_poses
from .branch import BRANCH_STEP
from .linkage import Linkage
from .pose import initial_guess, LinkageMotion, LinkagePose, path_pose
from .reach import path_arcs, reachable_arcs
from .step import step_functions

if TYPE_CHECKING:
    from klann_ros.kinematics.batch.tables import LegTable

# Below this part of |dH/dalpha| the component along a direction is rounding.
MIN_COMPONENT_RATIO = 8.0 * float_info.epsilon
# A warm start that needs more restarts from the closed form.
MAX_ITERATIONS = 10
# Tolerance [rad] and iterations of the poses between the parts of a split step, which only have
# to stay on the branch.
COARSE_LIMITS = 1e-3, 6
# Half a turn is 9 parts of 0.35 rad; for a larger step the closed form is cheaper.
MAX_SUBSTEPS = 9
PoseT = TypeVar('PoseT', bound=LinkagePose)
MotionT = TypeVar('MotionT', bound=LinkageMotion)


class Leg(Generic[PoseT, MotionT]):
    """
    A linkage that is solved for one crank angle after the other.

    `LinkageLeg` takes any linkage; `KlannLeg` and `FourBar` have named angles and are made from
    their dimensions.

    Parameters
    ----------
    linkage : Linkage
        The linkage to solve.
    tolerance : float
        Largest correction of a converged pose [rad].
    max_crank_step : float
        Larger steps of the crank are split into parts of at most this [rad]; 0.05 rad at most
        where loops are coupled.

    Raises
    ------
    ValueError
        `tolerance` is not above 0 and at most 1e-3 rad, or `max_crank_step` not finite and > 0.
    GeometryError
        Coupled loops change their assembly mode within a turn, or are nearly singular at the
        start.
    TypeError
        `linkage` is no Linkage.

    """

    pose_class: ClassVar[type[LinkagePose]] = LinkagePose
    motion_class: ClassVar[type[LinkageMotion]] = LinkageMotion

    def __init__(
        self, linkage: Linkage, *, tolerance: float = 1e-12, max_crank_step: float = 0.35
    ) -> None:
        if not isinstance(linkage, Linkage):
            raise TypeError(f'linkage = {linkage!r} is refused: it must be a Linkage')
        self._linkage = linkage
        tolerance = validation.positive_setting('tolerance', tolerance, COARSE_LIMITS[0])
        max_crank_step = validation.positive_setting('max_crank_step', max_crank_step)
        if not linkage.is_dyadic:
            # Coupled loops leave their tangents sooner; their branch is followed once.
            max_crank_step = min(max_crank_step, BRANCH_STEP)
            _ = linkage.branch
        # A seed of coupled loops costs less than two parts.
        max_parts = MAX_SUBSTEPS if linkage.is_dyadic else 1
        self._settings = tolerance, max_crank_step, max_parts
        self._last: PoseT | None = None
        self._make()

    def _make(self) -> None:
        # By the signs, which change along the path of a linkage with change points.
        self._functions_of = cache(partial(step_functions, self._linkage, self.pose_class))
        functions = self._functions_of(self._linkage.assembly)
        self._correct = functions.correct
        self._predict = functions.predict
        if self._linkage.change_points:
            # Every pose is one along the path.
            self._predict = lambda *_: None
        self._velocity = functions.velocity
        self._acceleration = functions.acceleration

    def __repr__(self) -> str:
        return f'{type(self).__name__}({self._linkage!r})'

    def _repr_svg_(self) -> str:
        from klann_ros.kinematics.svg import leg_svg  # noqa: PLC0415 - only notebooks draw

        return leg_svg(self)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the functions: `__setstate__` makes them."""
        state = dict(self.__dict__)
        for name in ('_correct', '_predict', '_velocity', '_acceleration', '_functions_of'):
            del state[name]
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the functions again."""
        self.__dict__.update(state)
        self._make()

    @property
    def linkage(self) -> Linkage:
        """Return the linkage."""
        return self._linkage

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of its angles, the crank's first."""
        return self._linkage.joint_names

    @property
    def tolerance(self) -> float:
        """Return the largest correction of a converged pose [rad]."""
        return self._settings[0]

    @property
    def assembly(self) -> tuple[int, ...]:
        """Return the assembly mode: the sign of each block's sine."""
        return self._linkage.assembly

    @property
    def last(self) -> PoseT | None:
        """Return the last good pose: the warm start of the next `solve`."""
        return self._last

    def reset(self) -> None:
        """Forget the last pose, so that the next `solve` starts from nothing."""
        self._last = None

    def solve(self, alpha: float) -> PoseT:
        """
        Return the pose at a crank angle by Newton-Raphson, warm started from the last pose.

        A large step of the crank is split; the pose is always on the assembly branch. A solve
        that fails leaves the last good pose as it was. Of a linkage with change points that is
        not back after a turn the path goes on from the last pose, over the wrap of a turn too;
        the first pose, and one after a jump of more than a turn, are those of `closed_form`.

        Parameters
        ----------
        alpha : float
            Crank angle, any number of turns [rad].

        Raises
        ------
        CrankAngleError
            `alpha` is not finite, or beyond +-1e6 rad.
        UnreachableError, LoopsOpenError
            A dyad, or coupled loops on their branch, do not close at this crank angle.
        NotConvergedError
            Newton-Raphson does not confirm its initial guess.

        """
        last = self._last
        # The hot path: a small step from a pose that is not singular.
        if last is not None and type(alpha) is float and abs(alpha) <= MAX_CRANK_ANGLE:
            tolerance, max_crank_step, _ = self._settings
            step = alpha - last[0]
            if -max_crank_step <= step <= max_crank_step:
                pose = self._predict(alpha, step, last[1], last[5], tolerance, MAX_ITERATIONS)
                # The derivatives of a singular pose are NaN, which is not itself.
                if pose is not None and pose[5][0] == pose[5][0]:
                    self._last = pose
                    return pose  # type: ignore[no-any-return]  # of its class
        alpha = crank_angle(alpha)
        if self._linkage.change_points:
            self._last = pose = self._follow_path(alpha, last)
        else:
            self._last = pose = self._follow_branch(alpha, last)
        return pose  # type: ignore[no-any-return]  # of its class

    def _follow_branch(self, alpha: float, last: Any) -> Any:
        """
        Return the pose at a crank angle, on the assembly branch of the last pose.

        The step, less whole turns, is split into parts of at most `max_crank_step`, each predicted
        along the tangent and corrected. Without a last pose, after a failed part, and from a
        singular pose, whose sign does not tell the branch, the closed form gives the guess.
        """
        tolerance, max_crank_step, max_parts = self._settings
        if last is not None:
            step = alpha - last[0]
            if not -max_crank_step <= step <= max_crank_step:
                step = remainder(step, TURN)
            if abs(step) <= max_parts * max_crank_step:
                pose = self._take_steps(alpha, step, last)
                if pose is not None and not isnan(pose.coefficients[0]):
                    return pose
        guess = initial_guess(self._linkage, alpha)
        pose = self._correct(alpha, guess, tolerance, MAX_ITERATIONS)
        if pose is None:
            reason = 'it does not confirm the closed form'
            raise errors.NotConvergedError(alpha, np.array([guess]), reason)
        return pose

    def _follow_path(self, alpha: float, last: Any) -> Any:
        """
        Return the pose at a crank angle of a linkage with change points, along its path.

        The path angle follows the crank from the last pose, the wrap of a turn included. Without
        a last pose, and after a jump of more than a turn, it is the crank angle.
        """
        tolerance, max_crank_step, _ = self._settings
        linkage = self._linkage
        turns = 0
        step = inf
        if last is not None and abs(alpha - last[0]) <= TURN + max_crank_step:
            step = remainder(alpha - last[0], TURN)
            wraps = round((alpha - last[0] - step) / TURN)
            turns = (last.turns - wraps) % linkage.change_points.period
        beta = alpha + turns * TURN
        # Near a change point Newton-Raphson has no way of its own.
        if abs(step) <= max_crank_step and linkage.interpolated(beta) is None:
            predict = self._functions_of(linkage.signs(beta)).predict
            pose = predict(alpha, step, last.x, last.coefficients, tolerance, MAX_ITERATIONS)
            if pose is not None:
                return pose._replace(turns=turns) if turns else pose
        return self.pose_class(*path_pose(linkage, alpha, turns))

    def _take_steps(self, alpha: float, step: float, last: Any) -> Any:
        """Return the pose at a crank angle, a step from the last; None if a part fails."""
        tolerance, max_crank_step, _ = self._settings
        parts = max(1, ceil(abs(step) / max_crank_step))
        step = step / parts
        iterations = 0
        for remaining in reversed(range(parts)):
            limits = COARSE_LIMITS if remaining else (tolerance, MAX_ITERATIONS)
            part_alpha = alpha - remaining * step
            last = self._predict(part_alpha, step, last.x, last.coefficients, *limits)
            if last is None:
                return None
            iterations += last.iterations
        return last if parts == 1 else last._replace(iterations=iterations)

    def closed_form(self, alpha: float) -> PoseT:
        """
        Return the pose at a crank angle by the geometric method; it neither reads nor sets `last`.

        Coupled loops have no closed form: theirs is the nearest pose of their branch, refined. Of
        a linkage with change points `alpha` is the path angle, with its whole turns.
        Errors as for `solve`, but NotConvergedError.
        """
        alpha = crank_angle(alpha)
        return self.pose_class(*path_pose(self._linkage, alpha))  # type: ignore[return-value]  # of its class

    def path_arcs(self) -> list[Arc]:
        """Return the arcs of path angles [rad]: see `klann_ros.kinematics.path_arcs`."""
        return path_arcs(self._linkage)

    def reachable_arcs(self) -> list[Arc]:
        """
        Return the arcs (start, end) of crank angles where every loop closes [rad].

        `[(0, 2 pi)]` for a crank that turns fully: see `klann_ros.kinematics.reachable_arcs`.
        """
        return reachable_arcs(self._linkage)

    def table(self, alphas: ArrayLike, crank_rate: float | None = None) -> 'LegTable':
        """
        Return the quantities of the leg at many crank angles; `print` shows them.

        Parameters
        ----------
        alphas : array-like of real numbers
            Crank angles of any shape, or path angles [rad].
        crank_rate : float, optional
            Constant rate of the crank, for the quantities with rates [rad/s].

        Returns
        -------
        LegTable
            Coordinates by the bodies' names (`gamma`), moving points (`H.x`), transmission angles
            (`mu_1`); with a crank rate `gamma_rate`, `H.x_acceleration`, ..., and mechanical
            advantages (`gamma_advantage`), T / T_crank or F / T_crank: the crank's rate over the
            body's, inf where that is 0.

        Raises
        ------
        ValueError
            `alphas` is no array of real numbers, or the rate not finite.

        Examples
        --------
        >>> from klann_ros.kinematics import deg, KlannLeg
        >>> table = KlannLeg().table([0, 60 * deg], crank_rate=2.0)
        >>> table.gamma.round(4).tolist(), table['H.x_rate'].round(4).tolist()
        ([0.0491, 0.186], [-0.0691, -0.3883])

        """
        # The bulk solver is not loaded where a leg is solved pose by pose.
        from klann_ros.kinematics.batch.tables import leg_table  # noqa: PLC0415

        return leg_table(self, alphas, crank_rate)

    def velocity(self, pose: PoseT, alpha_rate: float) -> MotionT:
        """
        Return the velocity of a pose for a crank rate: dx/dt = dx/dalpha alpha_rate.

        Parameters
        ----------
        pose : LinkagePose
            A solved pose.
        alpha_rate : float
            Rate of the crank [rad/s].

        Raises
        ------
        SingularPoseError
            The pose has no velocity.
        ValueError
            The rate is not finite, or the pose is one of another linkage.

        """
        if type(pose) is not self.pose_class or pose.linkage is not self._linkage:
            self._check_pose(pose)
        if isnan(pose.coefficients[0]):
            raise errors.SingularPoseError(pose.crank_angle)
        validation.check_rate('alpha_rate', alpha_rate)
        rates = self._velocity(pose.crank_angle, pose.x, pose.coefficients, alpha_rate)
        motion: Any = self.motion_class._make((*rates, pose, None))
        return motion  # type: ignore[no-any-return]  # of its class

    def _check_pose(self, pose: LinkagePose) -> None:
        """Refuse what is no pose, and a pose of another linkage, unless it is equal."""
        if not isinstance(pose, LinkagePose):
            raise TypeError(refusal('pose', pose, 'a pose, as leg.solve(alpha) returns it'))
        if pose.linkage != self._linkage:
            raise ValueError(
                f'the pose is one of another linkage, {pose.linkage.name!r} with '
                f'{listed(pose.linkage.joint_names, 8)}: take one that this leg has solved'
            )

    def gradient(self, pose: PoseT) -> LinkagePoses:
        """
        Return a pose's `h` and the derivatives `h_gradient` and `angles_gradient` by dimensions.

        The loops stay closed, Phi dx = -df; the derivatives by an encoder's zero are dx/dalpha.

        Raises
        ------
        SingularPoseError
            The pose has no derivatives.
        ValueError
            The pose is one of another linkage.

        """
        # This raises both errors: a pose without a velocity has no derivatives either.
        self.velocity(pose, 1.0)
        if self._linkage.change_points:
            # The motion goes on through a change point, but no other dimensions have one.
            for sine, block in zip(pose.sines, self._linkage.blocks, strict=True):
                if sine <= block.singular_sine:
                    raise errors.SingularPoseError(pose.crank_angle)
        x_gradient, h_gradient = self._linkage.derivatives(pose.crank_angle, pose.x)
        return LinkagePoses(
            np.array(pose.h),
            np.zeros((), dtype=np.uint8),
            h_gradient=h_gradient,
            angles_gradient=x_gradient,
            dimension_names=tuple(self._linkage.dimensions),
        )

    def acceleration(self, pose: PoseT, alpha_rate: float, alpha_acceleration: float) -> MotionT:
        """
        Return the acceleration of a pose for a crank rate and its change.

        The loops stay closed, W d2u/dt2 = 0: the same linear step as for the velocity, block by
        block.

        Parameters
        ----------
        pose : LinkagePose
            A solved pose.
        alpha_rate : float
            Rate of the crank [rad/s].
        alpha_acceleration : float
            Change of the crank's rate [rad/s^2].

        Raises
        ------
        SingularPoseError
            The pose has no velocity.
        ValueError
            The rate or its change is not finite.

        """
        velocity = self.velocity(pose, alpha_rate)
        validation.check_rate('alpha_acceleration', alpha_acceleration)
        interpolated = self._linkage.interpolated(pose.crank_angle + pose.turns * TURN)
        if interpolated is not None:
            x_2 = alpha_rate**2 * interpolated.x_2 + alpha_acceleration * interpolated.x_1
            accelerations = alpha_acceleration, *x_2.tolist()
            interpolation: Any = self.motion_class(accelerations, (0.0, 0.0), pose, velocity)
            h = interpolation.points[self._linkage.foot].tolist()
            return interpolation._replace(h=tuple(h))  # type: ignore[no-any-return]
        state = pose.crank_angle, pose.x, pose.coefficients, alpha_rate, alpha_acceleration
        motion: Any = self.motion_class._make((*self._acceleration(*state), pose, velocity))
        return motion  # type: ignore[no-any-return]  # of its class

    def crank_torque(self, pose: PoseT, force: Sequence[float]) -> float:
        """
        Return the torque at the crank that balances a force (x, y) [N] on the foot H [N m].

        With no friction and no weight the linkage is in equilibrium where no small motion does
        work, T dalpha + F . dH = 0, so T = -F . dH/dalpha, counter-clockwise positive.

        Raises
        ------
        SingularPoseError
            The pose has no velocity.
        ValueError
            The force is not two finite numbers.

        References
        ----------
        J. J. Uicker, G. R. Pennock, J. E. Shigley, Theory of Machines and Mechanisms, the chapter
        on static force analysis.

        """
        x_1, y_1 = self.velocity(pose, 1.0).h
        f_x, f_y = validation.finite_vector('force', force)
        # From 0.0, so that no force takes a torque of 0.0 and not of -0.0.
        return 0.0 - (f_x * x_1 + f_y * y_1)

    def foot_force(self, pose: PoseT, torque: float, direction: Sequence[float]) -> float:
        """
        Return the force on the foot along a direction (x, y) that a crank torque balances [N].

        With the direction's unit vector u: F = -T / (u . dH/dalpha), the inverse of
        `crank_torque`; negative where it acts against the direction.

        Raises
        ------
        ImmobileDirectionError
            The foot does not move along the direction, and any force is balanced.
        SingularPoseError
            The pose has no velocity.
        ValueError
            The torque is not finite, or the direction not two finite numbers, or without length.

        """
        h_1 = self.velocity(pose, 1.0).h
        validation.check_rate('torque', torque)
        u, v = validation.unit_vector('direction', direction)
        along = u * h_1[0] + v * h_1[1]
        if abs(along) <= MIN_COMPONENT_RATIO * hypot(*h_1):
            raise errors.ImmobileDirectionError(h_1, (u, v))
        return -torque / along

    # The textbook's methods, which neither read nor set the last pose.

    def f(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """
        Return the loop equations' left-hand sides, in the textbook's order and signs.

        Parameters
        ----------
        alpha : float
            Crank angle [rad].
        x : sequence of float, shape (n - 1,)
            The other angles, in the order of `joint_names` [rad].

        Returns
        -------
        numpy.ndarray, shape (n - 1,)
            Of each loop its x equation, then its y equation [m]; the linkage closes where all are
            0.

        Raises
        ------
        CrankAngleError
            `alpha` is not finite, or beyond +-1e6 rad.
        ValueError
            `x` is not as many finite numbers.

        """
        return self._linkage.f(crank_angle(alpha), self._x('x', x))

    def phi(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """Return the Jacobian Phi = df/dx, shape (n - 1, n - 1) [m/rad]; see `f`."""
        return self._linkage.phi(crank_angle(alpha), self._x('x', x))

    def correction(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """
        Return the correction of Newton-Raphson, -Phi^-1 f, at an estimate x, shape (n - 1,) [rad].

        Parameters and errors as for `f`.

        Raises
        ------
        SingularPoseError
            Phi cannot be inverted.

        """
        try:
            step = np.linalg.solve(self.phi(alpha, x), self.f(alpha, x))
        except np.linalg.LinAlgError:
            raise errors.SingularPoseError(crank_angle(alpha)) from None
        return np.asarray(-step, dtype=np.float64)

    def _x(self, name: str, x: Sequence[float] | FloatArray) -> FloatArray:
        return validation.finite_angles(x, ', '.join(self.joint_names[1:]), name)

    def newton(
        self,
        alpha: float,
        guess: Sequence[float] | FloatArray,
        *,
        max_iterations: int = 50,
        tolerance: float | None = None,
        residual: float | None = None,
    ) -> FloatArray:
        """
        Return the iterates of the textbook's Newton-Raphson, on any branch.

        It stops at the first iterate whose correction was at most `tolerance`; with `residual` at
        the first whose equations are all open by less than that; with both where both hold.

        Parameters
        ----------
        alpha : float
            Crank angle [rad].
        guess : sequence of float, shape (n - 1,)
            The other angles of the first iterate, in the order of `joint_names` [rad].
        max_iterations : int
            Maximum number of corrections.
        tolerance : float, optional
            Convergence limit of every correction [rad]; the leg's without `residual`.
        residual : float, optional
            Limit of every `|f|` [m]: the stop of the four-bar's course.

        Returns
        -------
        numpy.ndarray, shape (k, n - 1)
            The iterates [rad], neither rounded nor wrapped; row 0 is the guess. `iterations` has
            f, Phi and the corrections beside them.

        Raises
        ------
        NotConvergedError
            It carries the iterates.
        CrankAngleError
            `alpha` is not finite, or beyond +-1e6 rad.
        ValueError
            The guess is not as many finite numbers, `max_iterations` no whole number >= 0, or
            `tolerance` or `residual` not finite and > 0.

        """
        alpha = crank_angle(alpha)
        linkage = self._linkage
        if tolerance is not None:
            tolerance = validation.positive_setting('tolerance', tolerance)
        if residual is not None:
            residual = validation.positive_setting('residual', residual)
        elif tolerance is None:
            tolerance = self.tolerance
        limits: Any = {'max_iterations': max_iterations, 'residual': residual}
        try:
            return newton_raphson(
                linkage, alpha, self._x('guess', guess), tolerance=tolerance, **limits
            )
        except errors.NotConvergedError as error:
            if not linkage.is_dyadic or assembly_poses(linkage, alpha):
                raise
            reason = f'{error.reason}; at this crank angle it closes in no assembly'
            raise errors.NotConvergedError(alpha, error.iterates, reason) from None

    def iterations(
        self, alpha: float, guess: Sequence[float] | FloatArray, **stop: Any
    ) -> Iterations:
        """
        Return a run of `newton` with f, Phi and the corrections; `print` shows it as a table.

        Parameters and errors as for `newton`; `stop` are `max_iterations`, `tolerance` and
        `residual`.
        """
        x = self.newton(alpha, guess, **stop)
        f = np.array([self.f(alpha, iterate) for iterate in x])
        phi = np.array([self.phi(alpha, iterate) for iterate in x])
        for array in (x, f, phi):
            array.setflags(write=False)
        units = tuple(body.unit for body in self._linkage.structure.bodies[1:])
        return Iterations(crank_angle(alpha), self.joint_names[1:], units, x, f, phi)


class LinkageLeg(Leg[LinkagePose, LinkageMotion]):
    """Any linkage, such as one from a file; see `Leg`."""


AnyLeg: TypeAlias = Leg[Any, Any]
