"""The angles of all bodies while they are being found."""

from cmath import rect
from collections.abc import Iterable, Sequence


class Configuration:
    """
    The angles of all bodies and, always with them, their unit vectors.

    Parameters
    ----------
    senses : sequence of int
        +1 for a counter-clockwise angle, -1 for a clockwise one, for every body.
    angles : iterable of float
        The angles, the crank's first [rad].

    Attributes
    ----------
    angles : list of float
        The angles [rad].
    u : list of complex
        u_j = exp(i s_j phi_j).

    """

    __slots__ = ('_senses', 'angles', 'u')

    def __init__(self, senses: Sequence[int], angles: Iterable[float]) -> None:
        """Compute the unit vectors."""
        self._senses = senses
        self.angles = list(angles)
        self.u = [rect(1.0, s * angle) for s, angle in zip(senses, self.angles, strict=True)]

    def put(self, j: int, angle: float) -> None:
        """Set the angle of one body [rad]."""
        self.angles[j] = angle
        self.u[j] = rect(1.0, self._senses[j] * angle)
