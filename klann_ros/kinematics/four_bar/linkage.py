"""The four-bar linkage as an object: it remembers the last good pose, and nothing else."""

from collections.abc import Sequence
from functools import partial

from klann_ros.kinematics import validation
from klann_ros.kinematics.angles import crank_angle
from klann_ros.kinematics.errors import KinematicsError
from klann_ros.kinematics.newton import newton_raphson
from klann_ros.kinematics.tracked_leg import TrackedLeg
import numpy as np
from numpy.typing import NDArray

from . import closed_form, equations, motion, reach, transmission
from .dead_points import dead_points, DeadPoint, rocker_limits, RockerLimits
from .geometry import FourBarGeometry
from .grashof import Grashof
from .pose import closed_form_pose, FourBarPose, NO_COEFFICIENTS
from .refinement import constants, refine

Array = NDArray[np.float64]


class FourBar(TrackedLeg[FourBarPose]):
    """
    A four-bar linkage that is solved for one crank angle after the other.

    The loop is L2 e^(i theta2) + L3 e^(i theta3) = L1 + L4 e^(i theta4), all angles
    counter-clockwise from the ground.

    Parameters
    ----------
    ground, crank, coupler, rocker : float
        L1, L2, L3 and L4 [m], > 0.
    assembly : int
        The sign (+1 or -1) of sin(theta4 - theta3); +1 is the open one. At a change point of
        class III both assemblies meet: it is the sign on either side, and not the motion through
        it. So `FourBar(2, 1, 2, 1)` is a parallelogram up to 180 deg, and an antiparallelogram
        from there to 360 deg.
    tolerance : float
        Largest correction of a converged pose [rad].
    max_crank_step : float
        Larger steps of the crank are split into parts of at most this [rad].

    Raises
    ------
    GeometryError
        The lengths or the assembly are no linkage; the text says why.
    ValueError
        `tolerance` is not above 0 and at most 1e-3 rad, or `max_crank_step` not finite and > 0.

    """

    def __init__(
        self,
        ground: float,
        crank: float,
        coupler: float,
        rocker: float,
        assembly: int = 1,
        *,
        tolerance: float = 1e-12,
        max_crank_step: float = 0.35,
    ) -> None:
        """Start without a pose."""
        self._geometry = FourBarGeometry(ground, crank, coupler, rocker, assembly)
        super().__init__(
            partial(refine, constants(self._geometry)),
            partial(closed_form.angles, self._geometry),
            tolerance=tolerance,
            max_crank_step=max_crank_step,
        )

    @property
    def geometry(self) -> FourBarGeometry:
        """Return the linkage's lengths and assembly."""
        return self._geometry

    def solve(self, theta2: float) -> FourBarPose:
        """Return the pose at a crank angle theta2 [rad]: see `TrackedLeg.solve`."""
        last = self._last
        pose = super().solve(theta2)
        if last is not None and pose.coefficients is NO_COEFFICIENTS:
            # The sign that tells the assemblies apart is rounding here, and where A is next to O4
            # they are half a turn apart: only the closed form knows.
            self.reset()
            try:
                pose = super().solve(theta2)
            except KinematicsError:
                self._last = last
                raise
        return pose

    def newton(
        self, theta2: float, guess: Sequence[float] | Array, *, max_iterations: int = 50
    ) -> Array:
        """
        Return the iterates of the course's Newton-Raphson, on whichever assembly they end.

        Parameters
        ----------
        theta2 : float
            Crank angle [rad].
        guess : sequence of float, shape (2,)
            theta3, theta4 of the first iterate [rad].
        max_iterations : int
            How many corrections it may make.

        Returns
        -------
        numpy.ndarray, shape (k, 2)
            The iterates [rad], neither rounded nor wrapped; row 0 is the guess.

        Raises
        ------
        NotConvergedError
            It carries the iterates.
        CrankAngleError
            `theta2` is not finite, or beyond +-1e6 rad.
        ValueError
            The guess is not two finite numbers, or `max_iterations` no whole number >= 0.

        References
        ----------
        "Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples, example 2.

        """
        theta2 = crank_angle(theta2)
        return newton_raphson(
            lambda x: equations.f(self._geometry, theta2, x),
            lambda x: equations.phi(self._geometry, x),
            validation.guess(guess, 'theta3, theta4'),
            alpha=theta2,
            tolerance=self._tolerance,
            max_iterations=max_iterations,
        )

    def closed_form(self, theta2: float) -> FourBarPose:
        """
        Return the pose at a crank angle by the geometric method; it neither reads nor sets `last`.

        Raises
        ------
        CrankAngleError
            `theta2` is not finite, or beyond +-1e6 rad.
        UnreachableError
            Coupler and rocker do not meet at this crank angle.

        """
        return closed_form_pose(self._geometry, theta2)

    def velocity(self, pose: FourBarPose, rate: float) -> motion.FourBarVelocity:
        """
        Return the velocity of a pose for a crank rate; see `motion.velocity`.

        Parameters
        ----------
        pose : FourBarPose
            A solved pose.
        rate : float
            Rate of the crank [rad/s].

        Raises
        ------
        SingularPoseError
            The pose has no velocity.
        ValueError
            The rate is not finite.

        """
        return motion.velocity(pose, rate)

    def acceleration(
        self, pose: FourBarPose, rate: float, acceleration: float
    ) -> motion.FourBarAcceleration:
        """
        Return the acceleration of a pose; see `motion.acceleration`.

        Parameters
        ----------
        pose : FourBarPose
            A solved pose.
        rate : float
            Rate of the crank [rad/s].
        acceleration : float
            Acceleration of the crank [rad/s^2].

        Raises
        ------
        SingularPoseError
            The pose has no velocity, and no acceleration either.
        ValueError
            The rate or the acceleration is not finite.

        """
        return motion.acceleration(pose, rate, acceleration)

    def transmission_angle(self, theta2: float) -> float:
        """
        Return the angle between coupler and rocker at a crank angle, in [0, pi] [rad].

        Parameters
        ----------
        theta2 : float
            Crank angle [rad].

        Raises
        ------
        CrankAngleError
            `theta2` is not finite, or beyond +-1e6 rad.
        UnreachableError
            Coupler and rocker do not meet at this crank angle.

        """
        return transmission.transmission_angle(self._geometry, theta2)

    @property
    def transmission_extremes(self) -> transmission.TransmissionExtremes:
        """Return the least and the greatest transmission angle that can be reached, and where."""
        return transmission.transmission_extremes(self._geometry)

    def mechanical_advantage(self, theta2: float) -> float:
        """
        Return T4 / T2 = w2 / w4 at a crank angle; see `transmission.mechanical_advantage`.

        inf at a limit position of the rocker, 0 where coupler and rocker are in line, NaN where
        all links are.

        Parameters
        ----------
        theta2 : float
            Crank angle [rad].

        Raises
        ------
        CrankAngleError
            `theta2` is not finite, or beyond +-1e6 rad.
        UnreachableError
            Coupler and rocker do not meet at this crank angle.

        """
        return transmission.mechanical_advantage(self._geometry, theta2)

    def reachable_arcs(self) -> list[reach.Arc]:
        """Return start and end of each arc of crank angles at which the linkage closes [rad]."""
        return reach.reachable_arcs(self._geometry.lengths)

    @property
    def grashof(self) -> Grashof:
        """
        Return what Grashof's law says of the linkage.

        Its attributes: `class_`, `margin` [m], `type_` with its parts `shape` and `motion`,
        `roles` of the links, and `inversions`, the same with another link held.
        """
        return Grashof(self._geometry.lengths)

    def dead_points(self, driver: str = 'crank') -> list[DeadPoint]:
        """
        Return where a driver stops, by its angle; none where it turns fully.

        Those of the crank belong to both assemblies. Those of the rocker are this assembly's; the
        other assembly has them mirrored, so that a rocker of class II has one of each assembly.

        Parameters
        ----------
        driver : str
            'crank' or 'rocker'.

        Raises
        ------
        ValueError
            `driver` is neither.

        """
        return dead_points(self._geometry, driver)

    @property
    def rocker_limits(self) -> RockerLimits:
        """Return the limit positions of the rocker, its swing and its time ratio."""
        return rocker_limits(self._geometry, self.grashof.motion)
