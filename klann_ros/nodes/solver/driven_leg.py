"""One of the legs that a node solves: its crank, its solver, and what that did so far."""

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


class SolverFigures:
    """
    Counts since the start, and the worst figures since the last report.

    Attributes
    ----------
    solved, rejected, failed : int
        Answers published; inputs that were no crank angle; angles that could not be solved. Since
        the start.
    failure : str
        What failed last since the last report; empty when nothing did.
    rejection : str
        The last rejection since the last report; empty if there was none.
    iterations : int
        The most Newton iterations of a pose.
    residual : float
        The largest residual [m]; NaN without any pose.
    worst : list of pose
        For each dyad, the pose in which it was nearest to singular; empty without any pose.
    inputs : int
        Inputs since the last report.

    """

    def __init__(self) -> None:
        self.solved = self.rejected = self.failed = 0
        self.begin_report()

    def begin_report(self) -> None:
        """Forget the worst figures, keep the counts."""
        self.failure = self.rejection = ''
        self.inputs = self.iterations = 0
        self.residual = nan
        self.worst: list[LinkagePose] = []
        self._least: list[float] = []

    def solve(self, pose: LinkagePose) -> None:
        """Count a solved pose."""
        self.solved += 1
        self.inputs += 1
        self.iterations = max(self.iterations, pose.iterations)
        self.residual = max(pose.residual, self.residual)
        sines = pose.sines
        if not self.worst:
            self.worst, self._least = [pose] * len(sines), list(sines)
        for i, sine in enumerate(sines):
            if sine < self._least[i]:
                self._least[i], self.worst[i] = sine, pose

    def reject(self, reason: str) -> None:
        """Count an input that was no crank angle."""
        self.rejected += 1
        self.inputs += 1
        self.rejection = reason

    def fail(self, reason: str) -> None:
        """Count a crank angle that could not be solved."""
        self.failed += 1
        self.inputs += 1
        self.failure = reason

    def transmission_angles(self, count: int) -> tuple[float, ...]:
        """Return the worst transmission angle of each dyad [rad]; NaN without any pose."""
        worst = (pose.transmission_angles[i] for i, pose in enumerate(self.worst))
        return tuple(worst) or (nan,) * count

    @property
    def from_singular(self) -> float:
        """Return the least min(mu, pi - mu) of all dyads [rad]; NaN without any pose."""
        angles = self.transmission_angles(len(self.worst))
        return min((min(mu, pi - mu) for mu in angles), default=nan)

    @property
    def condition(self) -> float:
        """Return the condition of Phi where a dyad was nearest to singular; NaN without pose."""
        return max((pose.condition for pose in self.worst), default=nan)


@dataclass(eq=False)
class DrivenLeg:
    """A leg with the crank that drives it, and what its solver did since the last report."""

    # Its geometry and its drive.
    robot_leg: RobotLeg
    # Its solver.
    leg: AnyLeg
    # What stands between its name and its joints' in JointState.
    joint_separator: str = '/'
    # What its solver did.
    figures: SolverFigures = field(default_factory=SolverFigures, init=False)
    # The last pose; None before the first.
    last: LinkagePose | None = field(default=None, init=False)

    @property
    def name(self) -> str:
        """Return its name; empty for the only, unnamed one."""
        return self.robot_leg.name

    @property
    def crank_joint(self) -> str:
        """Return the joint in crank_state that turns its crank."""
        return self.robot_leg.crank_joint

    def prefixed(self, word: str) -> str:
        """Return a topic's or frame's name as it is for this leg."""
        return self.robot_leg.prefix + word

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names under which its angles are published, the crank's first."""
        names = self.leg.joint_names
        return tuple(self.robot_leg.joint_name(name, self.joint_separator) for name in names)

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
        try:
            pose = self.leg.solve(self.robot_leg.direction * alpha + self.robot_leg.phase)
        except CrankAngleError as error:
            self.figures.reject(str(error))
            raise
        except KinematicsError as error:
            self.figures.fail(str(error))
            raise
        self.figures.solve(pose)
        self.last = pose
        if rate is None:
            return pose, None
        try:
            return pose, self.leg.velocity(pose, self.robot_leg.direction * rate)
        except SingularPoseError:
            return pose, None
