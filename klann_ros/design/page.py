"""The result of a search as one HTML page: the legs, their aims, and chosen legs side by side."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from klann_ros.export import ExportError, scene_parts
from klann_ros.kinematics import foot_path, linkage_poses, LinkageLeg
from klann_ros.kinematics.arrays import plane_vectors
from klann_ros.robot import robot_from_text
from klann_ros.sanitize.text import counted, finite
from klann_ros.web import element, FRAME, leg_shape, Markup, Parts, SHARED
import numpy as np

from .figures import crank_angles, FIGURES
from .leg_file import parameter_text
from .proof import FoundLeg
from .report import next_commands
from .requirements import Aim, Requirements
from .search import SearchResult
from .titles import aims_text, figure_aims

_STATIC = Path(__file__).resolve().parent / 'static'
_SHARED_STYLES = [SHARED / f'{name}.css' for name in ('drawing', 'tables', 'sortable')]
_SHARED_SCRIPTS = [SHARED / f'{name}.js' for name in ('theme', 'drawing', 'sortable')]
_SCRIPTS = [_STATIC / f'{name}.js' for name in ('scatter', 'walker', 'compare', 'design')]
PAGE_PARTS = Parts(
    styles=(*FRAME, *_SHARED_STYLES, _STATIC / 'design.css'), scripts=(*_SHARED_SCRIPTS, *_SCRIPTS)
)
_SCENE = [SHARED / f'{name}.js' for name in ('three/three.min', 'solids', 'orbit', 'scene')]
WALKER_PARTS = replace(PAGE_PARTS, scripts=(*_SCENE, *PAGE_PARTS.scripts))
# Poses of a leg's animation.
ANIMATION_POSES = 120
# Two groups of legs that take turns are always on the ground from this duty factor on.
GAPLESS_DUTY_FACTOR = 0.5


def page(search_result: SearchResult, leg_names: Sequence[str]) -> str:
    """Return the page of a result."""
    requirements = search_result.requirements
    search_legs = search_result.legs
    count = f'{counted(len(search_legs), "leg")} of {search_result.state.evaluations} candidates'
    title = f'{"Legs that fulfil" if search_legs else "No leg fulfils"} the requirements'
    about = element('p', f'{count}. {aims_text(requirements)}.')
    header = element('header', element('div', element('h1', title), about))
    notes = search_result.reasons or _warnings(requirements, search_legs)
    items = [element('li', note, class_='warning') for note in notes]
    findings = element('section', element('ul', *items, class_='findings')) if items else Markup()
    if not search_legs:
        return PAGE_PARTS.page(title, header, findings)
    aims = figure_aims(requirements)
    units = requirements.units
    figures = []
    for name in dict.fromkeys((*aims, *FIGURES)):
        kind = FIGURES[name]
        aim = aims.get(name, Aim(name, ''))._asdict()
        unit = {'unit': units.name(kind.unit), 'size': units.size(kind.unit)}
        figures.append({'name': name, 'text': kind.text, **aim, **unit})
    target = requirements.target
    leg_data = partial(_leg_data, requirements)
    legs = [*map(leg_data, search_legs, leg_names, search_result.titles)]
    data = {
        'figures': figures,
        'aimCount': len(requirements.aims),
        'speed': requirements.speed,
        'legs': legs,
        'target': target and plane_vectors(target.points).tolist(),
    }
    parts = PAGE_PARTS if requirements.walker is None else WALKER_PARTS
    return parts.page(
        title,
        header,
        findings,
        element('noscript', element('p', 'The legs are drawn by scripts, which are off here.')),
        element('section', class_='choice'),
        element('section', class_='compare'),
        data=data,
    )


def _warnings(requirements: Requirements, legs: Sequence[FoundLeg]) -> list[str]:
    """Return what the figures mean for walkers whose legs stand for a short part of a turn."""
    short = [leg for leg in legs if leg.reached.get('duty_factor', 1.0) < GAPLESS_DUTY_FACTOR]
    is_for_walking = not {'stride', 'ground_covered'}.isdisjoint(requirements.figures)
    if not short or not (is_for_walking or requirements.walker):
        return []
    effect = 'between the stances of two groups nobody carries'
    if requirements.walker is not None:
        falling = sum(leg.reached.get('static_margin', 0.0) < 0.0 for leg in legs)
        effect = f'{falling} of {counted(len(legs), "walker")} tip over in between'
    count = f'{len(short)} of {counted(len(legs), "leg")}'
    text = f'On the ground for less than half a turn: {count}; {effect}. '
    return [f'{text}A step walks ground covered, not stride.']


def _leg_data(requirements: Requirements, leg: FoundLeg, name: str, title: str) -> dict[str, Any]:
    """Return the data of a leg for the page: its motion, figures and margins."""
    angles = crank_angles(ANIMATION_POSES)
    poses: Any = linkage_poses(leg.linkage, angles, points=True)
    stance = foot_path(LinkageLeg(leg.linkage)).stance()
    rounded = [float(f'{metres:.5g}') for metres in poses.points.ravel()]
    return {
        'name': name,
        'title': title,
        'linkage': leg.linkage.name,
        'shape': leg_shape(leg.linkage),
        'foot': leg.linkage.foot,
        'points': np.reshape(rounded, poses.points.shape).tolist(),
        'stands': stance.holds(angles).tolist(),
        'figures': leg.reached,
        'expected': finite(leg.expected),
        'margins': finite(leg.margins),
        'commands': next_commands(requirements, leg, name, Path()),
        'walker': leg.walker and {**leg.walker, 'parts': _walker_parts(leg.walker)},
    }


def _walker_parts(walker: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the parts of a walker for the scene; None where they have no layers."""
    with suppress(ExportError):
        return scene_parts(robot_from_text(parameter_text(walker), 'the walker'))
    return None
