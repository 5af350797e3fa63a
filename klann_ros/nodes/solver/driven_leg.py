"""A leg of a solver node: its crank, its solver, and the solver's statistics."""

from dataclasses import dataclass, field
from math import nan, pi

from klann_ros.kinematics import (
    AnyLeg,
    CrankAngleError,
    KinematicsError,
    LinkageMotion,
    LinkagePose,
    SingularPoseError,
)
from klann_ros.robot import RobotLeg


class SolverStatistics:
    """Counts since the start, and the worst values since the last report."""

    def __init__(self) -> None:
        # Since the start: published answers, refused inputs, and unsolvable crank angles.
        self.solved = self.rejected = self.failed = 0
        self.begin_report()

    def begin_report(self) -> None:
        """Reset all but the counts since the start."""
        # The texts of the last failure and the last rejection; '' without one.
        self.failure = self.rejection = ''
        # The number of inputs, and the most Newton iterations of a pose.
        self.inputs = self.iterations = 0
        # The largest residual [m]; NaN without any pose.
        self.residual = nan
        # For each dyad its pose nearest to a singular one; empty without any pose.
        self.worst: list[LinkagePose] = []
        self._min_sines: list[float] = []

    def solve(self, pose: LinkagePose) -> None:
        """Count a solved pose."""
        self.solved += 1
        self.inputs += 1
        self.iterations = max(self.iterations, pose.iterations)
        self.residual = max(pose.residual, self.residual)
        sines = pose.sines
        if not self.worst:
            self.worst, self._min_sines = [pose] * len(sines), list(sines)
        for i, sine in enumerate(sines):
            if sine < self._min_sines[i]:
                self._min_sines[i], self.worst[i] = sine, pose

    def reject(self, reason: str) -> None:
        """Count an input without a valid crank angle."""
        self.rejected += 1
        self.inputs += 1
        self.rejection = reason

    def fail(self, reason: str) -> None:
        """Count a crank angle without a solution."""
        self.failed += 1
        self.inputs += 1
        self.failure = reason

    def transmission_angles(self, count: int) -> tuple[float, ...]:
        """Return the worst transmission angle of each dyad [rad]; NaN without any pose."""
        worst = (pose.transmission_angles[i] for i, pose in enumerate(self.worst))
        return tuple(worst) or (nan,) * count

    @property
    def min_transmission_angle(self) -> float:
        """Return the least min(mu, pi - mu) of all dyads [rad]; NaN without any pose."""
        angles = self.transmission_angles(len(self.worst))
        return min((min(mu, pi - mu) for mu in angles), default=nan)

    @property
    def condition(self) -> float:
        """Return the condition of Phi nearest to a singular pose; NaN without any pose."""
        return max((pose.condition for pose in self.worst), default=nan)


@dataclass(eq=False)
class DrivenLeg:
    """A leg with its crank, its solver and the solver's statistics."""

    # Its geometry and its drive.
    robot_leg: RobotLeg
    # Its solver.
    leg: AnyLeg
    # Separates its name and its joints' in JointState.
    joint_separator: str = '/'
    statistics: SolverStatistics = field(default_factory=SolverStatistics, init=False)
    # The last pose; None before the first.
    last: LinkagePose | None = field(default=None, init=False)

    @property
    def name(self) -> str:
        """Return its name; '' for an unnamed leg."""
        return self.robot_leg.name

    @property
    def crank_joint(self) -> str:
        """Return the joint in crank_state that turns its crank."""
        return self.robot_leg.crank_joint

    def prefixed(self, name: str) -> str:
        """Return this leg's topic or frame of a name."""
        return self.robot_leg.prefix + name

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the published names of its joints, the crank's first."""
        names = self.leg.joint_names
        return tuple(self.robot_leg.joint_name(name, self.joint_separator) for name in names)

    def answer(self, alpha: float, rate: float | None) -> tuple[LinkagePose, LinkageMotion | None]:
        """
        Return the pose at a crank angle [rad], and the velocity if the rate [rad/s] is known.

        alpha_leg = direction * alpha + phase. A CrankAngleError for an invalid angle, or another
        KinematicsError for one without a solution, is counted before it is raised.
        """
        try:
            pose = self.leg.solve(self.robot_leg.direction * alpha + self.robot_leg.phase)
        except CrankAngleError as error:
            self.statistics.reject(str(error))
            raise
        except KinematicsError as error:
            self.statistics.fail(str(error))
            raise
        self.statistics.solve(pose)
        self.last = pose
        if rate is None:
            return pose, None
        try:
            return pose, self.leg.velocity(pose, self.robot_leg.direction * rate)
        except SingularPoseError:
            return pose, None
