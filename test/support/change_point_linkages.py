"""
Linkages that pass change points, and one of their points in closed form over many turns.

The closed forms share nothing with the solver: translations, reflections, and roots that are
continued analytically, cos(alpha / 2) in place of its absolute value.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from klann_ros.kinematics import Linkage, linkage_from_file, shipped_linkages
from klann_ros.kinematics.linkage.file import SHIPPED
import numpy as np

FOLDER = Path(__file__).parent / 'change_points'
ClosedForm = Callable[[Any], Any]


def _on_pin(axle: complex, length: float, alpha: Any, bend: float = 0.0) -> Any:
    return axle + length * np.exp(1j * (alpha + np.radians(bend)))


def _reflected(point: Any, p: Any, q: Any) -> Any:
    """Return a point mirrored in the line through two others."""
    along = (q - p) / abs(q - p)
    return p + along**2 * np.conj(point - p)


def _joint(p: Any, q: Any, r_p: float, r_q: float, h: Any) -> Any:
    """Return the joint of two links at p and q, at the signed height h left of the line p-q."""
    d = abs(q - p)
    return p + (q - p) / d * ((d**2 + r_p**2 - r_q**2) / (2.0 * d) + 1j * h)


def _two_turns(alpha: Any) -> Any:
    pin = 0.02 * np.exp(1j * alpha)
    d = abs(0.08 - pin)
    # (p + q)^2 - d^2 = 4 l s cos(alpha / 2)^2.
    root = 2.0 * np.sqrt(0.08 * 0.02) * np.cos(alpha / 2.0) * np.sqrt(d**2 - 0.02**2)
    return _joint(pin, 0.08, 0.06, 0.04, root / (2.0 * d))


def _level_foot(alpha: Any, level: complex = 0.03 + 0.02j) -> Any:
    pin = 0.03 * np.exp(1j * alpha)
    d = abs(0.1 - pin)
    heron = ((0.095 + 0.06) ** 2 - d**2) * (d**2 - (0.095 - 0.06) ** 2)
    rocker = _joint(pin, 0.1, 0.095, 0.06, np.sqrt(heron) / (2.0 * d)) - 0.1
    ankle = 0.1 + rocker / 0.06 * 0.09 * np.exp(1j * np.radians(120.0))
    return ankle - 1j * 0.05 * level / abs(level)


def _coupled_parallelogram(alpha: Any) -> Any:
    # The coupler is carried without rotation: its point G turns about a centre that stays.
    centre = 0.05 + 0.06j
    pin = _on_pin(0.08 + 0.06j, 0.08, alpha)
    d = abs(centre - pin)
    heron = ((0.09 + 0.07) ** 2 - d**2) * (d**2 - (0.09 - 0.07) ** 2)
    rocker = _joint(pin, centre, 0.09, 0.07, np.sqrt(heron) / (2.0 * d)) - centre
    return rocker + 0.06 * np.exp(-1j * np.pi / 3.0)


def _kite_on_crank(alpha: Any) -> Any:
    half = np.exp(0.5j * alpha)
    return half * (0.05 * np.cos(alpha / 2.0) + np.sqrt(0.01 - (0.05 * np.sin(alpha / 2.0)) ** 2))


def _platform(alpha: Any) -> Any:
    # Its cranks are parallel to the rocker of the four-bar, and its links are carried along.
    crank = 40e-3 * np.exp(1j * np.angle(_two_turns(alpha) - 0.08))
    joining = (40 - 50j) / abs(40 - 50j)
    return 0.1 + 0.02j + crank + 30e-3 * joining * np.exp(1j * np.radians(80.0))


FEET: dict[str, ClosedForm] = {
    'parallelogram': lambda alpha: _on_pin(-0.08j, 0.04, alpha),
    'side_rod': lambda alpha: _on_pin(0.31, 0.03, alpha, 90.0),
    'galloway': lambda alpha: _reflected(0.0, _on_pin(0.0, 0.1, alpha), 0.05),
    'kite_on_crank': _kite_on_crank,
    'kite_on_ground': lambda alpha: _reflected(0.0, _on_pin(0.0, 0.05, alpha), 0.1),
    'cardan': lambda alpha: 0.1 * np.cos(alpha) + 0j,
    'slotted_arm': lambda alpha: 0.15 * np.exp(0.5j * alpha),
    'level_foot': _level_foot,
    'coupled_parallelogram': _coupled_parallelogram,
    'two_turns': _two_turns,
    'platform_two_turns': _platform,
}
"""The foot of each over any number of turns [m], by the crank angle [rad]."""


def change_point_file(name: str) -> Path:
    """Return the file of a linkage of `FEET`: a shipped one, or one of the tests."""
    folder = Path(str(SHIPPED)) if name in shipped_linkages() else FOLDER
    return folder / f'{name}.yaml'


def change_point_linkage(name: str) -> Linkage:
    """Return a linkage of `FEET`."""
    return linkage_from_file(change_point_file(name))


def resting_parallelogram() -> tuple[str, ClosedForm]:
    """
    Return `level_foot` with its parallelogram in line where the rocker comes to rest.

    There both motions have the same velocity: it is no sign that changes, but the acceleration
    that decides. The text of its file, and its foot in closed form.
    """
    text = (FOLDER / 'level_foot.yaml').read_text(encoding='utf-8')
    cosine = (0.1**2 + 0.06**2 - 0.125**2) / (2.0 * 0.1 * 0.06)
    rest = np.pi - np.arccos(cosine) + np.radians(120.0)
    level = abs(0.03 + 0.02j) * np.exp(1j * rest)
    pivot = 100.0 + 1e3 * complex(level)
    degrees = float(np.degrees(rest))
    replaced = (
        ('E: [130, 20]', f'E: [{pivot.real!r}, {pivot.imag!r}]'),
        ('foot: 33.7', f'foot: {degrees!r}'),
        ('length: 36.05551275463989', f'length: {1e3 * abs(complex(level))!r}'),
    )
    for old, new in replaced:
        assert old in text
        text = text.replace(old, new)
    return text, lambda alpha: _level_foot(alpha, level)
