"""What a leg's solver did since the last report: counts and worst figures."""

from math import nan, pi, sin

from klann_ros.kinematics import KlannPose


class SolverFigures:
    """
    Counts since the start, and the worst figures since the last report.

    Attributes
    ----------
    solved, rejected, failed, out_of_order : int
        Answers published; inputs that were no crank angle; angles that could not be solved;
        inputs older than the one before. Since the start.
    failure : str
        What failed last since the last report; empty when nothing did.
    rejection : str
        What was rejected last since the last report; empty when nothing was.
    iterations : int
        The most Newton iterations of a pose.
    residual : float
        The largest residual [m]; NaN without any pose.
    worst_1, worst_2 : KlannPose or None
        The pose in which dyad 1, dyad 2, was nearest to singular; None without any pose.
    inputs : int
        Inputs since the last report.

    """

    def __init__(self) -> None:
        """Start from nothing."""
        self.solved = self.rejected = self.failed = self.out_of_order = 0
        self.reported()

    def reported(self) -> None:
        """Begin a new report: forget the worst figures, keep the counts."""
        self.failure = self.rejection = ''
        self.inputs = self.iterations = 0
        self.residual = nan
        self.worst_1: KlannPose | None = None
        self.worst_2: KlannPose | None = None
        self._least_1 = self._least_2 = 2.0

    def solve(self, pose: KlannPose) -> None:
        """Count a solved pose."""
        self.solved += 1
        self.inputs += 1
        self.iterations = max(self.iterations, pose.iterations)
        self.residual = max(pose.residual, self.residual)
        sine_1, sine_2 = abs(sin(pose.gamma + pose.beta)), abs(sin(pose.delta + pose.theta))
        if sine_1 < self._least_1:
            self._least_1, self.worst_1 = sine_1, pose
        if sine_2 < self._least_2:
            self._least_2, self.worst_2 = sine_2, pose

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

    @property
    def transmission_angles(self) -> tuple[float, float]:
        """Return the worst transmission angle of each dyad [rad]; NaN without any pose."""
        if self.worst_1 is None or self.worst_2 is None:
            return nan, nan
        return self.worst_1.transmission_angles[0], self.worst_2.transmission_angles[1]

    @property
    def from_singular(self) -> float:
        """Return the least min(mu, pi - mu) of both dyads [rad]; NaN without any pose."""
        return min(min(mu, pi - mu) for mu in self.transmission_angles)

    @property
    def condition(self) -> float:
        """Return the condition of Phi where a dyad was nearest to singular; NaN without pose."""
        worst = (self.worst_1, self.worst_2)
        return max((pose.condition for pose in worst if pose is not None), default=nan)
