"""A pose of the four-bar, and its motion, by the course's names."""

from math import atan2, dist

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.linkage.pose import LinkageMotion, LinkagePose, PoseEntry
from klann_ros.kinematics.linkage.reach import triangle_angle

Vector = tuple[float, float]


class FourBarPose(LinkagePose):
    """
    A solved pose of a four-bar: `x` are theta3, theta4; `points` O2, A, B, O4; `h` is B.

    theta2, theta3 and theta4 are the angles of crank, coupler and rocker, counter-clockwise from
    the ground; all but theta2 in (-pi, pi] [rad]. alpha and beta are the course's angles at O4,
    and not the crank's: that is theta2.
    """

    __slots__ = ()

    theta2 = PoseEntry('joints', 0)
    theta3 = PoseEntry('x', 0)
    theta4 = PoseEntry('x', 1)

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
        return triangle_angle(self.z, numbers['rocker'], numbers['coupler'])

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
        along = complex(u, v) * complex(self.vectors[1])
        return x + along.real, y + along.imag


class FourBarMotion(LinkageMotion):
    """The velocity or the acceleration of a pose, by the course's names [rad/s, rad/s^2]."""

    __slots__ = ()

    theta2 = PoseEntry('joints', 0)
    theta3 = PoseEntry('joints', 1)
    theta4 = PoseEntry('joints', 2)

    def coupler_point(self, u: float, v: float) -> Vector:
        """Return that of the pose's coupler point at u, v (x, y) [m/s] or [m/s^2]."""
        x, y = self.points[1].tolist()
        along = complex(self.vectors[1]) * complex(u, v)
        return x + along.real, y + along.imag
