"""How far an accelerometer is believed: what friction would have to do where it is right."""

from math import exp, hypot

from klann_ros.dynamics import GRAVITY

from .imu import ImuIncrement
from .settings import OdometryNoise


class AccelerometerMonitor:
    """
    The friction that the measured acceleration needs, by the largest.

    `innovation_square` is its mean square over `slope_time`.
    """

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        self.innovation_square = 0.0
        # Mean force that friction adds to the accelerometer, by the largest.
        self._force = 0j
        # Mean size of the measured horizontal acceleration [m/s^2].
        self._shaking = 0.0

    @property
    def innovation(self) -> float:
        """Return the friction that the measured motion needs in the mean, by the largest."""
        return abs(self._force)

    def stop(self) -> None:
        """Forget the mean."""
        self._force = 0j

    def forget(self) -> None:
        """Begin again, after the accelerometer was rejected."""
        self._force = 0j
        self._shaking = 0.0

    def is_contradicted(self, force: complex, dt: float) -> bool:
        """Learn how hard friction corrects the accelerometer; return whether that is too much."""
        n = self._noise
        self._force += (1.0 - exp(-dt / n.innovation_time)) * (force - self._force)
        square = self.innovation**2 - self.innovation_square
        self.innovation_square += min(1.0, dt / n.slope_time) * square
        return self.innovation > n.innovation_gate

    def is_shaken(self, taken: ImuIncrement, seconds: float) -> bool:
        """Return whether it measures for a second what no feet can do."""
        if taken.delta_velocity is None or not taken.span:
            return False
        size = hypot(*taken.delta_velocity[:2]) / taken.span
        share = min(1.0, seconds / self._noise.innovation_time)
        self._shaking += share * (size - self._shaking)
        return self._shaking > GRAVITY
