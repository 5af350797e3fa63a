"""
The trust in an accelerometer: by its mean at standstill, and by the feet on the way.

Standstill is known by the commands and the cranks; the mean rate of a gyro there is its bias.
"""

from collections.abc import Sequence
from enum import Enum
from math import exp, hypot, sqrt

from klann_ros.dynamics import GRAVITY

from .imu import ImuIncrement
from .low_pass import low_pass_gain, mean_gain
from .settings import OdometryNoise


class AccelerometerState(Enum):
    """How an accelerometer is used, in the words of the diagnostics."""

    NONE = 'none'
    UNKNOWN = 'unknown until it rests'
    USED = 'used'
    NOT_BELIEVED = 'not believed'


class AccelerometerMonitor:
    """
    Decide how far an accelerometer is believed.

    Friction corrects the velocity that it measures. Where the mean correction needs more friction
    than is usual, noise of the accelerometer is the reason: joints with play rattle, and an IMU
    that samples instants loses impacts. So its variance grows until the correction is usual. One
    that would have to be so noisy that it measures no more than friction does is rejected for a
    while, each time for twice as long.
    """

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        # Mean square of `innovation` over `slope_time`.
        self.innovation_square = 0.0
        # Factor of the variance of its noise.
        self.noise_factor = 1.0
        # Mean force that friction adds to the accelerometer, by the largest.
        self._mean_force = 0j
        # Mean size of the measured horizontal acceleration [m/s^2].
        self._shaking = 0.0
        # Time at standstill [s], and the mean specific force less gravity there [m/s^2].
        self._rest_time = 0.0
        self._rest_force = [0.0, 0.0, 0.0]
        # Time for which it is rejected, and the time of the next rejection [s].
        self._wait = 0.0
        self._next_wait = 2.0 * noise.settling_time

    @property
    def innovation(self) -> float:
        """Return the friction that the measured motion needs in the mean, by the largest."""
        return abs(self._mean_force)

    @property
    def state(self) -> AccelerometerState:
        """Return the state of an accelerometer."""
        if self._wait > 0.0:
            return AccelerometerState.NOT_BELIEVED
        if self._rest_time < self._noise.settling_time:
            return AccelerometerState.UNKNOWN
        is_plausible = max(map(abs, self._rest_force)) < self._noise.max_accelerometer_bias
        return AccelerometerState.USED if is_plausible else AccelerometerState.NOT_BELIEVED

    def stop(self) -> None:
        """Forget the mean correction."""
        self._mean_force = 0j

    def rest(self, increment: ImuIncrement) -> None:
        """Take a measurement at standstill."""
        if increment.delta_velocity is None or not increment.span:
            return
        self._rest_time += increment.span
        # The mean of the last seconds.
        gain = mean_gain(increment.span, self._rest_time, 4.0 * self._noise.settling_time)
        for axis, delta_velocity in enumerate(increment.delta_velocity):
            force = delta_velocity / increment.span
            self._rest_force[axis] += gain * (force - self._rest_force[axis])

    def reject(self, *, is_at_rest: bool) -> None:
        """Reject it for a while; at standstill until it has rested again."""
        self._mean_force = 0j
        self.noise_factor = self._noise.max_noise_factor / 10.0
        if is_at_rest:
            # While a body settles on its feet its acceleration is mistaken for a bias.
            self._rest_time = 0.0
        else:
            self._wait = self._next_wait
            self._next_wait = min(2.0 * self._wait, self._noise.max_rejection)

    def elapse(self, seconds: float) -> None:
        """Let time pass: it is tried again, the sooner the longer it was right."""
        self._wait = max(0.0, self._wait - seconds)
        if not self._wait:
            min_wait = 2.0 * self._noise.settling_time
            decay = exp(-seconds / self._noise.max_rejection)
            self._next_wait = max(min_wait, decay * self._next_wait)

    def is_contradicted(self, force: complex, dt: float) -> bool:
        """Learn by which friction the feet correct it; return whether that is too much."""
        n = self._noise
        self._mean_force += low_pass_gain(dt, n.innovation_time) * (force - self._mean_force)
        square_change = self.innovation**2 - self.innovation_square
        self.innovation_square += min(1.0, dt / n.slope_time) * square_change
        excess = (self.innovation / n.expected_innovation) ** 2 - 1.0
        self.noise_factor *= exp(dt / n.innovation_time * min(excess, 3.0))
        self.noise_factor = max(1.0, self.noise_factor)
        return self.noise_factor > n.max_noise_factor

    def is_shaken(self, increment: ImuIncrement, seconds: float) -> bool:
        """Return whether it measures for a second what no feet can do."""
        if increment.delta_velocity is None or not increment.span:
            return False
        acceleration = hypot(*increment.delta_velocity[:2]) / increment.span
        gain = min(1.0, seconds / self._noise.innovation_time)
        self._shaking += gain * (acceleration - self._shaking)
        return self._shaking > GRAVITY


class StandstillDetector:
    """
    Tell whether a walker stands, by two witnesses.

    It stands while no motion is commanded and, whatever moves it, while its cranks and its body
    are slow and the cranks stay where they are: means of many angles show a creep that is far
    below the noise of one.
    """

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        # Variance of an angle about the last one [rad^2].
        self._variance = 0.0
        self.restart()

    def restart(self) -> None:
        """Begin a standstill now."""
        # Time for which it has stood [s].
        self.time = 0.0
        self._last: list[float] = []
        # Mean angles of its first `settling_time`, later of that before, and of the last [rad].
        self._first_means: list[float] = []
        self._means: list[float] = []

    @property
    def is_confirmed(self) -> bool:
        """Return whether the cranks have stood for long enough to show a creep."""
        return self.time >= 2.0 * self._noise.settling_time

    def update(
        self,
        angles: Sequence[float],
        rates: Sequence[float],
        body_rate: float,
        seconds: float,
        *,
        is_commanded: bool = False,
    ) -> bool:
        """
        Return whether it stands.

        `angles` [rad] and `rates` [rad/s] are those of the cranks, `body_rate` is the largest of
        the body [rad/s], and `is_commanded` tells whether a motion is commanded.
        """
        fastest = max(*map(abs, rates), body_rate)
        if is_commanded or fastest > self._noise.stationary_rate or self._has_moved(angles):
            self.restart()
            return False
        self._average(angles, seconds)
        return True

    def _has_moved(self, angles: Sequence[float]) -> bool:
        if not self._means:
            return False
        distance = max(abs(angle - mean) for angle, mean in zip(angles, self._means, strict=True))
        if distance > self._noise.stationary_angle:
            return True
        gate = self._noise.stationary_shift + self._noise.standstill_gate * sqrt(self._variance)
        means = zip(self._means, self._first_means, strict=True)
        return max(abs(mean - first) for mean, first in means) > gate

    def _average(self, angles: Sequence[float], seconds: float) -> None:
        """Add angles to their means, and to the variance of the noise."""
        self.time += seconds
        settling = self._noise.settling_time
        gain = mean_gain(seconds, self.time, settling) if self.time else 1.0
        if self._last:
            largest = max(
                abs(angle - last) for angle, last in zip(angles, self._last, strict=True)
            )
            # White noise is in both angles of a step, and in two means of `settling_time`.
            square = largest * largest / 2.0
            self._variance += gain * (square * 2.0 * seconds / settling - self._variance)
        self._last = list(angles)
        self._means = _low_passed(self._means or self._last, angles, gain)
        if self.time <= settling or not self._first_means:
            self._first_means = self._means
        elif self.is_confirmed:
            # Motors that are not held give way under the weight: the means may move, but slowly.
            self._first_means = _low_passed(self._first_means, self._means, gain)


def _low_passed(means: Sequence[float], angles: Sequence[float], gain: float) -> list[float]:
    return [mean + gain * (angle - mean) for mean, angle in zip(means, angles, strict=True)]


class GyroCalibration:
    """
    Measure the drift of the heading at standstill.

    `is_steady` is False after a drift that no bias explains.
    """

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        self.is_steady = True
        self.restart()

    def restart(self) -> None:
        """Forget the measurement, as a standstill has ended or begins."""
        # The rotation by the gyro [rad] and its time [s]; and those that count only when the
        # cranks have confirmed the standstill.
        self._turn = 0.0
        self._time = 0.0
        self._waiting_turn = 0.0
        self._waiting_time = 0.0

    def update(
        self,
        increment: ImuIncrement,
        seconds: float,
        heading_variance: float,
        *,
        is_confirmed: bool,
    ) -> tuple[float, float] | None:
        """
        Return the drift of the heading [rad/s] and its variance from a measured interval.

        They are independent of those before; None where nothing is measured yet.
        `heading_variance` is 0 without an orientation.
        """
        self._waiting_turn += increment.turn
        self._waiting_time += seconds
        if not is_confirmed or not self._waiting_time:
            return None
        # The mean rate since the standstill began is known with this information; what the
        # interval adds is that after it less that before it.
        information_before, vector_before = self._information(heading_variance)
        self._time += self._waiting_time
        self._turn += self._waiting_turn
        self._waiting_turn = 0.0
        self._waiting_time = 0.0
        information, vector = self._information(heading_variance)
        gained = information - information_before
        return (vector - vector_before) / gained, 1.0 / gained

    def _information(self, heading_variance: float) -> tuple[float, float]:
        """Return the information on the mean rate, by noise and creeping feet, and its vector."""
        time = self._time
        if not time:
            return 0.0, 0.0
        white = self._noise.gyro_noise**2
        variance = white / time
        if heading_variance:
            filtered = white * self._noise.orientation_filter_time / 2.0
            variance = 2.0 * (heading_variance + filtered) / time**2
        information = 1.0 / (variance + self._noise.standstill_yaw_rate**2)
        return information, information * self._turn / time
