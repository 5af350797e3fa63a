"""A simulated robot in the engine: its motors, sensors and readings, in real time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from importlib import import_module
from math import cos, degrees, exp, isfinite
from typing import Any, NamedTuple

from klann_ros.kinematics.arrays import FloatArray
from klann_ros.missing_package import install_command
from klann_ros.robot import Robot
from klann_ros.sanitize.text import did_you_mean, printable, printable_line, refusal
import numpy as np

from .mjcf import FLAT, Floor, robot_mjcf


class TwinError(ValueError):
    """An invalid simulated robot or command; the text says why."""


class NoMujocoError(ImportError):
    """The physics engine is not installed; the text says how to install it."""


def engine() -> Any:
    """Return the module of the physics engine, imported when it is used, or a NoMujocoError."""
    try:
        return import_module('mujoco')
    except ImportError as error:
        raise NoMujocoError(
            f'the physics engine is not installed: {install_command("mujoco", "sim")}'
        ) from error


def _require(condition: bool, name: str, value: float, rule: str) -> None:
    if not condition:
        raise TwinError(refusal(name, value, rule))


@dataclass(frozen=True)
class Motors:
    """
    The drives of the cranks: a velocity servo for each joint.

    `bandwidth` is that of the first-order response of the speed, `max_velocity` its saturation,
    both > 0 [rad/s]; `factors` are those of the speeds of joints, 1 by default.
    """

    bandwidth: float = 50.0
    max_velocity: float = 20.0
    factors: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse invalid motors."""
        for name in ('bandwidth', 'max_velocity'):
            value = getattr(self, name)
            _require(isfinite(value) and value > 0.0, name, value, 'finite and > 0')
        for joint, factor in self.factors.items():
            _require(isfinite(factor), f'factor of {printable(joint)}', factor, 'finite')


class ImuSampling(Enum):
    """Whether a reading is the mean since the last one, as of a filter, or of one instant."""

    MEAN = 'mean'
    INSTANT = 'instant'


# Standard deviation of a point that a camera mistakes for another [m].
OUTLIER_SIZE = 0.05


@dataclass(frozen=True)
class Sensors:
    """Sensor noise: standard deviations of white noise."""

    encoder_noise: float = 0.0  #: of the angle of a crank [rad]
    velocity_noise: float = 0.0  #: of its rate [rad/s]
    encoder_offset: float = 0.0  #: constant error of all encoders [rad]
    gyro_noise: float = 0.0  #: of each component [rad/s]
    accelerometer_noise: float = 0.0  #: of each component [m/s^2]
    accelerometer_offset: float = 0.0  #: constant error of each component [m/s^2]
    orientation_noise: float = 0.0  #: about each axis [rad]
    camera_noise: float = 0.0  #: of each coordinate of a measured point [m]
    camera_outliers: float = 0.0  #: share of the measured points that are wrong, by OUTLIER_SIZE
    imu_sampling: ImuSampling = ImuSampling.MEAN  #: of rates and accelerations

    def __post_init__(self) -> None:
        """Refuse invalid noise."""
        for name, value in vars(self).items():
            if isinstance(value, ImuSampling):
                continue
            if name.endswith('_offset'):
                _require(isfinite(value), name, value, 'finite')
            else:
                _require(isfinite(value) and value >= 0.0, name, value, 'finite and >= 0')


class SimulatedCrank(NamedTuple):
    """A crank as its encoder reads it: the joint's angle [rad] and rate [rad/s]."""

    position: float
    velocity: float


class Imu(NamedTuple):
    """
    The reading of an IMU in `base_link`.

    `orientation` is that in the world: x, y, z, w. `angular_velocity` [rad/s] and
    `linear_acceleration`, the specific force, gravity included [m/s^2], are in its own frame.
    """

    orientation: tuple[float, ...]
    angular_velocity: tuple[float, ...]
    linear_acceleration: tuple[float, ...]


class Truth(NamedTuple):
    """
    The true pose and velocity of `base_link`.

    `position` [m] and `orientation`, x, y, z, w, are in the world; `linear` [m/s] and `angular`
    [rad/s] in its own frame.
    """

    position: tuple[float, ...]
    orientation: tuple[float, ...]
    linear: tuple[float, ...]
    angular: tuple[float, ...]


# Ideal sensors and motors.
MOTORS, SENSORS = Motors(), Sensors()


# For a walker: half of it changes the distance walked by 0.3 %, and takes twice as long [s].
TIME_STEP = 1e-3
# Softer legs carry no robot [s].
MAX_COMPLIANCE = 0.05
# Cosine of the tilt beyond which a walker has fallen.
FALLEN = cos(np.radians(60.0))
# A larger position, angle, speed or rate means divergence [m, rad, s].
MAX_STATE = 1e6
# A larger delay is given up: time continues from there, without a burst [s].
MAX_CATCH_UP = 0.2


class _Servos:
    """The speed servos of the cranks: `gain` is the part of a speed error that a step corrects."""

    def __init__(self, motors: Motors, joints: Sequence[str], time_step: float) -> None:
        self._factors = np.array([motors.factors.get(joint, 1.0) for joint in joints])
        self._max_velocity = motors.max_velocity
        self.gain = 1.0 - exp(-motors.bandwidth * time_step)
        self.stop()

    def stop(self) -> None:
        """Command all to stand."""
        self._commanded = np.zeros(len(self._factors))

    def command(self, index: int, velocity: float) -> float:
        """Command a speed; return the saturated one."""
        saturated = max(-self._max_velocity, min(self._max_velocity, velocity))
        self._commanded[index] = saturated
        return saturated

    @property
    def velocities(self) -> FloatArray:
        """Return the speeds to which they tend [rad/s]."""
        return np.asarray(self._commanded * self._factors)


class _ImuSamples:
    """Rates and specific force of the engine's IMU, one after the other, for a mean reading."""

    def __init__(self, at_rest: FloatArray) -> None:
        # The reading before the first step.
        self._reading = at_rest
        self._sum = np.zeros(6)
        self._count = 0

    def add(self, sample: FloatArray) -> None:
        """Take the sample of a step."""
        self._sum += sample
        self._count += 1

    def mean(self) -> FloatArray:
        """Return the mean since the last call, or the last one where there is none."""
        if self._count:
            self._reading = self._sum / self._count
            self._sum = np.zeros(6)
            self._count = 0
        return self._reading


class DivergedError(TwinError):
    """The simulation diverged; `Twin.reset` restarts it."""


class Twin:
    """
    A robot in the physics engine.

    A walker stands on its feet at the start; one leg hangs, and its `base_link` never moves.

    Parameters
    ----------
    robot : Robot
        With masses.
    floor : Floor
        The floor.
    motors : Motors
        The drives of the cranks.
    sensors : Sensors
        The sensors.
    time_step : float
        Of the engine [s]; 0: 1 ms for a walker, 0.2 ms for a leg.
    seed : int
        Of the noise: the same seed, commands and steps give the same robot, to the last digit.
    mjcf : str
        A changed model of `robot_mjcf`, with a floor or contacts of its own, instead of that.
    compliance : float
        Time constant with which the loops of the legs close [s]: see `robot_mjcf`.

    Attributes
    ----------
    joints : tuple of str
        The joints that turn its cranks.
    is_free : bool
        Whether it is a walker.

    Raises
    ------
    NoMujocoError
        The engine is not installed.
    MassError
        The robot has no masses.
    TwinError
        A motor has no joint, or the engine refuses the model.

    """

    def __init__(
        self,
        robot: Robot,
        *,
        floor: Floor = FLAT,
        motors: Motors = MOTORS,
        sensors: Sensors = SENSORS,
        time_step: float = 0.0,
        seed: int = 0,
        mjcf: str = '',
        compliance: float = 0.0,
    ) -> None:
        self.joints = robot.crank_joints
        self._sensors = sensors
        self._legs = robot.legs
        for joint in motors.factors:
            if joint not in self.joints:
                joints = ', '.join(map(printable, self.joints)) + did_you_mean(joint, self.joints)
                raise TwinError(f'{printable(joint)} turns no crank: there are {joints}')
        self._engine, self._seed = engine(), seed
        # Otherwise it writes a log file in the working directory; each step checks for divergence.
        self._engine.set_mju_user_warning(lambda _: None)
        step = time_step or (TIME_STEP if robot.is_walker else 0.0)
        min_compliance = 2.0 * (step or TIME_STEP)
        is_possible = compliance == 0.0 or min_compliance <= compliance <= MAX_COMPLIANCE
        rule = f'0, or within {min_compliance:g} .. {MAX_COMPLIANCE:g} s'
        _require(is_possible, 'compliance', compliance, rule)
        text = mjcf or robot_mjcf(robot, floor=floor, time_step=step, compliance=compliance)
        try:
            self._model = self._engine.MjModel.from_xml_string(text)
        except ValueError as error:
            # Masses or sizes out of range.
            raise TwinError(f'the engine takes no such robot: {printable_line(error)}') from error
        self._model.opt.disableflags |= int(self._engine.mjtDisableBit.mjDSBL_AUTORESET)
        self._data = self._engine.MjData(self._model)
        self.is_free = robot.is_walker
        # The order of the joints is that of the actuators.
        self._servos = _Servos(motors, self.joints, self.time_step)
        # Places of the cranks' angles and rates in the engine's state.
        ids = self._model.actuator_trnid[:, 0]
        self._angle_indices = self._model.jnt_qposadr[ids]
        self._rate_indices = self._model.jnt_dofadr[ids]
        if self.is_free:
            # Gyro and accelerometer, one after the other.
            first = int(self._model.sensor('imu_gyro').adr[0])
            self._imu_slice = slice(first, first + 6)
        self.reset()

    @property
    def time(self) -> float:
        """Return the time since its start [s]."""
        return float(self._data.time)

    @property
    def time_step(self) -> float:
        """Return the engine's step [s]."""
        return float(self._model.opt.timestep)

    def reset(self) -> None:
        """Reset it to its start, at rest, at time 0."""
        self._engine.mj_resetData(self._model, self._data)
        self._random = np.random.default_rng(self._seed)
        self._servos.stop()
        self._engine.mj_forward(self._model, self._data)
        at_rest = np.array([0.0, 0.0, 0.0, *-self._model.opt.gravity])
        self._imu_samples = _ImuSamples(self._imu_sample() if self.is_free else at_rest)

    def _imu_sample(self) -> FloatArray:
        return np.array(self._data.sensordata[self._imu_slice])

    def command(self, joint: str, velocity: float) -> float:
        """
        Command a crank's speed [rad/s]; return the saturated one.

        Raises
        ------
        TwinError
            There is no such joint, or the speed is no number.

        """
        if joint not in self.joints:
            raise TwinError(f'{printable(joint)} turns no crank')
        if not isfinite(velocity):
            raise TwinError(f'velocity of {printable(joint)} = {velocity!r} is refused')
        return self._servos.command(self.joints.index(joint), float(velocity))

    def step(self, until: float) -> None:
        """
        Simulate until the time is at least `until` [s].

        Raises
        ------
        DivergedError
            The simulation diverged.

        """
        model, data, move = self._model, self._data, self._engine.mj_step
        gain, velocities = self._servos.gain, self._servos.velocities
        # A step is due within rounding.
        end = until - 1e-6 * self.time_step
        while data.time < end:
            data.ctrl += gain * (velocities - data.ctrl)
            move(model, data)
            if self.is_free:
                self._imu_samples.add(data.sensordata[self._imu_slice])
        # NaN fails the comparison as well.
        if not (np.abs(data.qpos).max() < MAX_STATE and np.abs(data.qvel).max() < MAX_STATE):
            raise DivergedError(f'the simulation became unstable at {self.time:.3f} s')

    def cranks(self) -> dict[str, SimulatedCrank]:
        """Return the readings of the encoders, by joint."""
        sensors, count = self._sensors, len(self.joints)
        angles = self._data.qpos[self._angle_indices] + sensors.encoder_offset
        angles = angles + sensors.encoder_noise * self._random.standard_normal(count)
        rates = self._data.qvel[self._rate_indices]
        rates = rates + sensors.velocity_noise * self._random.standard_normal(count)
        readings = map(SimulatedCrank, angles.tolist(), rates.tolist())
        return dict(zip(self.joints, readings, strict=True))

    def points(self) -> dict[str, tuple[float, float]]:
        """Return the moving points of each leg as cameras measure them, in its leg_plane [m]."""
        sensors, names, places = self._sensors, [], []
        for leg in self._legs:
            plane = self._data.body(f'{leg.prefix}leg_plane')
            axes = plane.xmat.reshape(3, 3)[:, :2]
            structure = leg.linkage.structure
            for point in structure.points:
                if point not in structure.pivots:
                    name = f'{leg.prefix}{point.lower()}'
                    names.append(name)
                    places.append((self._data.site(name).xpos - plane.xpos) @ axes)
        seen = np.array(places)
        seen += sensors.camera_noise * self._random.standard_normal(seen.shape)
        wrong = self._random.random((len(seen), 1)) < sensors.camera_outliers
        seen += wrong * OUTLIER_SIZE * self._random.standard_normal(seen.shape)
        return {name: (x, y) for name, (x, y) in zip(names, seen.tolist(), strict=True)}

    def efforts(self) -> list[float]:
        """Return the torque of each joint's legs [N m], without the rotor's."""
        rotors = self._model.dof_armature[self._rate_indices] * self._data.qacc[self._rate_indices]
        efforts: list[float] = (self._data.actuator_force - rotors).tolist()
        return efforts

    def imu(self) -> Imu:
        """
        Return the reading of the IMU: by default the mean since the last one.

        A suspended leg reads gravity alone.
        """
        sensors, random = self._sensors, self._random
        x, y, z, w = self.truth().orientation
        sample = self._imu_samples.mean()
        if sensors.imu_sampling is ImuSampling.INSTANT and self.is_free:
            sample = self._imu_sample()
        rates = sample[:3] + sensors.gyro_noise * random.standard_normal(3)
        force = sample[3:] + sensors.accelerometer_offset
        force = force + sensors.accelerometer_noise * random.standard_normal(3)
        rotation = sensors.orientation_noise * random.standard_normal(3)
        orientation = np.zeros(4)
        self._engine.mju_mulQuat(
            orientation, np.array([w, x, y, z]), np.array([1.0, *(rotation / 2.0)])
        )
        self._engine.mju_normalize4(orientation)
        w, x, y, z = orientation.tolist()
        return Imu((x, y, z, w), tuple(rates.tolist()), tuple(force.tolist()))

    def truth(self) -> Truth:
        """Return the true pose and velocity; zero and upright for a leg that is hung up."""
        if not self.is_free:
            zero = (0.0, 0.0, 0.0)
            return Truth(zero, (0.0, 0.0, 0.0, 1.0), zero, zero)
        pose = self._data.qpos
        velocity = self._data.qvel
        w, x, y, z = pose[3:7].tolist()
        rotation = np.zeros(9)
        self._engine.mju_quat2Mat(rotation, pose[3:7])
        # MuJoCo has the linear velocity in the world, the angular one in the body's frame.
        linear = velocity[:3] @ rotation.reshape(3, 3)
        return Truth(
            position=tuple(pose[:3].tolist()),
            orientation=(x, y, z, w),
            linear=tuple(linear.tolist()),
            angular=tuple(velocity[3:6].tolist()),
        )

    @property
    def tilt(self) -> float:
        """Return the angle of its z axis from the vertical [rad]."""
        if not self.is_free:
            return 0.0
        _, x, y, _ = self._data.qpos[3:7].tolist()
        return float(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)))

    @property
    def summary(self) -> str:
        """Return a description."""
        kind = 'a walker' if self.is_free else 'a leg hung up'
        cranks = ', '.join(map(printable, self.joints))
        return f'{kind}, {self._model.body_subtreemass[0]:.3g} kg, turned by {cranks}'

    @property
    def state(self) -> str:
        """Return a message if it has fallen, else ''."""
        has_fallen = self.is_free and cos(self.tilt) < FALLEN
        return f'it has fallen, tilted by {degrees(self.tilt):.0f} deg' if has_fallen else ''


class Pace:
    """
    The ticks of a simulation in real time.

    Made of the period of simulated time between ticks [s], simulated time over wall time, and the
    wall time at the start [s].
    """

    def __init__(self, period: float, factor: float, now: float) -> None:
        self._period, self._between = period, period / factor
        self._begin = now
        self._ticks = 0
        # Wall time given up so far [s].
        self.slipped = 0.0
        # Time of the last real-time factor [s], and the ticks since.
        self._since = now
        self._done = 0

    def due(self, now: float) -> int:
        """Return the number of ticks due at a wall time [s]; they count as done."""
        late = now - self._begin - (self._ticks + 1) * self._between
        if late > MAX_CATCH_UP:
            # One tick is due now, the others are dropped.
            self._begin += late
            self.slipped += late
        count = max(0, int((now - self._begin) / self._between + 1e-6) - self._ticks)
        self._ticks += count
        self._done += count
        return count

    def real_time_factor(self, now: float) -> float:
        """Return simulated time over wall time since the last call."""
        factor = self._done * self._period / max(now - self._since, 1e-9)
        self._since, self._done = now, 0
        return factor
