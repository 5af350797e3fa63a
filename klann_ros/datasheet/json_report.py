"""A data sheet as JSON: SI units throughout, null for unknown or infinite values."""

from collections.abc import Sequence
import json
from typing import Any

from klann_ros import __version__
from klann_ros.dynamics import TurnOfForces
from klann_ros.kinematics import ChangePoint, Linkage, Stance
from klann_ros.sanitize.text import finite
import numpy as np

from .sheet import BarFigures, CrankSheet, DataSheet, LegSheet

# Increases when a key changes its meaning.
VERSION = 1
PATH_KEYS = ('x_range', 'y_range', 'stride', 'lift', 'length', 'area')
STANCE_KEYS = (
    *('start', 'end', 'duty_factor', 'ground', 'ground_covered', 'deviation', 'straightness'),
    *('minimax_deviation', 'ripple'),
)
MOTOR_KEYS = (
    *('turns', 'faults', 'available', 'peak', 'peak_at', 'margin', 'braking_peak'),
    *('braking_margin', 'motor_rms', 'thermal_margin', 'fastest'),
)


def report(sheet: DataSheet) -> str:
    """Return the data sheet as JSON; docs/describe.md lists its keys."""
    document = {
        'version': VERSION,
        'klann_ros': __version__,
        **_attributes(sheet, ('name', 'source', 'speed', 'load')),
        'no_forces': sheet.no_forces or None,
        'legs': [_leg_content(leg, sheet.speed) for leg in sheet.legs],
        'cranks': [_crank_content(crank) for crank in sheet.cranks],
        'motor_turns': sheet.motor_turns if sheet.motor else None,
        'walk': _walk_content(sheet),
    }
    return json.dumps(finite(document), indent=1, allow_nan=False) + '\n'


def _attributes(record: Any, names: Sequence[str]) -> dict[str, Any]:
    return {name: getattr(record, name) for name in names}


def _plain(record: Any) -> Any:
    """Return records as mappings by their fields, and arrays as lists."""
    if isinstance(record, np.ndarray):
        return record.tolist()
    if hasattr(record, '_asdict'):
        return {name: _plain(field) for name, field in record._asdict().items()}
    if isinstance(record, complex):
        return [record.real, record.imag]
    return [*map(_plain, record)] if isinstance(record, tuple) else record


def _leg_content(leg: LegSheet, speed: float) -> dict[str, Any]:
    linkage = leg.linkage
    points = linkage.change_points
    return {
        'names': list(leg.names),
        'linkage': linkage.name,
        'source': linkage.source,
        'foot': linkage.structure.foot,
        'bars': [*map(_bar_content, leg.bars)],
        'no_margins': leg.no_margins or None,
        'turns_fully': leg.turns_fully,
        'arcs': leg.arcs,
        'change_points': [_change_point_content(linkage, point) for point in points.points],
        'period': points.period,
        'near_misses': _plain(tuple(points.near_misses)),
        'path': _path_content(leg),
        'stance': _stance_content(leg.stance, speed) if leg.stance else None,
        'no_stance': leg.no_stance or None,
        'transmission': _plain(leg.transmission),
        **_mass_content(leg),
        'crank_angle': _plain(leg.alphas),
        'empty': _plain(leg.empty),
        'loaded': _plain(leg.loaded),
    }


def _mass_content(leg: LegSheet) -> dict[str, Any]:
    masses = leg.masses
    if masses is None:
        return {'mass': None, 'masses': [], 'mass_basis': None, 'mass_origin': None}
    bodies = zip(leg.linkage.structure.labels, masses.bodies, strict=True)
    return {
        'mass': masses.total,
        'masses': [{'body': label, **_plain(body)} for label, body in bodies],
        'mass_basis': masses.basis.name.lower(),
        'mass_origin': masses.origin,
    }


def _change_point_content(linkage: Linkage, point: ChangePoint) -> dict[str, Any]:
    path, other = linkage.change_points.continuations(point)
    return {
        'crank_angle': point.beta,
        'links': linkage.change_points.links(point),
        **_attributes(point, ('block', 'order', 'is_free')),
        'path': _plain(path),
        'other': _plain(other),
    }


def _bar_content(bar: BarFigures) -> dict[str, Any]:
    return {
        **_attributes(bar, ('name', 'unit', 'value')),
        'least': bar.margin.least if bar.margin else None,
        'greatest': bar.margin.greatest if bar.margin else None,
    }


def _path_content(leg: LegSheet) -> dict[str, Any] | None:
    if leg.path is None:
        return None
    x, y = leg.points[:, leg.linkage.foot].T.tolist()
    return {**_attributes(leg.path, PATH_KEYS), 'x': x, 'y': y}


def _stance_content(stance: Stance, speed: float) -> dict[str, Any]:
    return {
        **_attributes(stance, STANCE_KEYS),
        'speed_mean': stance.speed_mean * abs(speed),
        'speed_least': stance.speed_least * abs(speed),
        'speed_greatest': stance.speed_greatest * abs(speed),
        'body_speed': stance.speed(speed),
    }


def _crank_content(crank: CrankSheet) -> dict[str, Any]:
    return {
        **_attributes(crank, ('joint', 'legs')),
        'empty': _turn_content(crank.empty),
        'loaded': _turn_content(crank.loaded),
        'motor': _attributes(crank.motor, MOTOR_KEYS) if crank.motor else None,
    }


def _turn_content(turn: TurnOfForces | None) -> dict[str, Any] | None:
    if turn is None:
        return None
    return {
        'torque_least': float(turn.torque.min()),
        'torque_greatest': float(turn.torque.max()),
        'torque_peak': turn.peak,
        'torque_rms': turn.rms,
        'torque_mean': turn.mean,
        'power_least': float(turn.power.min()),
        'power_greatest': float(turn.power.max()),
        'power_mean': turn.mean * turn.rate,
        'energy_swing': turn.energy_swing,
        'angle': turn.alphas.tolist(),
        'torque': turn.torque.tolist(),
    }


def _walk_content(sheet: DataSheet) -> dict[str, Any] | None:
    walk = sheet.walk
    if walk is None:
        return {'no_walk': sheet.no_walk} if sheet.no_walk else None
    is_stable = walk.stable_fraction > 0.0
    supports = []
    for feet, fraction in walk.support_patterns().items():
        supports.append({'legs': feet, 'fraction': fraction})
    return {
        'speed': walk.speed * sheet.speed,
        **_attributes(walk, ('stride', 'least_margin')),
        'stable_fraction': walk.stable_fraction,
        'cost_of_transport': _plain(sheet.costs_of_transport),
        'warnings': walk.warnings,
        'height_variation': walk.height_variation if is_stable else None,
        'pitch': walk.greatest_pitch if is_stable else None,
        'roll': walk.greatest_roll if is_stable else None,
        'foot_slip': walk.slid,
        'supports': supports,
    }
