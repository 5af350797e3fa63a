"""What `solver_node` does: crank angle in, poses of the legs out."""

from collections.abc import Mapping, Sequence

from klann_ros.kinematics import CrankAngleError, GeometryError, KinematicsError
from klann_ros.nodes.endpoints import create_trigger
from klann_ros.nodes.parameters import declare
from klann_ros.untrusted.text import printable
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from .crank_inputs import Crank, CrankInputs, Stamp
from .declarations import PUBLISHED
from .diagnostics import SolverDiagnostics
from .leg_parameters import LegParameters
from .leg_publishers import LegMarkers, LegMessages

# How often a complaint about inputs is logged at most [s].
THROTTLE = 2.0


class Solver:
    """
    What a node does to answer every crank angle with the joint angles and the feet of the legs.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose parameters, topics and services they are; any kind of node.

    Raises
    ------
    StartError
        A parameter is refused; the text says why.

    """

    def __init__(self, node: Node) -> None:
        """Declare, validate and connect, but do not listen yet."""
        self._node = node
        self._leg_parameters = LegParameters(node)
        self._legs = self._leg_parameters.legs
        values = declare(node, PUBLISHED)
        self._messages = LegMessages(node, self._legs, values['frame_id'])
        joints = dict.fromkeys(leg.crank_joint for leg in self._legs)
        self._inputs = CrankInputs(node, list(joints), self._turn, self._reject)
        self._diagnostics = SolverDiagnostics(
            node,
            self._legs,
            self._inputs,
            period=values['diagnostics_period'],
            min_transmission_angle=values['min_transmission_angle'],
        )
        self._markers = (
            LegMarkers(node, self._legs, values['frame_id']) if values['publish_markers'] else None
        )
        create_trigger(node, 'reset', self._on_reset)
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._apply)

    @property
    def summary(self) -> str:
        """Return which legs it solves, and what turns them, in words."""
        return f'{self._leg_parameters.summary}, turned by {self._inputs.summary}'

    def listen(self) -> None:
        """Answer what comes from now on."""
        self._inputs.listen()

    def ignore(self) -> None:
        """Answer nothing any more, until told to listen again."""
        self._inputs.ignore()

    def reset(self) -> None:
        """Forget the warm starts."""
        for leg in self._legs:
            leg.leg.reset()

    # Inputs: ask the legs, answer.

    def _turn(self, cranks: Mapping[str, Crank], stamp: Stamp) -> None:
        answers = []
        for leg in self._legs:
            crank = cranks.get(leg.crank_joint)
            if crank is None:
                continue
            try:
                answers.append((leg, *leg.answer(*crank)))
            except CrankAngleError as error:
                self._complain(error)
            except KinematicsError as error:
                name = f'{leg.name}: ' if leg.name else ''
                self._node.get_logger().error(f'{name}{error}', throttle_duration_sec=THROTTLE)
        if answers:
            self._messages.publish(answers, stamp)

    def _reject(self, error: KinematicsError) -> None:
        for leg in self._legs:
            leg.figures.reject(str(error))
        self._complain(error)

    def _complain(self, error: KinematicsError) -> None:
        self._node.get_logger().warning(f'input rejected: {error}', throttle_duration_sec=THROTTLE)

    # Parameters and services.

    def _validate(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        try:
            self._leg_parameters.changed(parameters)
        except GeometryError as error:
            return SetParametersResult(successful=False, reason=printable(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: Sequence[Parameter]) -> None:
        changed = self._leg_parameters.changed(parameters)
        for leg in self._legs:
            leg.leg = changed.get(leg.name, leg.leg)
        if changed:
            self._diagnostics.legs_changed()
        if changed and self._markers:
            self._markers.legs_changed()

    def _on_reset(self) -> tuple[bool, str]:
        self.reset()
        return True, 'the next pose starts from the closed form'
