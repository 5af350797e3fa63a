"""commission_node, whose judgement of the IMU fails, and a callback after it: a script."""

import sys
from typing import Any

from klann_ros.nodes.commission.node import CommissionNode, main
from klann_ros.stop_signals import StopSignals
from klann_ros.walker import Commissioning


def fail(*_: Any) -> None:
    raise RuntimeError('on purpose')


def stop_twice(node: CommissionNode) -> None:
    stop_after_error(node)
    stop_after_error(node)


stop_after_error = CommissionNode.on_callback_error
CommissionNode.on_callback_error = stop_twice  # type: ignore[method-assign]
Commissioning.judge_imu = fail  # type: ignore[method-assign]
if __name__ == '__main__':
    sys.exit(main(sys.argv, StopSignals()))
