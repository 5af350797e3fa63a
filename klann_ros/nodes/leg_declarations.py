"""The parameters of legs, as they are declared: all legs', and each leg's own."""

from collections.abc import Mapping
from dataclasses import replace
from math import pi
from typing import Any

from . import geometry_parameters
from .parameters import Declared

UPRIGHT = (pi / 2, 0.0, 0.0)
LEGS = (
    Declared(
        'legs', [''], 'names of the legs; none for one unnamed leg', constraint='names, all others'
    ),
    Declared('linkage', '', "a linkage's YAML file; empty: the Klann leg of the lengths"),
    Declared('crank_joint', 'crank', 'the joint in crank_state that turns the crank'),
)
SETTINGS = (
    Declared(
        'tolerance',
        1e-12,
        'largest correction of a converged pose [rad]',
        constraint='> 0, <= 1e-3',
    ),
    Declared(
        'max_crank_step', 0.35, 'larger crank steps are split [rad]', constraint='finite, > 0'
    ),
)
COMMON = (*geometry_parameters.declared(), *LEGS, *SETTINGS)
# What leg files may hold for others: masses and sizes, which a solver does not need.
FOR_OTHERS = ('bar_density', 'foot_mass', 'body_mass', 'body_size', 'body_centre')


def drive(prefix: str) -> list[Declared]:
    """Return the parameters of how a leg is driven."""
    return [
        Declared(
            f'{prefix}phase',
            0.0,
            "the leg's crank angle where the crank is at 0 [rad]",
            constraint='finite',
            any_number=True,
        ),
        Declared(
            f'{prefix}direction',
            1,
            '+1, or -1 for a leg whose crank turns the other way',
            constraint='+1 or -1',
            any_number=True,
        ),
    ]


def place(name: str) -> list[Declared]:
    """Return the parameters that only a named leg has."""
    return [
        Declared(f'{name}.crank_joint', '', 'its own joint in crank_state; empty: crank_joint'),
        Declared(f'{name}.mount_xyz', [0.0] * 3, 'where its plane is in base_link [m]'),
        Declared(f'{name}.mount_rpy', list(UPRIGHT), 'how its plane is turned in it [rad]'),
    ]


def own(name: str, common: Mapping[str, Any]) -> list[Declared]:
    """Return the parameters of a named leg; its geometry is the common one where not given."""
    geometry = [
        replace(
            p,
            name=f'{name}.{p.name}',
            default=common[p.name],
            description=f'{name}: {p.description}',
        )
        for p in geometry_parameters.declared()
    ]
    return [*geometry, *drive(f'{name}.'), *place(name)]
