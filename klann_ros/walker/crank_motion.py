"""
From readings of the cranks to the stance of a walker: angles, centre of mass, feet.

A measured attitude tells more than the feet: the slope, bumps, and feet that cannot carry.
"""

from collections.abc import Sequence
from math import exp, sin, sqrt

from klann_ros.dynamics import GRAVITY
from klann_ros.gait import Facet, Feet, FootMotion, Point, stance, StancePose, Support

from .low_pass import low_pass_gain, mean_gain
from .settings import OdometryNoise

Attitude = tuple[float, float]


class SlopeEstimator:
    """The running mean of the measured attitude less that of the body on its feet."""

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        # Gravity along the slope, in the level frame of base_link [m/s^2].
        self.acceleration = 0j
        # Roll and pitch: the measured ones, or those to which the body tips [rad].
        self.attitude: Attitude | None = None
        # Weight of the contact model: less where the attitude contradicts its feet.
        self.contact_weight = 1.0
        # Mean square of the normalised innovation, cut while the body tips.
        self.roughness = 0.0
        # Mean square of the normalised innovation, and the time measured so far [s].
        self._innovation_square = 0.0
        self._time = 0.0

    @property
    def innovation(self) -> float:
        """Return the root mean square of the attitude's normalised innovation; 1 is usual."""
        return sqrt(self._innovation_square)

    @property
    def is_known(self) -> bool:
        """Return whether the slope is known well enough to contradict the feet."""
        return self._time >= self._noise.slope_time / 4.0

    def forget(self) -> None:
        """Begin again on level ground."""
        self.acceleration = 0j
        self._time = 0.0

    def turn(self, turn: complex) -> None:
        """Turn the level frame; `turn` is a unit vector."""
        self.acceleration *= turn

    def above(self, attitude: Attitude) -> Attitude:
        """Return roll and pitch above the ground [rad]."""
        roll, pitch = attitude
        return roll + self.acceleration.imag / GRAVITY, pitch - self.acceleration.real / GRAVITY

    def update(self, support: Support, measured: Attitude | None, dt: float) -> None:
        """Take an attitude, None without an IMU, that lasted for `dt` [s]."""
        n = self._noise
        if measured is None:
            gain = low_pass_gain(dt, n.tilt_time)
            roll, pitch = self.attitude or (support.roll, support.pitch)
            roll += gain * (support.roll - roll)
            pitch += gain * (support.pitch - pitch)
            self.attitude = roll, pitch
            return
        self.attitude = measured
        self._time += dt
        ground_roll = measured[0] - support.roll
        ground_pitch = measured[1] - support.pitch
        innovation = complex(ground_pitch, -ground_roll) - self.acceleration / GRAVITY
        square = abs(innovation) ** 2 / (2.0 * n.tilt_error**2)
        gain = min(1.0, dt / n.slope_time)
        self._innovation_square += gain * (square - self._innovation_square)
        self.roughness += gain * (min(square, n.tipping_innovation**2) - self.roughness)
        slope_gain = mean_gain(dt, self._time, n.slope_time)
        # A body that rocks, jumps or stands on other feet measures no slope.
        self.contact_weight = 1.0 / max(1.0, square)
        if self.is_known:
            slope_gain *= self.contact_weight
        downhill = GRAVITY * complex(sin(ground_pitch), -sin(ground_roll))
        self.acceleration += slope_gain * (downhill - self.acceleration)


class SupportCheck:
    """`violation` is the part of the last `slope_time` on feet that cannot carry the body."""

    period = 0.1

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        self.violation = 0.0
        # Time to the next check [s].
        self._wait = 0.0

    def update(
        self, feet: Sequence[Point], load_point: Point, facet: Facet, level: Attitude, dt: float
    ) -> None:
        """Check now and then; `level` is the attitude above ground, `load_point` is carried."""
        self._wait -= dt
        if self._wait > 0.0:
            return
        self._wait = self.period
        is_outside = stance.outside_feet(feet, load_point, level, facet) > self._noise.max_outside
        gain = self.period / self._noise.slope_time
        self.violation += gain * (is_outside - self.violation)


class CrankFilter:
    """`angles` are those of the cranks without most of the encoders' noise [rad]."""

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        self.angles: list[float] | None = None
        self._rates: list[float] = []

    def read(
        self, cranks: Sequence[float], rates: Sequence[float], seconds: float
    ) -> tuple[list[float], list[float]]:
        """Return the angles before and after a reading; noise would be slip of the feet."""
        noise = self._noise
        before = list(cranks) if self.angles is None else self.angles
        last_rates = self._rates or rates
        self._rates = list(rates)
        self.angles = list(cranks)
        differences = []
        for crank, angle in enumerate(before):
            predicted = angle + (last_rates[crank] + rates[crank]) / 2.0 * seconds
            differences.append(predicted - cranks[crank])
        is_smooth = max(map(abs, differences)) < noise.encoder_gate
        if 0.0 < seconds < noise.max_step_time and is_smooth:
            decay = exp(-seconds / noise.encoder_filter_time)
            for crank, difference in enumerate(differences):
                self.angles[crank] += decay * difference
        return before, self.angles


class CentreMotion:
    """The centre of mass of a walker."""

    def __init__(self, noise: OdometryNoise) -> None:
        self._filter_time = noise.load_shift_time
        # Height above the ground [m].
        self.height = 0.0
        self.stop()

    def stop(self) -> None:
        """Forget how it moved."""
        # Velocity in base_link [m/s]; None where unknown.
        self.velocity: complex | None = None
        # Acceleration over ground, filtered, in the level frame of base_link [m/s^2].
        self.acceleration = 0j
        # Velocity over ground [m/s].
        self._ground_velocity: complex | None = None

    def accelerate(self, base_velocity: complex, yaw_rate: float, dt: float) -> None:
        """Follow its acceleration; velocity [m/s] and yaw rate [rad/s] are those of base_link."""
        velocity = base_velocity + (self.velocity or 0j)
        last = velocity if self._ground_velocity is None else self._ground_velocity
        acceleration = (velocity - last) / dt + 1j * yaw_rate * velocity
        self._ground_velocity = velocity
        self.acceleration += low_pass_gain(dt, self._filter_time) * (
            acceleration - self.acceleration
        )


class StanceEstimator:
    """The feet on which a walker stands, and its pose on them."""

    def __init__(self, feet: Feet, noise: OdometryNoise) -> None:
        self.feet = feet
        self._noise = noise
        # None before the first angles, and where its centre of mass is not above its feet.
        self.support: Support | None = None
        # None where it has no support, and after a jump of the encoders.
        self.pose: StancePose | None = None
        # The centre of mass, the ground below it, and whether the feet can carry it.
        self.centre = CentreMotion(noise)
        self.slope = SlopeEstimator(noise)
        self.support_check = SupportCheck(noise)
        self._last_pose: StancePose | None = None
        # Heights of the feet above the plane of their support [m].
        self._heights: list[float] = []

    def update(
        self,
        angles: Sequence[float],
        attitude: Attitude | None,
        dt: float,
        *,
        is_acceleration_measured: bool,
    ) -> complex | None:
        """
        Place the walker at angles of the cranks [rad] after a step [s].

        Returns the displacement of its centre of mass in base_link [m], None if a pose is unknown.
        """
        feet, rolled, centre = self.feet.pose(angles)
        load_point = self._zero_moment_point(centre, is_accelerated=is_acceleration_measured)
        slope = self.slope
        level = slope.above(attitude) if attitude and slope.is_known else None
        facet = self.support and self.support.facet
        tolerance = 3.0 * self._noise.tilt_error
        self.support = support = stance.support(feet, load_point, facet, level, tolerance)
        self._last_pose = self.pose
        self.pose = None
        if support is None:
            return None
        slope.update(support, attitude, dt)
        if attitude and slope.is_known:
            level = slope.above(attitude)
            self.support_check.update(feet, load_point, support.facet, level, dt)
        self.pose = stance.stance_pose(feet, rolled, support, slope.attitude, centre)
        if self._last_pose is None:
            return None
        self.centre.height = support.height_of(centre)
        nx, ny, nz = support.normal
        height = support.height
        self._heights = [max(0.0, nx * x + ny * y + nz * z + height) for x, y, z in feet]
        return self.pose.centre - self._last_pose.centre

    def _zero_moment_point(self, centre: Point, *, is_accelerated: bool) -> Point:
        """Return the centre of mass, shifted by the slope and an acceleration that is measured."""
        acceleration = -self.slope.acceleration
        if is_accelerated:
            acceleration += self.centre.acceleration
        point = stance.zero_moment_point(complex(*centre[:2]), self.centre.height, acceleration)
        return point.real, point.imag, centre[2]

    def standing_feet(self, dt: float) -> list[FootMotion]:
        """Return the motions of the feet that carry it, in a step [s] between two poses."""
        if self.pose is None or self._last_pose is None:
            return []
        # The acceleration of the body shifts the load between the feet.
        load_point = stance.zero_moment_point(
            self.pose.centre, self.centre.height, self.centre.acceleration
        )
        loads = stance.spring_loads(self.pose.flat, self._heights, load_point)
        standing = []
        for foot, load in enumerate(loads):
            if load > 0.0:
                start, end = self._last_pose.flat[foot], self.pose.flat[foot]
                standing.append(stance.foot_motion(start, end, load, dt))
        return standing
