"""The result of a search as one HTML page: a scatter of the aims, and the legs in motion."""

from math import isfinite
from pathlib import Path
from typing import Any

from klann_ros.kinematics import foot_path, linkage_poses, LinkageLeg
from klann_ros.kinematics.angles import TURN
from klann_ros.sanitize.text import counted
from klann_ros.web import element, FRAME, leg_shape, Markup, Parts, scrolling_table, SHARED
import numpy as np

from .figures import crank_angles, FIGURES
from .proof import FoundLeg
from .report import leg_name, shown_figures
from .search import Found

_STATIC = Path(__file__).resolve().parent / 'static'
PAGE_PARTS = Parts(
    styles=(*FRAME, SHARED / 'drawing.css', SHARED / 'tables.css', _STATIC / 'design.css'),
    scripts=(SHARED / 'theme.js', SHARED / 'drawing.js', _STATIC / 'design.js'),
)
# Poses of a leg's animation.
ANIMATION_POSES = 120


def page(found: Found) -> str:
    """Return the page of a result."""
    units, target = found.requirements.units, found.requirements.target
    title = f'{"Legs that fulfil" if found.legs else "No leg fulfils"} the requirements'
    about = f'{counted(len(found.legs), "leg")} of {found.state.evaluations} candidates'
    header = element('header', element('div', element('h1', title), element('p', about)))
    reasons = [element('li', reason) for reason in found.reasons]
    why = element('section', element('ul', *reasons, class_='findings')) if reasons else Markup()
    if not found.legs:
        return PAGE_PARTS.page(title, header, why)
    names = shown_figures(found.requirements)
    axes = [
        {'name': name, 'unit': units.name(FIGURES[name].unit)}
        for name in names
        if all(isfinite(leg.reached.get(name, np.nan)) for leg in found.legs)
    ]
    choices = [element('label', f'{a} ', element('select', class_=f'axis-{a}')) for a in 'xy']
    data = {
        'axes': axes,
        'legs': [_leg(found, leg, leg_name(n)) for n, leg in enumerate(found.legs)],
        'target': target and [[z.real, z.imag] for z in target.points.tolist()],
    }
    return PAGE_PARTS.page(
        title,
        header,
        element('noscript', element('p', 'The legs are drawn by scripts, which are off here.')),
        element(
            'section',
            element('h2', 'The aims'),
            element('p', 'Choose up to four legs: they move below.', class_='quiet'),
            element('div', *choices, class_='axes'),
            element('div', class_='scatter card'),
        ),
        element('section', element('h2', 'Chosen legs'), element('div', class_='chosen')),
        element('section', element('h2', 'All legs'), _table(found, names)),
        data=data,
    )


def _table(found: Found, names: list[str]) -> Markup:
    rows = [
        (
            leg_name(n),
            *(found.requirements.figure_text(name, leg.reached.get(name)) for name in names),
            f'{100.0 * leg.non_turning_fraction:.1f} %',
            leg.linkage.name,
        )
        for n, leg in enumerate(found.legs)
    ]
    heads = ('Leg', *(name.replace('_', ' ') for name in names), 'jams', 'Linkage')
    return scrolling_table('All legs', heads, rows)


def _leg(found: Found, leg: FoundLeg, name: str) -> dict[str, Any]:
    units = found.requirements.units
    poses: Any = linkage_poses(leg.linkage, crank_angles(ANIMATION_POSES), points=True)
    stance = foot_path(LinkageLeg(leg.linkage)).stance()
    since = (crank_angles(ANIMATION_POSES) - stance.start) % TURN
    return {
        'name': name,
        'linkage': leg.linkage.name,
        'shape': leg_shape(leg.linkage),
        'foot': leg.linkage.foot,
        'points': [[[float(f'{m:.5g}') for m in p] for p in pose] for pose in poses.points],
        'stands': (since <= stance.end - stance.start).tolist(),
        'figures': {
            key: value / units.size(FIGURES[key].unit) for key, value in leg.reached.items()
        },
        'rows': [
            [
                key.replace('_', ' '),
                found.requirements.figure_text(key, leg.expected.get(key)),
                found.requirements.figure_text(key, value),
            ]
            for key, value in leg.reached.items()
        ],
        'margins': [
            [key, *(f'{end:.5g}' if isfinite(end) else 'any' for end in ends)]
            for key, ends in leg.margins.items()
        ],
        'walker': leg.walker is not None,
    }
