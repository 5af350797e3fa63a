"""The aims of a benchmark, and its three forms: the usual one, `--full` and `--smoke`."""

import sys
from typing import TypeVar

_T = TypeVar('_T')


def _take_option(option: str) -> bool:
    has_option = option in sys.argv
    if has_option:
        sys.argv.remove(option)
    return has_option


# Every step once, on little data, in the tests: the figures mean nothing, and no aim decides the
# exit code.
SMOKE = _take_option('--smoke')
# As published: up to hours. The usual forms take a quarter of an hour together.
FULL = _take_option('--full')


def sized(smoke: _T, usual: _T, full: _T | None = None) -> _T:
    """Return the number of this form; the full form has the usual one by default."""
    return smoke if SMOKE else usual if full is None or not FULL else full


# Time for a process to come to rest, and of its measurement at rest [s].
REST = sized(0.2, 2.0)


def is_met(name: str, figure: float, limit: float, unit: str = '') -> bool:
    """Print a figure beside its aim, the most it may be; return whether the aim is met."""
    met = figure <= limit
    print(f'{name}: {figure:.3g}{unit}, aim <= {limit:.3g}{unit}: {"met" if met else "MISSED"}')
    return met


def exit_code(*met: bool) -> int:
    """Return 0 if every aim is met, or if this is the smallest form."""
    return 0 if SMOKE or all(met) else 1
