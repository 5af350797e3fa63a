"""commission_node, whose judgement of the IMU fails: to be run as a script."""

import sys
from typing import Any

from klann_ros.nodes.commission.node import main
from klann_ros.stop_signals import StopSignals
from klann_ros.walker import Commissioning


def fail(*_: Any) -> None:
    raise RuntimeError('on purpose')


Commissioning.judge_imu = fail  # type: ignore[method-assign]
if __name__ == '__main__':
    sys.exit(main(sys.argv, StopSignals()))
