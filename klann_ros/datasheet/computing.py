"""From a robot to its data sheet."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from math import isfinite

from klann_ros.kinematics.angles import TURN
from klann_ros.robot import Robot, RobotLeg
from klann_ros.walker import GaitFigures, NoWalkerError, walk_figures
import numpy as np

from .leg_sheet import alike, dynamics_of, leg_sheet
from .load import crank_load, CrankLoad, turn_angles, Turned, with_extremes
from .motor import Motor, verdict
from .sheet import CrankSheet, DataSheet, LegSheet, SheetError

# A turn a second.
SPEED = TURN
SHEET_SAMPLES = 720
# Nothing that is built turns slower or faster [rad/s], or carries more [N].
SLOWEST, FASTEST, MOST = 1e-6, 1e6, 1e9
# With fewer legs a robot cannot stand.
FEWEST_LEGS = 3


def data_sheet(
    robot: Robot,
    *,
    speed: float = SPEED,
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
        The force of the ground on each foot that stands, up along y of the leg's plane [N].
    motor : Motor, optional
        The motor of each crank.
    margins : bool
        Whether the margins of coupled loops are wanted, too, which take seconds.
    samples : int
        Of the turn; those where the load steps are added.

    Raises
    ------
    SheetError
        A number is refused; a load is asked about where no foot stands, or a motor where there
        are neither masses nor a load.

    """
    _check(speed, load)
    first, number = _distinct(robot.legs)
    sheets = [
        leg_sheet(robot, leg, speed, load, margins=margins, samples=samples) for leg in first
    ]
    names = [
        tuple(leg.name for leg, own in zip(robot.legs, number, strict=True) if own == k)
        for k in range(len(sheets))
    ]
    legs = tuple(replace(sheet, names=own) for sheet, own in zip(sheets, names, strict=True))
    missing = _missing(robot)
    if motor is not None and missing and not load:
        raise SheetError(f'{missing}; a motor is judged by masses, or by --load')
    of = {leg.name: sheets[k] for leg, k in zip(robot.legs, number, strict=True)}
    cranks = []
    for joint in robot.crank_joints:
        turned = [
            Turned(leg, dynamics_of(robot, leg), own.stance, own.turns_fully)
            for leg in robot.on_joint(joint)
            for own in [of[leg.name]]
        ]
        crank, hardest = _crank(joint, turned, speed, load, samples)
        cranks.append(_judged(crank, hardest, motor, speed))
    walk, no_walk = _walk(robot)
    return DataSheet(
        name=robot.name,
        source=robot.source,
        speed=float(speed),
        load=float(load),
        legs=legs,
        cranks=tuple(cranks),
        motor=motor,
        no_forces=_no_forces(legs, missing, load),
        walk=walk,
        no_walk=no_walk,
    )


def _check(speed: float, load: float) -> None:
    if not (isfinite(speed) and SLOWEST <= abs(speed) <= FASTEST):
        raise SheetError(
            f'speed = {speed!r} rad/s is refused: a number whose size is {SLOWEST:g} to '
            f'{FASTEST:g}, negative for clockwise'
        )
    if not (isfinite(load) and 0.0 <= load <= MOST):
        raise SheetError(f'load = {load!r} N is refused: a number from 0 to {MOST:g}')


def _distinct(legs: Sequence[RobotLeg]) -> tuple[list[RobotLeg], list[int]]:
    """Return each leg that is different once, and of all legs which of these they are."""
    first: list[RobotLeg] = []
    number = []
    for leg in legs:
        like = next((k for k, known in enumerate(first) if alike(known, leg)), len(first))
        if like == len(first):
            first.append(leg)
        number.append(like)
    return first, number


def _missing(robot: Robot) -> str:
    """Return which masses are missing; '' if none is."""
    without = [leg for leg in robot.legs if leg.masses is None]
    if not without:
        return ''
    one = len(without) == len(robot.legs)
    which = '' if one else f' for {", ".join(leg.name for leg in without)}'
    return f'no masses: bar_density [kg/m] (a linkage: density) is missing{which}'


def _no_forces(legs: Sequence[LegSheet], missing: str, load: float) -> str:
    reasons = []
    if not all(leg.turns_fully for leg in legs):
        reasons.append('the crank does not turn fully: there are no forces over a turn')
    if missing:
        reasons.append(f'{missing}; the figures are of the load alone' if load else missing)
    lost = [leg for leg in legs if any(np.isnan(of.torque).any() for of in leg.cases)]
    if lost:
        reasons.append(
            'links are in line at a crank angle, where no force follows from the motion'
        )
    return '; '.join(reasons)


def _crank(
    joint: str, turned: Sequence[Turned], speed: float, load: float, samples: int
) -> tuple[CrankSheet, CrankLoad | None]:
    """Return the sheet of a joint without its motor, and what the motor has to turn."""
    legs = [each.leg for each in turned]
    (first, *others) = legs
    bare = CrankSheet(
        joint=joint,
        legs=tuple(leg.name for leg in legs),
        is_own=not others and (first.direction, first.phase) == (1, 0.0),
        empty=None,
        loaded=None,
        motor=None,
    )
    if not all(each.is_full for each in turned):
        return bare, None
    weighed = all(leg.masses is not None for leg in legs)
    edges = [edge for each in turned for edge in each.edges] if load else []
    angles = turn_angles(samples, edges)

    def cases() -> list[CrankLoad | None]:
        return [
            crank_load(turned, 0.0, angles) if weighed else None,
            crank_load(turned, load, angles) if load else None,
        ]

    known = [case for case in cases() if case]
    curves = [(case.still, case.per_speed_squared, case.torque(speed)) for case in known]
    angles = with_extremes(angles, chain.from_iterable(curves))
    empty, loaded = cases()
    empty_turn, loaded_turn = (each.turn(speed) if each else None for each in (empty, loaded))
    return replace(bare, empty=empty_turn, loaded=loaded_turn), loaded or empty


def _judged(
    crank: CrankSheet, load: CrankLoad | None, motor: Motor | None, speed: float
) -> CrankSheet:
    if motor is None or load is None:
        return crank
    return replace(crank, motor=verdict(motor, load, speed))


def _walk(robot: Robot) -> tuple[GaitFigures | None, str]:
    if len(robot.legs) < FEWEST_LEGS:
        return None, ''
    try:
        return walk_figures(robot), ''
    except NoWalkerError as error:
        return None, str(error)
