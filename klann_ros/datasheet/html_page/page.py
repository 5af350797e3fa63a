"""A data sheet as one HTML file."""

from pathlib import Path
from string import Template
from typing import Any

from klann_ros.datasheet.load import EDGE_OFFSET, on_the_ground
from klann_ros.datasheet.sheet import DataSheet, LegSheet
from klann_ros.kinematics.angles import TURN
from klann_ros.sanitize.text import printable
from klann_ros.web.markup import element
from klann_ros.web.parts import as_script, FRAME, Parts, SHARED, text
from klann_ros.web.shape import leg_shape
import numpy as np

from . import sections

_STATIC_FILES = Path(__file__).resolve().parent / 'static'
PAGE_PARTS = Parts(
    styles=(
        *FRAME,
        SHARED / 'drawing.css',
        SHARED / 'tables.css',
        _STATIC_FILES / 'sheet.css',
    ),
    # In this order: each uses what stands above it.
    scripts=(SHARED / 'theme.js', SHARED / 'drawing.js', _STATIC_FILES / 'sheet.js'),
)
# Poses a turn of the animation.
POSES = 360


def page(sheet: DataSheet) -> str:
    """Return the page of a data sheet."""
    data = [_leg(leg, sheet.speed) for leg in sheet.legs]
    return Template(text(_STATIC_FILES / 'page.html')).substitute(
        title=element('title', f'Data sheet of {printable(sheet.name)}'),
        policy=PAGE_PARTS.policy(),
        styles=PAGE_PARTS.style_elements(),
        header=sections.header(sheet),
        notes=sections.notes(sheet),
        legs=sections.legs(sheet),
        cranks=sections.cranks(sheet),
        walking=sections.walking(sheet),
        data=element('script', as_script(data), id='data', type='application/json'),
        scripts=PAGE_PARTS.script_elements(),
    )


def _leg(leg: LegSheet, speed: float) -> dict[str, Any]:
    """Return what moves in the page: a leg's shape, and where its points are at crank angles."""
    known = np.asarray(np.isfinite(leg.points).all(axis=(1, 2)))
    step = max(1, len(leg.alphas) // POSES)
    rows = np.arange(0, len(leg.alphas), step)
    if leg.turns_fully:
        # Evenly: the samples are denser at extremes.
        even = np.linspace(0.0, TURN, POSES, endpoint=False) - EDGE_OFFSET
        rows = np.unique(np.searchsorted(leg.alphas, even) % len(leg.alphas))
    rows = rows[known[rows]]
    stands = on_the_ground(leg.stance, leg.alphas) if leg.stance else np.zeros(known.shape, bool)
    shape = leg_shape(leg.linkage)
    names = [{**point, 'name': printable(point['name'], 12)} for point in shape['points']]
    return {
        'shape': {**shape, 'points': names},
        'foot': leg.linkage.foot,
        'isTurn': leg.turns_fully,
        'isClockwise': speed < 0.0,
        'angles': np.degrees(leg.alphas[rows]).round(4).tolist(),
        'points': [[[_short(x), _short(y)] for x, y in pose] for pose in leg.points[rows]],
        'stands': stands[rows].tolist(),
    }


def _short(metres: float) -> float:
    return float(f'{metres:.6g}')
