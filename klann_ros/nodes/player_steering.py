"""What users steer a playback with: services and parameters."""

from collections.abc import Callable, Sequence

from klann_ros.log.playing.timeline import RATES
from klann_ros.log.playing.transport import PlaybackError, Transport
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from .parameters import Declared


def declared(rate: float, position: float, length: float) -> tuple[Declared, Declared]:
    """Return the parameters, with what they are at start, of a log of some length [s]."""
    return (
        Declared(
            'rate',
            rate,
            'how fast the log is played; 2 is twice as fast',
            limits=RATES,
            read_only=False,
            any_number=True,
        ),
        Declared(
            'position',
            position,
            'set it to go there; after that, a pause or a step it tells where it is, counted from '
            'the start of the log [s]',
            limits=(0.0, max(position, length)),
            read_only=False,
            any_number=True,
        ),
    )


class PlayerSteering:
    """
    Services and parameters of a node that steer a transport.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose they are; it has declared them.
    transport : Transport
        What they steer.
    parameters : sequence of Declared
        The parameters.

    """

    def __init__(self, node: Node, transport: Transport, parameters: Sequence[Declared]) -> None:
        """Offer them."""
        self._node = node
        self._transport = transport
        self._declared = {parameter.name: parameter for parameter in parameters}
        self._telling = False
        self._offer('pause', transport.pause, 'paused at')
        self._offer('resume', transport.resume, 'playing from')
        self._offer('step', transport.step, 'one message on, at')
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._apply)

    def _offer(self, name: str, act: Callable[[], None], said: str) -> None:
        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                act()
            except PlaybackError as error:
                response.message = str(error)
                return response
            response.success = True
            response.message = f'{said} {self._tell_position():.6f} s'
            return response

        self._node.create_service(Trigger, f'~/{name}', answer)

    def _tell_position(self) -> float:
        """Let the parameter tell where it is, which is no wish to go there."""
        position = self._transport.position
        self._telling = True
        self._node.set_parameters([Parameter('position', value=position)])
        self._telling = False
        return position

    def _validate(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            declared = self._declared.get(parameter.name)
            reason = declared.refusal(parameter.value) if declared else ''
            if reason:
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def _apply(self, parameters: Sequence[Parameter]) -> None:
        values = {p.name: p.value for p in parameters if p.name in self._declared}
        if 'rate' in values:
            self._transport.set_rate(float(values['rate']))
        if 'position' in values and not self._telling:
            self._transport.seek(float(values['position']))
