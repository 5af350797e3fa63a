"""
The agreement of every shipped leg with the physics engine, at two speeds of its crank.

    python3 benchmarks/twin.py [TIME_STEP]

A leg is turned in MuJoCo by the model that `klann_ros.twin` writes. The foot is compared with the
closed form, the torque of the servo with the torques of an even turn and of the true motion of the
crank, and the force of every pin with the one in that motion. TIME_STEP is in seconds (0.0002).
"""

import math
import sys

from klann_ros.kinematics import shipped_linkages
from klann_ros.robot import robot_of
from klann_ros.twin import agreement
import numpy as np
from support.aims import exit_code, SMOKE

RATES = (2.0, 2.0 * math.pi)
# Limits: foot [m], torque of an even turn, torque as moved, and reactions.
LIMITS = (20e-6, 5e-3, 1e-3, 1e-2)


def main() -> int:
    """Print the table; return 1 if a value exceeds its bound."""
    time_step = float(sys.argv[1]) if len(sys.argv) > 1 else 2e-4
    print(f'time step {time_step * 1e3:g} ms; rms in % of the rms over the turn')
    print(
        f'{"":17}{"rad/s":>6}{"foot um":>9}{"torque, even":>14}{"as moved":>10}'
        f'{"reactions":>11}{"ripple":>9}'
    )
    deviations = []
    names = ('sem104', 'patent', *shipped_linkages())
    for name in names[:1] if SMOKE else names:
        for rate in RATES[:1] if SMOKE else RATES:
            leg = agreement(robot_of(name), rate, time_step=time_step)
            print(
                f'{name:17}{rate:6.2f}{leg.foot * 1e6:9.3f}{leg.torque:14.3%}'
                f'{leg.torque_as_moved:10.4%}{leg.reactions:11.4%}{leg.ripple:9.3%}',
                flush=True,
            )
            deviations.append((leg.foot, leg.torque, leg.torque_as_moved, leg.reactions))
    foot, torque, torque_as_moved, reactions = np.max(deviations, axis=0).tolist()
    print(
        f'worst: foot {foot * 1e6:.2f} um, torque {torque:.3%} of an even turn and '
        f'{torque_as_moved:.4%} as moved, reactions {reactions:.4%}'
    )
    return exit_code(bool(np.all(np.max(deviations, axis=0) <= LIMITS)))


if __name__ == '__main__':
    sys.exit(main())
