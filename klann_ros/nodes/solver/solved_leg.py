"""One of the legs that a node solves: its crank, its solver, and its figures."""

from dataclasses import dataclass

from klann_ros.kinematics import (
    AnyLeg,
    CrankAngleError,
    KinematicsError,
    LinkageMotion,
    LinkagePose,
    SingularPoseError,
)

from .figures import SolverFigures


@dataclass(frozen=True)
class Mounting:
    """
    How a leg is driven and mounted.

    Attributes
    ----------
    name : str
        The leg's name; empty for the only, unnamed one.
    crank_joint : str
        The joint in crank_state that turns its crank.
    phase : float
        Its crank angle where the crank is at 0 [rad].
    direction : int
        +1, or -1 for a leg whose crank turns the other way.
    mount_xyz, mount_rpy : tuple of float
        Where its plane is in base_link [m], and how it is turned [rad].

    """

    name: str
    crank_joint: str
    phase: float
    direction: int
    mount_xyz: tuple[float, ...]
    mount_rpy: tuple[float, ...]

    def prefixed(self, word: str) -> str:
        """Return a joint's, topic's or frame's name as it is for this leg."""
        return f'{self.name}/{word}' if self.name else word


class SolvedLeg:
    """
    A leg, and what its solver did since the last report.

    Parameters
    ----------
    mounting : Mounting
        How it is driven and mounted.
    leg : Leg
        Its solver.

    """

    def __init__(self, mounting: Mounting, leg: AnyLeg) -> None:
        """Start from nothing."""
        self.mounting = mounting
        self.leg = leg
        self.figures = SolverFigures()
        self.last: LinkagePose | None = None

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names under which its angles are published, the crank's first."""
        return tuple(map(self.mounting.prefixed, self.leg.joint_names))

    def answer(self, alpha: float, rate: float | None) -> tuple[LinkagePose, LinkageMotion | None]:
        """
        Return the pose for a crank angle, and the velocity where there is one.

        alpha_leg = direction * alpha + phase. What fails is counted before it is raised.

        Parameters
        ----------
        alpha : float
            The crank's angle, before direction and phase [rad].
        rate : float or None
            Its rate [rad/s]; None where it is not known.

        Raises
        ------
        CrankAngleError
            It is no crank angle.
        KinematicsError
            It cannot be solved.

        """
        mounting = self.mounting
        try:
            pose = self.leg.solve(mounting.direction * alpha + mounting.phase)
        except CrankAngleError as error:
            self.figures.reject(str(error))
            raise
        except KinematicsError as error:
            self.figures.fail(str(error))
            raise
        self.figures.solve(pose)
        self.last = pose
        return pose, None if rate is None else self._velocity(pose, mounting.direction * rate)

    def _velocity(self, pose: LinkagePose, rate: float) -> LinkageMotion | None:
        try:
            velocity: LinkageMotion = self.leg.velocity(pose, rate)
        except SingularPoseError:
            return None
        return velocity
