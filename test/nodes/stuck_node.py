"""An executable whose middleware never ends, nor lets Python run: to be run as a script."""

import ctypes
import sys

from klann_ros import executables, stop_signals
from rclpy.node import Node


def _destroy_node(_: Node) -> None:
    print('stuck', file=sys.stderr, flush=True)
    # It keeps Python's lock, as Fast DDS does that waits for its own.
    ctypes.PyDLL(None).sleep(600)


if __name__ == '__main__':
    Node.destroy_node = _destroy_node
    stop_signals.END_TIMEOUT = float(sys.argv.pop(1))
    stop_signals.END_GRACE = float(sys.argv.pop(1))
    sys.exit(getattr(executables, sys.argv.pop(1))())
