"""What a run tells of the solver that made its poses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from klann_ros.kinematics.leg_types import Leg
from klann_ros.log.run_parameters import solver_parameters, SOLVER_RECORD, SolverParameters

from .leg_file import leg_from_parameters

CRANK_JOINT = 'crank'
Metadata = Mapping[str, Sequence[Mapping[str, str]]]


@dataclass(frozen=True)
class LegSolver:
    """
    The solver of a leg.

    Attributes
    ----------
    crank_joint : str
        The joint that turns its crank.
    sim_time : bool
        Whether it stamps by a simulated clock what has no stamp.
    leg : KlannLeg, LinkageLeg or None
        What it solves at last; None where the run does not tell.
    legs : tuple of str
        The names of its legs; empty for one unnamed leg.
    leg_time : int
        The log time since which it has it [ns]; 0 when it never had another.

    """

    crank_joint: str = CRANK_JOINT
    sim_time: bool = False
    leg: Leg | None = None
    legs: tuple[str, ...] = ()
    leg_time: int = 0


def solver_records(metadata: Metadata) -> list[SolverParameters]:
    """Return what the records of a run say about solvers, in the order of time."""
    found = []
    for record in metadata.get(SOLVER_RECORD, ()):
        solver = _solver(record)
        if solver is not None:
            found.append(solver)
    return sorted(found, key=lambda solver: solver.time)


def leg_solver(records: Sequence[SolverParameters], namespace: str) -> LegSolver:
    """Return the solver in a namespace; the last one of the run where there is none in it."""
    own = [record for record in records if parent(record.node) == namespace]
    own = own or [record for record in records if record.node == records[-1].node]
    if not own:
        return LegSolver()
    legs = [_leg(record.parameters) for record in own]
    geometries = [leg and leg.geometry for leg in legs]
    changes = [
        record.time
        for record, (before, after) in zip(own[1:], pairwise(geometries), strict=True)
        if before != after
    ]
    last = own[-1].parameters
    return LegSolver(
        crank_joint=str(last.get('crank_joint', CRANK_JOINT)),
        sim_time=any(record.parameters.get('use_sim_time') is True for record in own),
        leg=legs[-1],
        legs=_names(last.get('legs')),
        leg_time=changes[-1] if changes else 0,
    )


def _names(legs: Any) -> tuple[str, ...]:
    """Return the names of a parameter that may be anything; an empty one stands for none."""
    return tuple(str(name) for name in legs if name) if isinstance(legs, list) else ()


def parent(name: str) -> str:
    """Return the namespace of a full name; '' for the root."""
    return name.rpartition('/')[0]


def _solver(record: Mapping[str, str]) -> SolverParameters | None:
    try:
        return solver_parameters(record)
    except ValueError:
        return None


def _leg(parameters: Mapping[str, Any]) -> Leg | None:
    try:
        return leg_from_parameters(parameters)
    except (TypeError, ValueError):
        return None
