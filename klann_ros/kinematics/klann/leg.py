"""The Klann leg: its angles by the textbook's names."""

from klann_ros.kinematics.linkage.leg import Leg
from klann_ros.kinematics.linkage.pose import LinkageMotion, LinkagePose, PoseEntry

from .geometry import KlannGeometry, STRUCTURE

JOINTS = STRUCTURE.angles
"""The names under which the angles are published and drawn, the crank's first."""


class KlannPose(LinkagePose):
    """
    A solved pose of the Klann leg: `x` are gamma, beta, delta, theta; `points` A to H.

    gamma (the coupler) and theta (the leg) are clockwise; beta is the lower rocker's angle, delta
    the upper one's. All but alpha are in (-pi, pi] [rad].
    """

    __slots__ = ()

    gamma = PoseEntry('x', 0)
    beta = PoseEntry('x', 1)
    delta = PoseEntry('x', 2)
    theta = PoseEntry('x', 3)


class KlannMotion(LinkageMotion):
    """The velocity or the acceleration of a pose, by the textbook's names [rad/s, rad/s^2]."""

    __slots__ = ()

    alpha = PoseEntry('joints', 0)
    gamma = PoseEntry('joints', 1)
    beta = PoseEntry('joints', 2)
    delta = PoseEntry('joints', 3)
    theta = PoseEntry('joints', 4)


class KlannLeg(Leg[KlannPose, KlannMotion]):
    """
    A Klann leg that is solved for one crank angle after the other.

    Its `newton` makes the iterates of SEM 104, from (gamma, beta, delta, theta).

    Parameters
    ----------
    geometry : KlannGeometry, optional
        The leg; SEM 104's where it is left out.
    tolerance, max_crank_step : float
        As for every `Leg` [rad].

    Raises
    ------
    TypeError
        `geometry` is no KlannGeometry.

    """

    pose_class = KlannPose
    motion_class = KlannMotion

    def __init__(self, geometry: KlannGeometry | None = None, **settings: float) -> None:
        if not isinstance(geometry, KlannGeometry | None):
            msg = f'geometry = {geometry!r} is refused: it must be a KlannGeometry'
            raise TypeError(msg)
        self._geometry = geometry or KlannGeometry.sem104()
        super().__init__(self._geometry.linkage, **settings)

    def __repr__(self) -> str:
        return f'KlannLeg({self._geometry!r})'

    @property
    def geometry(self) -> KlannGeometry:
        """Return the leg's dimensions."""
        return self._geometry
