"""
How far every shipped leg agrees with the physics engine, at two speeds of its crank.

    python3 benchmarks/twin.py [TIME_STEP]

A leg is turned in MuJoCo by the model that `klann_ros.twin` writes. Compared are the foot with the
closed form, the torque of the servo with that of an even turn and with that of the motion that the
crank really made, and the force of every pin in that motion. TIME_STEP is in seconds (0.0002).
"""

import math
import sys

from klann_ros.kinematics import shipped_linkages
from klann_ros.robot import robot_of
from klann_ros.twin import agreement
from support.aims import exit_code, SMOKE

RATES = (2.0, 2.0 * math.pi)
# Which are held: foot [m], torque of an even turn, torque as moved, and reactions.
MOST = (20e-6, 5e-3, 1e-3, 1e-2)


def main() -> int:
    """Print the table; return 1 if a value exceeds its bound."""
    time_step = float(sys.argv[1]) if len(sys.argv) > 1 else 2e-4
    print(f'time step {time_step * 1e3:g} ms; rms in % of the rms over the turn')
    print(
        f'{"":17}{"rad/s":>6}{"foot um":>9}{"torque, even":>14}{"as moved":>10}'
        f'{"reactions":>11}{"ripple":>9}'
    )
    worst = [0.0] * len(MOST)
    names = ('sem104', 'patent', *shipped_linkages())
    for name in names[:1] if SMOKE else names:
        for rate in RATES[:1] if SMOKE else RATES:
            found = agreement(robot_of(name), rate, time_step=time_step)
            print(
                f'{name:17}{rate:6.2f}{found.foot * 1e6:9.3f}{found.torque:14.3%}'
                f'{found.torque_as_moved:10.4%}{found.reactions:11.4%}{found.ripple:9.3%}',
                flush=True,
            )
            held = (found.foot, found.torque, found.torque_as_moved, found.reactions)
            worst = [max(pair) for pair in zip(worst, held, strict=True)]
    print(
        f'worst: foot {worst[0] * 1e6:.2f} um, torque {worst[1]:.3%} of an even turn and '
        f'{worst[2]:.4%} as moved, reactions {worst[3]:.4%}'
    )
    return exit_code(*(value <= most for value, most in zip(worst, MOST, strict=True)))


if __name__ == '__main__':
    sys.exit(main())
