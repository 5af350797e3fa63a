"""A linkage as an object that is solved: it remembers the last good pose, and nothing else."""

from collections.abc import Sequence

from klann_ros.kinematics import validation
from klann_ros.kinematics.angles import crank_angle, wrap
from klann_ros.kinematics.arcs import Arc
from klann_ros.kinematics.newton import newton_raphson
from klann_ros.kinematics.tracked_leg import FootedLeg
import numpy as np
from numpy.typing import NDArray

from .branch_table import TRUSTED
from .description import Description
from .linkage import Linkage
from .motion import acceleration, LinkageMotion, velocity
from .pose import LinkagePose, made_pose
from .refinement import refine
from .seeds import Seeds, STEP

Array = NDArray[np.float64]


class LinkageLeg(FootedLeg[LinkagePose]):
    """
    A linkage that is solved for one crank angle after the other, as `KlannLeg` is.

    Parameters
    ----------
    linkage : Linkage
        The linkage.
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
        Coupled loops are put together in another way after a turn, or are nearly singular at the
        start.
    TypeError
        `linkage` is no Linkage.

    """

    def __init__(
        self, linkage: Linkage, *, tolerance: float = 1e-12, max_crank_step: float = 0.35
    ) -> None:
        """Start without a pose."""
        if not isinstance(linkage, Linkage):
            msg = f'linkage = {linkage!r} is refused: it must be a Linkage'
            raise TypeError(msg)
        self._linkage = linkage
        self._seeds = Seeds(linkage)
        # Its tangents lead astray sooner where loops are coupled.
        most = max_crank_step if linkage.is_dyadic else min(max_crank_step, STEP)
        super().__init__(
            self._refined,
            self._seeds.seed,
            tolerance=tolerance,
            max_crank_step=most,
            # A seed costs less than two parts.
            max_parts=1,
        )

    @property
    def linkage(self) -> Linkage:
        """Return what it solves."""
        return self._linkage

    @property
    def geometry(self) -> Description:
        """Return its description."""
        return self._linkage.description

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of its angles, the crank's first."""
        return self._linkage.joint_names

    @property
    def assembly(self) -> tuple[int, ...]:
        """Return the sign of each dyad's sine: how it is put together."""
        return self._linkage.assembly

    def newton(
        self, alpha: float, guess: Sequence[float] | Array, *, max_iterations: int = 50
    ) -> Array:
        """
        Return the iterates of Newton-Raphson for all loops at once, on whichever branch they end.

        Parameters
        ----------
        alpha : float
            Crank angle [rad].
        guess : sequence of float, shape (n - 1,)
            The other angles of the first iterate, in the order of `joint_names` [rad].
        max_iterations : int
            How many corrections it may make.

        Returns
        -------
        numpy.ndarray, shape (k, n - 1)
            The iterates [rad], neither rounded nor wrapped; row 0 is the guess.

        Raises
        ------
        NotConvergedError
            It carries the iterates.
        CrankAngleError
            `alpha` is not finite, or beyond +-1e6 rad.
        ValueError
            The guess is not as many finite numbers.

        """
        alpha = crank_angle(alpha)
        linkage = self._linkage
        return newton_raphson(
            lambda x: linkage.f(alpha, x),
            lambda x: linkage.phi(alpha, x),
            validation.guess(guess, ', '.join(linkage.joint_names[1:])),
            alpha=alpha,
            tolerance=self._tolerance,
            max_iterations=max_iterations,
        )

    def closed_form(self, alpha: float) -> LinkagePose:
        """
        Return the pose at a crank angle from nothing; it neither reads nor sets `last`.

        Dyads are placed by the geometric method alone. Coupled loops have no closed form: theirs
        is the nearest pose of their branch, refined.

        Raises
        ------
        CrankAngleError
            `alpha` is not finite, or beyond +-1e6 rad.
        UnreachableError
            A dyad does not close at this crank angle.
        LoopsOpenError
            Coupled loops do not close at this crank angle on their branch.

        """
        return made_pose(self._linkage, self._seeds.assembled(crank_angle(alpha)), 0)

    def residual(self, alpha: float, x: Sequence[float]) -> float:
        """Return the norm of f at a crank angle and the other angles [m]."""
        return float(np.linalg.norm(self._linkage.f(alpha, x)))

    def reachable_arcs(self) -> list[Arc]:
        """
        Return the arcs of crank angles at which every loop closes.

        Returns
        -------
        list of (float, float)
            Start and end of each arc, start < end, start in [0, 2 pi) [rad]; `[(0, 2 pi)]` for a
            crank that turns fully.

        """
        return self._seeds.arcs()

    def velocity(self, pose: LinkagePose, alpha_rate: float) -> LinkageMotion:
        """Return the velocity of a pose for a crank rate [rad/s]: see `motion.velocity`."""
        return velocity(pose, alpha_rate)

    def acceleration(
        self, pose: LinkagePose, alpha_rate: float, alpha_acceleration: float
    ) -> LinkageMotion:
        """Return the acceleration of a pose: see `motion.acceleration`."""
        return acceleration(pose, alpha_rate, alpha_acceleration)

    def _refined(
        self, alpha: float, guess: tuple[float, ...], tolerance: float, max_iterations: int
    ) -> LinkagePose | None:
        pose = refine(self._linkage, alpha, guess, tolerance, max_iterations)
        if pose is None or self._linkage.is_dyadic:
            return pose
        # The signs alone do not tell the branches of coupled loops apart.
        astray = max(abs(wrap(a - b)) for a, b in zip(pose.x, guess, strict=True))
        return pose if astray <= TRUSTED else None
