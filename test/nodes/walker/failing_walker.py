"""walker_node, which fails as the topic `fail` says: to be run as a script."""

import sys
from typing import Any

from klann_ros.nodes.process import Finish, run
from klann_ros.nodes.walker.node import WalkerNode
from klann_ros.stop_signals import StopSignals
from std_msgs.msg import String


class FailingWalker(WalkerNode):
    """A walker_node with a callback for each way to fail."""

    def __init__(self, _: Finish) -> None:
        super().__init__()
        self.create_subscription(String, 'fail', self._on_fail, 10)

    def _on_fail(self, message: String) -> None:
        if message.data == 'exit in a callback':
            raise SystemExit(3)
        if message.data == 'errors of all steps':
            self._walker.controller.step = _raise  # type: ignore[method-assign]
        if message.data == 'errors of the executor':
            self.executor.wait_for_ready_callbacks = _raise


def _raise(*_: Any, **__: Any) -> Any:
    raise RuntimeError('on purpose')


if __name__ == '__main__':
    sys.exit(run('walker_node', FailingWalker, sys.argv, StopSignals(), raw=True))
