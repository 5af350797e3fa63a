"""How far an accelerometer is believed: by its mean at standstill, and by the feet on the way."""

from enum import Enum
from math import exp, hypot

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

    Attributes
    ----------
    innovation_square : float
        Mean square of `innovation` over `slope_time`.
    noise_factor : float
        Factor of the variance of its noise.

    """

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        self.innovation_square = 0.0
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
