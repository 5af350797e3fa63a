"""From a robot to its data sheet."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf, pi
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

from .load import crank_load, CrankLoad, foot_load, LoadedLeg, turn_angles, with_extremes
from .motor import Motor, verdict
from .sheet import (
    BarFigures,
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
MIN_SPEED, MAX_SPEED = 1e-6, 1e6
MAX_LOAD = 1e9
# A robot with fewer legs cannot stand; the supports of one with more take minutes, as they grow
# with the third power.
MIN_WALKING_LEGS = 3
MAX_WALKING_LEGS = 24
# A sheet takes a time proportional to the legs that differ.
MAX_SHEET_LEGS = 100
# Distances from change points at which forces are compared [rad]: those that grow without bound
# towards them double from the far to the near one.
NEAR, FAR = 1e-3, 2e-3
MIN_GROWTH = 1.5
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
    options = _SheetOptions(robot, float(speed), float(load), motor, margins, samples)
    alike: dict[Any, list[RobotLeg]] = {}
    for leg in robot.legs:
        # Equal bars, masses, and gravity in their planes.
        down = (*leg.mount.rotation[2, :2].round(9).tolist(),)
        alike.setdefault((leg.linkage, leg.masses, down), []).append(leg)
    sheets = [_leg_sheet(options, legs) for legs in alike.values()]
    missing = _missing_masses(robot)
    if motor is not None and missing and not load:
        raise SheetError(f'{missing}; a motor is checked by masses, or by --load')
    sheets_by_name: dict[str, LegSheet] = {}
    for sheet in sheets:
        sheets_by_name |= dict.fromkeys(sheet.names, sheet)
    walk, no_walk = _walk_figures(robot)
    cranks = [_crank_sheet(options, joint, sheets_by_name) for joint in robot.crank_joints]
    return DataSheet(
        name=robot.name,
        source=robot.source,
        speed=options.speed,
        load=options.load,
        legs=tuple(sheets),
        cranks=tuple(cranks),
        motor=motor,
        no_forces=_no_forces(sheets, missing, load),
        walk=walk,
        no_walk=no_walk,
        body_mass=robot.body.mass if robot.body else 0.0,
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


class _SheetOptions(NamedTuple):
    """The options of `data_sheet`."""

    robot: Robot
    speed: float
    load: float
    motor: Motor | None
    margins: bool
    samples: int


def _missing_masses(robot: Robot) -> str:
    """Return a message about legs without masses; '' without any."""
    massless = [leg.name for leg in robot.legs if leg.masses is None]
    if not massless:
        return ''
    legs = f' for {", ".join(massless)}' if len(massless) < len(robot.legs) else ''
    return f'no masses: bar_density [kg/m] (a linkage: density, or parts) is missing{legs}'


def _no_forces(legs: Sequence[LegSheet], missing: str, load: float) -> str:
    reasons = []
    if not all(leg.turns_fully for leg in legs):
        reasons.append('the crank does not turn fully: there are no forces over a turn')
    if missing:
        reasons.append(f'{missing}; the figures are of the load alone' if load else missing)
    torques = [forces.torque for leg in legs for _, forces in cases(leg)]
    if torques and np.isnan(np.concatenate(torques)).any():
        reasons.append(
            'links are in line at a crank angle, where no force follows from the motion'
        )
    return '; '.join(reasons)


def _crank_sheet(options: _SheetOptions, joint: str, sheets: Mapping[str, LegSheet]) -> CrankSheet:
    """Return the forces and the motor of a crank joint, which need legs that turn fully."""
    robot = options.robot
    speed = options.speed
    legs = robot.on_joint(joint)
    crank_sheet = CrankSheet(
        joint=joint,
        legs=tuple(leg.name for leg in legs),
        is_own=len(legs) == 1 and (legs[0].direction, legs[0].phase) == (1, 0.0),
        empty=None,
        loaded=None,
        motor=None,
    )
    if not all(sheets[leg.name].turns_fully for leg in legs):
        return crank_sheet
    loaded_legs: list[LoadedLeg] = []
    load_steps = []
    turns = max(leg.linkage.change_points.period for leg in legs)
    for leg in legs:
        stance = sheets[leg.name].stance
        loaded_legs.append(LoadedLeg(leg, _dynamics(robot, leg), stance))
        if options.load and stance:
            for turn in range(turns):
                load_steps.append(leg.direction * (stance.start - leg.phase) + TURN * turn)
                load_steps.append(leg.direction * (stance.end - leg.phase) + TURN * turn)
    has_masses = all(leg.masses is not None for leg in legs)

    def loads(angles: FloatArray) -> tuple[CrankLoad | None, CrankLoad | None]:
        """Return the crank's load at angles [rad], without and with the load on the feet."""
        empty = crank_load(loaded_legs, 0.0, angles) if has_masses else None
        full = crank_load(loaded_legs, options.load, angles) if options.load else None
        return empty, full

    angles = turn_angles(options.samples, load_steps, turns)
    curves: list[FloatArray] = []
    for load in loads(angles):
        if load:
            curves += [load.static_torque, load.per_speed_squared, load.torque(speed)]
    empty, full = loads(with_extremes(angles, curves))
    decisive = full or empty
    motor = options.motor
    return replace(
        crank_sheet,
        empty=empty.turn(speed) if empty else None,
        loaded=full.turn(speed) if full else None,
        motor=verdict(motor, decisive, speed) if motor and decisive else None,
    )


def _walk_figures(robot: Robot) -> tuple[GaitFigures | None, str]:
    """Return the figures of a walk, and why there are none; neither for a few legs."""
    count = len(robot.legs)
    if count < MIN_WALKING_LEGS:
        return None, ''
    if count > MAX_WALKING_LEGS:
        return None, f'no gait is computed of {count} legs: at most {MAX_WALKING_LEGS}'
    try:
        return walk_figures(robot), ''
    except NoWalkerError as error:
        return None, str(error)


def _leg_sheet(options: _SheetOptions, legs: Sequence[RobotLeg]) -> LegSheet:
    """Return the sheet of legs that are alike."""
    leg = legs[0]
    linkage = leg.linkage
    load = options.load
    arcs = tuple(reachable_arcs(linkage))
    turns = arcs == ((0.0, TURN),)
    path, stance, no_stance = _path(linkage)
    if turns:
        load_steps = (stance.start, stance.end) if load and stance else ()
        alphas = turn_angles(options.samples, load_steps, linkage.change_points.period)
    else:
        alphas = _arc_angles(arcs, options.samples)
    bars, no_margins = _bars(linkage, turns=turns, margins=options.margins)
    sheet = LegSheet(
        names=tuple(equal_leg.name for equal_leg in legs),
        linkage=linkage,
        # A load stands on a foot, and so does a walker.
        has_foot=leg.has_foot or bool(load) or options.robot.is_walker,
        bars=bars,
        no_margins=no_margins,
        turns_fully=turns,
        arcs=arcs,
        path=path,
        stance=stance,
        no_stance=no_stance,
        masses=leg.masses,
        empty=None,
        loaded=None,
        **_poses(linkage, alphas),
    )
    if not turns:
        return sheet
    if load and stance is None:
        raise SheetError(f'a load on the foot has nowhere to be: {no_stance}')

    def with_forces() -> LegSheet:
        dynamics = _dynamics(options.robot, leg)
        empty = _forces(dynamics, sheet, options.speed, 0.0) if leg.masses else None
        loaded = _forces(dynamics, sheet, options.speed, load) if load else None
        return replace(sheet, empty=empty, loaded=loaded)

    curves: list[FloatArray] = []
    for _, forces in cases(with_forces()):
        curves += [forces.torque, *(joint.force for joint in forces.joints)]
    sheet = replace(sheet, **_poses(linkage, with_extremes(alphas, curves)))
    return with_forces()


def _poses(linkage: Linkage, alphas: FloatArray) -> dict[str, Any]:
    """Return the fields of a sheet that are sampled over crank angles [rad]."""
    poses: Any = linkage_poses(linkage, alphas, points=True, transmission_angles=True)
    transmission = _transmission(linkage, alphas, poses.transmission_angles)
    return {'alphas': alphas, 'points': poses.points, 'transmission': transmission}


def _dynamics(robot: Robot, leg: RobotLeg) -> Dynamics:
    """Return the dynamics of a leg; without masses a massless one, which carries a load too."""
    if leg.masses is not None:
        return robot.dynamics(leg)
    return Dynamics(leg.linkage, Masses((BodyMass(),) * len(leg.linkage.structure.bodies)))


def _arc_angles(arcs: Sequence[Arc], samples: int) -> FloatArray:
    angles = [np.empty(0)]
    for start, end in arcs:
        share = max(2, round(samples * (end - start) / TURN))
        angles.append(np.linspace(start, end, share))
    return np.concatenate(angles)


def _path(linkage: Linkage) -> tuple[FootPath | None, Stance | None, str]:
    path = None
    try:
        path = foot_path(LinkageLeg(linkage))
        return path, path.stance(), ''
    except KinematicsError as error:
        return path, None, str(error)


def _bars(linkage: Linkage, *, turns: bool, margins: bool) -> tuple[tuple[BarFigures, ...], str]:
    """Return the bars, and the reason for missing margins, or ''."""
    margin_of: dict[str, Margin] = {}
    reason = '' if linkage.is_dyadic or margins else COUPLED
    if not turns:
        reason = 'the crank does not turn fully'
    if not reason:
        try:
            margin_of = length_margins(linkage)
        except PartialTurnError:
            # Within rounding of a change point.
            reason = 'the crank only just turns fully'
    bars = []
    for dimension, number in zip(linkage.structure.dimensions, linkage.numbers, strict=True):
        name = dimension.name
        bars.append(BarFigures(name, dimension.unit, number, margin_of.get(name)))
    return tuple(bars), reason


def _transmission(
    linkage: Linkage, alphas: FloatArray, angles: FloatArray
) -> tuple[Transmission, ...]:
    """Return the transmission angles of each block, [rad], with their extremes."""
    transmission = []
    for block, mu in zip(linkage.blocks, angles.T, strict=True):
        if np.isnan(mu).all():
            continue
        links = filter(None, block.names[-2:])
        name = ', '.join(links) if block.is_dyad else 'coupled loops'
        minimum = _extreme(mu, alphas, int(np.nanargmin(mu)))
        maximum = _extreme(mu, alphas, int(np.nanargmax(mu)))
        if minimum.value <= pi - maximum.value:
            from_in_line = minimum
        else:
            from_in_line = Extreme(pi - maximum.value, maximum.at)
        transmission.append(Transmission(name, mu, minimum, maximum, from_in_line))
    return tuple(transmission)


def _forces(dynamics: Dynamics, sheet: LegSheet, speed: float, load: float) -> LegForces:
    alphas = sheet.alphas
    loads = foot_load(sheet.linkage.structure.foot, sheet.stance, alphas, load)
    torque = dynamics.crank_torque(alphas, speed, 0.0, loads)
    joints = _joints(sheet, dynamics.reactions(alphas, speed, 0.0, loads), alphas)
    change_angles = np.unique([point.beta for point in sheet.linkage.change_points.points])
    if not len(change_angles):
        return LegForces(torque, tuple(joints))

    def forces_beside(distance: float) -> FloatArray:
        """Return the forces of all joints at a distance from each change point [rad]."""
        beside = change_angles + distance
        beside_loads = foot_load(sheet.linkage.structure.foot, sheet.stance, beside, load)
        reactions = dynamics.reactions(beside, speed, 0.0, beside_loads)
        return np.array([joint.force for joint in _joints(sheet, reactions, beside)])

    grows = forces_beside(NEAR) > MIN_GROWTH * forces_beside(FAR)
    grows |= forces_beside(-NEAR) > MIN_GROWTH * forces_beside(-FAR)
    for n in np.flatnonzero(grows.any(axis=1)).tolist():
        angle = float(change_angles[grows[n].argmax()])
        joints[n] = joints[n]._replace(greatest=Extreme(inf, angle))
    return LegForces(torque, tuple(joints))


def _joints(sheet: LegSheet, reactions: Reactions, alphas: FloatArray) -> list[JointForce]:
    joints = []
    for point in sheet.linkage.structure.points:
        forces = [np.abs(force) for (name, _), force in reactions.pins.items() if name == point]
        if forces:
            force = np.max(forces, axis=0)
            joints.append(JointForce(point, force, _maximum(force, alphas)))
    for angle, (normal, moment) in reactions.lines.items():
        force = np.abs(normal)
        max_moment = _maximum(np.abs(moment), alphas)
        joints.append(JointForce(angle, force, _maximum(force, alphas), max_moment))
    return joints


def _maximum(curve: FloatArray, alphas: FloatArray) -> Extreme:
    if np.isnan(curve).all():
        return Extreme(float('nan'), float('nan'))
    return _extreme(curve, alphas, int(np.nanargmax(curve)))


def _extreme(curve: FloatArray, alphas: FloatArray, index: int) -> Extreme:
    return Extreme(float(curve[index]), float(alphas[index]))
