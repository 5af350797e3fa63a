"""The aims of a benchmark, and its three forms: the usual one, `--full` and `--smoke`."""

import sys
from typing import TypeVar

_T = TypeVar('_T')


def _given(option: str) -> bool:
    is_given = option in sys.argv
    if is_given:
        sys.argv.remove(option)
    return is_given


# Every step once, on little data, in the tests: the figures mean nothing, and no aim decides the
# exit code.
SMOKE = _given('--smoke')
# As published: up to hours. The usual forms take a quarter of an hour together.
FULL = _given('--full')


def sized(smoke: _T, usual: _T, full: _T | None = None) -> _T:
    """Return a number of this form; that of the full one is the usual one where left out."""
    return smoke if SMOKE else usual if full is None or not FULL else full


# How long a process is given to come to rest, and is measured at rest [s].
REST = sized(0.2, 2.0)


def is_met(name: str, value: float, limit: float, unit: str = '') -> bool:
    """Print a figure beside its aim, the most it may be; return whether the aim is met."""
    met = value <= limit
    print(f'{name}: {value:.3g}{unit}, aim <= {limit:.3g}{unit}: {"met" if met else "MISSED"}')
    return met


def exit_code(*met: bool) -> int:
    """Return 0 if every aim is met, or if this is the smallest form."""
    return 0 if SMOKE or all(met) else 1
