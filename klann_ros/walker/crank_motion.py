"""The cranks and the centre of mass of a walker from reading to reading."""

from collections.abc import Sequence
from math import exp

from .settings import OdometryNoise


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
        before = list(cranks) if self.angles is None else self.angles
        last, self._rates = self._rates or rates, list(rates)
        both = zip(before, last, rates, cranks, strict=True)
        away = [was + (p + q) / 2.0 * seconds - is_ for was, p, q, is_ in both]
        n, self.angles = self._noise, list(cranks)
        if 0.0 < seconds < n.max_step_time and max(map(abs, away)) < n.encoder_gate:
            share = exp(-seconds / n.encoder_filter_time)
            self.angles = [is_ + share * by for is_, by in zip(cranks, away, strict=True)]
        return before, self.angles


class CentreMotion:
    """
    The centre of mass of a walker.

    Attributes
    ----------
    height : float
        Above the ground [m].
    velocity : complex, optional
        In base_link [m/s]; None where unknown.
    acceleration : complex
        Over ground, filtered, in the level frame of base_link [m/s^2].

    """

    def __init__(self, noise: OdometryNoise) -> None:
        self._time = noise.load_shift_time
        self.height = 0.0
        self.stop()

    def stop(self) -> None:
        """Forget how it moved."""
        self.velocity: complex | None = None
        self.acceleration = 0j
        # Velocity over ground [m/s].
        self._ground_velocity: complex | None = None

    def accelerate(self, motion: complex, w: float, dt: float) -> None:
        """Follow its acceleration; base_link moves by `motion` [m/s] and turns by w [rad/s]."""
        velocity = motion + (self.velocity or 0j)
        last = velocity if self._ground_velocity is None else self._ground_velocity
        acceleration = (velocity - last) / dt + 1j * w * velocity
        self._ground_velocity = velocity
        share = 1.0 - exp(-dt / self._time)
        self.acceleration += share * (acceleration - self.acceleration)
