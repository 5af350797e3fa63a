"""`solver_node --lifecycle`: a managed node, configured and activated by another node."""

from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from .solver import Solver


class ManagedSolverNode(LifecycleNode):
    """A solver that answers while it is active; its parameters are validated at the start."""

    def __init__(self, **options: Any) -> None:
        super().__init__('solver_node', **options)
        self._solver = Solver(self)
        self.get_logger().info(f'ready, unconfigured: {self._solver.summary}, while it is active')

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Do nothing: the parameters were validated at the start."""
        return self._logged('configured', super().on_configure(state))

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe."""
        self._solver.inputs.subscribe()
        return self._logged('activated: it answers', super().on_activate(state))

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Unsubscribe."""
        self._solver.inputs.unsubscribe()
        return self._logged('deactivated: it does not listen', super().on_deactivate(state))

    def on_cleanup(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Forget the warm starts."""
        self._solver.reset()
        return self._logged('cleaned up: unconfigured', TransitionCallbackReturn.SUCCESS)

    def on_shutdown(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Unsubscribe."""
        self._solver.inputs.unsubscribe()
        return self._logged('shut down: it answers no more', TransitionCallbackReturn.SUCCESS)

    def _logged(self, text: str, outcome: TransitionCallbackReturn) -> TransitionCallbackReturn:
        if outcome == TransitionCallbackReturn.SUCCESS:
            self.get_logger().info(text)
        return outcome
