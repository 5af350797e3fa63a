"""The result of a search as one HTML page: a scatter of the aims, and the legs in motion."""

from collections.abc import Sequence
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
from .report import shown_figures
from .search import SearchResult

_STATIC = Path(__file__).resolve().parent / 'static'
PAGE_PARTS = Parts(
    styles=(*FRAME, SHARED / 'drawing.css', SHARED / 'tables.css', _STATIC / 'design.css'),
    scripts=(SHARED / 'theme.js', SHARED / 'drawing.js', _STATIC / 'design.js'),
)
# Poses of a leg's animation.
ANIMATION_POSES = 120


def page(search_result: SearchResult, leg_names: Sequence[str]) -> str:
    """Return the page of a result."""
    requirements = search_result.requirements
    state = search_result.state
    title = f'{"Legs that fulfil" if search_result.legs else "No leg fulfils"} the requirements'
    about = f'{counted(len(search_result.legs), "leg")} of {state.evaluations} candidates'
    header = element('header', element('div', element('h1', title), element('p', about)))
    reasons = [element('li', reason) for reason in search_result.reasons]
    why = element('section', element('ul', *reasons, class_='findings')) if reasons else Markup()
    if not search_result.legs:
        return PAGE_PARTS.page(title, header, why)
    names = shown_figures(requirements)
    target = requirements.target
    axes = []
    for name in names:
        figures = [leg.reached.get(name, np.nan) for leg in search_result.legs]
        if np.isfinite(figures).all():
            axes.append({'name': name, 'unit': requirements.units.name(FIGURES[name].unit)})
    choices = [element('label', f'{a} ', element('select', class_=f'axis-{a}')) for a in 'xy']
    legs = []
    for leg, name in zip(search_result.legs, leg_names, strict=True):
        legs.append(_leg_data(search_result, leg, name))
    data = {
        'axes': axes,
        'legs': legs,
        'target': target and np.stack([target.points.real, target.points.imag], axis=1).tolist(),
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
        element('section', element('h2', 'All legs'), _table(search_result, leg_names, names)),
        data=data,
    )


def _table(search_result: SearchResult, leg_names: Sequence[str], names: list[str]) -> Markup:
    figure_text = search_result.requirements.figure_text
    lines = []
    for leg, leg_name in zip(search_result.legs, leg_names, strict=True):
        figures = [figure_text(name, leg.reached.get(name)) for name in names]
        jams = f'{100.0 * leg.non_turning_fraction:.1f} %'
        lines.append((leg_name, *figures, jams, leg.linkage.name))
    heads = ('Leg', *[name.replace('_', ' ') for name in names], 'jams', 'Linkage')
    return scrolling_table('All legs', heads, lines)


def _leg_data(search_result: SearchResult, leg: FoundLeg, name: str) -> dict[str, Any]:
    """Return the data of a leg for the page: its motion, figures and margins."""
    requirements = search_result.requirements
    angles = crank_angles(ANIMATION_POSES)
    poses: Any = linkage_poses(leg.linkage, angles, points=True)
    stance = foot_path(LinkageLeg(leg.linkage)).stance()
    angles_since_stance_start = (angles - stance.start) % TURN
    figures = {}
    rows = []
    for figure_name, reached in leg.reached.items():
        figures[figure_name] = reached / requirements.units.size(FIGURES[figure_name].unit)
        expected_text = requirements.figure_text(figure_name, leg.expected.get(figure_name))
        reached_text = requirements.figure_text(figure_name, reached)
        rows.append([figure_name.replace('_', ' '), expected_text, reached_text])
    margins = []
    for dimension, limits in leg.margins.items():
        limit_texts = [f'{limit:.5g}' if isfinite(limit) else 'any' for limit in limits]
        margins.append([dimension, *limit_texts])
    rounded = [float(f'{metres:.5g}') for metres in poses.points.ravel()]
    return {
        'name': name,
        'linkage': leg.linkage.name,
        'shape': leg_shape(leg.linkage),
        'foot': leg.linkage.foot,
        'points': np.reshape(rounded, poses.points.shape).tolist(),
        'stands': (angles_since_stance_start <= stance.end - stance.start).tolist(),
        'figures': figures,
        'rows': rows,
        'margins': margins,
        'walker': leg.walker is not None,
    }
