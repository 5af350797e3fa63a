"""Proof of a leg: a full turn in one assembly mode, margins, tolerances, figures as reported."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

from klann_ros.datasheet import data_sheet, SheetError
from klann_ros.gait import NoWalkerError, walk_figures
from klann_ros.kinematics import foot_path, KinematicsError, Linkage, LinkageLeg, tolerance_study
from klann_ros.robot import Robot, robot_from_parameters, RobotLeg
import numpy as np

from .figures import sheet_figures
from .leg_file import walker_parameters, with_numbers
from .requirements import Limit, Requirements
from .space import Space

_Content: TypeAlias = Mapping[str, Any]
_Figures: TypeAlias = dict[str, float]
# Relative half-width of all lengths where the requirements have no tolerance.
DEFAULT_TOLERANCE = 1e-3
STUDY_LEGS, STUDY_ANGLES = 1000, 180
# Crank angles of the comparison of a leg with its path.
PROOF_ANGLES = 1024


class FittedCandidate(NamedTuple):
    """A linkage from a space, with its figures in the search (SI)."""

    space: Space
    linkage: Linkage
    expected: dict[str, float]


@dataclass(frozen=True, eq=False)
class FoundLeg:
    """
    A leg that fulfils the requirements, from a space.

    Attributes
    ----------
    expected, reached : mapping of str to float
        Its figures in the search, and in its data sheet (SI).
    margins : mapping of str to (float, float)
        The range of each dimension in which it turns, all others unchanged [m, rad].
    tolerance : float
        Half-width of the lengths in the study: relative, or in m where the requirements have one.
    non_turning_fraction : float
        Of the legs within the tolerance.
    assembly : tuple of int
        Its assembly mode, which it never leaves.
    walker : mapping, optional
        The parameters of the walker of the leg.

    """

    leg: RobotLeg
    space: Space
    expected: dict[str, float]
    reached: dict[str, float]
    margins: dict[str, tuple[float, float]]
    tolerance: float
    non_turning_fraction: float
    assembly: tuple[int, ...]
    walker: Mapping[str, Any] | None = None

    @property
    def linkage(self) -> Linkage:
        """Return its linkage."""
        return self.leg.linkage


class ProofError(ValueError):
    """
    A leg that is no answer; the text says why.

    `limit` is the one that does not hold, and `value` the leg's figure (SI).
    """

    def __init__(self, text: str, limit: Limit | None = None, value: float = np.nan) -> None:
        super().__init__(text)
        self.limit, self.value = limit, value


def prove(requirements: Requirements, candidate: FittedCandidate) -> FoundLeg:
    """
    Return a leg with its proof.

    Raises
    ------
    ProofError
        It does not turn fully, or a limit does not hold.

    """
    try:
        # As its file has it, without masses: the torque is that of the load alone.
        leg = with_numbers(candidate.space.leg, candidate.linkage)
        linkage = leg.linkage
        sheet = data_sheet(
            Robot('leg', (RobotLeg('', linkage),)),
            speed=requirements.speed,
            load=requirements.load,
            motor=requirements.motor,
            margins=True,
            samples=360,
        )
    except (SheetError, KinematicsError, ValueError) as error:
        raise ProofError(str(error)) from error
    (of,) = sheet.legs
    if not of.turns_fully:
        raise ProofError('the crank does not turn fully')
    reached = sheet_figures(sheet, linkage)
    if not reached['transmission_angle'] > 0.0:
        raise ProofError('links are in line')
    if requirements.target is not None:
        h = foot_path(LinkageLeg(linkage), samples=PROOF_ANGLES).h[None]
        # In place: it may neither be moved nor turned nor scaled any more.
        fixed = replace(requirements.target, can_move=False, can_turn=False, can_scale=False)
        reached['path_error'] = float(fixed.fit(h).error[0])
    dimensions = zip(linkage.structure.dimensions, linkage.numbers, strict=True)
    lengths = {d.name: number for d, number in dimensions if d.is_length}
    is_absolute, width = bool(requirements.tolerance), requirements.tolerance or DEFAULT_TOLERANCE
    tolerances = {name: width if is_absolute else width * own for name, own in lengths.items()}
    try:
        study = tolerance_study(linkage, tolerances, samples=STUDY_LEGS, crank_angles=STUDY_ANGLES)
    except ValueError as error:
        raise ProofError(str(error)) from error
    reached['turning_fraction'] = 1.0 - study.non_turning_fraction
    walker = None
    if requirements.walker is not None:
        walker, figures = _walker(leg, requirements.walker, requirements.speed)
        reached |= figures
    for limit in requirements.limits:
        value = reached.get(limit.figure, np.nan)
        if not limit.shortfall(value) <= 0.0:
            raise ProofError(f'{limit.figure} does not hold', limit, float(value))
    return FoundLeg(
        leg,
        candidate.space,
        candidate.expected,
        {name: value for name, value in reached.items() if np.isfinite(value)},
        {bar.name: (bar.margin.least, bar.margin.greatest) for bar in of.bars if bar.margin},
        width,
        study.non_turning_fraction,
        linkage.assembly,
        walker,
    )


def _walker(leg: RobotLeg, wanted: Mapping[str, Any], speed: float) -> tuple[_Content, _Figures]:
    try:
        parameters = walker_parameters(leg, wanted)
        walk: Any = walk_figures(robot_from_parameters(parameters))
    except (NoWalkerError, KinematicsError) as error:
        raise ProofError(str(error)) from error
    figures = {'speed': walk.speed * speed, 'static_margin': walk.least_margin}
    if walk.stable_fraction:
        figures['height_variation'] = walk.height_variation
    return parameters, figures
