"""
Let solver_node answer 1 kHz for a long time: nothing may be lost, and its memory stays flat.

    PYTHONPATH=benchmarks python -m support.soak [MINUTES]
"""

import sys

from support.node_under_test import NodeUnderTest, SOLVER
from support.programs import memory_of

RATE = 1000.0
# Growth that a leak of one small object a message would exceed many times [MB].
MAX_GROWTH = 5.0


def main(minutes: float) -> int:
    """Print the figures of every minute; return 0 if nothing was lost and memory stayed flat."""
    node = NodeUnderTest(SOLVER)
    lost = 0
    memory: list[float] = []
    try:
        print(f'{"minute":>6} {"CPU/us":>7} {"p50/us":>7} {"p99/us":>7} {"lost":>5} {"MB":>7}')
        for minute in range(round(minutes)):
            figures = node.measure(RATE, 57.0)
            lost += figures.lost
            memory.append(memory_of(node.process.pid))
            print(
                f'{minute + 1:6} {figures.cpu:7.1f} {figures.p50:7.0f} {figures.p99:7.0f} '
                f'{figures.lost:5} {memory[-1]:7.1f}',
                flush=True,
            )
    finally:
        node.stop()
    growth = memory[-1] - memory[0]
    print(f'lost {lost}, memory {memory[0]:.1f} MB and {growth:+.1f} MB since the first minute')
    return 0 if lost == 0 and growth <= MAX_GROWTH else 1


if __name__ == '__main__':
    sys.exit(main(float(sys.argv[1]) if len(sys.argv) > 1 else 20.0))
