"""A leg of a solver node: its crank, its solver, and the solver's statistics."""

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
        # Counts since the start of published answers, refused inputs, and unsolvable crank angles.
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
        # The pose nearest to a singular one of each dyad; empty without any pose.
        self.worst: list[LinkagePose] = []

    def solve(self, pose: LinkagePose) -> None:
        """Count a solved pose."""
        self.solved += 1
        self.inputs += 1
        self.iterations = max(self.iterations, pose.iterations)
        self.residual = max(pose.residual, self.residual)
        if not self.worst:
            self.worst = [pose] * len(pose.sines)
        for i, sine in enumerate(pose.sines):
            if sine < self.worst[i].sines[i]:
                self.worst[i] = pose

    def reject(self, reason: str, *, is_fault: bool = True) -> None:
        """Count an input without a valid crank angle; one that is no fault is no input either."""
        self.rejected += 1
        if is_fault:
            self.inputs += 1
            self.rejection = reason

    def fail(self, reason: str) -> None:
        """Count a crank angle without a solution."""
        self.failed += 1
        self.inputs += 1
        self.failure = reason

    def transmission_angles(self, count: int) -> tuple[float, ...]:
        """Return the worst transmission angle of each dyad [rad]; NaN without any pose."""
        angles = tuple(pose.transmission_angles[i] for i, pose in enumerate(self.worst))
        return angles or (nan,) * count

    @property
    def min_transmission_angle(self) -> float:
        """Return the least min(mu, pi - mu) of all dyads [rad]; NaN without any pose."""
        angles = self.transmission_angles(len(self.worst))
        return min((min(mu, pi - mu) for mu in angles), default=nan)

    @property
    def condition(self) -> float:
        """Return the condition of Phi nearest to a singular pose; NaN without any pose."""
        return max((pose.condition for pose in self.worst), default=nan)


class DrivenLeg:
    """A leg with its crank, its solver and the solver's statistics."""

    def __init__(self, robot_leg: RobotLeg, leg: AnyLeg, joint_separator: str = '/') -> None:
        # Replaced when its lengths are changed.
        self.leg = leg
        self.name = robot_leg.name
        self.crank_joint = robot_leg.crank_joint
        # It stands before the names of the leg's topics and frames.
        self.prefix = robot_leg.prefix
        # The published names, the crank's first.
        self.joint_names = [robot_leg.joint_name(j, joint_separator) for j in leg.joint_names]
        self._direction = robot_leg.encoder_direction
        self._phase = robot_leg.encoder_phase
        self.statistics = SolverStatistics()
        # The last pose; None before the first.
        self.last: LinkagePose | None = None

    def answer(self, alpha: float, rate: float | None) -> tuple[LinkagePose, LinkageMotion | None]:
        """
        Return the pose at a crank angle [rad], and the velocity if the rate [rad/s] is known.

        alpha_leg = direction * alpha + phase, with those of the leg's encoder. A CrankAngleError
        for an invalid angle, or another KinematicsError for one without a solution, is counted
        before it is raised.
        """
        try:
            pose = self.leg.solve(self._direction * alpha + self._phase)
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
            return pose, self.leg.velocity(pose, self._direction * rate)
        except SingularPoseError:
            return pose, None
