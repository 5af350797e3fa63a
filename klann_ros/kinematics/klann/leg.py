"""The Klann leg as an object: it remembers the last good pose, and nothing else."""

from collections.abc import Sequence
from functools import partial

from klann_ros.kinematics import validation
from klann_ros.kinematics.angles import crank_angle
from klann_ros.kinematics.arcs import Arc
from klann_ros.kinematics.newton import newton_raphson
from klann_ros.kinematics.tracked_leg import FootedLeg
import numpy as np
from numpy.typing import NDArray

from . import closed_form, equations
from .acceleration import acceleration, KlannAcceleration
from .geometry import KlannGeometry
from .pose import closed_form_pose, JOINTS, KlannPose
from .reach import reachable_arcs
from .refinement import constants, refine
from .velocity import KlannVelocity, velocity

Array = NDArray[np.float64]


class KlannLeg(FootedLeg[KlannPose]):
    """
    A Klann leg that is solved for one crank angle after the other.

    Parameters
    ----------
    geometry : KlannGeometry, optional
        The leg; SEM 104's where it is left out.
    tolerance : float
        Largest correction of a converged pose [rad].
    max_crank_step : float
        Larger steps of the crank are split into parts of at most this [rad].

    Raises
    ------
    ValueError
        `tolerance` is not above 0 and at most 1e-3 rad, or `max_crank_step` not finite and > 0.
    TypeError
        `geometry` is no KlannGeometry.

    """

    def __init__(
        self,
        geometry: KlannGeometry | None = None,
        *,
        tolerance: float = 1e-12,
        max_crank_step: float = 0.35,
    ) -> None:
        """Start without a pose."""
        if not isinstance(geometry, KlannGeometry | None):
            msg = f'geometry = {geometry!r} is refused: it must be a KlannGeometry'
            raise TypeError(msg)
        self._geometry = geometry or KlannGeometry.sem104()
        super().__init__(
            partial(refine, constants(self._geometry)),
            partial(closed_form.seed, self._geometry),
            tolerance=tolerance,
            max_crank_step=max_crank_step,
        )

    @property
    def geometry(self) -> KlannGeometry:
        """Return the leg's dimensions."""
        return self._geometry

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of its angles, the crank's first."""
        return JOINTS

    @property
    def assembly(self) -> tuple[int, int]:
        """Return the signs of sin(gamma + beta) and of sin(delta + theta)."""
        return self._geometry.assembly

    def newton(
        self, alpha: float, guess: Sequence[float] | Array, *, max_iterations: int = 50
    ) -> Array:
        """
        Return the iterates of the textbook's Newton-Raphson, on whichever branch they end.

        Parameters
        ----------
        alpha : float
            Crank angle [rad].
        guess : sequence of float, shape (4,)
            gamma, beta, delta, theta of the first iterate [rad].
        max_iterations : int
            How many corrections it may make.

        Returns
        -------
        numpy.ndarray, shape (k, 4)
            The iterates [rad], neither rounded nor wrapped; row 0 is the guess.

        Raises
        ------
        NotConvergedError
            It carries the iterates.
        CrankAngleError
            `alpha` is not finite, or beyond +-1e6 rad.
        ValueError
            The guess is not four finite numbers.

        References
        ----------
        R. Nicoletti, SEM 104 Mecanismos, lecture 7.

        """
        alpha, geometry = crank_angle(alpha), self._geometry
        return newton_raphson(
            lambda x: equations.f(geometry, alpha, x),
            lambda x: equations.phi(geometry, x),
            validation.guess(guess, 'gamma, beta, delta, theta'),
            alpha=alpha,
            tolerance=self._tolerance,
            max_iterations=max_iterations,
        )

    def closed_form(self, alpha: float) -> KlannPose:
        """
        Return the pose at a crank angle by the geometric method; it neither reads nor sets `last`.

        Raises
        ------
        CrankAngleError
            `alpha` is not finite, or beyond +-1e6 rad.
        UnreachableError
            A dyad does not close at this crank angle.

        """
        return closed_form_pose(self.geometry, alpha)

    def residual(self, alpha: float, x: Sequence[float]) -> float:
        """Return the norm of f at a crank angle and gamma, beta, delta, theta [m]."""
        return float(np.linalg.norm(equations.f(self._geometry, alpha, x)))

    def reachable_arcs(self) -> list[Arc]:
        """Return the arcs of crank angles at which both dyads close: see `reachable_arcs`."""
        return reachable_arcs(self.geometry)

    def velocity(self, pose: KlannPose, alpha_rate: float) -> KlannVelocity:
        """
        Return the velocity of a pose for a crank rate [rad/s].

        dx/dt = -Phi^-1 df/dalpha * alpha_rate; that of H follows by the chain rule.

        Raises
        ------
        SingularPoseError
            The pose has no velocity.
        ValueError
            The rate is not finite.

        """
        return velocity(pose, alpha_rate)

    def acceleration(
        self, pose: KlannPose, alpha_rate: float, alpha_acceleration: float
    ) -> KlannAcceleration:
        """
        Return the acceleration of a pose for a crank rate [rad/s] and its change [rad/s^2].

        Phi d2x/dalpha2 = -d(Phi dx/dalpha + df/dalpha)/dalpha, the second derivatives held.

        Raises
        ------
        SingularPoseError
            The pose has no velocity, and no acceleration either.
        ValueError
            The rate or its change is not finite.

        """
        return acceleration(pose, alpha_rate, alpha_acceleration)
