"""Solver parameters of a run: geometry, direction, phase and masses of its legs."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
import json
import sys
from typing import Any

from klann_ros.dynamics import Dynamics
from klann_ros.kinematics import AnyLeg, LinkageLeg
from klann_ros.log.run_parameters import solver_parameters, SOLVER_RECORD, SolverParameters
from klann_ros.review.model.recording import LegRecording, LegSolver
from klann_ros.robot import Robot, robot_from_parameters
from klann_ros.robot.file import LEG_PARAMETERS, of_leg
from klann_ros.robot.robot import SEPARATORS
from klann_ros.sanitize.text import printable

# Source of a reference leg.
REFERENCE = '--geometry'
Metadata = Mapping[str, Sequence[Mapping[str, str]]]


def solver_records(metadata: Metadata) -> list[SolverParameters]:
    """Return the solver parameters of a run, in the order of time."""
    found = []
    for record in metadata.get(SOLVER_RECORD, ()):
        with suppress(ValueError):
            found.append(solver_parameters(record))
    return sorted(found, key=lambda solver: solver.time)


def leg_solvers(
    records: Sequence[SolverParameters], namespace: str, reference: Robot | None = None
) -> dict[str, LegSolver]:
    """
    Return the solvers of the legs in a namespace by their names, '' for the unnamed one.

    Without one in the namespace, the last node of the run counts.

    Parameters
    ----------
    records : sequence of SolverParameters
        Solver parameters of the run, in the order of time.
    namespace : str
        Namespace of the legs.
    reference : Robot, optional
        The reference robot, which replaces the legs in the run.

    """
    own = [record for record in records if parent(record.node) == namespace]
    own = own or [record for record in records if record.node == records[-1].node]
    # The last parameters of each node count; several nodes may have the same leg.
    last = {record.node: _names(record.parameters.get('legs')) for record in own}
    return {
        name: _solver([record for record in own if name in last[record.node]], name, reference)
        for name in dict.fromkeys(name for names in last.values() for name in names)
    }


def _solver(own: Sequence[SolverParameters], name: str, reference: Robot | None) -> LegSolver:
    values = [of_leg(record.parameters, name) for record in own]
    legs = (
        [reference_leg(reference, name)]
        if reference
        else [_leg(parameters) for parameters in values]
    )
    last, source = values[-1], REFERENCE if reference else ''
    if legs[-1] and not reference:
        source = f'the parameters of {printable(own[-1].node)}'
    return LegSolver(
        crank_joint=str(last.get('crank_joint') or LegSolver.crank_joint),
        sim_time=any(record.parameters.get('use_sim_time') is True for record in own),
        leg=legs[-1],
        leg_time=0 if reference else last_change([record.time for record in own], legs),
        direction=_number(last.get('direction'), 1),
        phase=_number(last.get('phase'), 0.0),
        nodes=tuple(dict.fromkeys(record.node for record in own)),
        source=source,
        joint_separator='_' if last.get('joint_separator') == '_' else '/',
    )


def last_change(times: Sequence[int], legs: Sequence[AnyLeg | None]) -> int:
    """Return the time of the last change of a leg; 0 for none."""
    linkages = [leg and leg.linkage for leg in legs]
    changes = zip(times[1:], linkages, linkages[1:], strict=False)
    return max((time for time, before, after in changes if before != after), default=0)


def _names(legs: Any) -> tuple[str, ...]:
    """Return the leg names of an unchecked parameter; '' for the unnamed leg."""
    names = [str(name) for name in legs if name] if isinstance(legs, list) else []
    return tuple(names) or ('',)


def _number(value: Any, otherwise: float) -> float:
    number = isinstance(value, int | float) and abs(value) <= sys.float_info.max
    return value if number else otherwise


def parent(name: str) -> str:
    """Return the namespace of a full name; '' for the root."""
    return name.rpartition('/')[0]


def reference_leg(robot: Robot | None, name: str) -> AnyLeg | None:
    """Return the leg of a robot by its name; None without one."""
    leg = robot and robot.leg(name)
    return LinkageLeg(leg.linkage) if leg else None


def published_legs(names: Sequence[str], joints: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the name and the separator of each leg with all its joints among the names."""
    known = set(names)
    for name in names:
        head = name.removesuffix(joints[0])
        prefix, separator = head[:-1], head[-1:] or SEPARATORS[0]
        is_prefix = head == '' or (prefix and separator in SEPARATORS)
        if head != name and is_prefix and all(f'{head}{other}' in known for other in joints):
            yield prefix, separator


def _leg(parameters: Mapping[str, Any]) -> AnyLeg | None:
    # The run has the text of a linkage; a file name in it is never opened.
    parameters_ = {
        name: parameters[name]
        for name in LEG_PARAMETERS
        if name in parameters and name != 'linkage'
    }
    try:
        return _leg_of(json.dumps(parameters_))
    except (TypeError, ValueError):
        return None


@lru_cache(maxsize=64)
def _leg_of(text: str) -> AnyLeg:
    """Return the leg of parameters as JSON; cached for many runs."""
    (leg,) = robot_from_parameters(json.loads(text), weigh=False).legs
    return LinkageLeg(leg.linkage)


def with_dynamics(
    leg: LegRecording, records: Sequence[SolverParameters], robot: Robot | None = None
) -> LegSolver:
    """
    Return a leg's solver with the leg's masses, if known.

    Parameters
    ----------
    leg : LegRecording
        The leg.
    records : sequence of SolverParameters
        Solver parameters of the run, in the order of time.
    robot : Robot, optional
        The reference robot.

    """
    solver = leg.solver
    if robot is not None:
        return replace(solver, dynamics=_of_robot(robot, leg.name))
    own = [record for record in records if record.node in solver.nodes]
    if solver.leg is None or not own:
        return solver
    # A file name in a run is never opened.
    parameters_ = {
        name: value
        for name, value in own[-1].parameters.items()
        if name.rpartition('.')[2] != 'linkage'
    }
    # Only this leg matters.
    parameters_['legs'] = [leg.name] if leg.name else []
    try:
        return replace(solver, dynamics=_of_robot(robot_from_parameters(parameters_), leg.name))
    except (TypeError, ValueError, RecursionError):
        return solver


def _of_robot(robot: Robot, name: str) -> Dynamics | None:
    """Return the dynamics of a leg of a robot, if it has masses."""
    leg = robot.leg(name)
    return robot.dynamics(leg) if leg and leg.masses else None
