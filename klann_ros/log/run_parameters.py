"""What a run says about itself in metadata records: its solvers, and what it lost."""

from collections.abc import Mapping
from dataclasses import dataclass
import json
from typing import Any

SOLVER_RECORD = 'klann_ros.solver'
LOSS_RECORD = 'klann_ros.loss'
# The solver's parameter that holds the text of its linkage's file; empty for a Klann leg.
LINKAGE_PARAMETER = 'linkage_description'
_UNKNOWN = 'unknown'


@dataclass(frozen=True)
class SolverParameters:
    """
    The parameters of a solver at a time; a run has one for each change that it heard of.

    Attributes
    ----------
    node : str
        The solver's full name.
    time : int
        When it had them [ns since the epoch], on the clock of the log times.
    parameters : dict
        The parameters by name: numbers, texts, flags, and lists of them.

    """

    node: str
    time: int
    parameters: dict[str, Any]


def solver_record(solver: SolverParameters) -> dict[str, str]:
    """Return the metadata record of a solver's parameters."""
    parameters = json.dumps(solver.parameters, sort_keys=True)
    return {'node': solver.node, 'time': str(solver.time), 'parameters': parameters}


def solver_parameters(record: Mapping[str, str]) -> SolverParameters:
    """
    Return a solver's parameters from a metadata record.

    Raises
    ------
    ValueError
        It is no such record.

    """
    try:
        parameters = dict(json.loads(record['parameters']))
        return SolverParameters(record['node'], int(record['time']), parameters)
    except (KeyError, TypeError, ValueError):
        msg = f'not a record of a solver: {dict(record)}'
        raise ValueError(msg) from None


def loss_record(lost: Mapping[str, int | None]) -> dict[str, str]:
    """Return the metadata record of lost messages by topic; None where nobody can tell."""
    return {name: _UNKNOWN if count is None else str(count) for name, count in lost.items()}


def losses(record: Mapping[str, str]) -> dict[str, int | None]:
    """
    Return the lost messages by topic from a metadata record.

    Raises
    ------
    ValueError
        It is no such record.

    """
    return {name: None if text == _UNKNOWN else int(text) for name, text in record.items()}
