"""Proof of a leg: a full turn in one assembly mode, margins, tolerances, figures as reported."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any, NamedTuple

from klann_ros.datasheet import data_sheet, DataSheet, LegSheet
from klann_ros.export import weighed_leg
from klann_ros.gait import NoWalkerError, walk_figures
from klann_ros.kinematics import KinematicsError, Linkage, linkage_poses, tolerance_study
from klann_ros.robot import Robot, robot_from_file, robot_from_text, RobotLeg
from klann_ros.sanitize.text import printable
import numpy as np

from .figures import crank_angles, sheet_figures
from .leg_file import leg_text, parameter_text, walker_parameters, with_numbers
from .refine import path_error, point_error
from .requirements import Limit, Requirements
from .space import Space

# Relative half-width of all lengths where the requirements have no tolerance.
DEFAULT_TOLERANCE = 1e-3
STUDY_LEGS = 1000
STUDY_ANGLES = 180
SHEET_SAMPLES = 360
# Crank angles at which a leg is compared with its candidate, and with poses and forbidden areas.
PROOF_ANGLES = 2**14
# Poses with links nearer to a line are ill-conditioned: rounding decides their branch [rad].
MIN_TRANSMISSION_ANGLE = 1e-3
# Rounding of a file: distance of its foot from the candidate's, relative to the leg's size.
ROUNDING = 1e-6


class FittedCandidate(NamedTuple):
    """A linkage from a space, with its figures in the search (SI)."""

    space: Space
    linkage: Linkage
    expected: dict[str, float]


@dataclass(frozen=True, eq=False)
class FoundLeg:
    """A leg that fulfils the requirements, from a space."""

    leg: RobotLeg
    space: Space
    expected: dict[str, float]  #: its figures in the search (SI)
    reached: dict[str, float]  #: its figures in its data sheet (SI)
    #: The range of each dimension in which it turns, all others unchanged [m, rad].
    margins: dict[str, tuple[float, float]]
    #: Of the lengths in the study: relative, or in m where the requirements have one.
    tolerance: float
    non_turning_fraction: float  #: of the legs within the tolerance
    walker: Mapping[str, Any] | None = None  #: the parameters of the walker of the leg

    @property
    def linkage(self) -> Linkage:
        """Return its linkage, whose assembly mode it never leaves."""
        return self.leg.linkage


class ProofError(ValueError):
    """
    A leg that is no answer; the text says why.

    `limit` is the one that does not hold, and `value` the leg's figure (SI).
    """

    def __init__(self, text: str, limit: Limit | None = None, value: float = np.nan) -> None:
        super().__init__(text)
        self.limit = limit
        self.value = value


def prove(requirements: Requirements, candidate: FittedCandidate) -> FoundLeg:
    """
    Return the leg of a candidate's file, its figures computed again and checked.

    Only the file's text counts: no number of the search is used. Raises a ProofError if it does
    not turn fully, or in another way than the candidate, links are in line, or a limit fails.
    """
    try:
        text = leg_text(with_numbers(candidate.space.leg, candidate.linkage))
        (leg,) = robot_from_text(text, 'the leg').legs
        # Without masses the torque is that of the load alone.
        bare_leg = RobotLeg('', leg.linkage)
        sheet = _sheet(Robot('leg', (bare_leg,)), requirements, margins=True)
        leg = weighed_leg(leg, requirements.parts)
    except (KinematicsError, TypeError, ValueError) as error:
        raise ProofError(str(error)) from error
    (leg_sheet,) = sheet.legs
    if not leg_sheet.turns_fully:
        raise ProofError('the crank does not turn fully')
    figures = sheet_figures(sheet, leg.linkage)
    # NaN is refused, too.
    if not _least_angle(leg_sheet, figures) > MIN_TRANSMISSION_ANGLE:
        raise ProofError('links are in line')
    turn: Any = linkage_poses(leg.linkage, crank_angles(PROOF_ANGLES), points=True)
    # NaN where a loop does not close.
    deviation = np.abs(turn.h - linkage_poses(candidate.linkage, crank_angles(PROOF_ANGLES)).h)
    if not deviation.max() <= ROUNDING * leg.linkage.size:
        raise ProofError('its file has another leg')
    if requirements.target is not None:
        figures['path_error'] = path_error(requirements.target, leg.linkage)
        figures['point_error'] = point_error(requirements.target, leg.linkage)
    columns = requirements.turn_figures(leg.linkage.structure, turn.points[None])
    figures |= {name: float(column[0]) for name, column in columns.items()}
    if requirements.rounding is not None:
        figures['rounding_error'] = requirements.rounding.error(candidate.space, leg.linkage)
    non_turning_fraction = _non_turning_fraction(leg.linkage, requirements.tolerance)
    figures['turning_fraction'] = 1.0 - non_turning_fraction
    walker = None
    if requirements.walker is not None:
        walker, walker_figures = _walker(leg, requirements)
        figures |= walker_figures
    _check_limits(requirements, figures)
    margins = {}
    for bar in leg_sheet.bars:
        if bar.margin:
            margins[bar.name] = (bar.margin.least, bar.margin.greatest)
    return FoundLeg(
        leg=leg,
        space=candidate.space,
        expected=candidate.expected,
        reached={name: figure for name, figure in figures.items() if np.isfinite(figure)},
        margins=margins,
        tolerance=requirements.tolerance or DEFAULT_TOLERANCE,
        non_turning_fraction=non_turning_fraction,
        walker=walker,
    )


def _sheet(robot: Robot, requirements: Requirements, *, margins: bool) -> DataSheet:
    """Return the data sheet at the speed and the load that are required."""
    speed, load, motor = requirements.speed, requirements.load, requirements.motor
    return data_sheet(
        robot, speed=speed, load=load, motor=motor, margins=margins, samples=SHEET_SAMPLES
    )


def _least_angle(leg: LegSheet, figures: Mapping[str, float]) -> float:
    """Return the least angle of links from in line, but for change points, which lead on [rad]."""
    passing = {point.block for point in leg.linkage.change_points.points}
    if not passing:
        return figures['transmission_angle']
    angles = [pi / 2.0]
    for number, dyad in enumerate(leg.transmission, start=1):
        if number not in passing:
            angles.append(dyad.from_in_line.value)
    return float(np.min(angles))


def check_file(path: Path, leg: FoundLeg) -> None:
    """Raise a ProofError if the file of a leg that was proven has another leg."""
    try:
        robot = robot_from_file(path)
    except ValueError as error:
        raise ProofError(str(error)) from error
    if [robot_leg.linkage for robot_leg in robot.legs] != [leg.linkage]:
        raise ProofError(f'{printable(path)} has another leg than the one that was proven')


def _non_turning_fraction(linkage: Linkage, tolerance: float) -> float:
    """Return the fraction of legs that jam with a tolerance of all lengths [m]; 0: the default."""
    lengths = [d.name for d in linkage.structure.dimensions if d.is_length]
    tolerances = dict.fromkeys(lengths, tolerance) if tolerance else DEFAULT_TOLERANCE
    try:
        study = tolerance_study(linkage, tolerances, samples=STUDY_LEGS, crank_angles=STUDY_ANGLES)
    except ValueError as error:
        raise ProofError(str(error)) from error
    return study.non_turning_fraction


def _check_limits(requirements: Requirements, figures: Mapping[str, float]) -> None:
    for limit in requirements.limits:
        figure = figures.get(limit.figure, np.nan)
        if not limit.shortfall(figure) <= 0.0:
            raise ProofError(f'{limit.figure} does not hold', limit, float(figure))


def _walker(
    leg: RobotLeg, requirements: Requirements
) -> tuple[Mapping[str, Any], dict[str, float]]:
    """Return the parameters and the figures of a walker made of a leg."""
    try:
        parameters = walker_parameters(leg, requirements.walker or {})
        robot = robot_from_text(parameter_text(parameters), 'the walker')
        walk: Any = walk_figures(robot)
    except (NoWalkerError, KinematicsError) as error:
        raise ProofError(str(error)) from error
    figures = {'speed': walk.speed * requirements.speed, 'static_margin': walk.least_margin}
    if walk.stable_fraction:
        figures['height_variation'] = walk.height_variation
    if requirements.motor is not None:
        # A motor turns several legs, with their masses.
        sheet = _sheet(robot, requirements, margins=False)
        motor_margins = [crank.motor.margin for crank in sheet.cranks if crank.motor is not None]
        figures['motor_margin'] = min(motor_margins)
    return parameters, figures
