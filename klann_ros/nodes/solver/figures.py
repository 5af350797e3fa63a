"""What a leg's solver did since the last report: counts and worst figures."""

from math import nan, pi

from klann_ros.kinematics import LinkagePose


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
        What was rejected last since the last report; empty when nothing was.
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
        """Start from nothing."""
        self.solved = self.rejected = self.failed = 0
        self.reported()

    def reported(self) -> None:
        """Begin a new report: forget the worst figures, keep the counts."""
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
        """Return the worst angle of each of so many dyads [rad]; NaN without any pose."""
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
