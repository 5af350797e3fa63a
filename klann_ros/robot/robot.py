"""A robot: legs on a body, each with its crank."""

from dataclasses import dataclass, replace
from math import cos, pi, sin
from typing import TYPE_CHECKING

from klann_ros.dynamics import MassError, Masses, with_rods
from klann_ros.kinematics import Linkage
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.sanitize.yaml_text import parse
import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from klann_ros.dynamics import Dynamics

Triple = tuple[float, float, float]

SEPARATORS = ('/', '_')
"""Separators between a leg's name and its joint's in JointState and URDF."""


@dataclass(frozen=True)
class Mount:
    """
    The pose of a leg's plane in base_link: x forward, y left, z up (REP 103).

    `xyz` is the plane's origin [m], `rpy` are roll, pitch and yaw about the fixed axes x, y, z in
    this order, as in a URDF [rad].
    """

    xyz: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (pi / 2, 0.0, 0.0)

    @property
    def rotation(self) -> FloatArray:
        """Return the rotation matrix: the plane's axes in base_link as columns, shape (3, 3)."""
        cos_x, cos_y, cos_z = map(cos, self.rpy)
        sin_x, sin_y, sin_z = map(sin, self.rpy)
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, cos_x, -sin_x], [0.0, sin_x, cos_x]])
        about_y = np.array([[cos_y, 0.0, sin_y], [0.0, 1.0, 0.0], [-sin_y, 0.0, cos_y]])
        about_z = np.array([[cos_z, -sin_z, 0.0], [sin_z, cos_z, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(about_z @ about_y @ about_x, dtype=np.float64)

    def rotate(self, vectors: ArrayLike) -> FloatArray:
        """Return vectors (x, y) of the plane in base_link: shape (..., 2) to (..., 3)."""
        return np.array(np.asarray(vectors, dtype=np.float64) @ self.rotation[:, :2].T)

    def transform(self, points: ArrayLike) -> FloatArray:
        """Return points (x, y) of the plane in base_link: shape (..., 2) to (..., 3) [m]."""
        return np.asarray(self.rotate(points) + np.array(self.xyz))


@dataclass(frozen=True)
class CrankDrive:
    """
    The encoder and the motor of a crank, as they are wired and mounted.

    `encoder_ratio` and `motor_ratio` are the turns of the encoder, and the turns that have to be
    commanded, by turn of the crank; they are negative where one goes against the other. `zero` is
    the angle of the crank that the encoder shows at the crank's zero [rad].
    """

    encoder_ratio: float = 1.0
    motor_ratio: float = 1.0
    zero: float = 0.0

    def measured(self, position: float, velocity: float | None) -> tuple[float, float | None]:
        """Return angle and rate of the crank by its encoder's position and velocity."""
        rate = None if velocity is None else velocity / self.encoder_ratio
        return position / self.encoder_ratio - self.zero, rate

    def commanded(self, angle: float, rate: float) -> tuple[float, float]:
        """Return the position, as the encoder shows it, and the velocity to command."""
        return (angle + self.zero) * self.encoder_ratio, rate * self.motor_ratio


@dataclass(frozen=True)
class RobotLeg:
    """
    A leg of a robot.

    Attributes
    ----------
    name : str
        '' for the only, unnamed one.
    linkage : Linkage
        The linkage.
    crank_joint : str
        The joint of its crank.
    phase : float
        Its crank angle at joint position 0 [rad].
    direction : int
        +1, or -1 for a crank that turns opposite to its joint.
    mount : Mount
        Its pose in base_link.
    masses : Masses, optional
        Its masses, if the file has them.
    description : str
        The text of its linkage's file; '' for a Klann leg by its lengths.
    linkage_file : str
        The name of that file.
    drive : CrankDrive
        Encoder and motor of its crank.

    """

    name: str
    linkage: Linkage
    crank_joint: str = 'crank'
    phase: float = 0.0
    direction: int = 1
    mount: Mount = Mount()
    masses: Masses | None = None
    description: str = ''
    linkage_file: str = ''
    drive: CrankDrive = CrankDrive()

    @property
    def has_foot(self) -> bool:
        """Return whether its point is a foot: without its file's word, if no body guides it."""
        content = parse(self.description) if self.description else {}
        return bool(content.get('leg', not any(self.linkage.structure.foot_guides)))

    @property
    def encoder_direction(self) -> float:
        """Return the turns of the crank by turn of the encoder."""
        return self.direction / self.drive.encoder_ratio

    @property
    def encoder_phase(self) -> float:
        """Return the crank angle where the encoder shows 0 [rad]."""
        return self.phase - self.direction * self.drive.zero

    @property
    def prefix(self) -> str:
        """Return the prefix of its joints and frames: '' or 'front_left/'."""
        return f'{self.name}/' if self.name else ''

    def joint_name(self, joint: str, separator: str) -> str:
        """Return the full name of one of its joints, such as 'front_left_gamma'."""
        return f'{self.name}{separator}{joint}' if self.name else joint

    def crank_angles(self, joint: ArrayLike) -> FloatArray:
        """Return the crank angles at joint positions [rad]."""
        return self.direction * np.asarray(joint, dtype=np.float64) + self.phase


@dataclass(frozen=True)
class WalkerBody:
    """
    The body of a walker: a box.

    `mass` is > 0 [kg]; `size` is along x, y and z of base_link, and `centre` is the centre of the
    box and of its mass in base_link [m].
    """

    mass: float
    size: Triple
    centre: Triple = (0.0, 0.0, 0.0)

    @property
    def inertia(self) -> Triple:
        """Return the moments of inertia of a homogeneous box about its centre [kg m^2]."""
        x, y, z = (self.mass * side * side / 12.0 for side in self.size)
        return y + z, x + z, x + y


@dataclass(frozen=True)
class Robot:
    """
    A leg on a stand, or a walker.

    `name` is the file's, without folder and ending, `source` the file, for messages; `body` is
    there if the file has its mass.
    """

    name: str
    legs: tuple[RobotLeg, ...]
    body: WalkerBody | None = None
    source: str = ''

    @property
    def is_walker(self) -> bool:
        """Return whether the robot has several legs."""
        return len(self.legs) > 1

    @property
    def crank_joints(self) -> tuple[str, ...]:
        """Return the unique joints of the cranks."""
        return tuple(dict.fromkeys(leg.crank_joint for leg in self.legs))

    def leg(self, name: str) -> RobotLeg | None:
        """Return the leg of a name; if there is none, the first leg of a robot with equal legs."""
        for leg in self.legs:
            if leg.name == name:
                return leg
        first = self.legs[0]
        return first if all(leg.linkage == first.linkage for leg in self.legs) else None

    def built_as(self, built: 'Robot') -> 'Robot':
        """
        Return the robot with the dimensions and encoder zeros of a built one.

        Parameters
        ----------
        built : Robot
            Its legs by their names; a single unnamed one stands for all.

        Raises
        ------
        ValueError
            A leg is not in it, or is of another structure.

        """
        legs = []
        for leg in self.legs:
            built_leg = built.leg(leg.name)
            if built_leg is None or built_leg.linkage.structure != leg.linkage.structure:
                name = leg.name or 'the leg'
                msg = f'{built.source or built.name} does not have {name}, or as another linkage'
                raise ValueError(msg)
            legs.append(replace(leg, linkage=built_leg.linkage, phase=built_leg.phase))
        return replace(self, legs=tuple(legs))

    def with_rods(self, density: float, *, slider_length: float = 0.0) -> 'Robot':
        """
        Return the robot with slender rods [kg/m] in place of the masses of bars in its file.

        Raises
        ------
        MassError
            The density is invalid.

        """
        legs = []
        for leg in self.legs:
            masses = with_rods(leg.masses, leg.linkage, density, slider_length=slider_length)
            legs.append(replace(leg, masses=masses))
        return replace(self, legs=tuple(legs))

    def joint_names(self, separator: str) -> tuple[str, ...]:
        """
        Return the published joint names of all legs.

        Raises
        ------
        ValueError
            Two legs have joints of one name.

        """
        owners: dict[str, str] = {}
        for leg in self.legs:
            for joint in leg.linkage.joint_names:
                name = leg.joint_name(joint, separator)
                if name in owners:
                    legs = f'{owners[name]} and {leg.name}'
                    msg = f'legs {legs} both have a joint {name}: joint_separator must be /'
                    raise ValueError(msg)
                owners[name] = leg.name
        return tuple(owners)

    @property
    def drives(self) -> dict[str, CrankDrive]:
        """Return encoder and motor of each crank joint."""
        return {leg.crank_joint: leg.drive for leg in self.legs}

    def on_joint(self, joint: str) -> tuple[RobotLeg, ...]:
        """Return the legs driven by a joint."""
        return tuple(leg for leg in self.legs if leg.crank_joint == joint)

    def dynamics(self, leg: RobotLeg) -> 'Dynamics':
        """
        Return the dynamics of a leg, with gravity along -z of base_link.

        Raises
        ------
        MassError
            The file has no masses; the text says which are missing.

        """
        # The solver of many poses is not loaded where a robot only turns or is drawn.
        from klann_ros.dynamics import Dynamics, GRAVITY  # noqa: PLC0415

        if leg.masses is None:
            missing = 'bar_density [kg/m] is missing, or what `export FILE --weighed OUT` writes'
            raise MassError(f'{self.source or self.name} has no masses: {missing}')
        x, y, _ = leg.mount.rotation.T @ (0.0, 0.0, -GRAVITY)
        return Dynamics(leg.linkage, leg.masses, gravity=(float(x), float(y)))
