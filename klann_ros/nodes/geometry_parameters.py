"""A Klann leg's geometry as parameters, named and ordered as the interface has them."""

from collections.abc import Mapping
from typing import Any

from klann_ros.kinematics import KlannGeometry, Linkage
from klann_ros.kinematics.klann.geometry import BENDS, LENGTHS, NUMBERS

from .parameters import Declared

_WORDS = {
    'l_ab': 'length of the crank AB',
    'l_bc': 'length of the coupler from the crank pin B to the elbow C',
    'l_dc': 'length of the lower rocker DC',
    'l_cg': 'length of the coupler from the elbow C to the hip G',
    'l_ef': 'length of the upper rocker EF',
    'l_fg': 'length of the leg from the knee F to the hip G',
    'l_gh': 'length of the leg from the hip G to the foot H',
    'x_d': 'x of the lower rocker pivot D, whose y is 0',
    'y_a': 'y of the crank axle A, whose x is 0',
    'x_e': 'x of the upper rocker pivot E',
    'y_e': 'y of the upper rocker pivot E',
    'angle_bcg': 'bend of the coupler at C',
    'angle_fgh': 'bend of the leg at G',
}
_CONSTRAINTS = {
    **dict.fromkeys(LENGTHS, 'finite, > 0'),
    **dict.fromkeys(BENDS, 'radians, not degrees: within +-2 pi'),
}


def declared() -> list[Declared]:
    """Return the parameters of a geometry; the defaults are SEM 104's."""
    default = KlannGeometry.sem104()
    numbers = [
        Declared(
            name,
            getattr(default, name),
            f'{_WORDS[name]} [{"rad" if name in BENDS else "m"}]',
            constraint=_CONSTRAINTS.get(name, 'finite'),
            read_only=False,
        )
        for name in NUMBERS
    ]
    assembly = Declared(
        'assembly',
        list(default.assembly),
        'assembly branch: the signs of sin(gamma + beta) and sin(delta + theta)',
        constraint='two signs, each +1 or -1',
        read_only=False,
    )
    return [*numbers, assembly]


PRESETS = {'sem104': KlannGeometry.sem104(), 'patent': KlannGeometry.patent()}
NAMES = tuple(parameter.name for parameter in declared())


def geometry(values: Mapping[str, Any]) -> KlannGeometry:
    """
    Return the geometry of parameter values.

    Raises
    ------
    GeometryError
        They are no leg; the text says why.

    """
    return KlannGeometry(**{name: values[name] for name in NAMES})


def in_words(linkage: Linkage) -> str:
    """Return which Klann leg it is: a preset's name, where it is one."""
    names = [name for name, preset in PRESETS.items() if preset.linkage == linkage]
    return f'Klann leg {names[0]}' if names else 'Klann leg of its own lengths'
