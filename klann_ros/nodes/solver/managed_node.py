"""`solver_node --lifecycle`: the solver as a managed node."""

from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from .solver import Solver


class ManagedSolverNode(LifecycleNode):
    """
    The same as a managed node: it answers while it is active.

    Its parameters are validated when it starts: a leg that is none is refused at once.
    """

    def __init__(self, **options: Any) -> None:
        """Declare and validate; `options` are those of LifecycleNode."""
        super().__init__('solver_node', **options)
        self._solver = Solver(self)
        self.get_logger().info(f'ready, unconfigured: {self._solver.summary}, while it is active')

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Have nothing to do: what could be refused was declared at the start."""
        return self._logged('configured', super().on_configure(state))

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen."""
        self._solver.listen()
        return self._logged('activated: it answers', super().on_activate(state))

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen no more."""
        self._solver.ignore()
        return self._logged('deactivated: it does not listen', super().on_deactivate(state))

    def on_cleanup(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Forget the warm starts."""
        self._solver.reset()
        return self._logged('cleaned up: unconfigured', TransitionCallbackReturn.SUCCESS)

    def on_shutdown(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Listen no more."""
        self._solver.ignore()
        return self._logged('shut down: it answers no more', TransitionCallbackReturn.SUCCESS)

    def _logged(self, what: str, result: TransitionCallbackReturn) -> TransitionCallbackReturn:
        if result == TransitionCallbackReturn.SUCCESS:
            self.get_logger().info(what)
        return result
