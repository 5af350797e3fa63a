"""What a leg is to those who only ask for its foot: a crank angle in, the point H out."""

from typing import Protocol, TypeVar

# A pose goes out of `solve` and back into `velocity`: whatever it is, it is the leg's own.
PoseT = TypeVar('PoseT', bound='LegPose')


class FootVector(Protocol):
    """A velocity or an acceleration of a leg, of which the foot's part is known by its name."""

    @property
    def h(self) -> tuple[float, float]:
        """Return that of the foot H (x, y) [m/s, m/s^2]."""
        ...


class LegPose(Protocol):
    """A solved pose."""

    @property
    def alpha(self) -> float:
        """Return the crank angle [rad]."""
        ...

    @property
    def h(self) -> tuple[float, float]:
        """Return the foot H (x, y) [m]."""
        ...


class Leg(Protocol[PoseT]):
    """
    A leg that one crank drives, such as `KlannLeg`; a shallow copy of it is a leg of its own.

    `solve` raises a KinematicsError where the linkage does not close, `velocity` and
    `acceleration` a SingularPoseError where there is none, as at the ends of an arc.
    """

    def solve(self, alpha: float, /) -> PoseT:
        """Return the pose at a crank angle [rad]."""
        ...

    def velocity(self, pose: PoseT, alpha_rate: float, /) -> FootVector:
        """Return the velocity of a pose for a crank rate [rad/s]."""
        ...

    def acceleration(
        self, pose: PoseT, alpha_rate: float, alpha_acceleration: float, /
    ) -> FootVector:
        """Return the acceleration for a crank rate [rad/s] and its change [rad/s^2]."""
        ...

    def reset(self) -> None:
        """Forget the last pose."""
        ...

    def reachable_arcs(self) -> list[tuple[float, float]]:
        """Return start and end of each reachable arc [rad]; [(0, 2 pi)] for a full turn."""
        ...
