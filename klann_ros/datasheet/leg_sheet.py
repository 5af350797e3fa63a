"""From a leg to what its sheet tells: its foot, its joints, how near it comes to being stuck."""

from collections.abc import Sequence
from dataclasses import replace
from math import pi
from typing import Any

from klann_ros.dynamics import BodyMass, Dynamics, Masses, Reactions
from klann_ros.kinematics import (
    foot_path,
    FootPath,
    KinematicsError,
    length_margins,
    Linkage,
    linkage_poses,
    LinkageLeg,
    PartialTurnError,
    reachable_arcs,
    Stance,
)
from klann_ros.kinematics.angles import Arc, TURN
from klann_ros.robot import Robot, RobotLeg
import numpy as np
from numpy.typing import NDArray

from .load import foot_load, turn_angles, with_extremes
from .sheet import (
    BarFigures,
    BodyMassFigures,
    Extreme,
    JointForce,
    LegForces,
    LegSheet,
    SheetError,
    Transmission,
)

Array = NDArray[np.float64]
COUPLED = 'of coupled loops they take seconds: --margins'


def leg_sheet(
    robot: Robot, leg: RobotLeg, speed: float, load: float, *, margins: bool, samples: int
) -> LegSheet:
    """Return the sheet of a leg; parameters and errors as `data_sheet`."""
    linkage = leg.linkage
    arcs = tuple(reachable_arcs(linkage))
    turns = arcs == ((0.0, TURN),)
    path, stance, no_stance = _path(linkage)
    edges = (stance.start, stance.end) if load and stance else ()
    alphas = turn_angles(samples, edges) if turns else _alphas(arcs, samples)
    bars, no_margins = _bars(linkage, turns=turns, margins=margins)
    sheet = LegSheet(
        names=(leg.name,),
        linkage=linkage,
        bars=bars,
        no_margins=no_margins,
        turns_fully=turns,
        arcs=arcs,
        path=path,
        stance=stance,
        no_stance=no_stance,
        masses=_masses(leg),
        empty=None,
        loaded=None,
        **_poses(linkage, alphas),
    )
    if not turns:
        return sheet
    if load and stance is None:
        raise SheetError(f'a load on the foot has nowhere to be: {no_stance}')

    def with_forces() -> LegSheet:
        empty = _forces(robot.dynamics(leg), sheet, speed, 0.0) if leg.masses else None
        loaded = _forces(dynamics_of(robot, leg), sheet, speed, load) if load else None
        return replace(sheet, empty=empty, loaded=loaded)

    cases = with_forces().cases
    curves = [curve for of in cases for curve in (of.torque, *(j.force for j in of.joints))]
    sheet = replace(sheet, **_poses(linkage, with_extremes(alphas, curves)))
    return with_forces()


def _poses(linkage: Linkage, alphas: Array) -> dict[str, Any]:
    """Return the fields of a sheet that are sampled over crank angles [rad]."""
    found = linkage_poses(linkage, alphas, points=True, transmission_angles=True)
    if found.points is None or found.transmission_angles is None:
        raise AssertionError('points and transmission angles are requested')
    transmission = _transmission(linkage, alphas, found.transmission_angles)
    return {'alphas': alphas, 'points': found.points, 'transmission': transmission}


def dynamics_of(robot: Robot, leg: RobotLeg) -> Dynamics:
    """Return a leg with its masses, or one that weighs nothing: a load is carried by it, too."""
    if leg.masses is not None:
        return robot.dynamics(leg)
    return Dynamics(leg.linkage, Masses((BodyMass(),) * len(leg.linkage.structure.bodies)))


def alike(one: RobotLeg, other: RobotLeg) -> bool:
    """Return whether two legs have one sheet: bars, masses, and gravity in their planes."""
    down, also = (leg.mount.rotation[2, :2] for leg in (one, other))
    same = one.linkage == other.linkage and one.masses == other.masses
    return same and bool(np.allclose(down, also, atol=1e-9))


def _alphas(arcs: Sequence[Arc], samples: int) -> Array:
    """Return crank angles of arcs, with their ends."""
    shares = [max(2, round(samples * (end - start) / TURN)) for start, end in arcs]
    spread = [np.linspace(*arc, share) for arc, share in zip(arcs, shares, strict=True)]
    return np.concatenate([np.empty(0), *spread])


def _path(linkage: Linkage) -> tuple[FootPath | None, Stance | None, str]:
    """Return the foot's path, its stance, and why there is none."""
    try:
        path = foot_path(LinkageLeg(linkage))
    except KinematicsError as error:
        return None, None, str(error)
    try:
        return path, path.stance(), ''
    except KinematicsError as error:
        return path, None, str(error)


def _bars(linkage: Linkage, *, turns: bool, margins: bool) -> tuple[tuple[BarFigures, ...], str]:
    """Return its numbers with their margins, and why there are none of these."""
    known, why = {}, ''
    if not turns:
        why = 'the crank does not turn fully'
    elif not linkage.is_dyadic and not margins:
        why = COUPLED
    else:
        try:
            known = length_margins(linkage)
        except PartialTurnError:
            # Nearer to a change point than rounding.
            why = 'the crank only just turns fully'
    bars = [
        BarFigures(d.name, d.unit, value, known.get(d.name))
        for d, value in zip(linkage.structure.dimensions, linkage.numbers, strict=True)
    ]
    return tuple(bars), why


def _transmission(linkage: Linkage, alphas: Array, angles: Array) -> tuple[Transmission, ...]:
    found = []
    for block, mu in zip(linkage.blocks, angles.T, strict=True):
        if np.isnan(mu).all():
            continue
        *_, one, other = block.names
        least, greatest = (
            Extreme(float(mu[k]), float(alphas[k])) for k in (np.nanargmin(mu), np.nanargmax(mu))
        )
        nearest = min(least.value, pi - greatest.value)
        at = least.at if nearest == least.value else greatest.at
        name = ', '.join(filter(None, (one, other))) if block.is_dyad else 'coupled loops'
        found.append(Transmission(name, mu, least, greatest, Extreme(nearest, at)))
    return tuple(found)


def _masses(leg: RobotLeg) -> tuple[BodyMassFigures, ...]:
    if leg.masses is None:
        return ()
    labels = leg.linkage.structure.labels
    return tuple(
        BodyMassFigures(label, body.mass, (body.centre.real, body.centre.imag), body.inertia)
        for label, body in zip(labels, leg.masses.bodies, strict=True)
    )


def _forces(dynamics: Dynamics, sheet: LegSheet, speed: float, load: float) -> LegForces:
    """Return what a leg takes at a speed with a load on its foot, if there is one."""
    alphas, foot = sheet.alphas, sheet.linkage.structure.foot
    loads = foot_load(foot, sheet.stance, alphas, load) if load and sheet.stance else None
    torque = dynamics.crank_torque(alphas, speed, 0.0, loads)
    carried = dynamics.reactions(alphas, speed, 0.0, loads)
    return LegForces(torque, tuple(_joints(sheet, carried)))


def _joints(sheet: LegSheet, carried: Reactions) -> list[JointForce]:
    alphas, found = sheet.alphas, []
    for point in sheet.linkage.structure.points:
        forces = [np.abs(force) for (name, _), force in carried.pins.items() if name == point]
        if forces:
            force = np.max(forces, axis=0)
            found.append(JointForce(point, force, _greatest(force, alphas)))
    for angle, (square, moment) in carried.lines.items():
        force = np.abs(square)
        turned = _greatest(np.abs(moment), alphas)
        found.append(JointForce(angle, force, _greatest(force, alphas), turned))
    return found


def _greatest(values: Array, alphas: Array) -> Extreme:
    if np.isnan(values).all():
        return Extreme(float('nan'), float('nan'))
    k = int(np.nanargmax(values))
    return Extreme(float(values[k]), float(alphas[k]))
