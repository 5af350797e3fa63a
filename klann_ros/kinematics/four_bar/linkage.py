"""The four-bar linkage: its angles by the course's names, and the course's questions."""

from math import dist

from klann_ros.kinematics.linkage.leg import Leg
from klann_ros.kinematics.linkage.pose import Entry, LinkageMotion, LinkagePose

from . import transmission
from .dead_points import dead_points, DeadPoint, rocker_limits, RockerLimits
from .geometry import FourBarGeometry
from .grashof import Grashof

Vector = tuple[float, float]


class FourBarPose(LinkagePose):
    """
    A solved pose of a four-bar: `x` are theta3, theta4; `points` O2, A, B, O4; `h` is B.

    theta2, theta3 and theta4 are the angles of crank, coupler and rocker, counter-clockwise from
    the ground; all but theta2 in (-pi, pi] [rad].
    """

    __slots__ = ()

    theta2 = Entry('joints', 0)
    theta3 = Entry('x', 0)
    theta4 = Entry('x', 1)

    @property
    def transmission_angle(self) -> float:
        """
        Return the angle between coupler and rocker, in [0, pi] [rad].

        pi/2 transmits best; at 0 and pi they are folded or stretched out, and it is singular.
        """
        return self.transmission_angles[0]

    @property
    def z(self) -> float:
        """Return the course's Z, the length of the diagonal A O4 [m]."""
        _, a, _, o_4 = self.points.tolist()
        return dist(a, o_4)

    @property
    def clearance(self) -> float:
        """Return the distance of Z from | L3 - L4 | and L3 + L4, where it is singular [m]."""
        return self.clearances[0]

    def coupler_point(self, u: float, v: float) -> Vector:
        """
        Return a point that is fixed to the coupler.

        Parameters
        ----------
        u, v : float
            Its place on the coupler [m]: u from A along AB, v to the left of it.

        Returns
        -------
        tuple of float
            (x, y) [m].

        """
        x, y = self.points[1].tolist()
        along = complex(u, v) * self.unit_vectors[1]
        return x + along.real, y + along.imag


class FourBarMotion(LinkageMotion):
    """The velocity or the acceleration of a pose, by the course's names [rad/s, rad/s^2]."""

    __slots__ = ()

    theta2 = Entry('joints', 0)
    theta3 = Entry('joints', 1)
    theta4 = Entry('joints', 2)

    def coupler_point(self, u: float, v: float) -> Vector:
        """Return that of the pose's coupler point at u, v (x, y) [m/s] or [m/s^2]."""
        x, y = self.points[1].tolist()
        along = self.vectors[1] * complex(u, v)
        return x + along.real, y + along.imag


class FourBar(Leg[FourBarPose, FourBarMotion]):
    """
    A four-bar linkage that is solved for one crank angle after the other.

    The loop is L2 e^(i theta2) + L3 e^(i theta3) = L1 + L4 e^(i theta4), all angles
    counter-clockwise from the ground. `newton` makes the iterates of the course, from
    (theta3, theta4).

    Parameters
    ----------
    ground, crank, coupler, rocker : float
        L1, L2, L3 and L4 [m], > 0.
    assembly : int
        The sign (+1 or -1) of sin(theta4 - theta3); +1 is the open one. At a change point of
        class III both assemblies meet: it is the sign on either side, and not the motion through
        it. So `FourBar(2, 1, 2, 1)` is a parallelogram up to 180 deg, and an antiparallelogram
        from there to 360 deg.
    tolerance, max_crank_step : float
        As for every `Leg` [rad].

    Raises
    ------
    GeometryError
        The lengths or the assembly are no linkage; the text says why.

    """

    pose_class = FourBarPose
    motion_class = FourBarMotion

    def __init__(
        self,
        ground: float,
        crank: float,
        coupler: float,
        rocker: float,
        assembly: int = 1,
        **settings: float,
    ) -> None:
        """Start without a pose."""
        self._geometry = FourBarGeometry(ground, crank, coupler, rocker, assembly)
        super().__init__(self._geometry.linkage, **settings)

    def __repr__(self) -> str:
        return f'FourBar({self._geometry!r})'

    @property
    def geometry(self) -> FourBarGeometry:
        """Return the linkage's lengths and assembly."""
        return self._geometry

    def transmission_angle(self, theta2: float) -> float:
        """
        Return the angle between coupler and rocker at a crank angle, in [0, pi] [rad].

        Parameters
        ----------
        theta2 : float
            Crank angle [rad].

        Raises
        ------
        CrankAngleError
            `theta2` is not finite, or beyond +-1e6 rad.
        UnreachableError
            Coupler and rocker do not meet at this crank angle.

        """
        return transmission.transmission_angle(self._geometry, theta2)

    @property
    def transmission_extremes(self) -> transmission.TransmissionExtremes:
        """Return the least and the greatest transmission angle that can be reached, and where."""
        return transmission.transmission_extremes(self._geometry)

    def mechanical_advantage(self, theta2: float) -> float:
        """
        Return T4 / T2 = w2 / w4 at a crank angle; see `transmission.mechanical_advantage`.

        inf at a limit position of the rocker, 0 where coupler and rocker are in line, NaN where
        all links are.

        Parameters
        ----------
        theta2 : float
            Crank angle [rad].

        Raises
        ------
        CrankAngleError
            `theta2` is not finite, or beyond +-1e6 rad.
        UnreachableError
            Coupler and rocker do not meet at this crank angle.

        """
        return transmission.mechanical_advantage(self._geometry, theta2)

    @property
    def grashof(self) -> Grashof:
        """
        Return what Grashof's law says of the linkage.

        Its attributes: `class_`, `margin` [m], `type_` with its parts `shape` and `motion`,
        `roles` of the links, and `inversions`, the same with another link held.
        """
        return Grashof(self._geometry.lengths)

    def dead_points(self, driver: str = 'crank') -> list[DeadPoint]:
        """
        Return where a driver stops, by its angle; none where it turns fully.

        Those of the crank belong to both assemblies. Those of the rocker are this assembly's; the
        other assembly has them mirrored, so that a rocker of class II has one of each assembly.

        Parameters
        ----------
        driver : str
            'crank' or 'rocker'.

        Raises
        ------
        ValueError
            `driver` is neither.

        """
        return dead_points(self._geometry, driver)

    @property
    def rocker_limits(self) -> RockerLimits:
        """Return the limit positions of the rocker, its swing and its time ratio."""
        return rocker_limits(self._geometry, self.grashof.motion)
