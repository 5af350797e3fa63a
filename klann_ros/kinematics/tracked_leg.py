"""What all legs have in common that are solved for one crank angle after the other."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, Generic

from . import validation, virtual_work
from .angles import crank_angle
from .tracking import COARSE_TOLERANCE, MAX_PARTS, Pose, Refine, Seed, track


class TrackedLeg(ABC, Generic[Pose]):
    """
    A linkage that remembers its last good pose, and nothing else; a subclass has its `geometry`.

    Parameters
    ----------
    refine : callable
        Newton-Raphson from a guess, onto the assembly branch: see `tracking`.
    seed : callable
        A guess made from nothing: see `tracking`.
    tolerance : float
        Largest correction of a converged pose [rad].
    max_crank_step : float
        Larger steps of the crank are split into parts of at most this [rad].
    max_parts : int
        A step of more parts is seeded.

    Raises
    ------
    ValueError
        `tolerance` is not above 0 and at most 1e-3 rad, or `max_crank_step` not finite and > 0.

    """

    def __init__(
        self,
        refine: 'Refine[Pose]',
        seed: Seed,
        *,
        tolerance: float,
        max_crank_step: float,
        max_parts: int = MAX_PARTS,
    ) -> None:
        """Start without a pose."""
        self._refine = refine
        self._seed = seed
        self._tolerance = validation.setting('tolerance', tolerance, COARSE_TOLERANCE)
        self._max_crank_step = validation.setting('max_crank_step', max_crank_step)
        self._max_parts = max_parts
        self._last: Pose | None = None

    def __repr__(self) -> str:
        return f'{type(self).__name__}({self.geometry!r})'

    @property
    @abstractmethod
    def geometry(self) -> Any:
        """Return what the linkage is made of."""

    @property
    def last(self) -> Pose | None:
        """Return the last good pose: the warm start of the next `solve`."""
        return self._last

    def reset(self) -> None:
        """Forget the last pose, so that the next `solve` starts from nothing."""
        self._last = None

    def solve(self, alpha: float) -> Pose:
        """
        Return the pose at a crank angle by Newton-Raphson, warm started from the last pose.

        A large step of the crank is split; the pose is always on the assembly branch. A solve
        that fails leaves the last good pose as it was.

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
        LoopsOpenError
            Coupled loops do not close at this crank angle on their branch.
        NotConvergedError
            Newton-Raphson does not confirm what it was seeded with.

        """
        self._last = track(
            self._refine,
            self._seed,
            crank_angle(alpha),
            self._last,
            tolerance=self._tolerance,
            max_crank_step=self._max_crank_step,
            max_parts=self._max_parts,
        )
        return self._last


class FootedLeg(TrackedLeg[Pose]):
    """A leg with a foot, on which forces act; a subclass has its `velocity`."""

    @abstractmethod
    def velocity(self, pose: Any, alpha_rate: float) -> Any:
        """Return the velocity of a pose for a crank rate [rad/s]."""

    def crank_torque(self, pose: Pose, force: Sequence[float]) -> float:
        """
        Return the torque at the crank that balances a force (x, y) [N] on the foot H [N m].

        Virtual work: T = -F . dH/dalpha, counter-clockwise positive; no friction, no weight.

        Raises
        ------
        SingularPoseError
            The pose has no velocity.
        ValueError
            The force is not two finite numbers.

        """
        return virtual_work.crank_torque(self.velocity(pose, 1.0).h, force)

    def foot_force(self, pose: Pose, torque: float, direction: Sequence[float]) -> float:
        """
        Return the force on the foot along a direction (x, y) that a crank torque balances [N].

        It is negative where it acts against the direction; the inverse of `crank_torque`.

        Raises
        ------
        ImmobileDirectionError
            The foot does not move along the direction, and any force is balanced.
        SingularPoseError
            The pose has no velocity.
        ValueError
            The torque is not finite, or the direction not two finite numbers, or without length.

        """
        return virtual_work.foot_force(self.velocity(pose, 1.0).h, torque, direction)
