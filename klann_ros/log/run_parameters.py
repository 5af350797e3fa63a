"""What a run says about the solvers it heard: their parameters, as a metadata record."""

from collections.abc import Mapping
import json
from typing import Any

SOLVER_RECORD = 'klann_ros.solver'


def solver_record(node: str, parameters: Mapping[str, Any]) -> dict[str, str]:
    """
    Return the metadata record of a solver.

    Parameters
    ----------
    node : str
        The solver's full name.
    parameters : mapping
        Its parameters: numbers, texts, flags, and lists of them.

    """
    return {'node': node, 'parameters': json.dumps(parameters, sort_keys=True)}


def solver_parameters(record: Mapping[str, str]) -> tuple[str, dict[str, Any]]:
    """
    Return a solver's full name and its parameters from a metadata record.

    Raises
    ------
    ValueError
        It is no such record.

    """
    try:
        return record['node'], dict(json.loads(record['parameters']))
    except (KeyError, TypeError, ValueError):
        msg = f'not a record of a solver: {dict(record)}'
        raise ValueError(msg) from None
