"""What users steer a playback with: services, parameters, and keys."""

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial

from klann_ros.log.playing.timeline import RATES
from klann_ros.log.playing.transport import PlaybackError, Transport
from klann_ros.nodes.parameters import Declared
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

KEYS_IN_WORDS = (
    'space pauses and resumes, right arrow plays the next message of a paused log, up and down '
    'arrow make it 10 % faster and slower'
)
# A key makes the rate so many times what it was, or that part of it.
FASTER = 1.1
# Whoever holds a key down, or drops a text on the terminal, waits no longer for what follows.
MOST_KEYS = 20


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
    Services, parameters and keys of a node that steer a transport.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose they are; it has declared the parameters.
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
        self._actions = {
            'pause': (transport.pause, 'paused at'),
            'resume': (transport.resume, 'playing from'),
            'step': (transport.step, 'one message on, at'),
        }
        for name in self._actions:
            node.create_service(Trigger, f'~/{name}', partial(self._answer, name))
        self._keys: deque[str] = deque(maxlen=MOST_KEYS)
        self._pressed = node.create_guard_condition(self._on_keys)
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._apply)

    def press(self, key: str) -> None:
        """Do what a key stands for, as soon as the node spins; any thread may call this."""
        self._keys.append(key)
        self._pressed.trigger()

    # What can be done, whoever asks for it: returns whether it was done, and what to say.

    def _do(self, name: str) -> tuple[bool, str]:
        act, said = self._actions[name]
        try:
            act()
        except PlaybackError as error:
            return False, str(error)
        return True, f'{said} {self._tell_position():.6f} s'

    def _toggle(self) -> tuple[bool, str]:
        return self._do('resume' if self._transport.paused else 'pause')

    def _change_rate(self, factor: float) -> tuple[bool, str]:
        # Without the digits that nobody reads, one key undoes the other.
        rate = float(f'{self._node.get_parameter("rate").value * factor:.9g}')
        (result,) = self._node.set_parameters([Parameter('rate', value=rate)])
        return result.successful, result.reason or f'rate {rate:g}'

    # Who asks.

    def _answer(self, name: str, _: Trigger.Request, answer: Trigger.Response) -> Trigger.Response:
        answer.success, answer.message = self._do(name)
        return answer

    def _on_keys(self) -> None:
        actions: dict[str, Callable[[], tuple[bool, str]]] = {
            'space': self._toggle,
            'right': partial(self._do, 'step'),
            'up': partial(self._change_rate, FASTER),
            'down': partial(self._change_rate, 1.0 / FASTER),
        }
        while self._keys:
            is_done, said = actions[self._keys.popleft()]()
            if is_done:
                self._node.get_logger().info(said)
            else:
                self._node.get_logger().warning(said)

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
