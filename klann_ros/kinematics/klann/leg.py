"""The Klann leg as an object: it remembers the last good pose, and nothing else."""

from collections.abc import Sequence
from math import inf

from klann_ros.kinematics.angles import crank_angle
from klann_ros.kinematics.newton import newton_raphson
import numpy as np
from numpy.typing import NDArray

from . import equations
from .geometry import KlannGeometry
from .pose import closed_form_pose, KlannPose
from .refinement import constants
from .tracking import COARSE_TOLERANCE, track
from .velocity import KlannVelocity, velocity

Array = NDArray[np.float64]


class KlannLeg:
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
        self._constants = constants(geometry or KlannGeometry.sem104())
        self._tolerance = _within('tolerance', tolerance, COARSE_TOLERANCE)
        self._max_crank_step = _within('max_crank_step', max_crank_step, inf)
        self._last: KlannPose | None = None

    @property
    def geometry(self) -> KlannGeometry:
        """Return the leg's dimensions."""
        return self._constants.geometry

    @property
    def last(self) -> KlannPose | None:
        """Return the last good pose: the warm start of the next `solve`."""
        return self._last

    def reset(self) -> None:
        """Forget the last pose, so that the next `solve` starts from the closed form."""
        self._last = None

    def solve(self, alpha: float) -> KlannPose:
        """
        Return the pose at a crank angle by Newton-Raphson, warm started from the last pose.

        A large step of the crank is split; the pose is always on the geometry's assembly branch.
        A solve that fails leaves the last good pose as it was.

        Parameters
        ----------
        alpha : float
            Crank angle, any number of turns [rad].

        Raises
        ------
        CrankAngleError
            `alpha` is not finite, or beyond +-1e6 rad.
        UnreachableError
            A dyad does not close at this crank angle.
        NotConvergedError
            Newton-Raphson does not confirm the closed form.

        """
        alpha = crank_angle(alpha)
        pose = track(self._constants, alpha, self._last, self._tolerance, self._max_crank_step)
        self._last = pose
        return pose

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
        alpha = crank_angle(alpha)
        try:
            x_1 = np.asarray(guess, dtype=np.float64)
        except (TypeError, ValueError):
            x_1 = np.empty(0)
        if x_1.shape != (4,) or not np.isfinite(x_1).all():
            msg = f'guess = {guess!r} is refused: gamma, beta, delta, theta, four finite numbers'
            raise ValueError(msg)
        geometry = self.geometry
        return newton_raphson(
            lambda x: equations.f(geometry, alpha, x),
            lambda x: equations.phi(geometry, x),
            x_1,
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

    def velocity(self, pose: KlannPose, alpha_rate: float) -> KlannVelocity:
        """
        Return the velocity of a pose for a crank rate.

        dx/dt = -Phi^-1 df/dalpha * alpha_rate; that of H follows by the chain rule.

        Parameters
        ----------
        pose : KlannPose
            A solved pose.
        alpha_rate : float
            Rate of the crank [rad/s].

        Raises
        ------
        SingularPoseError
            The pose has no velocity.
        ValueError
            The rate is not finite.

        """
        return velocity(pose, alpha_rate)


def _within(name: str, value: float, most: float) -> float:
    if not (0.0 < value <= most and value < inf):
        limit = '' if most == inf else f' and at most {most:g} rad'
        msg = f'{name} = {value!r} is refused: it must be finite, > 0{limit}'
        raise ValueError(msg)
    return float(value)
