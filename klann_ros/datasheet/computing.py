"""From a robot to its data sheet."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from math import pi
from typing import Any, NamedTuple

from klann_ros.dynamics import BodyMass, Dynamics, GRAVITY, Masses, Reactions
from klann_ros.gait import GaitFigures, NoWalkerError, walk_figures
from klann_ros.kinematics import (
    foot_path,
    FootPath,
    KinematicsError,
    length_margins,
    Linkage,
    linkage_poses,
    LinkageLeg,
    Margin,
    PartialTurnError,
    reachable_arcs,
    Stance,
)
from klann_ros.kinematics.angles import Arc, TURN
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import Robot, RobotLeg
import numpy as np

from .load import crank_load, CrankLoad, foot_load, turn_angles, with_extremes
from .motor import Motor, verdict
from .sheet import (
    BarFigures,
    BodyMassFigures,
    cases,
    CrankSheet,
    DataSheet,
    Extreme,
    JointForce,
    LegForces,
    LegSheet,
    SheetError,
    Transmission,
)

# A turn a second.
DEFAULT_SPEED = TURN
SHEET_SAMPLES = 720
# Limits of the crank's rate [rad/s] and of the load [N].
MIN_SPEED, MAX_SPEED, MAX_LOAD = 1e-6, 1e6, 1e9
# A robot with fewer legs cannot stand; the supports of one with more take minutes, as they grow
# with the third power.
MIN_WALKING_LEGS, MAX_WALKING_LEGS = 3, 24
# A sheet takes a time proportional to the legs that differ.
MAX_SHEET_LEGS = 100
COUPLED = 'of coupled loops they take seconds: --margins'


def data_sheet(
    robot: Robot,
    *,
    speed: float = DEFAULT_SPEED,
    load: float = 0.0,
    motor: Motor | None = None,
    margins: bool = False,
    samples: int = SHEET_SAMPLES,
) -> DataSheet:
    """
    Return the data sheet of a leg or of a walker.

    Parameters
    ----------
    robot : Robot
        The robot.
    speed : float
        Constant rate of the cranks; negative is clockwise [rad/s].
    load : float
        Ground reaction of each foot in stance, up along y of the leg's plane [N].
    motor : Motor, optional
        The motor of each crank.
    margins : bool
        Whether to compute the margins of coupled loops as well, which takes seconds.
    samples : int
        Samples of the turn, besides those at steps of the load and at extremes.

    Raises
    ------
    SheetError
        A number is invalid; the legs are too many; there is a load but no stance, or a motor but
        neither masses nor load.

    """
    if len(robot.legs) > MAX_SHEET_LEGS:
        raise SheetError(f'{len(robot.legs)} legs are refused: at most {MAX_SHEET_LEGS}')
    if not MIN_SPEED <= abs(speed) <= MAX_SPEED:
        raise SheetError(
            f'speed = {speed!r} rad/s is refused: a number whose size is {MIN_SPEED:g} to '
            f'{MAX_SPEED:g}, negative for clockwise'
        )
    if not 0.0 <= load <= MAX_LOAD:
        raise SheetError(f'load = {load!r} N is refused: a number from 0 to {MAX_LOAD:g}')
    request = _Request(robot, float(speed), float(load), motor, margins, samples)
    alike: dict[Any, list[RobotLeg]] = {}
    for leg in robot.legs:
        # Equal bars, masses, and gravity in their planes.
        down = (*leg.mount.rotation[2, :2].round(9).tolist(),)
        alike.setdefault((leg.linkage, leg.masses, down), []).append(leg)
    sheets = [_leg_sheet(request, legs) for legs in alike.values()]
    missing = _missing_masses(robot)
    if motor is not None and missing and not load:
        raise SheetError(f'{missing}; a motor is judged by masses, or by --load')
    by_name = {name: sheet for sheet in sheets for name in sheet.names}
    walk, no_walk = _walk(robot)
    return DataSheet(
        name=robot.name,
        source=robot.source,
        speed=request.speed,
        load=request.load,
        legs=tuple(sheets),
        cranks=tuple(_crank(request, joint, by_name) for joint in robot.crank_joints),
        motor=motor,
        no_forces=_no_forces(sheets, missing, load),
        walk=walk,
        no_walk=no_walk,
    )


def peak_efforts(robot: Robot, speed: float = 1.0) -> dict[str, float]:
    """
    Return the largest crank torque of each joint of a walker on three feet [N m].

    All cranks have the same speed [rad/s]. Without masses it is empty.
    """
    if robot.body is None or _missing_masses(robot):
        return {}
    sheet = data_sheet(robot, speed=speed, load=robot.body.mass * GRAVITY / 3.0)
    return {crank.joint: crank.loaded.peak for crank in sheet.cranks if crank.loaded}


class _Request(NamedTuple):
    """The parameters of `data_sheet`."""

    robot: Robot
    speed: float
    load: float
    motor: Motor | None
    margins: bool
    samples: int


def _missing_masses(robot: Robot) -> str:
    """Return a message about legs without masses; '' without any."""
    without = [leg for leg in robot.legs if leg.masses is None]
    if not without:
        return ''
    is_all = len(without) == len(robot.legs)
    which = '' if is_all else f' for {", ".join(leg.name for leg in without)}'
    return f'no masses: bar_density [kg/m] (a linkage: density) is missing{which}'


def _no_forces(legs: Sequence[LegSheet], missing: str, load: float) -> str:
    reasons = []
    if not all(leg.turns_fully for leg in legs):
        reasons.append('the crank does not turn fully: there are no forces over a turn')
    if missing:
        reasons.append(f'{missing}; the figures are of the load alone' if load else missing)
    if any(np.isnan(of.torque).any() for leg in legs for _, of in cases(leg)):
        reasons.append(
            'links are in line at a crank angle, where no force follows from the motion'
        )
    return '; '.join(reasons)


def _crank(request: _Request, joint: str, sheets: Mapping[str, LegSheet]) -> CrankSheet:
    robot, speed, load, motor, _, samples = request
    (first, *others) = legs = robot.on_joint(joint)
    bare = CrankSheet(
        joint=joint,
        legs=tuple(leg.name for leg in legs),
        is_own=not others and (first.direction, first.phase) == (1, 0.0),
        empty=None,
        loaded=None,
        motor=None,
    )
    if not all(sheets[leg.name].turns_fully for leg in legs):
        return bare
    loaded = [(leg, _dynamics(robot, leg), sheets[leg.name].stance) for leg in legs]
    edges = [
        leg.direction * (alpha - leg.phase)
        for leg, _, stance in loaded
        for alpha in ((stance.start, stance.end) if load and stance else ())
    ]
    has_masses = all(leg.masses is not None for leg in legs)
    angles = turn_angles(samples, edges)

    def loads() -> list[CrankLoad | None]:
        return [
            crank_load(loaded, 0.0, angles) if has_masses else None,
            crank_load(loaded, load, angles) if load else None,
        ]

    known = filter(None, loads())
    curves = [(case.still, case.per_speed_squared, case.torque(speed)) for case in known]
    angles = with_extremes(angles, chain.from_iterable(curves))
    empty, full = loads()
    judged = full or empty
    return replace(
        bare,
        empty=empty.turn(speed) if empty else None,
        loaded=full.turn(speed) if full else None,
        motor=verdict(motor, judged, speed) if motor and judged else None,
    )


def _walk(robot: Robot) -> tuple[GaitFigures | None, str]:
    count = len(robot.legs)
    if count < MIN_WALKING_LEGS:
        return None, ''
    if count > MAX_WALKING_LEGS:
        return None, f'no gait is computed of {count} legs: at most {MAX_WALKING_LEGS}'
    try:
        return walk_figures(robot), ''
    except NoWalkerError as error:
        return None, str(error)


def _leg_sheet(request: _Request, legs: Sequence[RobotLeg]) -> LegSheet:
    """Return the sheet of legs that are alike."""
    robot, speed, load, _, margins, samples = request
    leg, linkage = legs[0], legs[0].linkage
    arcs = tuple(reachable_arcs(linkage))
    turns = arcs == ((0.0, TURN),)
    path, stance, no_stance = _path(linkage)
    edges = (stance.start, stance.end) if load and stance else ()
    alphas = turn_angles(samples, edges) if turns else _arc_angles(arcs, samples)
    bars, no_margins = _bars(linkage, turns=turns, margins=margins)
    sheet = LegSheet(
        names=tuple(each.name for each in legs),
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
        dynamics = _dynamics(robot, leg)
        empty = _forces(dynamics, sheet, speed, 0.0) if leg.masses else None
        loaded = _forces(dynamics, sheet, speed, load) if load else None
        return replace(sheet, empty=empty, loaded=loaded)

    known = cases(with_forces())
    curves = [curve for _, of in known for curve in (of.torque, *(j.force for j in of.joints))]
    sheet = replace(sheet, **_poses(linkage, with_extremes(alphas, curves)))
    return with_forces()


def _poses(linkage: Linkage, alphas: FloatArray) -> dict[str, Any]:
    """Return the fields of a sheet that are sampled over crank angles [rad]."""
    found: Any = linkage_poses(linkage, alphas, points=True, transmission_angles=True)
    transmission = _transmission(linkage, alphas, found.transmission_angles)
    return {'alphas': alphas, 'points': found.points, 'transmission': transmission}


def _dynamics(robot: Robot, leg: RobotLeg) -> Dynamics:
    """Return the dynamics of a leg; without masses a massless one, which carries a load too."""
    if leg.masses is not None:
        return robot.dynamics(leg)
    return Dynamics(leg.linkage, Masses((BodyMass(),) * len(leg.linkage.structure.bodies)))


def _arc_angles(arcs: Sequence[Arc], samples: int) -> FloatArray:
    shares = [max(2, round(samples * (end - start) / TURN)) for start, end in arcs]
    spread = [np.linspace(*arc, share) for arc, share in zip(arcs, shares, strict=True)]
    return np.concatenate([np.empty(0), *spread])


def _path(linkage: Linkage) -> tuple[FootPath | None, Stance | None, str]:
    path = None
    try:
        path = foot_path(LinkageLeg(linkage))
        return path, path.stance(), ''
    except KinematicsError as error:
        return path, None, str(error)


def _bars(linkage: Linkage, *, turns: bool, margins: bool) -> tuple[tuple[BarFigures, ...], str]:
    known: dict[str, Margin] = {}
    reason = '' if linkage.is_dyadic or margins else COUPLED
    if not turns:
        reason = 'the crank does not turn fully'
    if not reason:
        try:
            known = length_margins(linkage)
        except PartialTurnError:
            # Within rounding of a change point.
            reason = 'the crank only just turns fully'
    bars = [
        BarFigures(d.name, d.unit, value, known.get(d.name))
        for d, value in zip(linkage.structure.dimensions, linkage.numbers, strict=True)
    ]
    return tuple(bars), reason


def _transmission(
    linkage: Linkage, alphas: FloatArray, angles: FloatArray
) -> tuple[Transmission, ...]:
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
    alphas, foot = sheet.alphas, sheet.linkage.structure.foot
    loads = foot_load(foot, sheet.stance, alphas, load)
    torque = dynamics.crank_torque(alphas, speed, 0.0, loads)
    reactions = dynamics.reactions(alphas, speed, 0.0, loads)
    return LegForces(torque, tuple(_joints(sheet, reactions)))


def _joints(sheet: LegSheet, reactions: Reactions) -> list[JointForce]:
    alphas, found = sheet.alphas, []
    for point in sheet.linkage.structure.points:
        forces = [np.abs(force) for (name, _), force in reactions.pins.items() if name == point]
        if forces:
            force = np.max(forces, axis=0)
            found.append(JointForce(point, force, _greatest(force, alphas)))
    for angle, (normal, moment) in reactions.lines.items():
        force = np.abs(normal)
        largest = _greatest(np.abs(moment), alphas)
        found.append(JointForce(angle, force, _greatest(force, alphas), largest))
    return found


def _greatest(values: FloatArray, alphas: FloatArray) -> Extreme:
    if np.isnan(values).all():
        return Extreme(float('nan'), float('nan'))
    k = int(np.nanargmax(values))
    return Extreme(float(values[k]), float(alphas[k]))
