"""What a run tells of the solver that made its poses."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
import json
import sys
from typing import Any

from klann_ros.kinematics import AnyLeg, LinkageLeg
from klann_ros.log.run_parameters import solver_parameters, SOLVER_RECORD, SolverParameters
from klann_ros.review.model.recording import LegSolver
from klann_ros.robot import Robot, robot_from_parameters
from klann_ros.robot.file import LEG_PARAMETERS, of_leg
from klann_ros.robot.robot import SEPARATORS
from klann_ros.sanitize.text import printable

# Who tells the leg that a run is held against.
GIVEN = '--geometry'
Metadata = Mapping[str, Sequence[Mapping[str, str]]]


def solver_records(metadata: Metadata) -> list[SolverParameters]:
    """Return what the records of a run say about solvers, in the order of time."""
    found = []
    for record in metadata.get(SOLVER_RECORD, ()):
        with suppress(ValueError):
            found.append(solver_parameters(record))
    return sorted(found, key=lambda solver: solver.time)


def leg_solvers(
    records: Sequence[SolverParameters], namespace: str, given: Robot | None = None
) -> dict[str, LegSolver]:
    """
    Return the solvers of the legs in a namespace by their names, '' for the unnamed one.

    Where there is none in it, the last one of the run is meant; where the run tells none at all,
    nothing is returned.

    Parameters
    ----------
    records : sequence of SolverParameters
        What the run says, in the order of time.
    namespace : str
        Where the legs publish.
    given : Robot, optional
        The robot whose legs replace those in the run.

    """
    own = [record for record in records if parent(record.node) == namespace]
    own = own or [record for record in records if record.node == records[-1].node]
    # Each node has the legs that it told at last, and several may have the same one.
    last = {record.node: _names(record.parameters.get('legs')) for record in own}
    return {
        name: _solver([record for record in own if name in last[record.node]], name, given)
        for name in dict.fromkeys(name for names in last.values() for name in names)
    }


def _solver(own: Sequence[SolverParameters], name: str, given: Robot | None) -> LegSolver:
    told = [of_leg(record.parameters, name) for record in own]
    legs = [given_leg(given, name)] if given else [_leg(parameters) for parameters in told]
    last, source = told[-1], GIVEN if given else ''
    if legs[-1] and not given:
        source = f'the parameters of {printable(own[-1].node)}'
    return LegSolver(
        crank_joint=str(last.get('crank_joint') or LegSolver.crank_joint),
        sim_time=any(record.parameters.get('use_sim_time') is True for record in own),
        leg=legs[-1],
        leg_time=0 if given else last_change([record.time for record in own], legs),
        direction=_number(last.get('direction'), 1),
        phase=_number(last.get('phase'), 0.0),
        nodes=tuple(dict.fromkeys(record.node for record in own)),
        source=source,
        joint_separator='_' if last.get('joint_separator') == '_' else '/',
    )


def last_change(times: Sequence[int], legs: Sequence[AnyLeg | None]) -> int:
    """Return the time at which a leg became another one for the last time; 0 if it never did."""
    linkages = [leg and leg.linkage for leg in legs]
    changes = zip(times[1:], linkages, linkages[1:], strict=False)
    return max((time for time, before, after in changes if before != after), default=0)


def _names(legs: Any) -> tuple[str, ...]:
    """Return the names of a parameter that may be anything; '' stands for the unnamed leg."""
    names = [str(name) for name in legs if name] if isinstance(legs, list) else []
    return tuple(names) or ('',)


def _number(value: Any, otherwise: float) -> float:
    number = isinstance(value, int | float) and abs(value) <= sys.float_info.max
    return value if number else otherwise


def parent(name: str) -> str:
    """Return the namespace of a full name; '' for the root."""
    return name.rpartition('/')[0]


def given_leg(robot: Robot | None, name: str) -> AnyLeg | None:
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
    # A linkage's text is in the run; the name of its file, maybe a stranger's, is never opened.
    told = {
        name: parameters[name]
        for name in LEG_PARAMETERS
        if name in parameters and name != 'linkage'
    }
    try:
        return _leg_of(json.dumps(told))
    except (TypeError, ValueError):
        return None


@lru_cache(maxsize=64)
def _leg_of(text: str) -> AnyLeg:
    """Return the leg of parameters as JSON; a thousand runs of it, or windows, need it once."""
    (leg,) = robot_from_parameters(json.loads(text), weigh=False).legs
    return LinkageLeg(leg.linkage)
