"""The four-bar linkage as the course asks of it: its class, its limits, its merit."""

from collections.abc import Mapping, Sequence

from klann_ros.kinematics.angles import crank_angle
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.linkage.leg import Leg
from numpy.typing import ArrayLike

from . import equations, transmission
from .geometry import FourBarGeometry
from .mobility import dead_points, DeadPoint, Grashof, rocker_limits, RockerLimits
from .pose import FourBarMotion, FourBarPose
from .transmission import four_bar_table, FourBarTable


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
        self._geometry = FourBarGeometry(ground, crank, coupler, rocker, assembly)
        super().__init__(self._geometry.linkage, **settings)

    def __repr__(self) -> str:
        return f'FourBar({self._geometry!r})'

    @property
    def geometry(self) -> FourBarGeometry:
        """Return the linkage's lengths and assembly."""
        return self._geometry

    def varied(self, changes: Mapping[str, float] | None = None, **numbers: float) -> 'FourBar':
        """
        Return the four-bar with some of its lengths replaced, by their names [m].

        Raises
        ------
        GeometryError
            It is no four-bar any more, or there is no such length.

        """
        return self._made(self._geometry.varied(changes, **numbers))

    def scaled(self, factor: float) -> 'FourBar':
        """Return the four-bar scaled by a factor; raises a GeometryError unless it is positive."""
        return self._made(self._geometry.scaled(factor))

    def mirrored(self) -> 'FourBar':
        """Return the four-bar mirrored in its ground, which is its other assembly."""
        return self._made(self._geometry.mirrored())

    def inversion(self, fixed: str, assembly: int | None = None) -> 'FourBar':
        """
        Return the four-bar with another of its links held.

        The next link in the order ground, crank, coupler, rocker plays the crank then, as in
        `Grashof.inversions`: with the crank held, the coupler is driven, the rocker couples, and
        the ground is led as the rocker was.

        Parameters
        ----------
        fixed : str
            The link that is held: 'ground', 'crank', 'coupler' or 'rocker'.
        assembly : int, optional
            Of the inversion: its sign belongs to another joint. This one's sign where left out.

        Raises
        ------
        GeometryError
            There is no such link, or the assembly is not +1 or -1.

        Examples
        --------
        >>> print(FourBar(180, 80, 200, 150).inversion('crank').grashof)
        class I, double crank: ground fixed, crank rotates, coupler rotates, rocker rotates

        """
        return self._made(self._geometry.inversion(fixed, assembly))

    def _made(self, geometry: FourBarGeometry) -> 'FourBar':
        tolerance, max_crank_step, _ = self._settings
        settings = {'tolerance': tolerance, 'max_crank_step': max_crank_step}
        return FourBar(*geometry.lengths, geometry.assembly, **settings)

    def f(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """
        Return the course's f1 and f2, shape (2,) [m]; the loop closes where both are 0.

            f1 = L1 + L4 cos(theta4) - L2 cos(theta2) - L3 cos(theta3)
            f2 =      L4 sin(theta4) - L2 sin(theta2) - L3 sin(theta3)

        Parameters
        ----------
        alpha : float
            theta2, the crank's angle [rad].
        x : sequence of float, shape (2,)
            theta3, theta4 [rad].

        Raises
        ------
        CrankAngleError, ValueError
            As for `Leg.f`.

        """
        return equations.f(self._geometry, crank_angle(alpha), self._x('x', x))

    def phi(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """
        Return the Jacobian of the course's f by theta3, theta4, shape (2, 2) [m/rad]; see `f`.

            Phi = [[ L3 sin(theta3), -L4 sin(theta4)],
                   [-L3 cos(theta3),  L4 cos(theta4)]]
        """
        crank_angle(alpha)
        return equations.phi(self._geometry, self._x('x', x))

    def table(self, theta2: ArrayLike) -> FourBarTable:
        """
        Return all of the course's quantities at many crank angles at once; `print` shows it.

        Parameters
        ----------
        theta2 : array-like of real numbers
            Crank angles, of any shape [rad].

        Returns
        -------
        FourBarTable
            theta3, theta4, alpha, beta, Z, transmission angle and mechanical advantage, arrays of
            that shape; NaN where the crank cannot be.

        Raises
        ------
        ValueError
            `theta2` is no array of real numbers.

        Examples
        --------
        >>> import numpy as np
        >>> table = FourBar(180, 80, 200, 150).table(np.radians([0, 60, 120]))
        >>> np.degrees(table.theta4).round(2).tolist()
        [75.52, 72.14, 103.58]

        """
        return four_bar_table(self._geometry, theta2)

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
        'both' gives all at once, the crank's and then the rocker's of either assembly: the four
        of the course's triple rocker.

        Parameters
        ----------
        driver : str
            'crank', 'rocker' or 'both'.

        Raises
        ------
        ValueError
            `driver` is none of these.

        """
        return dead_points(self._geometry, driver)

    @property
    def rocker_limits(self) -> RockerLimits:
        """Return the limit positions of the rocker, its swing and its time ratio."""
        return rocker_limits(self._geometry, self.grashof.motion)
