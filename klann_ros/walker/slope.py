"""What a measured attitude tells beyond the feet: the slope, bumps, and feet that cannot carry."""

from collections.abc import Sequence
from math import sin, sqrt

from klann_ros.dynamics import GRAVITY
from klann_ros.gait import Facet, Point, stance, Support

from .low_pass import low_pass_gain, mean_gain
from .settings import OdometryNoise

Attitude = tuple[float, float]


class SlopeEstimator:
    """
    The running mean of the measured attitude less that of the body on its feet.

    Attributes
    ----------
    acceleration : complex
        Gravity along the slope, in the level frame of base_link [m/s^2].
    attitude : tuple of float
        Roll and pitch: the measured ones, or those to which the body tips [rad].
    contact_weight : float
        Weight of the contact model: less where the attitude contradicts its feet.
    roughness : float
        Mean square of the normalised innovation, cut while the body tips.

    """

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        self.acceleration = 0j
        self.attitude: Attitude | None = None
        self.contact_weight = 1.0
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
