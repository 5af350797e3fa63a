"""The services of a recorder: split, pause, resume."""

from collections.abc import Callable

from rclpy.node import Node
from std_srvs.srv import Trigger

SERVICES = """Services (std_srvs/srv/Trigger):
  ~/split: finish the file and go on in a new one, whose name is the answer
  ~/pause: leave out what comes from now on; the run says when, and how much it was
  ~/resume: record again"""

# Returns whether it was done, and what to say.
Action = Callable[[], tuple[bool, str]]


def offer(node: Node, split: Action, pause: Action, resume: Action) -> None:
    """Offer the services of a recorder."""
    for name, action in (('split', split), ('pause', pause), ('resume', resume)):
        node.create_service(Trigger, f'~/{name}', _answer(action))


def _answer(action: Action) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
    def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = action()
        return response

    return answer
