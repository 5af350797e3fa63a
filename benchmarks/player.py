"""
How well player_node keeps the times of a log, what a message costs it, and what it keeps up with.

Stamps are the middleware's: what a listener in this process adds is not in the times of sending.
"""

import sys

from support.aims import exit_code, sized, SMOKE
from support.replay import percentile, Replay, replay

# Topics, messages a second of each, seconds.
SECONDS = sized(0.3, 5.0, 10.0)
AIMED, FAST = (3, 1000.0, SECONDS), (10, 1000.0, SECONDS)
RATES: tuple[float, ...] = sized((), (2.0, 4.0, 8.0, 16.0))
# The aim: the error of the time between two messages at rate 1 [s].
MOST_P99 = 2e-3
# It keeps up if it takes at most so much longer than it should.
MOST_SPAN = 1.05


def report(name: str, found: Replay) -> None:
    """Print a line."""
    times = [percentile(values, part) * 1e3 for values in (found.sent, found.came)
             for part in (0.5, 0.99, 1.0)]  # fmt: skip
    figures = ''.join(f' {time:8.3f}' for time in times)
    print(f'{name:22}{figures} {found.cpu:8.1f} {found.lost:6}')
    if found.said:
        print(f'    {found.said.splitlines()[-1]}')


def keeps_up(rate: float) -> bool:
    """Return whether three topics of 1 kHz are played at a rate in the time that they should."""
    topics, hz, _ = AIMED
    seconds = 3.0 * rate
    found = replay(topics, hz, seconds, rate)
    report(f'3 x 1 kHz, rate {rate:g}', found)
    return found.lost == 0 and found.span <= MOST_SPAN * seconds / rate


def main() -> int:
    """Print the figures; return 0 if the aim is met."""
    print('error of the time between two messages [ms], as sent and as received')
    print(f'{"":22}' + ''.join(f' {word:>8}' for word in ('p50', 'p99', 'max') * 2), end='')
    print(f' {"CPU/us":>8} {"lost":>6}')
    aimed = replay(*AIMED)
    report('3 x 1 kHz', aimed)
    fast = aimed if SMOKE else replay(*FAST)
    report('10 x 1 kHz', fast)
    kept = [1.0]
    for rate in RATES:
        if not keeps_up(rate):
            break
        kept.append(rate)
    print(f'3 x 1 kHz are kept up with at rate {kept[-1]:g}')
    p99 = max(percentile(values, 0.99) for values in (aimed.sent, aimed.came))
    met = p99 <= MOST_P99 and not aimed.lost and not fast.lost
    print(f'p99 {p99 * 1e3:.3f} ms, aim <= {MOST_P99 * 1e3:g}, no losses: ', end='')
    print('met' if met else 'MISSED')
    return exit_code(met)


if __name__ == '__main__':
    sys.exit(main())
