"""The aims of a benchmark, and its smallest form (`--smoke`), in which the tests start each."""

import sys

# Every step once, on little data: the figures mean nothing, and no aim decides the exit code.
SMOKE = '--smoke' in sys.argv
if SMOKE:
    sys.argv.remove('--smoke')
# How long a process is given to come to rest, and is measured at rest [s].
REST = 0.2 if SMOKE else 2.0


def is_met(name: str, value: float, limit: float, unit: str = '') -> bool:
    """Print a figure beside its aim, the most it may be; return whether the aim is met."""
    met = value <= limit
    print(f'{name}: {value:.3g}{unit}, aim <= {limit:.3g}{unit}: {"met" if met else "MISSED"}')
    return met


def exit_code(*met: bool) -> int:
    """Return 0 if every aim is met, or if this is the smallest form."""
    return 0 if SMOKE or all(met) else 1
