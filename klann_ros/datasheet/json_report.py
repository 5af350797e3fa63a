"""A data sheet as JSON, for machines: SI units throughout, null for unknown or infinite values."""

import json
from typing import Any

from klann_ros import __version__
from klann_ros.dynamics import TurnOfForces
from klann_ros.kinematics import Stance
from klann_ros.sanitize.outputs import finite

from .motor import MotorVerdict
from .sheet import (
    BarFigures,
    CrankSheet,
    DataSheet,
    Extreme,
    JointForce,
    LegForces,
    LegSheet,
    Transmission,
)

# Counts up when what stands in the report changes its meaning.
VERSION = 1


def report(sheet: DataSheet) -> str:
    """Return the data sheet as JSON; docs/describe.md has its keys."""
    content = {
        'version': VERSION,
        'klann_ros': __version__,
        'name': sheet.name,
        'source': sheet.source,
        'speed': sheet.speed,
        'load': sheet.load,
        'no_forces': sheet.no_forces or None,
        'legs': [_leg(leg, sheet) for leg in sheet.legs],
        'cranks': [_crank(crank) for crank in sheet.cranks],
        'motor_turns': sheet.motor_turns if sheet.motor else None,
        'walk': _walk(sheet),
    }
    return json.dumps(finite(content), indent=1, allow_nan=False) + '\n'


def _leg(leg: LegSheet, sheet: DataSheet) -> dict[str, Any]:
    linkage = leg.linkage
    return {
        'names': list(leg.names),
        'linkage': linkage.name,
        'source': linkage.source,
        'foot': linkage.structure.foot,
        'bars': [_bar(bar) for bar in leg.bars],
        'no_margins': leg.no_margins or None,
        'turns_fully': leg.turns_fully,
        'arcs': [list(arc) for arc in leg.arcs],
        'path': _path(leg),
        'stance': _stance(leg.stance, sheet.speed) if leg.stance else None,
        'no_stance': leg.no_stance or None,
        'transmission': [_transmission(each) for each in leg.transmission],
        'mass': leg.mass if leg.masses else None,
        'masses': [
            {
                'body': body.name,
                'mass': body.mass,
                'centre': list(body.centre),
                'inertia': body.inertia,
            }
            for body in leg.masses
        ],
        'crank_angle': leg.alphas.tolist(),
        'empty': _forces(leg.empty),
        'loaded': _forces(leg.loaded),
    }


def _bar(bar: BarFigures) -> dict[str, Any]:
    ends = (bar.margin.least, bar.margin.greatest) if bar.margin else (None, None)
    return {
        'name': bar.name,
        'unit': bar.unit,
        'value': bar.value,
        'least': ends[0],
        'greatest': ends[1],
    }


def _path(leg: LegSheet) -> dict[str, Any] | None:
    if leg.path is None:
        return None
    foot = leg.points[:, leg.linkage.foot]
    return {
        'x_range': list(leg.path.x_range),
        'y_range': list(leg.path.y_range),
        'stride': leg.path.stride,
        'lift': leg.path.lift,
        'length': leg.path.length,
        'area': leg.path.area,
        'x': foot[:, 0].tolist(),
        'y': foot[:, 1].tolist(),
    }


def _stance(stance: Stance, speed: float) -> dict[str, Any]:
    return {
        'start': stance.start,
        'end': stance.end,
        'duty_factor': stance.duty_factor,
        'ground': stance.ground,
        'ground_covered': stance.ground_covered,
        'deviation': stance.deviation,
        'straightness': stance.straightness,
        'speed_mean': stance.speed_mean * abs(speed),
        'speed_least': stance.speed_least * abs(speed),
        'speed_greatest': stance.speed_greatest * abs(speed),
        'ripple': stance.ripple,
        'body_speed': stance.speed(speed),
    }


def _extreme(extreme: Extreme | None) -> dict[str, float] | None:
    return None if extreme is None else extreme._asdict()


def _transmission(each: Transmission) -> dict[str, Any]:
    return {
        'name': each.name,
        'least': _extreme(each.least),
        'greatest': _extreme(each.greatest),
        'from_in_line': _extreme(each.worst),
        'angle': each.angles.tolist(),
    }


def _forces(forces: LegForces | None) -> dict[str, Any] | None:
    if forces is None:
        return None
    return {'torque': forces.torque.tolist(), 'joints': [_joint(each) for each in forces.joints]}


def _joint(joint: JointForce) -> dict[str, Any]:
    return {
        'name': joint.name,
        'greatest': _extreme(joint.greatest),
        'moment': _extreme(joint.moment),
        'force': joint.force.tolist(),
    }


def _crank(crank: CrankSheet) -> dict[str, Any]:
    return {
        'joint': crank.joint,
        'legs': list(crank.legs),
        'empty': _turn(crank.empty),
        'loaded': _turn(crank.loaded),
        'motor': _motor(crank.motor),
    }


def _turn(turn: TurnOfForces | None) -> dict[str, Any] | None:
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


def _motor(judged: MotorVerdict | None) -> dict[str, Any] | None:
    if judged is None:
        return None
    return {
        'turns': judged.turns,
        'faults': list(judged.faults),
        'available': judged.available,
        'peak': judged.peak,
        'peak_at': judged.peak_at,
        'margin': judged.margin,
        'braking_peak': judged.braking_peak,
        'braking_margin': judged.braking_margin,
        'motor_rms': judged.motor_rms,
        'thermal_margin': judged.thermal_margin,
        'fastest': judged.fastest,
    }


def _walk(sheet: DataSheet) -> dict[str, Any] | None:
    walk = sheet.walk
    if walk is None:
        return {'no_walk': sheet.no_walk} if sheet.no_walk else None
    rests = walk.rests > 0.0
    return {
        'speed': walk.speed * sheet.speed,
        'stride': walk.stride,
        'least_margin': walk.least_margin,
        'rests': walk.rests,
        'warnings': walk.warnings,
        'bob': walk.bob if rests else None,
        'pitch': walk.greatest_pitch if rests else None,
        'roll': walk.greatest_roll if rests else None,
        'slid': walk.slid,
        'supports': [{'legs': list(feet), 'part': part} for feet, part in walk.on().items()],
    }
