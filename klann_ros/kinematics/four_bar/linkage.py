"""The four-bar: its pose by the course's names, its class, limits and mechanical advantage."""

from cmath import rect
from collections.abc import Sequence
from math import atan2, dist, inf, nan, pi, radians, sqrt
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import crank_angle, TURN
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.batch.tables import LegTable, table_of
from klann_ros.kinematics.errors import GeometryError
from klann_ros.kinematics.linkage import pose
from klann_ros.kinematics.linkage.change_points import PARALLEL
from klann_ros.kinematics.linkage.leg import Leg
from klann_ros.kinematics.linkage.reach import crank_limits, triangle_angle
from klann_ros.sanitize.text import did_you_mean
import numpy as np
from numpy.typing import ArrayLike

from .geometry import FourBarGeometry, LENGTHS
from .mobility import dead_points, DeadPoint, Grashof, rocker_limits, RockerLimits

# Transmission angle limits for large forces (Norton, Design of Machinery).
MIN_TRANSMISSION_ANGLE, MAX_TRANSMISSION_ANGLE = radians(40.0), radians(140.0)


class FourBarPose(pose.LinkagePose):
    """
    A solved pose of a four-bar: `x` are theta3, theta4; `points` O2, A, B, O4; `h` is B.

    theta2, theta3 and theta4 are the angles of crank, coupler and rocker, counter-clockwise from
    the ground; all but theta2 in (-pi, pi] [rad]. alpha and beta are the course's angles at O4,
    and not the crank's: that is theta2.
    """

    __slots__ = ()

    theta2 = pose.PoseEntry('joints', 0)
    theta3 = pose.PoseEntry('x', 0)
    theta4 = pose.PoseEntry('x', 1)

    @property
    def transmission_angle(self) -> float:
        """Return the angle between coupler and rocker, in [0, pi] [rad]; singular at both."""
        return self.transmission_angles[0]

    @property
    def z(self) -> float:
        """Return the course's Z, the length of the diagonal A O4 [m]."""
        a = self.points[1].tolist()
        o_4 = self.points[3].tolist()
        return dist(a, o_4)

    @property
    def alpha(self) -> float:
        """
        Return the course's alpha, the angle at O4 from the rocker to Z = `|A O4|`, 0 to pi [rad].

            cos alpha = (Z^2 + L4^2 - L3^2) / (2 Z L4)

        theta4 = 180 deg - (alpha + beta) in the open assembly (+1), 180 deg + alpha - beta in the
        crossed one, modulo a turn.

        References
        ----------
        "Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples, example 1.

        """
        numbers = self.linkage.dimensions
        return float(triangle_angle(self.z, numbers['rocker'], numbers['coupler']))

    @property
    def beta(self) -> float:
        """
        Return the course's beta, the angle at O4 from the ground to Z, in [0, 2 pi) [rad].

            cos beta = (Z^2 + L1^2 - L2^2) / (2 Z L1)

        It is up to 180 deg where the crank is above the ground, and beyond where it is below it.
        """
        _, (x, y), _, (x_4, _) = self.points.tolist()
        return atan2(y, x_4 - x) % TURN

    @property
    def clearance(self) -> float:
        """Return the distance of Z from | L3 - L4 | and L3 + L4, where it is singular [m]."""
        return self.clearances[0]


class FourBarMotion(pose.LinkageMotion):
    """The velocity or the acceleration of a pose, by the course's names [rad/s, rad/s^2]."""

    __slots__ = ()

    theta2 = pose.PoseEntry('joints', 0)
    theta3 = pose.PoseEntry('joints', 1)
    theta4 = pose.PoseEntry('joints', 2)


class TransmissionExtremes(NamedTuple):
    """
    The least and the greatest transmission angle over the crank angles that can be reached.

    `least` and `greatest` are in [0, pi], `least_at` and `greatest_at` the crank angles where they
    occur, in (-pi, pi] [rad]: 0 or pi, or the two ends of what can be reached.
    """

    least: float
    least_at: tuple[float, ...]
    greatest: float
    greatest_at: tuple[float, ...]

    @property
    def good(self) -> bool:
        """Return whether the angle stays within 40 .. 140 deg, as good practice has it."""
        return self.least >= MIN_TRANSMISSION_ANGLE and self.greatest <= MAX_TRANSMISSION_ANGLE


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
        The sign (+1 or -1) of sin(theta4 - theta3); +1 is the open one. In class III it is that
        just after theta2 = 0.
    at_change_points : str
        How it goes on at the change points of class III: see `FourBarGeometry`. So
        `FourBar(2, 1, 2, 1)` is a parallelogram all the way round, its other assembly, and
        'crossed', an antiparallelogram.
    unit : str
        The unit of the lengths on axes and in texts, such as 'mm'; by default none is named.
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
        *,
        at_change_points: str = PARALLEL,
        unit: str = '',
        **settings: float,
    ) -> None:
        lengths = ground, crank, coupler, rocker
        self._geometry = FourBarGeometry(*lengths, assembly, at_change_points, unit)
        super().__init__(self._geometry.linkage, **settings)

    def __repr__(self) -> str:
        return f'FourBar({self._geometry!r})'

    @property
    def geometry(self) -> FourBarGeometry:
        """Return the linkage's lengths and assembly."""
        return self._geometry

    def inversion(self, fixed: str, assembly: int | None = None) -> 'FourBar':
        """
        Return the four-bar with another of its links held, in this assembly or another.

        A GeometryError says that there is no such link.

        Examples
        --------
        >>> print(FourBar(180, 80, 200, 150).inversion('crank').grashof)
        class I, double crank: ground fixed, crank rotates, coupler rotates, rocker rotates

        """
        if fixed not in LENGTHS:
            hint = did_you_mean(fixed, LENGTHS)
            msg = f'fixed = {fixed!r} is refused: it must be one of {", ".join(LENGTHS)}{hint}'
            raise GeometryError(msg)
        first = LENGTHS.index(fixed)
        lengths = self._geometry.lengths
        ground, crank, coupler, rocker = lengths[first:] + lengths[:first]
        tolerance, max_crank_step, _ = self._settings
        settings: dict[str, Any] = {'tolerance': tolerance, 'max_crank_step': max_crank_step}
        settings['at_change_points'] = self._geometry.at_change_points
        settings['unit'] = self._geometry.unit
        sign = self._geometry.assembly if assembly is None else assembly
        return FourBar(ground, crank, coupler, rocker, sign, **settings)

    def f(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """
        Return the course's f1 and f2 at theta2 and x = (theta3, theta4), shape (2,) [m].

            f1 = L1 + L4 cos(theta4) - L2 cos(theta2) - L3 cos(theta3)
            f2 =      L4 sin(theta4) - L2 sin(theta2) - L3 sin(theta3)

        Parameters and errors as for `Leg.f`.
        """
        # The linkage's loop leads the other way round.
        return -super().f(alpha, x)

    def phi(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """
        Return the Jacobian of the course's f by theta3, theta4, shape (2, 2) [m/rad]; see `f`.

            Phi = [[ L3 sin(theta3), -L4 sin(theta4)],
                   [-L3 cos(theta3),  L4 cos(theta4)]]
        """
        return -super().phi(alpha, x)

    def table(self, alphas: ArrayLike, crank_rate: float | None = None) -> LegTable:
        """
        Return all of the course's quantities at many crank angles at once; `print` shows it.

        The columns are theta2, theta3, theta4, alpha, beta, z in the unit of the lengths,
        transmission_angle and mechanical_advantage; a crank rate adds those of `Leg.table`, whose
        parameters and errors it has.

        Examples
        --------
        >>> import numpy as np
        >>> table = FourBar(180, 80, 200, 150).table(np.radians([0, 60, 120]))
        >>> np.degrees(table.theta4).round(2).tolist()
        [75.52, 72.14, 103.58]

        """
        table = super().table(alphas, crank_rate)
        geometry = self._geometry
        x = table['A.x'] - geometry.ground
        y = table['A.y']
        z = np.hypot(x, y)
        columns = {name: (table[name], 'rad') for name in self.joint_names}
        columns['alpha'] = triangle_angle(z, geometry.rocker, geometry.coupler), 'rad'
        columns['beta'] = np.arctan2(y, -x) % TURN, 'rad'
        columns['z'] = z, geometry.unit
        columns['transmission_angle'] = triangle_angle(geometry.coupler, geometry.rocker, z), 'rad'
        angles = table.theta2, table.theta3, table.theta4
        columns['mechanical_advantage'] = self._advantage(*angles), '1'
        if crank_rate is not None:
            others = zip(table.columns.values(), table.units, strict=True)
            columns |= dict(zip(table.columns, others, strict=True))
        return table_of(columns)

    def transmission_angle(self, theta2: float) -> float:
        """
        Return the angle mu between coupler and rocker at a crank angle, in [0, pi] [rad].

            cos mu = (L3^2 + L4^2 - L1^2 - L2^2 + 2 L1 L2 cos theta2) / (2 L3 L4)

        computed as the angle opposite Z = `|A O4|`. Both assemblies have the same.

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

        References
        ----------
        "Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples, "Angulo de transmissao".

        """
        theta2 = crank_angle(theta2)
        (dyad,) = self.linkage.blocks
        geometry = self._geometry
        to_a = geometry.ground - rect(geometry.crank, theta2)
        if -dyad.dyad_solver.clearance(to_a) > dyad.dyad_solver.dyad.contact_rounding:
            pose.closed_form_vectors(self.linkage, theta2)  # whose error has the missing length
        return float(triangle_angle(geometry.coupler, geometry.rocker, abs(to_a)))

    @property
    def transmission_extremes(self) -> TransmissionExtremes:
        """Return the least and the greatest transmission angle that can be reached, and where."""
        first, last = crank_limits(self._geometry.lengths)
        # mu grows with |theta2|; at the ends of the reach coupler and rocker are in line.
        min_angle = self.transmission_angle(0.0) if first == 0.0 else 0.0
        max_angle = self.transmission_angle(pi) if last == pi else pi
        return TransmissionExtremes(
            least=min_angle,
            least_at=(0.0,) if first == 0.0 else (-first, first),
            greatest=max_angle,
            greatest_at=(pi,) if last == pi else (-last, last),
        )

    def mechanical_advantage(self, theta2: float) -> float:
        """
        Return the mechanical advantage T4 / T2 = w2 / w4 at a crank angle.

            T4 / T2 = L4 sin(theta4 - theta3) / (L2 sin(theta2 - theta3))

        It is negative where rocker and crank turn in opposite directions; inf, without a sign
        since it changes there, where crank and coupler are in line (a limit position of the
        rocker); 0 where coupler and rocker are in line; NaN where all links are, at a change
        point. Parameters and errors as for `transmission_angle`.
        """
        theta2 = crank_angle(theta2)
        return float(self._advantage(theta2, *pose.initial_guess(self.linkage, theta2)))

    def _advantage(self, theta2: Any, theta3: Any, theta4: Any) -> Any:
        """Return the mechanical advantage of one pose, or of arrays of poses."""
        crank_sine = np.sin(theta2 - theta3)
        rocker_sine = np.sin(theta4 - theta3)
        (dyad,) = self.linkage.blocks
        geometry = self._geometry
        # The rounding of theta3 grows as coupler and rocker come in line.
        rounding = dyad.rounding / min(geometry.crank, geometry.coupler)
        with np.errstate(divide='ignore', invalid='ignore'):
            ratio = geometry.rocker * rocker_sine / (geometry.crank * crank_sine)
        ratio = np.where(np.abs(crank_sine * rocker_sine) <= rounding, inf, ratio)
        in_line = np.where(np.abs(crank_sine) <= sqrt(rounding), nan, 0.0)
        return np.where(np.abs(rocker_sine) <= dyad.singular_sine, in_line, ratio)

    @property
    def grashof(self) -> Grashof:
        """
        Return the four-bar's class by Grashof's law.

        Its attributes: `class_`, `margin` [m], `type_` with its parts `shape` and `motion`,
        `roles` of the links, and `inversions`, the same with another link held.
        """
        return Grashof(self._geometry.lengths)

    def dead_points(self, driver: str = 'crank') -> list[DeadPoint]:
        """
        Return the dead points of a driver, by its angle; none where it turns fully.

        Those of the crank are the ends of its reach, where both assemblies meet: two for each
        kind, one on each side. Those of the rocker are this assembly's, at most one for each
        kind; the other assembly has them mirrored, so that a rocker of class II has one of each
        assembly. A change point, where all links are in line and the driver passes, is no dead
        point. 'both' gives all at once, the crank's and then the rocker's of either assembly: the
        four of the course's triple rocker.

        Parameters
        ----------
        driver : str
            'crank', 'rocker' or 'both'.

        Raises
        ------
        ValueError
            `driver` is none of these.

        References
        ----------
        "Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples, "Posicoes de ponto
        morto".

        """
        return dead_points(self._geometry, driver)

    @property
    def rocker_limits(self) -> RockerLimits:
        """Return the limit positions of the rocker, its swing and its time ratio."""
        return rocker_limits(self._geometry, self.grashof.motion)
