"""What a slope pulls a walker down by: how its IMU says that it lies, less how its feet say so."""

from math import sin

from klann_ros.dynamics import GRAVITY

from .slip import Flat, low_pass, turned

# Averaging time of the slope, since a walker rocks [s].
MEAN = 10.0


class Slope:
    """
    The slope that a walker stands on.

    Attributes
    ----------
    pull : (float, float)
        What it accelerates by that nothing holds, in the level frame of base_link [m/s^2].

    """

    def __init__(self) -> None:
        self.pull: Flat = (0.0, 0.0)
        self._known = 0.0

    def learn(self, roll: float, pitch: float, seconds: float) -> None:
        """Take by how much more it leans than on level ground [rad]."""
        self._known += seconds
        share = seconds / min(self._known, MEAN) if self._known else 1.0
        self.pull = low_pass(self.pull, (GRAVITY * sin(pitch), -GRAVITY * sin(roll)), share)

    def turn(self, yaw: float) -> None:
        """Turn the walker on it."""
        self.pull = turned(self.pull, -yaw)
